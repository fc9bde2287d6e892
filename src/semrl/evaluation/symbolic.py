"""Symbolic plans in discrete worlds: play that is stored as cells, operators learned from it, plans carried out."""

import contextlib
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from semrl.core.arrays import Arrays, array_to_json, json_to_array, nest, unnest
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import make_folder, read_arrays, write_arrays
from semrl.envs import Game, make_env
from semrl.envs.actions import action_meanings
from semrl.envs.environment import EnvironmentConfig
from semrl.perception.lattice import Lattice
from semrl.planning.symbolic.cells import OUTSIDE, CellConcepts, GridEpisode, GridState, learn_concepts
from semrl.planning.symbolic.downward import fast_downward
from semrl.planning.symbolic.operators import Operators, learn_operators
from semrl.planning.symbolic.pddl import write_domain, write_problem
from semrl.planning.symbolic.search import SymbolicGoal, SymbolicPlan, follow, nearest, search, validate

PLAY = "symbols.npz"
"""File in a run's folder: the play that operators are learned from, cell by cell."""

SymbolicPlanner = Literal["astar", "fast-downward"]
"""Who plans: our own A*, or Fast Downward."""

LEARNING_DECISIONS = 2_000
TRIAL_DECISIONS = 200
"""After which a trial ends."""

UNSEEN_SEED = 2**31
"""First seed that learning, whose seeds are smaller, cannot have drawn."""

_FIRST = 60
"""Random decisions before what was never tried is sought."""
_EVERY = 20
_EVERY_PART = 5
"""Decisions after which operators are learned anew: so many at least, and such a part of all."""
_FRAMES = 30
"""From which the side of a cell is found."""


@dataclass(kw_only=True)
class SymbolicWorld:
    """A discrete world as it was learned from play."""

    env: str
    actions: tuple[str, ...]
    lattice: Lattice
    episodes: list[GridEpisode] = field(default_factory=list)

    def learn(self) -> tuple[CellConcepts, Operators]:
        """Learn concepts and operators from all play."""
        concepts = learn_concepts(self.episodes)
        return concepts, learn_operators(self.episodes, concepts)

    @property
    def decisions(self) -> int:
        """Of the play."""
        return sum(len(episode.actions) for episode in self.episodes)

    def save(self, run: Path) -> None:
        """Write it into a run's folder."""
        make_folder(run)
        meta = {"env": self.env, "actions": self.actions, "ended": [episode.ended for episode in self.episodes]}
        parts: Arrays = {"meta": json_to_array(meta), **nest(lattice=self.lattice.to_arrays())}
        for number, episode in enumerate(self.episodes):
            own = {"grids": episode.grids, "actions": episode.actions, "rewards": np.array(episode.rewards, np.float64)}
            parts |= nest(**{f"episode{number}": own})
        write_arrays(run / PLAY, parts)

    @classmethod
    def load(cls, run: Path) -> "SymbolicWorld":
        """Read it.

        Raises
        ------
        UsageError
            When there is none.
        """
        if not (run / PLAY).exists():
            raise UsageError(f"{run} has no play of a discrete world yet; name one with --env, such as --env ID")
        arrays = read_arrays(run / PLAY)
        try:
            meta, lattice = array_to_json(arrays["meta"]), Lattice()
            lattice.from_arrays(unnest(arrays, "lattice"))
            episodes = [
                GridEpisode(
                    grids=own["grids"], actions=own["actions"], rewards=own["rewards"].tolist(), ended=bool(ended)
                )
                for number, ended in enumerate(meta["ended"])
                for own in [unnest(arrays, f"episode{number}")]
            ]
            return cls(env=meta["env"], actions=tuple(meta["actions"]), lattice=lattice, episodes=episodes)
        except (KeyError, ValueError, TypeError) as error:
            raise SemrlError(f"{run / PLAY} is damaged ({error})") from error


