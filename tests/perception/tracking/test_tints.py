import numpy as np
import pytest

from semrl.concepts import Concepts
from semrl.core import Objects
from semrl.core.things import KIND
from semrl.perception.tracking import SlotAssigner, SlotAssignerConfig, TrackingConfig, follow, no_tracks
from semrl.perception.tracking.tints import ALIKE, LEAST_SEEN, MOST_TINTS, Tints

GREEN, BROWN, WHITE, BLUE = [92, 186, 92], [213, 130, 74], [236, 236, 236], [20, 20, 220]


def learned(*objects, times=LEAST_SEEN):
    """Tints of (class, colour) that were seen so many times each."""
    tints = Tints()
    for _ in range(times):
        tints.learn(np.array([number for number, _ in objects]), np.array([c for _, c in objects], np.float32))
    tints.settle()
    return tints


def kinds(tints, *objects):
    return tints.kinds(
        np.array([number for number, _ in objects]), np.array([c for _, c in objects], np.float32)
    ).tolist()


def test_one_class_in_two_colours_is_two_kinds_and_the_commoner_keeps_its_number():
    tints = learned((1, GREEN), (0, WHITE), (1, GREEN), (1, BROWN))
    assert kinds(tints, (1, GREEN), (1, BROWN), (0, WHITE)) == [1, 2, 0]


@pytest.mark.parametrize("objects", [[(0, WHITE), (1, GREEN)], [(0, WHITE), (1, WHITE)], [(3, BLUE)]])
def test_classes_of_one_colour_each_stay_as_they_are(objects):
    assert kinds(learned(*objects), *objects) == [number for number, _ in objects]


def test_what_is_seen_seldom_in_a_colour_is_of_the_class():
    tints = learned((0, WHITE), (0, GREEN), times=LEAST_SEEN - 1)
    assert kinds(tints, (0, WHITE), (0, GREEN), (0, BLUE)) == [0, 0, 0]


def test_a_class_in_a_colour_in_which_it_was_hardly_seen_goes_by_the_colour():
    """Two players change their posture; in two of the postures only one of them was seen often."""
    tints = learned((0, GREEN), (0, BROWN), (1, GREEN), (2, GREEN), (2, GREEN), (3, BROWN))
    tints.learn(np.array([1]), np.array([BROWN], np.float32))
    tints.settle()
    assert kinds(tints, (0, GREEN), (1, GREEN), (2, GREEN), (3, BROWN), (0, BROWN)) == [0, 1, 2, 3, 4]
    green, brown, also_brown = kinds(tints, (3, GREEN), (1, BROWN), (2, BROWN))
    assert brown == also_brown and {green, brown} == {5, 6}
    assert kinds(tints, (1, BLUE), (1, WHITE)) == [1, 1]  # of which nothing is known


@pytest.mark.parametrize(("step", "apart"), [(ALIKE - 4, False), (ALIKE + 4, True)])
def test_shades_are_one_colour(step, apart):
    shade = [92 + step, 186, 92]
    tints = learned((0, GREEN), (0, GREEN), (0, shade))
    assert (kinds(tints, (0, GREEN)) != kinds(tints, (0, shade))) == apart


def test_a_class_that_is_new_is_none_of_the_kinds_that_are_known():
    tints = learned((0, GREEN), (0, BROWN))
    assert kinds(tints, (0, GREEN), (0, BROWN), (1, GREEN), (5, BLUE)) == [0, 1, 2, 2]


def test_there_are_no_more_colours_than_are_told_apart():
    tints = Tints()
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 256, (400, 3)).astype(np.float32)
    for _ in range(LEAST_SEEN):
        tints.learn(np.zeros(len(colours), np.int64), colours)
    tints.settle()
    assert tints.numbers_.shape == (1, MOST_TINTS + 1)
    assert set(tints.kinds(np.zeros(400, np.int64), colours)) <= set(range(MOST_TINTS))


def test_nothing_seen_is_nothing_told():
    tints = Tints()
    tints.learn(np.zeros(0, np.int64), np.zeros((0, 3), np.float32))
    tints.settle()
    assert tints.kinds(np.zeros(0, np.int64), np.zeros((0, 3), np.float32)).shape == (0,)
    assert kinds(tints, (4, GREEN)) == [4]


def test_they_are_restored_and_older_runs_tell_by_class():
    tints, fresh = learned((0, GREEN), (0, BROWN), (1, WHITE)), Tints()
    fresh.from_arrays(tints.to_arrays())
    assert kinds(fresh, (0, BROWN), (1, WHITE)) == kinds(tints, (0, BROWN), (1, WHITE)) == [2, 1]
    fresh.from_arrays({})
    assert kinds(Tints(), (0, BROWN), (1, WHITE)) == [0, 1]


def frame(i):
    """Two objects of one class that go up and down, one green, one brown."""
    centres = np.array([[20 + i % 40, 10], [60 - i % 40, 70]], np.float32)
    return Objects(
        crops=np.ones((2, 8, 8), np.float32),
        centres_px=centres,
        boxes_px=np.column_stack([centres.astype(np.int64) - 1, np.full((2, 2), 3)]),
        labels=np.zeros((84, 84), np.int32),
        colours=np.array([GREEN, BROWN], np.float32),
    )


def test_things_are_told_apart_by_colour_and_roles_are_what_they_were():
    slots, plain = SlotAssigner(SlotAssignerConfig(frames=60)), SlotAssigner(SlotAssignerConfig(frames=60))
    tracks, grey, config = no_tracks(1), no_tracks(1), TrackingConfig()
    for i in range(80):
        objects, one = frame(i), np.zeros(2, np.int64)
        tracks = follow(tracks, objects, one, np.zeros((2, 1), np.float32), config)
        bare = Objects(
            crops=objects.crops, centres_px=objects.centres_px, boxes_px=objects.boxes_px, labels=objects.labels
        )
        grey = follow(grey, bare, one, np.zeros((2, 1), np.float32), config)
        slots.partial_fit(tracks, 0)
        plain.partial_fit(grey, 0)
        np.testing.assert_array_equal(slots.transform(tracks), plain.transform(grey))
    assert slots.things(tracks)[:, KIND].tolist() == [0, 1]
    assert plain.things(grey)[:, KIND].tolist() == [0, 0]
    assert tracks.colours.tolist() == [GREEN, BROWN]


def test_two_that_change_their_posture_are_two_concepts_though_one_was_seen_late_in_some():
    """While kinds are learned, brown never bends down; later both do, and stand up again."""
    tints, concepts = learned((0, GREEN), (0, BROWN), (1, GREEN)), Concepts()
    colours = np.array([GREEN, BROWN], np.float32)
    play = []
    for t in range(400):
        number = tints.kinds(np.array([t // 3 % 2, t // 4 % 2]), colours)
        play.append(np.array([[i, number[i], 0, 0, -1, 10, 40 * i + t % 30, 14, 40 * i + t % 30 + 8] for i in (0, 1)]))
    table = concepts.partial_fit(play).table_
    assert {frozenset(each) for each in table.kinds} == {frozenset(kinds(tints, (0, c), (1, c))) for c in colours}
    assert len(table) == 2
