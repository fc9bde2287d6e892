"""Playing for a goal that is given (§2.5): nothing is trained for it."""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, MapGraph
from semrl.core.errors import UsageError
from semrl.envs import Game
from semrl.envs.actions import Env
from semrl.evaluation.graph import node_states
from semrl.evaluation.player import Player, load_player
from semrl.evaluation.rules import switch_rules
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.evaluation.shield import keeping_out
from semrl.evaluation.words import RunWords, knowledge_of, words_of_run
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.distance import Distance
from semrl.knowledge.edits import enabled_forbidden
from semrl.knowledge.goals import Goal, Progress, read_goal, require_possible_goal
from semrl.planning.goal_planner import GoalPlanner, Verdicts
from semrl.planning.module import PlanningModule
from semrl.training.loop import EpisodeView, Step, play
from semrl.training.session import limited_threads

TRIAL_DECISIONS = 400
"""After which a trial ends."""

GoalPolicy = Literal["goal", "random", "agent", "planner"]
"""Who decides: plans for the goal, chance, or who was trained for the reward."""

_LATER = 0.05
"""What a decision later counts, in percent of the image."""


@dataclass(frozen=True, kw_only=True)
class GoalResult:
    """What came of a goal."""

    run: str
    goal: str
    trials: int
    reached: int
    share: float
    decisions: list[int | None]
    """Of each trial: the decision after which the goal was reached; None where it was not."""


class GoalWatch:
    """Follows one episode towards a goal, and judges what is imagined by it (`GoalJudge`).

    Parameters
    ----------
    goal
        What is sought.
    words
        Of the run.
    planning
        Of the run.
    """

    def __init__(self, goal: Goal, words: RunWords, planning: PlanningModule) -> None:
        self.goal = goal
        self.words = words
        self.planning = planning
        self.progress = Progress(goal)
        questions = {f"_{i}": expression for i, expression in enumerate(goal.expressions)}
        self._classifier = Classifier(words.words, questions)
        self._names = tuple(questions)
        self._distances = [Distance(expression, words.words) for expression in goal.expressions]
        self._nodes: dict[object, tuple[MapGraph, NDArray[np.bool_]]] = {}

    def begin(self) -> None:
        """Begin a trial."""
        self.progress = Progress(self.goal)

    def observe(self, state: Floats, previous: Floats) -> None:
        """Take note of what was reached."""
        self.progress.follow(self._truths(state[None], previous[None]))

    def judge(self, states: Floats, start: Floats) -> Verdicts:
        """Judge ``(s, t, d)`` imagined states that follow the state ``(d,)``."""
        s, t, d = states.shape
        previous = np.concatenate([np.broadcast_to(start, (s, 1, d)), states[:, :-1]], axis=1)
        scenes = self.words.reader.read(states.reshape(-1, d), previous.reshape(-1, d))
        truths = self._classifier.of_scenes(scenes, self._names).reshape(s, t, -1)
        course = self.progress.copies(s)
        broken, reached = np.full(s, t + 1), np.full(s, t + 1)
        for i in range(t):
            course.follow(truths[:, i])
            broken = np.where(course.broken, np.minimum(broken, i + 1), broken)
            reached = np.where(course.reached, np.minimum(reached, i + 1), reached)
        distances = np.zeros(s)
        for asked in self.progress.wanted():
            for place, sought in asked:
                each = self._distances[place](scenes).reshape(s, t)
                each = np.minimum(each, 1e6) + _LATER * np.arange(t)  # (s, t)
                holds = sought and self._hold(place) == 1
                distances = distances + (each.min(axis=1) if holds else each.mean(axis=1))
        return Verdicts(broken=broken, reached=reached, progress=course.share, distances=distances)

    def nodes(self, graph: MapGraph) -> NDArray[np.bool_] | None:
        """Return which nodes of a map meet what is sought next, ``(n,)``; None where something is only kept."""
        wanted = tuple(place for asked in self.progress.wanted() for place, sought in asked if sought)
        if not wanted:
            return None
        known = self._nodes.get(wanted)
        if known is None or known[0] is not graph:
            dimension = self.planning.dimension
            states, previous = node_states(graph, self.planning.config.velocity_weight, dimension)
            truths = self._truths(states, previous)
            self._nodes[wanted] = known = graph, np.asarray(truths[:, list(wanted)].all(axis=1))
        return known[1]

    def _truths(self, states: Floats, previous: Floats) -> NDArray[np.bool_]:
        return self._classifier.of_scenes(self.words.reader.read(states, previous), self._names)

    def _hold(self, place: int) -> int:
        expression = self.goal.expressions[place]
        return max(stage.hold for task in self.goal.tasks for stage in task if stage.reach == expression)


