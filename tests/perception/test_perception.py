"""The learned boxes together."""

from dataclasses import replace

import numpy as np
import pytest
from seeing import CONFIG, episodes, learned, play, relearned

from semrl.core.arrays import digest
from semrl.perception.detection import DetectionConfig
from semrl.perception.perception import Perception

SHOWN = [observation.frame for observation, _ in play(60, seed=3)]


def test_the_kinds_of_catch_are_told_apart():
    seen = learned("classes").perception
    objects = seen.detector.detect(SHOWN[7])
    classes = seen.classes(objects)
    _, columns = objects.centres_px.T
    rows = objects.boxes_px[:, 0]
    walls = (columns < 2) | (columns > 81)
    paddle = (rows == 79) & ~walls
    ball = ~walls & ~paddle
    kinds = [{*classes[which].tolist()} for which in (walls, paddle, ball)]
    assert all(kinds) and kinds[0].isdisjoint(kinds[1]) and kinds[1].isdisjoint(kinds[2])
    assert kinds[0].isdisjoint(kinds[2])


def test_classes_that_are_remembered_are_forgotten_when_more_is_learned():
    seen, fresh = relearned("scene").perception, Perception(CONFIG, embedded=True)
    known = learned("scene").perception
    objects = seen.detector.detect(SHOWN[-1])
    before = seen.classes(objects)
    reduced = seen.reducer.transform(objects.features)
    seen.clusterer.partial_fit(np.concatenate([reduced + shift for shift in (0.1, 3.0, 9.0)]))
    for box, own in ((seen.clusterer, known.clusterer), (seen.reducer, known.reducer)):
        fresh.from_arrays(seen.to_arrays())  # learned, then restored: both count as something new
        np.testing.assert_array_equal(seen.classes(objects), fresh.classes(objects))
        box.from_arrays(own.to_arrays())
    np.testing.assert_array_equal(seen.classes(objects), before)


def test_no_objects_have_no_classes():
    seen = learned("scene").perception
    assert seen.classes(seen.detector.detect(np.zeros((168, 168, 3), np.uint8))).shape == (0,)


@pytest.mark.parametrize(
    ("flags", "boxes"),
    [
        ({}, {"detector", "reducer", "clusterer", "scenery"}),
        ({"embedded": True}, {"detector", "reducer", "clusterer", "scenery"}),  # hashing has nothing to save
        ({"tracked": True}, {"detector", "reducer", "clusterer", "slot_assigner", "jumps"}),
    ],
)
def test_what_every_box_has_learned_is_saved(flags, boxes):
    name = "objects" if flags.get("tracked") else "scene" if flags else "classes"
    arrays = learned(name).to_arrays()
    assert {key.split("/")[0] for key in arrays} <= boxes
    again = Perception(CONFIG, **flags)
    again.from_arrays(arrays)
    assert digest(again.to_arrays()) == digest(arrays)


def test_crops_of_tracked_scenes_are_of_one_size_whatever_otsu_cuts():
    seen = Perception(replace(CONFIG, otsu=DetectionConfig(max_object_share=0.2)), tracked=True)
    seen.detector.partial_fit(np.zeros((168, 168, 3), np.uint8))
    shown = [seen.detector.detect(frame) for frame in SHOWN]
    for objects in shown:
        seen.reducer.partial_fit(objects.features)
    for objects in shown:
        seen.clusterer.partial_fit(seen.reducer.transform(objects.features))
    assert all(len(seen.classes(objects)) == len(objects) for objects in shown)
    assert shown[0].crops.shape[1:] == (seen.detector.crop_size_px,) * 2


def test_tracks_go_in_and_come_out():
    seen = learned("objects").perception
    before = digest(seen.to_arrays())
    tracks, ids = seen.begin(), []
    for observation, _ in episodes(46, seed=3)[0]:
        earlier = {name: getattr(tracks, name).copy() for name in ("ids", "centres_px", "ages")}
        following = seen.assign(seen.track(tracks, observation))
        for name, array in earlier.items():
            np.testing.assert_array_equal(getattr(tracks, name), array)  # the old ones stay as they were
        ids.append(following.ids.tolist())
        tracks = following
    assert digest(seen.to_arrays()) == before and not len(seen.begin())
    assert ids[0] and any(number in ids[-1] for number in ids[0])  # something was there throughout
