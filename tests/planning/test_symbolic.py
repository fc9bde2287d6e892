"""Operators learned from pixels of discrete worlds are those of the world, and plans with them are shortest."""

import re
from dataclasses import replace

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs.maze import N_TILES, draw_maze, shortest_steps
from semrl.evaluation.symbolic import (
    SymbolicWorld,
    concept_names,
    learn_world,
    play_plans,
    read_symbolic_goal,
    write_pddl,
)
from semrl.perception.lattice import Lattice
from semrl.planning.symbolic.cells import GridState
from semrl.planning.symbolic.operators import Effect, Operator, Operators
from semrl.planning.symbolic.search import SymbolicGoal, SymbolicPlan, nearest, search, validate

MAZE = "semrl/DrawnFourRooms-v0"


@pytest.fixture(scope="module")
def maze():
    return learn_world(MAZE, decisions=500, seed=3)


@pytest.fixture(scope="module")
def known(maze):
    return maze.learn()


def at(maze, concepts, tile):
    return next(concepts.states(maze.lattice.read(draw_maze(tile))[None]))


@pytest.mark.parametrize("side", [3, 4, 7, 8])
def test_cells_are_found_where_a_world_is_drawn_with_them(side):
    rng = np.random.default_rng(side)
    patterns = rng.integers(0, 256, (5, side, side, 3)).astype(np.uint8)
    tables = rng.integers(5, size=(12, 9, 9))
    frames = [np.concatenate([np.concatenate(list(patterns[row]), axis=1) for row in table]) for table in tables]
    lattice = Lattice().fit(frames)
    assert lattice.side_px_ == side
    read = np.array([lattice.read(frame) for frame in frames])
    pairs = set(zip(tables.ravel().tolist(), read.ravel().tolist(), strict=True))
    assert read.shape == tables.shape and len(pairs) == 5  # one kind a pattern, and the other way round
    again = Lattice()
    again.from_arrays(lattice.to_arrays())
    np.testing.assert_array_equal(again.read(frames[0]), read[0])


def test_what_is_not_drawn_cell_by_cell_is_refused():
    noise = np.random.default_rng(0).integers(0, 256, (10, 84, 84, 3)).astype(np.uint8)
    with pytest.raises(UsageError, match="cell by cell"):
        Lattice().fit(list(noise))
    with pytest.raises(UsageError, match="square cells"):
        Lattice().fit([noise[0, :83, :79]])


def test_plans_out_of_the_maze_are_as_short_as_can_be_from_every_tile(maze, known):
    concepts, operators = known
    goal = SymbolicGoal(event="end")
    found = [search(operators, at(maze, concepts, tile), goal) for tile in range(N_TILES)]
    assert [len(plan) for plan in found] == shortest_steps().tolist()
    for plan in found:
        validate(operators, plan, goal)


def test_a_place_is_reached_and_what_cannot_be_is_told(maze, known):
    concepts, operators = known
    start = at(maze, concepts, 0)
    plan = search(operators, start, SymbolicGoal(place=(1, 9)))
    assert len(plan) == 4 and (plan.states[-1].row, plan.states[-1].column) == (1, 9)
    assert len(search(operators, start, SymbolicGoal(place=(1, 1)))) == 0
    assert search(operators, start, SymbolicGoal(place=(0, 0))) is None  # a wall


def test_a_plan_that_does_not_hold_is_refused_with_its_step(maze, known):
    concepts, operators = known
    goal = SymbolicGoal(event="end")
    plan = search(operators, at(maze, concepts, 27), goal)
    away = SymbolicPlan(operators=plan.operators[1:], states=plan.states[1:])
    validate(operators, away, goal)
    with pytest.raises(UsageError, match=r"step 0 .* leads elsewhere"):
        validate(operators, SymbolicPlan(operators=plan.operators, states=(plan.states[1], *plan.states[1:])), goal)
    with pytest.raises(UsageError, match="does not reach"):
        validate(operators, SymbolicPlan(operators=plan.operators[:-1], states=plan.states[:-1]), goal)
    others = Operators(operators=tuple(one for one in operators.operators if one != plan.operators[-1]))
    with pytest.raises(UsageError, match=rf"step {len(plan) - 1} .* cannot be taken"):
        validate(others, plan, goal)


def test_what_was_never_tried_is_sought(maze, known):
    concepts, operators = known
    start = at(maze, concepts, 44)
    assert len(nearest(operators, start, lambda _: True)) == 0
    context = operators.context(start)
    fresh = replace(operators, tried=frozenset())
    assert fresh.untried(context, 4) == [0, 1, 2, 3]
    assert fresh.untried(context, 4, since=set(fresh.met(2, context))) == [0, 1, 3]
    assert operators.untried(context, 4) == []


