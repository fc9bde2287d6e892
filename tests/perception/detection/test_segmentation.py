"""Segmentation by k-means: what is an object, and that it is what Otsu's threshold finds."""

import numpy as np
import pytest
from scipy import ndimage
from sklearn.cluster import KMeans

from semrl.core.arrays import digest
from semrl.core.errors import DataError, UsageError
from semrl.envs import Game, make_env
from semrl.perception.detection import KMeansDetector, KMeansDetectorConfig, OtsuDetector
from semrl.perception.detection.cutting import n_parts
from semrl.perception.detection.grey import to_grey

EIGHT_NEIGHBOURS = np.ones((3, 3))


def shapes(seed):
    """A grey ground with a dark, a bright and a brighter thing of known places, and noise."""
    rng = np.random.default_rng(seed)
    image = np.full((84, 84), 100)
    image[10:15, 20:26] = 20
    image[40:47, 50:53] = 180
    image[60:62, 5:8] = 250
    return (image + rng.integers(-3, 4, size=image.shape)).clip(0, 255).astype(np.uint8)


def detector_of(images, **settings):
    detector = KMeansDetector(KMeansDetectorConfig(learning_frames=len(images), **settings))
    for image in images:
        detector.partial_fit(image)
    return detector


def test_darker_and_brighter_things_are_found():
    detector = detector_of([shapes(i) for i in range(5)], clusters=4)
    np.testing.assert_allclose(detector.centres_[:, 0], [20, 100, 180, 250], atol=3)
    assert detector.background_ == 1
    objects = detector.detect(shapes(9))
    assert objects.boxes_px.tolist() == [[10, 20, 5, 6], [40, 50, 7, 3], [60, 5, 2, 3]]
    np.testing.assert_allclose(objects.centres_px, [[12, 22.5], [43, 51], [60.5, 6]])
    assert objects.crops.shape == (3, 8, 8)


def test_things_of_different_brightness_stay_apart_where_they_touch():
    image = np.zeros((84, 84), np.uint8)
    image[30:34, 30:34], image[30:34, 34:38] = 120, 240
    detector = detector_of([image])
    assert detector.detect(image).boxes_px.tolist() == [[30, 30, 4, 4], [30, 34, 4, 4]]
    assert len(OtsuDetector().partial_fit(image).detect(image)) == 1


@pytest.mark.parametrize("clusters", [2, 3, 5])
def test_clusters_of_grey_levels_are_as_good_as_scikit_learns(clusters):
    rng = np.random.default_rng(clusters)
    images = [rng.choice([40, 90, 130, 200, 240], size=(84, 84), p=[0.1, 0.6, 0.1, 0.1, 0.1]) for _ in range(4)]
    images = [(image + rng.integers(-12, 13, size=image.shape)).astype(np.uint8) for image in images]
    pixels = np.concatenate([image.reshape(-1, 1) for image in images]).astype(float)
    theirs = KMeans(clusters, n_init=10, random_state=0).fit(pixels)
    ours = detector_of(images, clusters=clusters)
    distances = np.abs(pixels - ours.centres_.T).min(axis=1)
    assert np.square(distances).sum() <= 1.001 * theirs.inertia_
    largest = np.bincount(theirs.labels_).argmax()
    assert ours.centres_[ours.background_, 0] == pytest.approx(theirs.cluster_centers_[largest, 0], abs=1)


@pytest.mark.parametrize("position_weight", [0.0, 60.0])
def test_objects_are_the_connected_components_of_each_cluster(position_weight):
    detector = detector_of([shapes(i) for i in range(3)], position_weight=position_weight)
    image = np.random.default_rng(0).choice([20, 100, 250], size=(84, 84), p=[0.1, 0.8, 0.1]).astype(np.uint8)
    segments, found = detector.segment(image), detector.components(image)
    distances = np.abs(image[..., None] - detector.centres_[:, 0]) ** 2
    if position_weight:
        places = np.stack(np.indices((84, 84)), axis=-1) / 83 * position_weight
        distances = distances + np.square(places[:, :, None] - detector.centres_[:, 1:]).sum(axis=3)
    np.testing.assert_array_equal(segments, distances.argmin(axis=2))
    assert ((found == 0) == (segments == detector.background_)).all()
    total = 0
    for cluster in set(range(len(detector.centres_))) - {detector.background_}:
        labels, n = ndimage.label(segments == cluster, EIGHT_NEIGHBOURS)
        total += n
        ours = found[segments == cluster]
        assert len({*zip(ours, labels[segments == cluster], strict=True)}) == n == len({*ours})
    assert found.max() == total and found.dtype == np.int32


def test_place_parts_what_brightness_does_not():
    image = np.full((84, 84), 100, np.uint8)
    image[:, 60:] = 130
    by_level = detector_of([image], clusters=2)
    by_place = detector_of([image], clusters=2, position_weight=1_000.0)
    assert (by_level.segment(image)[:, 60:] == 1).all() and (by_level.segment(image)[:, :60] == 0).all()
    assert len({*by_place.segment(image)[:, :60].ravel().tolist()}) == 2