@dataclass(frozen=True, kw_only=True)
class SymbolicResult:
    """What came of plans."""

    run: str
    env: str
    goal: str
    operators: int
    concepts: list[str]
    """Names of what cells hold."""
    learned_from: int
    """Decisions of play."""
    trials: int
    solved: int
    share: float
    decisions: list[int | None]
    """Of each trial: the decision after which the goal was met; None where it was not."""
    planned: list[int | None]
    """Of each trial: steps of the first plan; None where there was none."""


def learn_world(
    env: str, *, decisions: int, seed: int = 0, on_decision: Callable[[int], None] = lambda _: None
) -> SymbolicWorld:
    """Play a discrete world and learn from it: at random first, then so as to try what was never tried.

    Parameters
    ----------
    env
        Environment; see `make_env`. A decision is one step.
    decisions
        To play.
    seed
        Of layouts and of what chance decides.
    on_decision
        Is told how many were played.

    Raises
    ------
    UsageError
        When the world is not discrete, or nothing moves in it.
    """
    if decisions < 1 or seed < 0:
        raise UsageError("decisions must be 1 or more, and seed 0 or more")
    rng = np.random.default_rng(seed)
    with contextlib.closing(make_env(env, EnvironmentConfig(frame_skip=1))) as made:
        game = Game(made, seed)
        world = SymbolicWorld(env=env, actions=tuple(action_meanings(made)), lattice=Lattice())
        world.lattice.fit(_frames(game, rng))
        chooser, played = _Curious(world, game.n_actions, rng), 0
        while played < decisions:
            observation = game.reset()
            record = _Record(world.lattice.read(observation.frame))
            while not record.over and played < decisions:
                record.take(game, chooser.choose(record), world.lattice)
                played += 1
                on_decision(played)
            world.episodes.append(record.episode())
    return world


def play_plans(
    run: str | Path,
    goal: str = "gain",
    *,
    trials: int = 1,
    seed: int | None = None,
    max_decisions: int = TRIAL_DECISIONS,
    planner: SymbolicPlanner = "astar",
    on_trial: Callable[[int, int | None], None] = lambda _trial, _decisions: None,
) -> SymbolicResult:
    """Plan for a goal in worlds that were not learned from, and carry the plans out.

    A step that leads elsewhere than planned is followed by a new plan.

    Parameters
    ----------
    run
        Folder with play of a discrete world; see `learn_world`.
    goal
        ``gain``, ``end``, a concept of cells, or ``row,column``.
    trials
        Episodes.
    seed
        Of the first episode's layout; those of learning are others when None.
    max_decisions
        After which a trial ends.
    planner
        ``astar``, or ``fast-downward`` (extra ``pddl``).
    on_trial
        Is told the number of each trial and after how many decisions the goal was met, or None.

    Raises
    ------
    UsageError
        When there is no play, or the goal is unknown.
    """
    if min(trials, seed or 0) < 0 or max_decisions < 1:
        raise UsageError("trials and seed must be 0 or more, and decisions 1 or more")
    world = SymbolicWorld.load(Path(run))
    concepts, operators = world.learn()
    sought = read_symbolic_goal(goal, concepts, operators)
    ended: list[int | None] = []
    planned: list[int | None] = []
    with contextlib.closing(make_env(world.env, EnvironmentConfig(frame_skip=1))) as made:
        game = Game(made, 0)
        for trial in range(trials):
            record = _Record(world.lattice.read(game.begin(_first_layout(seed) + trial).frame))
            layout = _Trial(game, record, world, concepts, operators, planner)
            solved, steps = layout.carry_out(sought, max_decisions)
            ended.append(solved)
            planned.append(steps)
            on_trial(trial, solved)
    solved_count = sum(one is not None for one in ended)
    return SymbolicResult(
        run=str(run),
        env=world.env,
        goal=goal,
        operators=len(operators.operators),
        concepts=[name for concept, name in concept_names(concepts, operators).items() if concept >= 0],
        learned_from=world.decisions,
        trials=trials,
        solved=solved_count,
        share=solved_count / trials if trials else 0.0,
        decisions=ended,
        planned=planned,
    )


