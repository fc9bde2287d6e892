import numpy as np
import pytest

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.envs.maze import N_TILES, OUTSIDE, TRANSITIONS, FourRooms, shortest_steps
from semrl_thesis.hierarchy import LOCAL_TILE, ROOM_OF, ROOM_TURNS, MazeHierarchy, MazeHierarchyConfig
from semrl_thesis.tabular import QLearning, QLearningConfig, train

SEEDS = [0, 1, 2]


def flat_learner() -> QLearning:
    return QLearning(QLearningConfig(), n_states=N_TILES, n_actions=4)


def hierarchy() -> MazeHierarchy:
    return MazeHierarchy(MazeHierarchyConfig())


LEARNERS = {"flat": flat_learner, "hierarchy": hierarchy}
STEPS_ENOUGH = {"flat": 40_000, "hierarchy": 20_000}


def greedy_steps(learner, rng, *, limit=50):
    """Length of the greedy path out from each tile; `limit` when it does not get out."""
    lengths = np.full(N_TILES, limit)
    for start in range(N_TILES):
        tile = start
        for step in range(1, limit):
            tile = int(TRANSITIONS[tile, learner.greedy(tile, rng)])
            if tile == OUTSIDE:
                lengths[start] = step
                break
    return lengths


def test_update_is_equation_2_1():
    learner = QLearning(QLearningConfig(learning_rate=0.25, discount=0.9), n_states=2, n_actions=2)
    learner.from_arrays({"values": np.array([[1.0, 2.0], [3.0, 4.0]])})
    learner.update(0, 1, 5.0, 1, terminated=False)
    assert learner.values_[0, 1] == pytest.approx(2 + 0.25 * (5 + 0.9 * 4 - 2))
    learner.update(0, 0, 5.0, 1, terminated=True)
    assert learner.values_[0, 0] == pytest.approx(1 + 0.25 * (5 - 1))
    np.testing.assert_array_equal(learner.values_[1], [3, 4])


def test_counts_of_values_are_those_of_the_thesis():
    assert flat_learner().n_values == 400
    learner = hierarchy()
    assert (learner.completion_.n_values, learner.subtask_.n_values) == (8, 200)
    assert learner.n_values == 208


def test_every_room_is_the_standard_room_turned():
    """Inside all rooms, and through both exits of each, turned moves do the same."""
    for room, turns in enumerate(ROOM_TURNS):
        tile_of = np.empty(25, dtype=int)
        tile_of[LOCAL_TILE[room == ROOM_OF]] = np.flatnonzero(room == ROOM_OF)
        for local in range(25):
            row, column = divmod(local, 5)
            for move, (down, right) in enumerate([(0, 1), (1, 0), (0, -1), (-1, 0)]):
                there = TRANSITIONS[tile_of[local], (move + turns) % 4]
                if (local, move) in [(2 * 5 + 4, 0), (4 * 5 + 2, 1)]:
                    assert there == OUTSIDE or ROOM_OF[there] != room
                elif (room, local, move) == (0, 2 * 5, 2):
                    assert ROOM_OF[there] == 3  # the third door of the exit's room
                else:
                    local_there = min(max(row + down, 0), 4) * 5 + min(max(column + right, 0), 4)
                    assert there == tile_of[local_there]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", LEARNERS)
def test_learns_the_shortest_path_from_every_tile(name, seed):
    rng = np.random.default_rng(seed)
    learner = LEARNERS[name]()
    train(learner, FourRooms(), steps=STEPS_ENOUGH[name], rng=rng)
    np.testing.assert_array_equal(greedy_steps(learner, rng), shortest_steps())


@pytest.mark.parametrize("seed", SEEDS)
def test_hierarchy_learns_the_true_values(seed):
    learner = hierarchy()
    train(learner, FourRooms(), steps=STEPS_ENOUGH["hierarchy"], rng=np.random.default_rng(seed))
    best = [learner.exit_values(tile).max() for tile in range(N_TILES)]
    np.testing.assert_allclose(best, -shortest_steps(), atol=1e-3)


def test_only_the_room_opposite_the_exit_needs_to_know_the_tile():
    learner = hierarchy()
    train(learner, FourRooms(), steps=STEPS_ENOUGH["hierarchy"], rng=np.random.default_rng(0))
    advantage = np.array([np.subtract(*learner.exit_values(tile)) for tile in range(N_TILES)])  # exit 0 − 1
    assert (advantage[ROOM_OF == 0] > 0.5).all()
    assert (advantage[ROOM_OF == 1] < -0.5).all()
    assert (advantage[ROOM_OF == 3] > 0.5).all()
    assert advantage[ROOM_OF == 2].min() == pytest.approx(-4, abs=0.01)
    assert advantage[ROOM_OF == 2].max() == pytest.approx(4, abs=0.01)


def test_hierarchy_needs_fewer_steps_than_flat():
    def steps_needed(make, seed):
        rng = np.random.default_rng(seed)
        learner = make()
        for steps in range(1000, 40_001, 1000):
            train(learner, FourRooms(), steps=1000, rng=rng)
            if (greedy_steps(learner, rng) == shortest_steps()).all():
                return steps
        raise AssertionError("did not learn")

    needed = {name: [steps_needed(make, seed) for seed in SEEDS] for name, make in LEARNERS.items()}
    assert max(needed["hierarchy"]) < min(needed["flat"]), needed


@pytest.mark.parametrize("name", LEARNERS)
def test_same_seed_same_tables_and_restored_learner_goes_on_alike(name):
    first, second, restored = (LEARNERS[name]() for _ in range(3))
    for learner in (first, second):
        train(learner, FourRooms(), steps=1500, rng=np.random.default_rng(7))
    assert digest(first.to_arrays()) == digest(second.to_arrays())
    saved = first.to_arrays()
    before = digest(saved)
    restored.from_arrays(saved)
    for learner in (first, restored):
        train(learner, FourRooms(), steps=500, rng=np.random.default_rng(8))
    assert digest(first.to_arrays()) == digest(restored.to_arrays()) != before
    assert digest(saved) == before


def test_exploration_takes_its_share():
    learner = QLearning(QLearningConfig(exploration=0.4), n_states=1, n_actions=4)
    learner.from_arrays({"values": np.array([[0.0, 1.0, 0.0, 0.0]])})
    rng = np.random.default_rng(0)
    chosen = np.bincount([learner.act(0, rng) for _ in range(4000)], minlength=4) / 4000
    np.testing.assert_allclose(chosen, [0.1, 0.7, 0.1, 0.1], atol=0.03)


def test_wrong_values_are_named():
    with pytest.raises(UsageError, match="discount"):
        QLearningConfig(discount=1.5)
    with pytest.raises(UsageError, match="wrong_exit_fine"):
        MazeHierarchyConfig(wrong_exit_fine=1.0)
    with pytest.raises(DataError, match=r"\(2, 2\)"):
        flat_learner().from_arrays({"values": np.zeros((2, 2))})
