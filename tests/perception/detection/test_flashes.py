import numpy as np

from semrl.perception.detection import ForegroundConfig, ForegroundDetector
from semrl.perception.detection.flashes import Flashes

GROUND, SKY, THING, FLASH = (0, 0, 0), (40, 40, 160), (160, 40, 40), (200, 200, 200)
FRAMES = 100


def empty(ground=GROUND):
    """The ground under the sky."""
    shown = np.full((84, 84, 3), ground, np.uint8)
    shown[:20] = SKY
    return shown


def night(i, ground=GROUND):
    """A thing that moves above the ground."""
    shown = empty(ground)
    shown[50:54, i % 70 : i % 70 + 6] = THING
    return shown


def test_a_flash_is_ground_and_what_is_before_it_is_seen():
    detector = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        detector.partial_fit(night(i, FLASH if i % 9 == 0 else GROUND))
    for ground in (GROUND, FLASH, THING):
        found = detector.detect(night(7, ground)).boxes_px.tolist()
        assert found == ([] if ground == THING else [[50, 7, 4, 6]])


def test_only_the_ground_flashes():
    flashes = Flashes(empty())
    np.testing.assert_array_equal(flashes.ground, [GROUND])
    calm = night(5)
    assert flashes.calmed(calm) is calm
    calm[25:45, 10:70] = FLASH  # large, but most of the ground shows
    assert flashes.calmed(calm) is calm
    shown = night(5, FLASH)
    shown[:5, :5] = FLASH
    expected = night(5)
    expected[:5, :5] = FLASH
    np.testing.assert_array_equal(flashes.calmed(shown), expected)
