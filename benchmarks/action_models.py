"""How good the operators are that are learned from pixels, as models of actions are measured in AMLGym.

    python benchmarks/action_models.py --worlds MiniGrid-DoorKey-5x5-v0 --decisions 1000 --json

The notions are those of AMLGym (Lamanna et al. 2025): precision and recall of predicted applicability, of predicted
effects and of the literals of operators, as means over actions, and the share of problems that are solved by plans.
What is true is asked of MiniGrid itself, in layouts that were not learned from. Needs the extra `minigrid`.
"""

import contextlib
import json
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import grid_oracle
import machine
import numpy as np
import tyro
from grid_oracle import Facts, Point
from grid_reference import ACTIONS, compared, in_words, reference
from rich.console import Console

from semrl.envs import Game, make_env
from semrl.envs.environment import EnvironmentConfig
from semrl.evaluation.symbolic import UNSEEN_SEED, SymbolicWorld, learn_world
from semrl.planning.symbolic.cells import CellConcepts, GridState
from semrl.planning.symbolic.operators import Operators
from semrl.planning.symbolic.search import SymbolicGoal, search

Share = tuple[float, float]
"""Precision and recall."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Learn each world with each seed; measure what was learned."""

    worlds: tuple[str, ...] = ("MiniGrid-DoorKey-5x5-v0",)
    """Environments."""
    decisions: int = 1_000
    """To learn from."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Of learning."""
    layouts: int = 20
    """That were not learned from, the same ones for each seed."""
    draws: int = 40
    """States of each."""
    states: int = 1_500
    """Of each from which these are drawn."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one seed learned of one world."""

    world: str
    seed: int
    states: int
    seen: float
    """Share of facts (cells, place, direction) that the learner has right of what it sees."""
    applicability: Share
    effects: Share
    effects_with_carried: Share
    """Where what is carried, which is not to be seen, counts as a fact as well."""
    preconditions: Share
    literals: Share
    """Of preconditions and effects."""
    solved: int
    false_plans: int
    """Plans that did not lead to the gain."""
    without_plan: int
    actions: dict[str, dict[str, Share]]
    """Of each action, before the mean is taken."""
    mistakes: dict[str, int]
    """Action, what was in front, what was carried, and what was wrong → times."""


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """What the learner's words are in the world's own."""

    things: dict[int, str]
    """Concept of a cell → what it mostly is."""
    ways: dict[int, int]
    """Kind of the thing that the actions move → the direction that it mostly faces."""

    def facts(self, state: GridState, carried: str, gain: int, *, ended: bool) -> Facts:
        """Return a learner's state in the world's words; what is carried is given."""
        cells = {
            divmod(place, state.columns): self.things.get(value, "?")
            for place, value in enumerate(np.frombuffer(state.cells, np.int8).tolist())
        }
        facing = self.ways.get(state.kind)
        place = {"at": (state.row, state.column), "facing": facing, "carried": carried}
        return {**place, "gain": gain, "ended": ended, **cells}


def main(arguments: Arguments) -> None:
    """Learn, measure, print."""
    console, rows = Console(stderr=True), list[Row]()
    for world in arguments.worlds:
        with contextlib.closing(make_env(world, EnvironmentConfig(frame_skip=1))) as env:
            game, rng = Game(env, 0), np.random.default_rng(0)
            points = [
                one
                for layout in range(UNSEEN_SEED, UNSEEN_SEED + arguments.layouts)
                for one in grid_oracle.points(game, layout, draws=arguments.draws, states=arguments.states, rng=rng)
            ]
            for seed in arguments.seeds:
                rows.append(measured(game, points, world, seed, arguments))
                console.print(asdict(rows[-1]))
    found = {"machine": machine.describe(), **asdict(arguments), "rows": [asdict(row) for row in rows]}
    if arguments.json:
        print(json.dumps(found))


def measured(game: Game, points: Sequence[Point], world: str, seed: int, arguments: Arguments) -> Row:
    """Learn a world and measure what was learned."""
    with tempfile.TemporaryDirectory() as folder:
        learn_world(world, decisions=arguments.decisions, seed=seed).save(Path(folder))
        learned = SymbolicWorld.load(Path(folder))
    concepts, operators = learned.learn()
    states = [_seen(learned, concepts, point) for point in points]
    meaning = _meaning(points, states)
    right = [_agreement(point, state, meaning) for point, state in zip(points, states, strict=True)]
    applicable, effects, carried, mistakes = _predicted(points, states, operators, meaning)
    things = {str(value) for point in points for value in point.facts.values()}
    literals = compared(in_words(operators.operators, meaning.things, meaning.ways), reference(things))
    plans = Counter(
        _planned(game, learned, concepts, operators, layout)
        for layout in range(UNSEEN_SEED, UNSEEN_SEED + arguments.layouts)
    )
    when = {action: own["when"] for action, own in literals.items()}
    both = {action: own["when"] + own["effects"] for action, own in literals.items()}
    counted = {"applicability": applicable, "effects": effects, "preconditions": when, "literals": both}
    return Row(
        world=world,
        seed=seed,
        states=len(points),
        seen=round(float(np.mean(right)), 4),
        applicability=_mean(applicable),
        effects=_mean(effects),
        effects_with_carried=_mean(carried),
        preconditions=_mean(when),
        literals=_mean(both),
        solved=plans["solved"],
        false_plans=plans["false"],
        without_plan=plans["none"],
        actions={name: {action: _share(count) for action, count in own.items()} for name, own in counted.items()},
        mistakes=dict(mistakes.most_common()),
    )