def test_large_components_are_cut_as_otsus_are():
    image = np.full((84, 84), 50, np.uint8)
    image[40:44] = 200
    detector = detector_of([image])
    assert detector.components(image).max() == 1
    assert len(detector.detect(image)) == n_parts(84, 8)
    otsu = OtsuDetector()
    otsu.from_arrays({"thresholds": np.array([100.0])})
    assert digest(parts(detector.detect(image))) == digest(parts(otsu.detect(image)))


def parts(objects):
    return {name: getattr(objects, name) for name in ("crops", "centres_px", "boxes_px", "labels")}


@pytest.fixture(scope="module")
def pong():
    """Images of Pong in play and both detectors, which have seen them."""
    game = Game(make_env("PongNoFrameskip-v4"), seed=0)
    game.reset()
    images = [to_grey(game.step(i // 7 % 2).observation.frame) for i in range(160)]
    detectors = OtsuDetector(), KMeansDetector()
    for image in images:
        for detector in detectors:
            detector.partial_fit(image)
    return *detectors, images[60:]


def in_field(objects):
    """Centres of what does not touch the walls of Pong: paddles and ball."""
    tops, heights = objects.boxes_px[:, 0], objects.boxes_px[:, 2]
    return objects.centres_px[(tops > 16) & (tops + heights < 75)]


def test_ball_and_paddles_of_pong_are_where_otsus_threshold_finds_them(pong):
    otsu, ours, images = pong
    away = {"paddle": [], "ball": []}
    for image in images:
        found = ours.detect(image).centres_px
        for centre in in_field(otsu.detect(image)):
            kind = "ball" if 12 < centre[1] < 72 else "paddle"
            away[kind].append(np.abs(found - centre).max(axis=1).min(initial=np.inf))
    assert len(away["paddle"]) > 150 and len(away["ball"]) > 30
    assert max(away["paddle"]) <= 1
    assert (np.array(away["ball"]) <= 1).all()


def test_the_field_of_pong_is_background(pong):
    _, ours, images = pong
    assert ours.is_fitted and len(ours.centres_) == 3
    for image in images[::20]:
        assert (ours.components(image)[image == 87] == 0).all()


def test_it_learns_from_the_first_frames_only():
    detector = KMeansDetector(KMeansDetectorConfig(learning_frames=4))
    for i in range(4):
        assert not detector.is_fitted
        detector.partial_fit(shapes(i))
        detector.detect(shapes(i))
    assert detector.is_fitted and detector.frames_ == 4
    before = digest(detector.to_arrays())
    assert sum(array.nbytes for array in detector.to_arrays().values()) < 100
    detector.partial_fit(np.full((84, 84), 255, np.uint8))
    assert digest(detector.to_arrays()) == before


@pytest.mark.parametrize(("position_weight", "stop"), [(0.0, 0), (0.0, 3), (0.0, 5), (40.0, 3)])
def test_a_restored_one_goes_on_bit_for_bit(position_weight, stop):
    config = KMeansDetectorConfig(learning_frames=5, position_weight=position_weight)
    whole, restored = KMeansDetector(config), KMeansDetector(config)
    for i in range(stop):
        whole.partial_fit(shapes(i))
    restored.from_arrays(whole.to_arrays())
    for i in range(stop, 6):
        for detector in (whole, restored):
            detector.partial_fit(shapes(i))
        np.testing.assert_array_equal(whole.components(shapes(9)), restored.components(shapes(9)))
    assert digest(whole.to_arrays()) == digest(restored.to_arrays())


@pytest.mark.parametrize("level", [0, 100, 255])
def test_plain_images_have_no_objects(level):
    image = np.full((84, 84), level, np.uint8)
    detector = detector_of([image])
    assert len(detector.detect(image)) == 0
    assert detector.detect(shapes(0)).crops.shape == (0, 8, 8)  # one cluster: all is background


def test_the_largest_object_is_a_tenth_of_the_image():
    assert KMeansDetector().crop_size_px == 8
    assert KMeansDetector(KMeansDetectorConfig(max_object_share=0.25)).crop_size_px == 21


@pytest.mark.parametrize("image", [np.zeros((84, 83), np.uint8), np.zeros((84, 84)), np.zeros((84, 84, 4), np.uint8)])
def test_what_is_no_grey_image_is_refused(image):
    for method in (KMeansDetector().partial_fit, detector_of([shapes(0)]).detect):
        with pytest.raises(DataError, match="RGB"):
            method(image)


def test_arrays_of_another_one_are_refused():
    arrays = detector_of([shapes(0)], clusters=4).to_arrays()
    for settings in ({"clusters": 3}, {"clusters": 4, "position_weight": 1.0}):
        with pytest.raises(DataError, match="other clusters"):
            KMeansDetector(KMeansDetectorConfig(**settings)).from_arrays(arrays)
    for name in arrays:
        with pytest.raises(DataError, match=name):
            KMeansDetector().from_arrays({key: array for key, array in arrays.items() if key != name})


@pytest.mark.parametrize(
    "values",
    [
        {"clusters": 1},
        {"learning_frames": 0},
        {"position_weight": -1.0},
        {"position_weight": float("inf")},
        {"max_object_share": 0.01},
        {"max_object_share": 1.5},
        {"seed": -1},
    ],
)
def test_impossible_settings_are_refused(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        KMeansDetectorConfig(**values)