def play_for_goal(
    run: str | Path,
    text: str,
    *,
    hold: int = 1,
    until: str | None = None,
    avoid: str | None = None,
    trials: int = 1,
    max_decisions: int = TRIAL_DECISIONS,
    seed: int | None = None,
    policy: GoalPolicy = "goal",
    on_trial: Callable[[int, int | None], None] = lambda _trial, _decisions: None,
    on_step: Callable[[int, Step], None] = lambda _trial, _step: None,
) -> GoalResult:
    """Play a run for a goal, with the world model and the map that it has learned for the reward.

    What people have forbidden is kept out of: a trial in which it is entered is lost.

    Parameters
    ----------
    run
        Folder of the run; its newest checkpoint plays.
    text, hold, until, avoid
        The goal; see `read_goal`.
    trials
        How many times, from as many random starts.
    max_decisions
        Decisions after which a trial ends; the end of the game ends it as well.
    seed
        Of the starts; when None, that of `evaluate`.
    policy
        Who decides.
    on_trial
        Called with the number of each trial and after how many decisions the goal was reached, or None.
    on_step
        Called with the number of the trial and every decision.

    Raises
    ------
    UsageError
        When there is no such run, it cannot predict, the goal is malformed or in unknown words, or it cannot be had.
    """
    if trials < 1 or max_decisions < 1:
        raise UsageError("trials and decisions must be 1 or more")
    ended: list[int | None] = []
    with goal_trials(run, text, hold=hold, until=until, avoid=avoid, seed=seed, policy=policy) as made:
        for trial in range(trials):
            ended.append(made.play(trial, max_decisions, on_step=partial(on_step, trial)))
            on_trial(trial, ended[-1])
    reached = sum(one is not None for one in ended)
    return GoalResult(run=str(run), goal=text, trials=trials, reached=reached, share=reached / trials, decisions=ended)


@dataclass(frozen=True, kw_only=True)
class GoalTrials:
    """Trials for one goal. One of the same number begins alike, whoever plays it."""

    player: Player
    watch: GoalWatch
    policy: GoalPolicy
    seed: int
    env: Env

    def play(
        self,
        trial: int,
        max_decisions: int = TRIAL_DECISIONS,
        *,
        choose: Callable[[Step], int] | None = None,
        on_step: Callable[[Step], None] = lambda _step: None,
    ) -> int | None:
        """Play a trial; return after how many decisions the goal was reached, None where it was not.

        Parameters
        ----------
        trial
            Its number.
        max_decisions
            After which it ends.
        choose
            Decides in place of the policy; what it decides by is not planned for.
        on_step
            Called with every decision.
        """
        rng = np.random.default_rng([self.seed, trial])
        game = Game(self.env, int(rng.integers(2**31)))
        view = self.player.view(plans=choose is None and self.policy != "random")
        chosen = choose or _chooser(self.player, game, rng, self.policy)
        return _outcome(_trial(view, game, self.watch, chosen), self.watch, max_decisions, on_step)


@contextlib.contextmanager
def goal_trials(
    run: str | Path,
    text: str,
    *,
    hold: int = 1,
    until: str | None = None,
    avoid: str | None = None,
    seed: int | None = None,
    policy: GoalPolicy = "goal",
) -> Iterator[GoalTrials]:
    """Make the trials of `play_for_goal`, one by one.

    Raises
    ------
    UsageError
        As there.
    """
    if seed is not None and seed < 0:
        raise UsageError("seed must be 0 or more")
    player, watch = _prepared(run, policy, text, hold=hold, until=until, avoid=avoid)
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        yield GoalTrials(player=player, watch=watch, policy=policy, seed=seed, env=env)


def _prepared(
    run: str | Path, policy: GoalPolicy, text: str, *, hold: int, until: str | None, avoid: str | None
) -> tuple[Player, GoalWatch]:
    """Load who plays, and read what is sought; what people have forbidden is kept out of."""
    player = load_player(run, memory=True)
    planning = player.require_predictions(run)
    planning.screen(False)  # scenarios that promise no reward may reach the goal
    words = words_of_run(player, run)
    known = knowledge_of(words, run)
    words = replace(words, words=known.words)
    goal = read_goal(text, words.words, hold=hold, until=until, avoid=avoid, forbidden=enabled_forbidden(known))
    require_possible_goal(goal, words.words)
    watch = GoalWatch(goal, words, planning)
    if policy == "goal":
        switch_rules(player, known.disabled)
        planning.planner = GoalPlanner(planning.planner, watch, planning.config.long_term)
        return player, watch
    return keeping_out(player, words, known), watch


def _chooser(player: Player, game: Game, rng: np.random.Generator, policy: GoalPolicy) -> Callable[[Step], int]:
    if policy == "random":
        return lambda _step: int(rng.integers(game.n_actions))
    return lambda step: player.choose(step, "agent" if policy == "agent" else "planner")


def _trial(view: EpisodeView, game: Game, watch: GoalWatch, choose: Callable[[Step], int]) -> Iterator[Step]:
    """Play an episode, and let the watch see it."""
    watch.begin()
    before: Floats | None = None
    for step in play(game, view, choose):
        assert step.state is not None
        watch.words.measure(view.look())
        if before is not None:
            watch.observe(step.state.facts, before)
        before = step.state.facts
        yield step


def _outcome(steps: Iterator[Step], watch: GoalWatch, most: int, on_step: Callable[[Step], None]) -> int | None:
    """Play until the goal is reached or can no longer be; return after how many decisions it was."""
    for step in steps:
        on_step(step)
        if watch.progress.reached[0]:
            return step.number
        if watch.progress.broken[0]:
            return None
        if step.number >= most or step.done:
            return step.number if watch.progress.reached_at_end[0] else None
    return None
