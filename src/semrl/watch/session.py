"""A run being watched: it plays on, goes back, and lets a person decide. It knows neither servers nor threads."""

import itertools
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from semrl.core import Frame, Sight
from semrl.core.errors import UsageError
from semrl.envs import Game
from semrl.envs.environment import newest_frames
from semrl.evaluation.explaining import explain_played
from semrl.evaluation.explanation import Explanation
from semrl.evaluation.player import Player, Policy, evaluation_game
from semrl.evaluation.rules import rule_book_of
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.evaluation.video import write_video
from semrl.knowledge.edits import Edit
from semrl.training.loop import EpisodeView, Step
from semrl.watch.keys import action_for, keys_of
from semrl.watch.teaching import Changed, Pursuit, Teaching, actions_of, describe_edit

MOST_KEPT = 600
"""Moments that are kept to go back to."""
MOST_KEPT_BYTES = 128 * 2**20
"""Of their frames together: large ones are kept for fewer moments."""

Decider = Literal["agent", "planner", "person"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Moment:
    """Where play stands after a decision, or at the beginning of an episode."""

    number: int
    """Of all moments of the session, from 0."""
    episode: int
    """Of the evaluation, from 0."""
    step: Step
    sight: Sight
    """What was seen in its frame."""
    by: Decider | None
    """Who took the decision that led here; None at the beginning."""
    pursuit: Pursuit | None = None
    """How far the goal is that a person has set; None where there is none."""


class WatchSession:
    """Plays the episodes of an evaluation, one after the other, and keeps the last moments.

    Parameters
    ----------
    player
        Plays.
    run
        Name of its run, for people.
    seed
        Of the episodes: those of ``semrl eval`` with this seed. Its own default when None.
    policy
        Who decides while no person does.
    episode
        The first one, from 0.
    folder
        Of its run, where edits are kept; `run` when None.

    Attributes
    ----------
    teaching : Teaching
        What it was asked, and what was added.
    changed : Changed or None
        What the last thing that was asked or added made of the plan.
    policy
        Who decides while no person does; see `decide_by`.
    person : bool
        Whether a person decides, by the keys in `held`.
    held : frozenset of str
        Keys that the person holds, as browsers call them.
    rules : RuleBook or None
        By which the run predicts; None where its world model has no rules.
    keys : list of frozenset of str
        Those that must be held for each action.

    Raises
    ------
    UsageError
        When the run has not learned to see, or the planner is to decide and cannot.
    """

    def __init__(
        self,
        player: Player,
        run: str,
        *,
        seed: int | None = None,
        policy: Policy = "agent",
        episode: int = 0,
        folder: Path | None = None,
    ) -> None:
        if player.perceiving:
            raise UsageError(f"{run} has not learned to see yet, so there is nothing to watch: it needs more decisions")
        if min(episode, seed or 0) < 0:
            raise UsageError(f"seed and episode must be 0 or more, not {seed} and {episode}")
        self.teaching = Teaching(player, Path(run) if folder is None else folder)
        self.changed: Changed | None = None
        self.player = self.teaching.player()
        self.run = run
        self.seed = player.config.seed + EVALUATION_SEED if seed is None else seed
        self.keys = keys_of(player.action_names)
        self.rules = rule_book_of(player)
        self.held: frozenset[str] = frozenset()
        self.person = False
        self.policy: Policy = policy
        self._policy_before: Policy | None = None
        self.decide_by(policy)
        self._kept: deque[Moment] = deque()
        self._behind = 0
        self._by: Decider | None = None
        self._env = player.new_env(every_frame=True)
        self._begin(episode)

    def close(self) -> None:
        """Close the environment."""
        self._env.close()

    @property
    def moment(self) -> Moment:
        """What is shown: the newest moment, or one before it."""
        return self._kept[-1 - self._behind]

    @property
    def kept(self) -> tuple[int, int]:
        """Numbers of the oldest and the newest moment that are kept."""
        return self._kept[0].number, self._kept[-1].number

    @property
    def frames_between(self) -> list[Frame]:
        """What the game showed between the newest decision and the one before."""
        return newest_frames(self._env)[:-1] if self._by is not None and not self._behind else []

    def decide_by(self, policy: Policy) -> None:
        """Let agent or planner decide from here on.

        Raises
        ------
        UsageError
            When there is no planner that can.
        """
        if policy not in ("agent", "planner"):
            raise UsageError("either the agent or the planner decides")
        if policy == "planner":
            self.player.require_predictions(self.run)
        self.policy, self._policy_before = policy, None

    def seek(self, goal: str | None) -> None:
        """Let the planner play for a goal from the newest moment on; for none: who decided before decides again.

        Raises
        ------
        UsageError
            When it is malformed, in unknown words, or cannot be had; the message says why.
        """
        self._behind = 0
        if goal is None:
            self.teaching.drop()
            self._hand_back()
        else:
            self.teaching.seek(goal, self._kept[-1].step)
            before = self._policy_before or self.policy
            self.decide_by("planner")
            self._policy_before = before
        self._plan_again("the goal" if goal else "no goal")

    def edit(self, edit: Edit) -> None:
        """Add to what the run knows, or take something back; the next decision heeds it.

        Raises
        ------
        UsageError
            When it is refused, with the reason.
        """
        self._behind = 0
        self.teaching.add(edit)
        self._plan_again(describe_edit(edit))

    def step(self) -> Moment:
        """Go on by a decision: to the next moment that is kept or, from the newest, by playing.

        After the end of an episode the next one begins.
        """
        if self._behind:
            self._behind -= 1
        elif (step := next(self._steps, None)) is not None:
            self._keep(step, self._by)
        else:
            self._begin(self._kept[-1].episode + 1)
        return self.moment

    def back(self) -> Moment:
        """Go back by a decision, as far as moments are kept."""
        return self.show(self.moment.number - 1)

    def show(self, number: int) -> Moment:
        """Go to a moment, or to the nearest that is kept; a high number leads to the newest."""
        self._behind = min(max(self.kept[1] - number, 0), len(self._kept) - 1)
        return self.moment

    def new_episode(self) -> Moment:
        """Leave this episode and begin the next one."""
        self._begin(self._kept[-1].episode + 1)
        return self.moment

    def following(self, count: int) -> list[Moment]:
        """Return what is shown and up to so many moments of the same episode after it."""
        after = itertools.islice(self._kept, len(self._kept) - 1 - self._behind, None)
        return [m for m in itertools.islice(after, count + 1) if m.episode == self.moment.episode]

    def before(self, count: int) -> list[Moment]:
        """Return up to so many moments of the same episode before what is shown, and it; the oldest first."""
        at = len(self._kept) - 1 - self._behind
        episode = self.moment.episode
        return [m for m in itertools.islice(self._kept, max(at - count, 0), at + 1) if m.episode == episode]

    def explain(self) -> Explanation:
        """Explain the decision that was taken at the moment shown; at the newest it is taken first.

        Raises
        ------
        UsageError
            When the run has no map or cannot predict, a person took the decision, or the episode is over here.
        """
        planning = self.player.require_predictions(self.run)
        if not self._behind and not self.moment.step.done:
            self.step()
            self.back()
        moments = self.following(planning.planner.depth)
        by = moments[1].by if len(moments) > 1 else None
        if by is None:
            raise UsageError("there is no decision to explain: the episode is over here")
        if by == "person":
            raise UsageError("there is nothing to explain: a person took this decision")
        ours = itertools.takewhile(lambda m: m.by != "person", moments[1:])
        explained = explain_played(
            self.player,
            [self.moment.step, *(m.step for m in ours)],
            self.moment.sight,
            run=self.run,
            policy=by,
            seed=self.seed,
            episode=self.moment.episode,
        )
        record = self.moment.step.record
        if record is None or record.plan is None:
            return explained
        return replace(explained, reason=self.teaching.reason(record.plan, self.moment.pursuit))

    def write_video(self, path: Path, count: int) -> None:
        """Film up to so many moments of the episode up to what is shown, as ``.mp4`` or ``.gif``; see `write_video`."""
        write_video(path, self.player.encoder.space, ((m.step, m.sight) for m in self.before(count)))

    def _begin(self, episode: int) -> None:
        self._by = None
        self.teaching.begin()
        self.player = self.teaching.player()
        game, self._rng = evaluation_game(self._env, episode, self.seed)
        self._view = self.player.view()
        self._steps = self._played(game, self._view)
        self._episode = episode
        self._behind = 0
        self._keep(next(self._steps), None)

    def _played(self, game: Game, view: EpisodeView) -> Iterator[Step]:
        return self.player.play_by(game, view, lambda step: self._choose(step, game.n_actions))

    def _choose(self, step: Step, n_actions: int) -> int:
        """Let the person decide, or, where no key is held that means something, whoever else does."""
        step = self._kept[-1].step  # the same one, but for a plan that was made anew
        action = action_for(self.held, self.keys) if self.person else None
        self._by = self.policy if action is None else "person"
        return self.player.decide(step, n_actions, self._rng, self.policy) if action is None else action

    def _keep(self, step: Step, by: Decider | None) -> None:
        number = self._kept[-1].number + 1 if self._kept else 0
        sight = self._view.look()
        ended = bool(self._kept) and by is not None and self.teaching.follow(step, self._kept[-1].step, sight)
        pursuit = self.teaching.pursuit(step)
        moment = Moment(number=number, episode=self._episode, step=step, sight=sight, by=by, pursuit=pursuit)
        self._kept.append(moment)
        most = max(2, min(MOST_KEPT, MOST_KEPT_BYTES // np.asarray(step.observation.frame).nbytes))
        while len(self._kept) > most:
            self._kept.popleft()
        if ended:
            if pursuit is not None and pursuit.state == "reached":
                self._hand_back()
            self._renew_plan()

    def _hand_back(self) -> None:
        """Let those decide who did before there was a goal."""
        if self._policy_before is not None:
            self.decide_by(self._policy_before)

    def _plan_again(self, by: str) -> None:
        """Plan anew at the newest moment, and note what became of the plan."""
        record = self._kept[-1].step.record
        before = actions_of(record.plan if record else None)
        self._renew_plan()
        record = self._kept[-1].step.record
        self.changed = Changed(by=by, before=before, after=actions_of(record.plan if record else None))

    def _renew_plan(self) -> None:
        """Let the newest moment be planned in by what is asked and known now."""
        self.player = self.teaching.player()
        moment, planning = self._kept[-1], self.player.planning
        step = moment.step
        if planning and step.record and step.shown and not step.done:
            record = planning.plan_again(step.record)
            shown = replace(step.shown, plan=record.features)
            step = replace(step, record=record, shown=shown)
        self._kept[-1] = replace(moment, step=step, pursuit=self.teaching.pursuit(step))
