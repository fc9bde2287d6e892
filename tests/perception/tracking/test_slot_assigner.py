from dataclasses import replace

import numpy as np
import pytest
from walkers import N_CLASSES, followed

from semrl.core.errors import UsageError
from semrl.perception.tracking import SLOT_NUMBERS, SlotAssigner, SlotAssignerConfig, no_tracks
from semrl.perception.tracking.controllability import Controllability
from semrl.perception.tracking.slot_statistics import SlotStatistics

FRAMES = 200
PLAYER, ENEMY, BALL, DIGIT = range(4)
CLASSES = (0, 0, 1, 2)
"""Player and enemy look the same."""


def game(seed, frames, odd=range(0)):
    """A paddle that the action moves, one that goes its own way, a ball that is away now and then, a digit.

    While `odd` the ball looks like something else.
    """
    rng = np.random.default_rng(seed)
    player, enemy, velocity = 40.0, 30.0, 1.5
    for t in range(frames):
        action = None if t == 0 else int(rng.integers(2))
        player = np.clip(player + (0 if action is None else 4 * action - 2), 10, 74)
        velocity = -velocity if not 12 < enemy < 70 else velocity
        enemy += velocity
        seen = [(0, player, 74), (0, enemy, 9), (2, 5, 20)]
        if t % 40 < 30:
            seen.append((3 if t in odd else 1, 20 + t % 40, 20 + 1.5 * (t % 40)))
        yield action, [seen[i] for i in rng.permutation(len(seen))]


def played(roles, seed=0, frames=FRAMES, odd=range(0)):
    """Play, learn while there is something to learn; yield the tracks with their roles."""
    tracks = no_tracks(N_CLASSES)
    for action, seen in game(seed, frames, odd):
        (tracks,) = followed([seen], tracks=tracks)
        roles.partial_fit(tracks, action)
        tracks = replace(tracks, roles=roles.predict(tracks))
        yield tracks


@pytest.fixture(scope="module")
def learned():
    roles = SlotAssigner(SlotAssignerConfig(frames=FRAMES, slots=4))
    for _ in played(roles):
        pass
    return roles


def slot_of(roles, column):
    """The slot of the role that stays in a column."""
    means = roles.means_px_[roles.slots_]
    return int(np.abs(means[:, 1] - column).argmin())


RED, BLUE = [240, 128, 128], [117, 128, 240]


def test_two_of_one_class_that_begin_at_either_end_have_their_slots_by_colour():
    """Whoever is above in one episode is below in the next."""
    roles = SlotAssigner(SlotAssignerConfig(frames=120))
    slots = []
    for episode in range(30):
        tracks = no_tracks(N_CLASSES)
        colours = [[RED, BLUE], [BLUE, RED]][episode % 2]
        for t in range(20):
            seen = [(0, 15, 20 + 2 * t), (0, 65, 60 - 2 * t)]
            (tracks,) = followed([seen], tracks=tracks, colours=[colours])
            roles.partial_fit(tracks, None if t == 0 else 0)
            tracks = replace(tracks, roles=roles.predict(tracks))
        if roles.is_fitted:
            slots.append([int(tracks.roles[(tracks.colours == colour).all(axis=1)][0]) for colour in (RED, BLUE)])
    assert len(slots) >= 20 and set(slots[0]) == {0, 1} == set(roles.slots_) and slots == [slots[0]] * len(slots)


def test_roles_of_older_runs_know_no_colours(learned):
    arrays = {name: array for name, array in learned.to_arrays().items() if name != "statistics/tints"}
    older = SlotAssigner(learned.config)
    older.from_arrays(arrays)
    for known, tracks in zip(played(older, seed=1), played(learned, seed=1), strict=True):
        assert known.roles.tolist() == tracks.roles.tolist()


def test_what_moves_has_a_slot_and_what_stands_still_has_none(learned):
    assert learned.is_fitted and len(learned.slots_) == 3
    kinds = learned.kinds_[learned.slots_]
    assert kinds.tolist() == [0, 0, 1]  # ordered by kind; no digit
    assert (learned.moving_[learned.slots_] > 0.8).all()


