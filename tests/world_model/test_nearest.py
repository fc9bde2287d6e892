"""What is nearest to each thing, against plain Python; and what it is for."""

import numpy as np

from semrl.core import History, Trajectory
from semrl.world_model import TreesConfig
from semrl.world_model.nearest import NEAREST, NONE_FAR, Nearest, nearest_of, none_compared
from semrl.world_model.tree_kernels import Relations, lay_out
from semrl.world_model.tree_world import TreeWorld
from semrl.world_model.trees import Forests

UNIT = 0.01
AXES = np.tile([0, 1, -1], 5)


def laid_out(windows, nearest):
    """What trees see of it in ``(n, 2, d)`` windows."""
    relations = Relations(np.zeros((0, 2), np.int64), True, nearest)
    n, _, dimension = windows.shape
    rows = lay_out(windows, np.zeros((n, 0), np.int64), np.zeros(n, np.int64), relations)
    return rows[:, 3 * dimension : -1].reshape(n, -1, NEAREST)


def plainly(now, then, thing):
    """The same numbers of one thing of ``(5, 3)`` things, in plain Python."""
    after = 2 * now - then
    others = [other for other in range(len(now)) if other != thing and now[other, 2] > 50]
    if not others or now[thing, 2] <= 50:
        return [NONE_FAR] * (NEAREST - 1) + [-1]
    which = min(others, key=lambda other: max(abs(now[thing, :2] - now[other, :2])))
    gaps = [*(now[thing, :2] - now[which, :2]), *(after[thing, :2] - after[which, :2])]
    return [*gaps, *map(abs, gaps), which]


def scenes(rng, count):
    """Five things, of which each is seen now and then; the second never leaves its row."""
    windows = rng.integers(0, 100, size=(count, 2, 15)).astype(np.float32)
    windows[:, :, 2::3] = 100 * (rng.random((count, 2, 5)) < 0.7)
    windows[:, :, 4] = 30
    return windows


def test_the_nearest_that_is_seen_is_found():
    windows = scenes(np.random.default_rng(0), 300)
    varying = np.delete(np.arange(15), 4)
    steady = np.zeros(15, np.float32)
    steady[4] = 30
    found = laid_out(windows[:, :, varying], nearest_of(AXES, varying, steady, UNIT))
    for row, (now, then) in zip(found, windows.reshape(-1, 2, 5, 3), strict=True):
        assert row.tolist() == [plainly(now, then, thing) for thing in range(5)]


def test_only_things_with_a_place_are_compared():
    axes = np.array([0, 1, -1, 0, -1, -1, 0, 1, -1])  # the second has no row, the third no place
    nearest = nearest_of(axes, np.array([0, 1, 2, 3, 4, 5, 7]), np.arange(9, dtype=np.float32), UNIT)
    assert nearest.columns.tolist() == [[0, 1, 2], [-1, 6, -1]]
    assert nearest.steady.tolist() == [[0, 1, 50], [6, 7, 50]]
    assert not len(none_compared().columns)


def test_what_any_of_many_things_does_is_one_rule():
    """Whoever touches the first thing sets it back: a tree about the nearest needs far less play than one of pairs."""
    rng = np.random.default_rng(0)
    windows = scenes(rng, 3000)
    windows[:, :, 2::3], windows[:, :, 4] = 100, rng.integers(0, 100, size=(3000, 2))
    now = windows[:, 0].reshape(-1, 5, 3)
    apart = np.abs(now[:, :1, :2] - now[:, 1:, :2]).max(axis=2)
    touched = (apart.min(axis=1) <= 12).astype(float)[:, None]
    every = np.arange(15)
    known = nearest_of(AXES, every, np.zeros(15, np.float32), UNIT)
    pairs = [(i, j) for i in every for j in every if i < j and AXES[i] == AXES[j] >= 0]
    errors = []
    for relations in (
        Relations(np.zeros((0, 2), np.int64), True, known),
        Relations(np.array(pairs), True, none_compared()),
    ):
        rows = lay_out(windows, np.zeros((3000, 0), np.int64), np.zeros(3000, np.int64), relations)
        forest = Forests(1).fit(rows[:500], touched[:500], rng, leaf_rows=[2])
        errors.append(np.abs(forest(rows[500:])[0] - touched[500:]).mean())
    assert errors[0] == 0 and errors[1] > 0.05


def test_a_world_that_compares_with_the_nearest_is_saved_whole():
    rng = np.random.default_rng(0)
    states = np.cumsum(rng.integers(-1, 2, size=(401, 15)), axis=0).astype(np.float32) * UNIT
    states[:, 2::3], states[:, 4] = 1, 0.3
    actions = rng.integers(2, size=400)
    config = TreesConfig(nearest_from=4, members=2, first_decisions=100, resolution=UNIT)
    world, again = (TreeWorld(config, 15, axes=AXES) for _ in range(2))
    world.partial_fit(Trajectory(states=states, actions=actions, rewards=(actions > 0).astype(np.float32)))
    again.from_arrays(world.to_arrays())
    history = History(states=states[20:4:-1], actions=actions[19:3:-1], number=20)
    told = [each.imagine(history, np.zeros((1, 5), np.int64)) for each in (world, again)]
    assert len(world.features.relations_.nearest.columns) == 5 and world.features.relations_.nearest.steady[1, 1] == 30
    np.testing.assert_array_equal(told[0].states, told[1].states)


def test_trees_compare_with_the_nearest_from_so_many_things_on():
    for things, nearest in ((3, 0), (4, 4), (5, 5)):
        world = TreeWorld(TreesConfig(nearest_from=4, distances=True), 3 * things, axes=AXES[: 3 * things])
        assert len(world.features.relations_.nearest.columns) == nearest
        assert (len(world.features.relations_.pairs) == 0) == (nearest > 0)
    never = TreeWorld(TreesConfig(), 15, axes=AXES)
    assert isinstance(never.features.relations_.nearest, Nearest) and not len(never.features.relations_.nearest.columns)
