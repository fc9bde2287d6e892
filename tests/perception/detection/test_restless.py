import numpy as np
import pytest

from semrl.perception.detection import ForegroundConfig, ForegroundDetector
from semrl.perception.detection.restless import LEAST_RATE

WATER, WAVE, BOAT, HUT = (0, 28, 136), (24, 59, 157), (187, 187, 53), (160, 40, 40)
FRAMES = 160
SEA = slice(40, 52)


def sea(i, boat=None, seed=0):
    """Water with waves that are elsewhere in every frame, a boat of 6×8 pixels, and a hut that comes and goes once."""
    shown = np.full((84, 84, 3), WATER, np.uint8)
    shown[SEA][np.random.default_rng([seed, i]).random((12, 84)) < 0.4] = WAVE
    if boat:
        shown[boat[0] : boat[0] + 6, boat[1] : boat[1] + 8] = BOAT
    if 40 <= i < 70:
        shown[4:8, 4:8] = HUT
    return shown


@pytest.fixture(scope="module")
def detector():
    learned = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        learned.partial_fit(sea(i, boat=(20, (3 * i) % 70)))
    return learned


@pytest.mark.parametrize("boat", [(60, 30), (43, 30), (49, 9)])
def test_waves_are_no_objects_and_a_boat_is_one_on_them_and_beside_them(detector, boat):
    objects = detector.detect(sea(0, boat=boat, seed=1))
    np.testing.assert_array_equal(objects.boxes_px, [[*boat, 6, 8]])


def test_what_is_restless_is_the_sea(detector):
    top, left, bottom, right = detector._restless.regions_[0]
    assert len(detector._restless.regions_) == 1
    assert SEA.start - 3 <= top <= SEA.start and SEA.stop <= bottom <= SEA.stop + 3
    assert (left, right) == (0, 84)


def lamp(i, walks):
    """A lamp that blinks, or that is at home every other time and else as far away as it happens to be."""
    shown = np.zeros((84, 84, 3), np.uint8)
    column = 10 + (int(np.random.default_rng(i).integers(4, 30)) if walks and i % 4 >= 2 else 0)
    if walks or i % 4 < 2:
        shown[10:18, column : column + 8] = BOAT
    return shown


@pytest.mark.parametrize("walks", [False, True])
def test_what_leaves_its_place_is_a_thing(walks):
    detector = ForegroundDetector(ForegroundConfig(background_frames=400))
    for i in range(400):
        detector.partial_fit(lamp(i, walks))
    assert len(detector._restless.regions_) == 1
    assert any(len(detector.detect(lamp(i, walks))) for i in (400, 402)) == walks


def test_what_comes_and_goes_seldom_is_seen(detector):
    objects = detector.detect(sea(41))
    np.testing.assert_array_equal(objects.boxes_px, [[4, 4, 4, 4]])


@pytest.mark.parametrize(("every", "restless"), [(2, True), (5, True), (20, False)])
def test_a_lamp_is_restless_if_it_changes_often(every, restless):
    detector = ForegroundDetector(ForegroundConfig(background_frames=400))
    shown = np.zeros((2, 84, 84, 3), np.uint8)
    shown[1, 10:14, 10:14] = BOAT
    for i in range(400):
        detector.partial_fit(shown[i // every % 2])
    assert (1 / every >= LEAST_RATE) == restless
    assert sorted(len(detector.detect(each)) for each in shown) == [0, 0 if restless else 1]


def test_it_is_restored_and_older_runs_have_none(detector):
    arrays = detector.to_arrays()
    fresh = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    fresh.from_arrays(arrays)
    shown = sea(7, boat=(44, 20), seed=2)
    np.testing.assert_array_equal(fresh.detect(shown).labels, detector.detect(shown).labels)
    older = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    older.from_arrays({name: array for name, array in arrays.items() if not name.startswith("restless")})
    assert len(older.detect(shown)) > len(detector.detect(shown))


@pytest.mark.parametrize("stops_after", [25, 100])
def test_a_detector_that_is_still_learning_goes_on_where_it_was(stops_after):
    whole, begun, restored = (ForegroundDetector(ForegroundConfig(background_frames=FRAMES)) for _ in range(3))
    for i in range(FRAMES):
        whole.partial_fit(sea(i))
    for i in range(stops_after):
        begun.partial_fit(sea(i))
    restored.from_arrays(begun.to_arrays())
    for i in range(stops_after, FRAMES):
        restored.partial_fit(sea(i))
    after = restored.to_arrays()
    for name, array in whole.to_arrays().items():
        np.testing.assert_array_equal(array, after[name], err_msg=name)