def test_what_changes_in_its_place_has_no_slot():
    """The digits of a clock change now and then, and their middle with them."""
    roles, tracks = SlotAssigner(SlotAssignerConfig(frames=FRAMES, slots=4)), no_tracks(N_CLASSES)
    for t, (action, seen) in enumerate(game(3, FRAMES)):
        (tracks,) = followed([[*seen, (2, 5 + 0.5 * (t // 4 % 3), 60)]], tracks=tracks)
        roles.partial_fit(tracks, action)
        tracks = replace(tracks, roles=roles.predict(tracks))
    clock = np.abs(roles.means_px_[:, 1] - 60) < 2
    assert (roles.moving_[clock] > 0.2).any() and (roles.seen_[clock] > 0.5).any()
    assert len(roles.slots_) == 3 and not clock[roles.slots_].any()


def test_the_action_moves_the_player_alone(learned):
    controlled = learned.controlled_[learned.slots_]
    assert controlled.sum() == 1 and controlled[slot_of(learned, 74)]
    influence = learned.controllability_[learned.slots_]
    assert influence.max() > 0.8 and np.sort(influence)[-2] < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_what_actions_move_has_one_slot_though_it_looks_two_ways(seed):
    """It is away now and then, and each second time comes back as something else."""
    roles, tracks = SlotAssigner(SlotAssignerConfig(frames=2 * FRAMES)), no_tracks(N_CLASSES)
    rng, player = np.random.default_rng(seed), 40.0
    for t in range(3 * FRAMES):
        action = int(rng.integers(2)) if t else None
        player = np.clip(player + (0 if action is None else 4 * action - 2), 10, 74)
        seen = [(0, 40 + 1.5 * abs(t % 40 - 20), 9)] + [(3 if t // 70 % 2 else 1, player, 74)] * (t % 70 < 60)
        (tracks,) = followed([seen], tracks=tracks)
        roles.partial_fit(tracks, action)
        tracks = replace(tracks, roles=roles.predict(tracks))
        if roles.is_fitted and t % 70 < 60:
            own = roles.slots_[roles.names_.index("own")]
            assert tracks.roles[tracks.visible & (tracks.centres_px[:, 1] == 74)].tolist() == [own]
    assert len(roles.kinds_) == 3 and sorted(roles.names_) == ["object 0", "own"]


def test_an_object_that_once_looked_odd_has_one_role_all_the_same(learned):
    """As it came back it fitted no role by its looks, and founded a second, which it had from then on or had not."""
    roles = SlotAssigner(SlotAssignerConfig(frames=FRAMES, slots=4))
    founded = [len(roles.kinds_) for _ in played(roles, odd=range(80, 90))][-1]
    assert founded == len(learned.kinds_) + 1
    assert roles.kinds_[roles.slots_].tolist() == [0, 0, 1]
    ball, same = roles.slots_[2], learned.slots_[2]
    np.testing.assert_allclose(roles.seen_[ball], learned.seen_[same], atol=0.03)
    np.testing.assert_allclose(roles.means_px_[ball], learned.means_px_[same], atol=0.5)
    np.testing.assert_allclose(roles.moving_[ball], learned.moving_[same], atol=0.02)
    np.testing.assert_allclose(roles.seen_.sum(), learned.seen_.sum(), atol=0.03)  # nobody is counted twice


def test_slots_tell_of_the_same_thing_in_every_episode(learned):
    """Whatever order objects are met in: the two paddles differ by their place alone."""
    player, enemy = slot_of(learned, 74), slot_of(learned, 9)
    for tracks in played(learned, seed=5, frames=120):
        slots = learned.transform(tracks).reshape(-1, len(SLOT_NUMBERS))
        assert slots.shape == (4, 3) and slots.dtype == np.float32
        assert slots[player, 0] == np.float32(74 / 83) and slots[player, 2] == 1
        assert slots[enemy, 0] == np.float32(9 / 83) and slots[enemy, 2] == 1
        assert (slots[3] == 0).all()  # a slot without a role


def test_a_ball_that_is_away_has_its_mean_place_and_is_not_seen(learned):
    ball = slot_of(learned, 40)
    mean = learned.means_px_[learned.slots_[ball], ::-1] / 83
    seen = np.array([learned.transform(t).reshape(-1, 3)[ball] for t in played(learned, seed=6, frames=120)])
    there = np.arange(120) % 40 < 30
    np.testing.assert_array_equal(seen[:, 2] == 1, there)
    np.testing.assert_allclose(seen[np.arange(120) % 40 > 34, :2], np.tile(mean, (15, 1)), rtol=1e-5)


def test_where_sizes_count_each_slot_holds_them_between_place_and_whether_it_is_seen(learned):
    roles = SlotAssigner(replace(learned.config, sizes=True))
    for _ in played(roles):
        pass
    assert roles.slots_.tolist() == learned.slots_.tolist()
    for tracks in played(roles, seed=1):
        sized, plain = roles.transform(tracks).reshape(4, 5), learned.transform(tracks).reshape(4, 3)
        np.testing.assert_array_equal(sized[:, [0, 1, 4]], plain)
        for slot, role in enumerate(roles.slots_):
            (seen,) = np.flatnonzero(tracks.roles == role) if (tracks.roles == role).any() else (None,)
            if seen is not None:
                left, top, right, bottom = tracks.edges_px[seen]
                np.testing.assert_allclose(sized[slot, 2:4], np.array([right - left, bottom - top]) / 83, atol=1e-6)
        for one, other in zip(roles.read(sized.ravel()), learned.read(plain.ravel()), strict=True):
            np.testing.assert_array_equal(one, other)
    at_rest = roles.at_rest_.reshape(4, 5)
    assert (at_rest[: len(roles.slots_), 2:4] > 0).all() and not at_rest[len(roles.slots_) :].any()


def test_a_list_is_read_as_the_objects_that_are_seen(learned):
    for tracks in played(learned, seed=8, frames=60):
        kinds, centres = learned.read(learned.transform(tracks))
        shown = [int(np.flatnonzero(tracks.roles == role)[0]) for role in learned.slots_ if role in tracks.roles]
        shown = [i for i in shown if tracks.time_since_update[i] == 0]
        assert kinds.tolist() == learned.kinds_[tracks.roles[shown]].tolist()
        np.testing.assert_allclose(centres, tracks.centres_px[shown], atol=1e-5)
    kinds, centres = learned.read(np.zeros(learned.dimension, np.float32))
    assert kinds.shape == (0,) and centres.shape == (0, 2)


def test_a_role_is_held_by_one_track(learned):
    for tracks in played(learned, seed=7, frames=60):
        held = tracks.roles[tracks.roles >= 0]
        assert len(set(held.tolist())) == len(held) and set(held.tolist()) <= set(learned.slots_.tolist())


def test_those_that_are_controlled_come_first_where_slots_are_few():
    roles = SlotAssigner(SlotAssignerConfig(frames=FRAMES, slots=1))
    for _ in played(roles):
        pass
    (slot,) = roles.slots_
    assert roles.controlled_[slot]


def test_what_was_learned_stays(learned):
    before = learned.to_arrays()
    for _ in played(learned, seed=8, frames=10):
        pass
    assert all(np.array_equal(value, before[name]) for name, value in learned.to_arrays().items())


def test_influence_finds_late_effects_and_is_blind_to_chance():
    rng, influence, actions = np.random.default_rng(0), Controllability(), [0, 0, 0]
    for _ in range(400):
        actions = [int(rng.integers(3)), *actions[:2]]
        steps = np.array([[actions[2] - 1.0, 0], rng.normal(size=2), [0, 0]])
        influence.learn(actions[0], np.arange(3), steps)
    late, chance, still = influence.shares(3)
    assert late > 0.95 and chance < 0.05 and still == 0
    assert influence.shares(4)[3] == 0


def test_nonsense_is_refused():
    for wrong in ({"frames": 0}, {"slots": -1}):
        with pytest.raises(UsageError):
            SlotAssignerConfig(**wrong)


def test_what_is_merged_is_as_if_counted_together():
    rng = np.random.default_rng(0)
    places = rng.uniform(10, 70, (60, 2))
    apart, together = (_counted(places, roles) for roles in (np.arange(60) % 3 == 0, np.zeros(60)))
    apart.merge(0, 1)
    for name in ("classes", "tints", "means", "deviations", "moves", "together"):
        np.testing.assert_allclose(getattr(apart, name)[0], getattr(together, name)[0], rtol=1e-4, err_msg=name)
    assert apart.seen[1] == 0 and (apart.moves[1] == 0).all() and not apart.together[:, 1].any()


def test_roles_take_turns_that_are_hardly_ever_seen_at_once():
    habits = SlotStatistics()
    for _ in range(3):
        habits.found()
    for t in range(100):
        roles = np.array([t % 2, 2]) if t else np.arange(3)  # the first two once, for a moment, together
        (tracks,) = followed([[(0, 10.0 * role, 10.0) for role in range(len(roles))]])
        habits.count(tracks, np.zeros(len(roles), int), np.arange(len(roles)), roles, moved=np.zeros(len(roles), bool))
    assert habits.take_turns(0, 1) and habits.take_turns(1, 0) and not habits.take_turns(0, 2)


def _counted(places, roles):
    habits = SlotStatistics()
    habits.found(), habits.found()
    for i, (place, role) in enumerate(zip(places, roles, strict=True)):
        (tracks,) = followed([[(i % 3, *place)]])
        moved = np.array([i % 2 == 0])
        habits.count(tracks, np.array([i // 3 % 2]), np.array([0]), np.array([int(role)]), moved=moved)
    return habits


def test_influence_of_merged_roles_is_that_of_one():
    rng = np.random.default_rng(0)
    apart, together = Controllability(), Controllability()
    for t in range(200):
        action = int(rng.integers(3))
        steps = np.array([[action - 1.0, 0.0]]) + rng.normal(0, 0.5, (1, 2))
        apart.learn(action, np.array([t % 2]), steps)
        together.learn(action, np.array([0]), steps)
    apart.merge(0, 1)
    np.testing.assert_allclose(apart.shares(2), [together.shares(1)[0], 0])
