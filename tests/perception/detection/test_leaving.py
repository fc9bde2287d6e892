import numpy as np
import pytest

from semrl.perception.detection import ForegroundConfig, ForegroundDetector

FRAMES, SHIP, BRICK = 240, (187, 187, 53), (66, 158, 130)
HOME, AWAY = (30, 40), (60, 10)


def at(place, brick=True):
    """A ship of 6×8 pixels, and a brick beside it."""
    shown = np.zeros((84, 84, 3), np.uint8)
    shown[place[0] : place[0] + 6, place[1] : place[1] + 8] = SHIP
    if brick:
        shown[30:36, 70:78] = BRICK
    return shown


def learned(play):
    """A detector that has seen frames."""
    detector = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        detector.partial_fit(play(i))
    return detector


def sails(i):
    """It is at home three fifths of the time, and goes down and comes back in between."""
    return at((HOME[0] + 3 * min(max(i % 20 - 11, 0), 20 - i % 20), HOME[1]))


def test_what_leaves_and_comes_back_is_seen_at_home_too():
    detector = learned(sails)
    for place in (HOME, AWAY, (45, 60)):
        np.testing.assert_array_equal(detector.detect(at(place)).boxes_px, [[*place, 6, 8]])


def test_what_is_lost_once_an_episode_stays_background_and_leaves_no_hole():
    detector = learned(lambda i: at((60, 10 + i % 50), brick=i % 120 < 80))
    for brick in (True, False):
        np.testing.assert_array_equal(detector.detect(at(AWAY, brick=brick)).boxes_px, [[*AWAY, 6, 8]])


@pytest.mark.parametrize("lost", [0, 1])
def test_a_hole_in_a_wall_is_no_object_where_the_ground_is_seen_through_it(lost):
    """Of two bricks, one on the other, the lower is gone: three of four of its sides are seen."""

    def wall(i, gone=False):
        shown = at((60, 10 + i % 50), brick=False)
        shown[4:24], shown[18:24, 20:30] = BRICK, 0 if gone else BRICK
        return shown

    detector = learned(wall)
    assert len(detector.detect(wall(lost, gone=bool(lost)))) == 1