def test_plans_are_carried_out_in_the_world_and_play_is_kept(maze, tmp_path):
    maze.save(tmp_path)
    again = SymbolicWorld.load(tmp_path)
    assert again.decisions == 500 and again.env == MAZE
    result = play_plans(tmp_path, "end", trials=6)
    assert result.solved == 6 and result.decisions == result.planned and result.learned_from == 500
    assert play_plans(tmp_path, "1,1", trials=2).share == 1


@pytest.mark.parametrize("text", ["gain", "somewhere", "1,", "solid9"])
def test_unknown_goals_are_refused(known, text):
    with pytest.raises(UsageError, match="gain"):
        read_symbolic_goal(text, *known)


def test_concepts_are_named_by_what_can_be_done_with_them(known):
    assert sorted(name[:4] for name in concept_names(*known).values()) == ["free", "outs", "soli"]


def test_domain_and_problem_are_written(maze, tmp_path):
    maze.save(tmp_path)
    domain, problem = write_pddl(tmp_path, "end", seed=5)
    for text in (domain, problem):
        assert text.count("(") == text.count(")")
    assert len(re.findall(r"\(:action", domain)) == 5  # four ways, and the way out


def test_layouts_of_minigrid_that_were_not_seen_are_solved(tmp_path):
    pytest.importorskip("minigrid", reason="needs the extra minigrid")
    learn_world("MiniGrid-Empty-Random-5x5-v0", decisions=250).save(tmp_path)
    result = play_plans(tmp_path, trials=5)
    assert result.solved == 5 and result.decisions == result.planned
    reader = pytest.importorskip("unified_planning.io", reason="needs the extra pddl").PDDLReader()
    domain, problem = write_pddl(tmp_path)
    (tmp_path / "d.pddl").write_text(domain)
    (tmp_path / "p.pddl").write_text(problem)
    read = reader.parse_problem(str(tmp_path / "d.pddl"), str(tmp_path / "p.pddl"))
    assert len(read.actions) == domain.count("(:action") and len(list(read.all_objects)) == 5 * 5 + 1


@pytest.mark.slow
@pytest.mark.parametrize(("world", "decisions"), [("DoorKey-5x5", 600), ("KeyCorridorS3R3", 2_000)])
def test_layouts_with_keys_and_doors_are_solved(world, decisions, tmp_path):
    pytest.importorskip("minigrid", reason="needs the extra minigrid")
    learn_world(f"MiniGrid-{world}-v0", decisions=decisions).save(tmp_path)
    assert play_plans(tmp_path, trials=3).solved == 3


@pytest.mark.slow
def test_fast_downward_plans_as_well(maze, tmp_path):
    pytest.importorskip("up_fast_downward", reason="needs the extra pddl")
    maze.save(tmp_path)
    result = play_plans(tmp_path, "end", trials=1, planner="fast-downward")
    assert result.solved == 1 and result.decisions == result.planned


def test_what_is_only_made_on_the_way_can_be_stood_on():
    def operator(action, held, **effect):
        what = {"move": (0, 0), "kind": 0} | effect
        return Operator(action=action, kind=0, when=(((0, 1), held),), effect=Effect(**what), support=1, against=0)

    opening, entering = operator(0, 2, changes=(((0, 1), 3),)), operator(1, 3, move=(0, 1))
    start = GridState(row=0, column=0, kind=0, cells=bytes([1, 2]), columns=2)
    plan = search(Operators(operators=(opening, entering)), start, SymbolicGoal(concept=3))
    assert plan is not None and plan.operators == (opening, entering)
    assert search(Operators(operators=(entering,)), start, SymbolicGoal(concept=3)) is None


@pytest.mark.parametrize(
    "effect",
    [Effect(move=(0, 0), kind=0, changes=(((3, 0), 1),)), Effect(move=(0, 0), kind=0, changes=(((0, 1), 1),))],
    ids=["below the last row", "right of the last column, where the next row would begin"],
)
def test_an_operator_that_would_change_what_lies_beyond_the_world_does_not_apply(effect):
    operator = Operator(action=0, kind=0, when=(), effect=effect, support=1, against=0)
    at_the_edge = GridState(row=0, column=1, kind=0, cells=bytes(4), columns=2)
    assert list(Operators(operators=(operator,)).successors(at_the_edge)) == []
    elsewhere = GridState(row=0, column=0, kind=0, cells=bytes(8), columns=2)
    assert len(list(Operators(operators=(operator,)).successors(elsewhere))) == 1