def write_pddl(run: str | Path, goal: str = "gain", *, seed: int | None = None) -> tuple[str, str]:
    """Return the operators of a world as a PDDL domain, and the first layout of `play_plans` and a goal as a problem.

    Raises
    ------
    UsageError
        When there is no play, the goal is unknown, or what the actions move is not seen.
    """
    world = SymbolicWorld.load(Path(run))
    concepts, operators = world.learn()
    names, sought = concept_names(concepts, operators), read_symbolic_goal(goal, concepts, operators)
    domain = write_domain(operators, world.env, world.actions, names)
    state = _first_state(world, concepts, _first_layout(seed))
    return domain, write_problem(operators, state, sought, world.env, names)


def _first_layout(seed: int | None) -> int:
    return UNSEEN_SEED if seed is None else seed


def _first_state(world: SymbolicWorld, concepts: CellConcepts, seed: int) -> GridState:
    """Return how an episode begins."""
    with contextlib.closing(make_env(world.env, EnvironmentConfig(frame_skip=1))) as made:
        grid = world.lattice.read(Game(made, 0).begin(seed).frame)
    state = next(concepts.states(grid[None]))
    if state is None:
        raise UsageError("what the actions move is not seen in this world, so no plan can begin")
    return state


def concept_names(concepts: CellConcepts, operators: Operators) -> dict[int, str]:
    """Return a name of each concept of cells by what was learned of it: gain, free, solid, outside, and a number."""
    entered: dict[int, int] = {}
    for operator in operators.operators:
        effect = operator.effect
        into = dict(operator.when).get(effect.move)
        if effect.move != (0, 0) and into is not None:
            entered[into] = max(entered.get(into, 0), effect.gain)
    names = {OUTSIDE: "outside"}
    for concept in sorted(set(concepts.concept_of.values())):
        kind = "solid" if concept not in entered else "gain" if entered[concept] > 0 else "free"
        names[concept] = f"{kind}{concept}"
    return names


def read_symbolic_goal(text: str, concepts: CellConcepts, operators: Operators) -> SymbolicGoal:
    """Read a goal: ``gain``, ``end``, a concept of cells, or ``row,column``.

    Raises
    ------
    UsageError
        When it is none of these, or was never met.
    """
    if text in ("gain", "end"):
        goal = SymbolicGoal(event=text)
        if not any(goal.reached(one, None, _NOWHERE) for one in operators.operators):
            raise UsageError(f"the play that was learned from has no {text}, so that none can be planned for")
        return goal
    if match := re.fullmatch(r"\s*(\d+)\s*,\s*(\d+)\s*", text):
        return SymbolicGoal(place=(int(match[1]), int(match[2])))
    names = concept_names(concepts, operators)
    for concept, name in names.items():
        if name == text and concept >= 0:
            return SymbolicGoal(concept=concept)
    known = ", ".join(name for concept, name in names.items() if concept >= 0)
    raise UsageError(f"there is no goal '{text[:60]}'; there are gain, end, row,column such as 3,4, and {known}")


_NOWHERE = GridState(row=0, column=0, kind=-1, cells=b"", columns=1)


class _Record:
    """The episode that is going on."""

    def __init__(self, grid: np.ndarray) -> None:
        self.grids, self.actions, self.rewards = [grid], list[int](), list[float]()
        self.ended = self.over = False

    def take(self, game: Game, action: int, lattice: Lattice) -> None:
        outcome = game.step(action)
        self.grids.append(lattice.read(outcome.observation.frame))
        self.actions.append(action)
        self.rewards.append(outcome.reward)
        self.ended, self.over = outcome.terminated, outcome.done

    def episode(self) -> GridEpisode:
        return GridEpisode(
            grids=np.array(self.grids),
            actions=np.array(self.actions, np.int64),
            rewards=tuple(self.rewards),
            ended=self.ended,
        )


