import itertools

import numpy as np
import pytest
from walkers import followed

from semrl.core import Objects, Tracks
from semrl.core.errors import UsageError
from semrl.perception.tracking import TrackingConfig, follow, no_tracks


def at(tracks: Tracks, place):
    """The identity of what is seen at a place."""
    (i,) = np.flatnonzero((tracks.centres_px == np.float32(place)).all(axis=1) & tracks.visible)
    return int(tracks.ids[i])


def test_identity_velocity_age_and_visibility():
    *_, tracks = followed([[(0, 10 + 3 * t, 20 - t)] for t in range(6)])
    assert (tracks.ids.tolist(), tracks.ages.tolist(), tracks.moves.tolist()) == ([0], [5], [5])
    assert tracks.velocities_px.tolist() == [[3, -1]] and tracks.visible.all() and int(tracks.born) == 1


def test_two_of_one_kind_that_cross_keep_their_identities():
    """Places alone would swap them: each ends nearer to where the other was."""
    frames = [[(0, 40.0, 20 + 4 * t), (0, 41.0, 62 - 4 * t)] for t in range(12)]
    first, *_, last = followed(frames)
    assert at(first, (40, 20)) == at(last, (40, 64)) and at(first, (41, 62)) == at(last, (41, 18))


RED, BLUE, GREEN = [240, 128, 128], [117, 128, 240], [92, 186, 92]


def test_two_that_change_ends_at_once_keep_their_identities():
    frames = [[(0, 16, 20 + t), (0, 66, 50 - t)] for t in range(8)]
    colours = [[RED, BLUE]] * 4 + [[BLUE, RED]] * 4
    for t, tracks in enumerate(followed(frames, colours=colours)):
        ends = (66, 50 - t), (16, 20 + t)
        assert at(tracks, ends[t < 4]) == 0 and at(tracks, ends[t >= 4]) == 1


@pytest.mark.parametrize("after", [[BLUE, BLUE], [GREEN, RED], [BLUE, GREEN]])
def test_what_changes_its_colour_alone_stays_what_it_is(after):
    frames = [[(0, 16, 20 + t), (0, 66, 50 - t)] for t in range(8)]
    for t, tracks in enumerate(followed(frames, colours=[[RED, BLUE]] * 4 + [after] * 4)):
        assert at(tracks, (16, 20 + t)) == 0 and at(tracks, (66, 50 - t)) == 1


def test_a_bounce_is_the_same_object():
    frames = [[(0, 40, 10 + 9 * t)] for t in range(6)] + [[(0, 40, 55 - 9 * t)] for t in range(1, 6)]
    for tracks in followed(frames):
        assert tracks.ids.tolist() == [0]


def test_the_assignment_costs_least_of_all():
    """Two objects and two tracks: the nearest pair first would leave a pair that is too far apart."""
    first, second = followed([[(0, 10, 10), (0, 18, 10)], [(0, 17, 10), (0, 26, 10)]], TrackingConfig(gate_px=9))
    assert at(second, (17, 10)) == at(first, (10, 10)) and at(second, (26, 10)) == at(first, (18, 10))


def test_appearance_decides_between_places():
    first, second = followed([[(0, 10, 10), (1, 14, 10)], [(1, 10, 10), (0, 14, 10)]])
    assert at(second, (10, 10)) == at(first, (14, 10))


@pytest.mark.parametrize("gap", [1, 2, 4])
def test_short_occlusions_are_bridged(gap):
    hidden = range(5, 5 + gap)
    frames = [[] if t in hidden else [(0, 10 + 2 * t, 30 + t)] for t in range(14)]
    for t, tracks in enumerate(followed(frames)):
        assert tracks.ids.tolist() == [0] and tracks.visible.tolist() == [t not in hidden]
        np.testing.assert_allclose(tracks.centres_px, [[10 + 2 * t, 30 + t]])  # it goes on as it went
        np.testing.assert_allclose(tracks.velocities_px, [[2, 1]] if t else [[0, 0]])


def test_long_ones_are_not():
    frames = [[(0, 40, 40)]] * 3 + [[]] * 5 + [[(0, 40, 40)]] * 2
    every = list(followed(frames))
    assert [len(tracks) for tracks in every] == [1] * 7 + [0, 1, 1]
    assert every[-1].ids.tolist() == [1] and every[-1].ages.tolist() == [1]


def test_what_jumps_too_far_is_another_object():
    *_, tracks = followed([[(0, 10, 10)], [(0, 10, 40)]])
    assert tracks.ids.tolist() == [0, 1] and tracks.visible.tolist() == [False, True]


def test_unseen_objects_stay_within_the_image():
    *_, tracks = followed([[(0, 78 + 3 * t, 40)] for t in range(2)] + [[]] * 3)
    assert tracks.centres_px.tolist() == [[83, 40]]


def test_following_depends_on_the_order_of_objects_in_nothing():
    rng = np.random.default_rng(0)
    places = rng.uniform(10, 70, size=(4, 2))
    frames = [[(i % 2, *(places[i] + t * rng.normal(size=2))) for i in range(4)] for t in range(5)]
    straight = list(followed(frames))[-1]
    turned = list(followed([frames[0], *(frame[::-1] for frame in frames[1:])]))[-1]
    np.testing.assert_array_equal(straight.ids, turned.ids)
    np.testing.assert_array_equal(straight.centres_px, turned.centres_px)


def test_many_at_once():
    """Thirty walkers in random order keep their identities."""
    rng = np.random.default_rng(1)
    grid = np.array(list(itertools.product(range(8, 80, 14), range(8, 80, 14))), float)
    first = last = None
    frames, orders = [], []
    for t in range(10):
        order = rng.permutation(len(grid))
        frames.append([(0, *(grid[i] + (t, -0.5 * t))) for i in order])
        orders.append(order)
    first, *_, last = followed(frames)
    for i, place in enumerate(grid):
        assert at(first, place) == at(last, place + np.array([9, -4.5])), i


def test_nonsense_is_refused():
    for wrong in ({"gate_px": 0}, {"class_cost": -1}, {"unseen_decisions": -1}, {"appearance_cost": -0.1}):
        with pytest.raises(UsageError):
            TrackingConfig(**wrong)


@pytest.mark.parametrize(("right", "moves"), [(0, 0), (1, 5)])
def test_what_grows_in_its_place_does_not_move(right, moves):
    """A bar gets longer at one end; a train of the same growing length goes on."""
    tracks = no_tracks(2)
    for t in range(6):
        edges = np.array([[10 + right * t, 20, 20 + 2 * t, 24]], np.float32)
        objects = Objects(
            crops=np.zeros((1, 8, 8), np.float32), centres_px=(edges[:, [1, 0]] + edges[:, [3, 2]]) / 2,
            boxes_px=np.array([[20, 10 + right * t, 4, 10 + (2 - right) * t]]), labels=np.zeros((84, 84), np.int32),
            edges_px=edges, colours=np.zeros((1, 3), np.float32),
        )  # fmt: skip
        tracks = follow(tracks, objects, np.zeros(1, np.int64), np.zeros((1, 2), np.float32), TrackingConfig())
    assert (tracks.ids.tolist(), tracks.moves.tolist()) == ([0], [moves])