def _seen(world: SymbolicWorld, concepts: CellConcepts, point: Point) -> GridState | None:
    *_, state = concepts.states(np.array([world.lattice.read(frame) for frame in point.frames]))
    return state


def _meaning(points: Sequence[Point], states: Sequence[GridState | None]) -> Meaning:
    things, ways = dict[int, Counter[str]](), dict[int, Counter[int]]()
    for point, state in zip(points, states, strict=True):
        if state is None:
            continue
        ways.setdefault(state.kind, Counter())[point.facts["facing"]] += 1
        for place, value in enumerate(np.frombuffer(state.cells, np.int8).tolist()):
            things.setdefault(value, Counter())[point.facts[divmod(place, state.columns)]] += 1
    return Meaning(
        things={concept: count.most_common(1)[0][0] for concept, count in things.items()},
        ways={kind: count.most_common(1)[0][0] for kind, count in ways.items()},
    )


def _agreement(point: Point, state: GridState | None, meaning: Meaning) -> float:
    if state is None:
        return 0.0
    seen = meaning.facts(state, point.facts["carried"], 0, ended=False)
    return float(np.mean([seen[name] == value for name, value in point.facts.items()]))


def _predicted(
    points: Sequence[Point], states: Sequence[GridState | None], operators: Operators, meaning: Meaning
) -> tuple[dict[str, Counter[str]], dict[str, Counter[str]], dict[str, Counter[str]], Counter[str]]:
    """Count right, extra and missing: of applicability, of effects, of these with what is carried; and mistakes."""
    applicable, effects, carried = ({action: Counter[str]() for action in ACTIONS} for _ in range(3))
    mistakes = Counter[str]()
    for point, state in zip(points, states, strict=True):
        outcomes = {} if state is None else {one.action: (one, after) for one, after in operators.successors(state)}
        for action, after in enumerate(point.after):
            name, expected = ACTIONS[action], None
            if action in outcomes:
                effect, then = outcomes[action][0].effect, outcomes[action][1]
                if then != state or effect.gain or effect.ends:
                    expected = meaning.facts(then, point.facts["carried"], effect.gain, ended=effect.ends)
            truly = after != point.facts
            which = ("extra", "right")[truly] if expected is not None else "missing"
            applicable[name][which] += truly or expected is not None
            wrong = which if which != "right" and (truly or expected is not None) else ""
            if truly and expected is not None:
                counted = _changes(point.facts, expected, after)
                carried[name] += counted
                effects[name] += (plain := _changes(point.facts, {**expected, "carried": after["carried"]}, after))
                effects[name]["right"] -= after["carried"] != point.facts["carried"]
                wrong = "effects" if plain["extra"] or plain["missing"] else ""
            if wrong:
                held = point.facts["carried"]
                mistakes[f"{name}, {grid_oracle.ahead(point.facts)} in front, {held} carried: {wrong}"] += 1
    return applicable, effects, carried, mistakes


def _changes(before: Facts, expected: Facts, after: Facts) -> Counter[str]:
    """Count facts that come true: right, extra; and those that cease to hold but are kept in what is expected."""
    came = {name for name, value in expected.items() if value != before[name]}
    right = sum(expected[name] == after[name] for name in came)
    kept = sum(value != after[name] for name, value in before.items() if expected[name] == value)
    return Counter(right=right, extra=len(came) - right, missing=kept)


def _planned(game: Game, world: SymbolicWorld, concepts: CellConcepts, operators: Operators, layout: int) -> str:
    """Plan for the gain in a layout and carry the plan out blindly; return ``solved``, ``false`` or ``none``."""
    state = concepts.state(world.lattice.read(game.begin(layout).frame), None)
    plan = None if state is None else search(operators, state, SymbolicGoal(event="gain"))
    if plan is None:
        return "none"
    for operator in plan.operators:
        outcome = game.step(operator.action)
        if outcome.done:
            break
    return "solved" if outcome.reward > 0 else "false"


def _share(count: Counter[str]) -> Share:
    """Return precision and recall; what was never said has no wrong in it, what never was has none missing."""
    right, said, was = count["right"], count["right"] + count["extra"], count["right"] + count["missing"]
    return round(right / said if said else 1.0, 3), round(right / was if was else 1.0, 3)


def _mean(counts: dict[str, Counter[str]]) -> Share:
    """Return the mean over the actions that do anything, as the world or as the learner has it."""
    shares: Iterable[Share] = [_share(count) for count in counts.values() if count.total()]
    precision, recall = np.mean(list(shares), axis=0).round(3).tolist()
    return precision, recall


if __name__ == "__main__":
    main(tyro.cli(Arguments))