class _Curious:
    """Decides while learning."""

    def __init__(self, world: SymbolicWorld, n_actions: int, rng: np.random.Generator) -> None:
        self.world, self.n_actions, self.rng = world, n_actions, rng
        self.known: tuple[CellConcepts, Operators] | None = None
        self.since = self.played = 0
        self.waiting: list[int] = []

    def choose(self, record: _Record) -> int:
        self.played += 1
        self.since += 1
        if not record.actions:
            self.waiting = []
        if self.played > _FIRST and not self.waiting and self.rng.random() < 1 / 2:
            self._seek(record)
        if self.waiting:
            return self.waiting.pop(0)
        return int(self.rng.integers(self.n_actions))

    def _seek(self, record: _Record) -> None:
        if self.known is None or self.since > max(_EVERY, self.played // _EVERY_PART):
            world = SymbolicWorld(env="", actions=(), lattice=self.world.lattice)
            world.episodes = [*self.world.episodes, *([record.episode()] if record.actions else [])]
            try:
                self.known = world.learn()
            except UsageError:
                return
            self.since = 0
        concepts, operators = self.known
        state = list(concepts.states(np.array(record.grids)))[-1]
        if state is None:
            return
        found = nearest(operators, state, lambda one: bool(operators.untried(one, self.n_actions)))
        if found is not None:
            new = operators.untried(found.states[-1], self.n_actions)
            self.waiting = [one.action for one in found.operators] + [int(self.rng.choice(new))]


def _frames(game: Game, rng: np.random.Generator) -> list[np.ndarray]:
    frames = [game.reset().frame]
    while len(frames) < _FRAMES:
        outcome = game.step(int(rng.integers(game.n_actions)))
        frames.append(game.reset().frame if outcome.done else outcome.observation.frame)
    return frames


@dataclass(frozen=True, slots=True)
class _Trial:
    """An episode in which plans are carried out."""

    game: Game
    record: _Record
    world: SymbolicWorld
    concepts: CellConcepts
    operators: Operators
    planner: SymbolicPlanner

    def carry_out(self, goal: SymbolicGoal, most: int) -> tuple[int | None, int | None]:
        """Plan and play until a goal is met; return after how many decisions it was, and steps of the first plan."""
        plan: SymbolicPlan | None = None
        steps: int | None = None
        place = 0
        while not self.record.over and len(self.record.actions) < most:
            state = list(self.concepts.states(np.array(self.record.grids)))[-1]
            if plan is None or place >= len(plan) or plan.states[place] != state:
                plan, place = None if state is None else self._planned(state, goal), 0
                if plan is None:
                    return None, steps
                validate(self.operators, plan, goal)
                steps = len(plan) if steps is None else steps
                if not plan.operators:
                    return len(self.record.actions), steps
            self.record.take(self.game, plan.operators[place].action, self.world.lattice)
            place += 1
            if _met(self.record, self.concepts, goal):
                return len(self.record.actions), steps
        return None, steps

    def _planned(self, state: GridState, goal: SymbolicGoal) -> SymbolicPlan | None:
        if self.planner == "astar":
            return search(self.operators, state, goal)
        names = concept_names(self.concepts, self.operators)
        domain = write_domain(self.operators, self.world.env, self.world.actions, names)
        problem = write_problem(self.operators, state, goal, self.world.env, names)
        actions = fast_downward(self.operators, domain, problem)
        return None if actions is None else follow(self.operators, state, actions)


def _met(record: _Record, concepts: CellConcepts, goal: SymbolicGoal) -> bool:
    """Tell whether the newest decision of an episode met a goal, as the world says, not the plan."""
    if goal.event:
        return record.rewards[-1] > 0 if goal.event == "gain" else record.ended
    *_, before, state = [None, *concepts.states(np.array(record.grids))]
    return state is not None and goal.reached(None, before, state)
