import numpy as np
import pytest

from semrl.perception.detection import ForegroundConfig, ForegroundDetector

FRAMES, LIT, RED = 200, (200, 200, 60), (200, 40, 40)
SEGMENTS = [  # of each digit, the lit ones of seven
    (0, 1, 2, 4, 5, 6), (2, 5), (0, 2, 3, 4, 6), (0, 2, 3, 5, 6), (1, 2, 3, 5),
    (0, 1, 3, 5, 6), (0, 1, 3, 4, 5, 6), (0, 2, 5), (0, 1, 2, 3, 4, 5, 6), (0, 1, 2, 3, 5, 6),
]  # fmt: skip
BOXES = [(0, 0, 1, 6), (0, 0, 5, 1), (0, 5, 5, 6), (4, 0, 5, 6), (4, 0, 9, 1), (4, 5, 9, 6), (8, 0, 9, 6)]


def put_digit(shown, number, top, left):
    """Draw a digit of 9×6 pixels."""
    for segment in SEGMENTS[number]:
        a, b, c, d = BOXES[segment]
        shown[top + a : top + c, left + b : left + d] = LIT


def play(i):
    """A clock at the top, a bar at the bottom that shrinks and is filled again, and a block that moves in a lane."""
    shown = np.zeros((84, 84, 3), np.uint8)
    put_digit(shown, i // 7 % 10, 4, 40)
    shown[76:80, 10 : 40 - i // 3 % 25] = LIT
    column = abs((3 * i) % 140 - 70)
    shown[40:48, column : column + 8] = RED
    return shown


@pytest.fixture(scope="module")
def detector():
    learned = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
    for i in range(FRAMES):
        learned.partial_fit(play(i))
    return learned


def test_digits_and_bars_are_background_and_what_moves_in_a_lane_is_not(detector):
    assert len(detector._panels.displays_) == 2
    for i in range(200, 260):
        (box,) = detector.detect(play(i)).boxes_px
        assert (box[0], box[2], box[3]) == (40, 8, 8)


def test_they_are_restored_and_older_runs_have_none(detector):
    arrays = detector.to_arrays()
    for kept, displays in ((arrays, 2), ({k: v for k, v in arrays.items() if not k.startswith("panels")}, 0)):
        fresh = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))
        fresh.from_arrays(kept)
        assert len(fresh._panels.displays_) == displays


def test_displays_are_cut_off_what_moves_all_over_the_image_close_to_them():
    learned = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))

    def crowded(i):
        shown = play(i)
        shown[13 + 2 : 74, (7 * i) % 80 : (7 * i) % 80 + 4] = RED  # up to two rows below the clock, and above the bar
        return shown

    for i in range(FRAMES):
        learned.partial_fit(crowded(i))
    assert sorted(box[0] for box in learned._panels.displays_.tolist()) == [4, 76]


@pytest.mark.parametrize("every", [1, 3])
def test_what_is_shot_from_one_place_is_no_display(every):
    """It passes the same places each time, and at each of them looks as if it never left it."""
    learned = ForegroundDetector(ForegroundConfig(background_frames=FRAMES))

    def shot(i):
        shown = np.zeros((84, 84, 3), np.uint8)
        row = 70 - 12 * (i // every % 6)
        shown[row : row + 4, 30:32] = RED
        return shown

    for i in range(FRAMES):
        learned.partial_fit(shot(i))
    assert [len(learned.detect(shot(i))) for i in range(0, 30, every)] == [1] * len(range(0, 30, every))
