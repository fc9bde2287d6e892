"""The encoders that show images: grey, components, classes."""

import numpy as np
import pytest
from seeing import CONFIG, encoded, learned, play

from semrl.perception.detection import label_image
from semrl.perception.detection.grey import to_grey
from semrl.perception.encoders import ENCODERS

SHOWN = [observation for observation, _ in play(60, seed=3)]


def test_grey_shows_the_grey_image():
    encoder = ENCODERS.load("grey")(CONFIG)
    for observation, state in zip(SHOWN, encoded(encoder, SHOWN), strict=True):
        np.testing.assert_array_equal(state.vector, to_grey(observation.frame))
    assert encoder.perception is None and encoder.is_fitted and encoder.to_arrays() == {}


def test_components_shows_each_of_them_in_a_level_of_its_own():
    encoder = learned("components")
    (state,) = encoded(encoder, [SHOWN[7]])
    np.testing.assert_array_equal(state.vector, label_image(encoder.perception.detector.components(SHOWN[7].frame)))
    assert len(np.unique(state.vector)) == 5  # background, two walls, ball, paddle


def test_classes_shows_objects_of_one_class_in_one_level():
    encoder = learned("classes")
    seen = encoder.perception
    for observation in SHOWN[::10]:
        (state,) = encoded(encoder, [observation])
        objects = seen.detector.detect(observation.frame)
        classes = seen.clusterer.predict(seen.reducer.transform(objects.features))
        levels = {}
        for i, number in enumerate(classes.tolist()):
            (level,) = np.unique(state.vector[objects.labels == i + 1])
            assert levels.setdefault(number, level) == level
        assert len({*levels.values()}) == len(levels) and 0 not in levels.values()
        assert (state.vector[objects.labels == 0] == 0).all()


@pytest.mark.parametrize("name", ["components", "classes"])
def test_what_is_seen_are_the_objects_of_the_newest_frame(name):
    encoder = learned(name)
    episode, detector = encoder.begin(), encoder.perception.detector
    for observation in SHOWN[:9]:
        episode.encode(observation)
        sight, objects = episode.look(), detector.detect(observation.frame)
        if name == "classes":
            np.testing.assert_array_equal(sight.boxes_px, objects.boxes_px)
            np.testing.assert_array_equal(sight.classes, encoder.perception.classes(objects))
        assert (sight.labels > 0).tolist() == (objects.labels > 0).tolist()
