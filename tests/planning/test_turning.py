"""Ways to face are turns of one another, and cells that differ in colours alone look alike."""

import numpy as np
import pytest

from semrl.planning.symbolic.appearances import Appearances
from semrl.planning.symbolic.cells import GridState
from semrl.planning.symbolic.turning import Turning, learn_turning, turned_offset

UP, LEFT, DOWN, RIGHT = (-1, 0), (0, -1), (1, 0), (0, 1)
WAYS = {4: UP, 5: LEFT, 6: DOWN, 7: RIGHT}


def pattern(inner, outer):
    cell = np.full((6, 6, 3), outer, np.uint8)
    cell[2:4, 1:4] = inner
    return cell


def test_ways_to_face_are_found_from_where_things_went():
    turning = learn_turning(set(WAYS), WAYS.items())
    assert turning == learn_turning(set(WAYS), list(WAYS.items())[:3])  # the fourth is what is left
    for kind, way in WAYS.items():
        assert turned_offset(UP, turning.of(kind)) == way and turning.stands_for(kind) == 4
        assert turning.turned_kind(4, turning.of(kind)) == kind


@pytest.mark.parametrize(
    "moves",
    [
        [(4, UP), (4, LEFT), (5, LEFT), (6, DOWN), (7, RIGHT)],  # goes where it does not face
        [(4, UP), (5, UP), (6, DOWN), (7, RIGHT)],
        [(4, UP), (5, LEFT)],
        [(4, UP), (5, LEFT), (6, (2, 0)), (7, RIGHT)],
    ],
)
def test_what_is_no_way_to_face_is_not_turned(moves):
    assert learn_turning(set(WAYS), moves) == Turning()


def test_cells_around_are_turned_with_what_faces_them():
    turning = learn_turning(set(WAYS), WAYS.items())
    cells = np.arange(20, dtype=np.int8)
    for kind, quarters in turning.quarters.items():
        state = GridState(row=1, column=3, kind=kind, cells=cells.tobytes(), columns=5)
        turned = turning.turned_state(state)
        assert turned.kind == 4 and (turned.columns == 5) == (quarters % 2 == 0)
        for offset in (UP, LEFT, DOWN, RIGHT, (1, -2), (0, 0), (9, 9)):
            assert turned.concept(offset) == state.concept(turned_offset(offset, quarters))


def test_shapes_are_the_same_in_all_colours():
    green, red = (0, 200, 0), (200, 0, 0)
    cells = [pattern(red, 0), pattern(green, 90), pattern(red, red), pattern(green, green), pattern(red, 0)[::-1, ::-1]]
    looks = Appearances(cells)
    assert looks.shape(0) == looks.shape(1) != looks.shape(4)
    assert looks.shape(2) == looks.shape(3) == b""  # of one colour: nothing but that tells them apart
    assert looks.most_alike(0, [1, 4]) == 4  # the ground and half of what is on it
