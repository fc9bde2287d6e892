"""Plans in layouts that were not learned from: made, carried out, and written as PDDL."""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from semrl.core.errors import UsageError
from semrl.envs import Game, make_env
from semrl.envs.environment import EnvironmentConfig
from semrl.evaluation.symbolic.naming import concept_names, read_symbolic_goal, require_reachable
from semrl.evaluation.symbolic.world import Record, SymbolicWorld
from semrl.planning.symbolic.cells import CellConcepts, GridState
from semrl.planning.symbolic.downward import fast_downward
from semrl.planning.symbolic.operators import Operators
from semrl.planning.symbolic.pddl import write_domain, write_problem
from semrl.planning.symbolic.search import SymbolicGoal, SymbolicPlan, follow, search, validate

SymbolicPlanner = Literal["astar", "fast-downward"]
"""Who plans: our own A*, or Fast Downward."""

TRIAL_DECISIONS = 200
"""After which a trial ends."""

UNSEEN_SEED = 2**31
"""First seed that learning, whose seeds are smaller, cannot have drawn."""


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
        Called with the number of each trial and after how many decisions the goal was met, or None.

    Raises
    ------
    UsageError
        When there is no play, or the goal is unknown or cannot be had.
    """
    if min(trials, seed or 0) < 0 or max_decisions < 1:
        raise UsageError("trials and seed must be 0 or more, and decisions 1 or more")
    world = SymbolicWorld.load(Path(run))
    concepts, operators = world.learn()
    sought = read_symbolic_goal(goal, concepts, operators)
    require_reachable(sought, world.episodes, concepts, operators)
    outcomes: list[tuple[int | None, int | None]] = []
    with contextlib.closing(make_env(world.env, EnvironmentConfig(frame_skip=1))) as made:
        game = Game(made, 0)
        for trial in range(trials):
            record = Record(world.lattice.read(game.begin(_first_layout(seed) + trial).frame))
            layout = _Trial(game, record, world, concepts, operators, planner)
            outcomes.append(layout.carry_out(sought, max_decisions))
            on_trial(trial, outcomes[-1][0])
    names = [name for concept, name in concept_names(concepts, operators).items() if concept >= 0]
    known = len(operators.operators)
    return _summed_up(run, goal, world, operators=known, concepts=names, outcomes=outcomes)


def _summed_up(
    run: str | Path,
    goal: str,
    world: SymbolicWorld,
    *,
    operators: int,
    concepts: list[str],
    outcomes: Sequence[tuple[int | None, int | None]],
) -> SymbolicResult:
    """Return what came of the trials: of each, decisions until the goal was met and steps of the first plan."""
    solved = sum(decisions is not None for decisions, _ in outcomes)
    return SymbolicResult(
        run=str(run),
        env=world.env,
        goal=goal,
        operators=operators,
        concepts=concepts,
        learned_from=world.decisions,
        trials=len(outcomes),
        solved=solved,
        share=solved / len(outcomes) if outcomes else 0.0,
        decisions=[decisions for decisions, _ in outcomes],
        planned=[steps for _, steps in outcomes],
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


@dataclass(frozen=True, slots=True)
class _Trial:
    """An episode in which plans are carried out."""

    game: Game
    record: Record
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
            *_, state = self.concepts.states(self.record.grids)
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


def _met(record: Record, concepts: CellConcepts, goal: SymbolicGoal) -> bool:
    """Tell whether the newest decision of an episode met a goal, as the world says, not the plan."""
    if goal.event:
        return record.rewards[-1] > 0 if goal.event == "gain" else record.ended
    *_, before, state = [None, *concepts.states(record.grids)]
    return state is not None and goal.reached(None, before, state)
