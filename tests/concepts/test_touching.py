"""What comes of touching the ground tells which of it blocks and which is lost."""

import numpy as np
import pytest
from bricks import BRICKS, WALL, bricks
from rallies import BALL, thing

from semrl.concepts import Concepts
from semrl.core.things import GROUND


def number_of(known, colour):
    """The concept of a colour of the ground."""
    (number,) = [i for i, kinds in enumerate(known.table_.kinds) if kinds == (colour,) and known.table_.static[i]]
    return number


@pytest.fixture(scope="module", params=[0, 1])
def known(request):
    return Concepts().partial_fit(bricks(1500, request.param)[0])


def test_bricks_are_lost_and_walls_are_not(known):
    brick, wall = number_of(known, BRICKS[0]), number_of(known, WALL)
    assert known.is_lost_[brick] and not known.is_lost_[wall]
    assert known.blocks_[brick] and known.blocks_[wall]
    assert known.families_[brick] != known.families_[wall]
    moving = ~known.table_.static
    assert not known.is_lost_[moving].any() and not known.blocks_[moving].any()


def test_a_colour_that_was_not_touched_is_like_one_of_its_size():
    """The upper row is out of reach at first."""
    known = Concepts().partial_fit(bricks(200, 2)[0])
    near, far = (number_of(known, colour) for colour in BRICKS)
    touched = known.to_arrays()["touches"]
    assert touched[4 * BRICKS[0] + 3, 0] >= 3 and touched[4 * BRICKS[1] + 3, 0] < 3
    assert known.is_lost_[far] and known.families_[far] == known.families_[near]


def test_what_is_flown_through_does_not_matter():
    tables = [
        np.array([
            thing(0, BALL, (4 + t % 60, 30, 6 + t % 60, 32)), thing(1_000_000, 0, (30, 20, 40, 60), still=GROUND)
        ], np.float32)
        for t in range(400)
    ]  # fmt: skip
    known = Concepts().partial_fit(tables)
    assert known.to_arrays()["touches"][3, 0] >= 5
    assert not known.blocks_.any() and not known.is_lost_.any()


def test_counts_of_before_there_was_ground_are_read(known):
    arrays = known.to_arrays()
    del arrays["touches"]
    old = Concepts()
    old.from_arrays(arrays)
    assert old.table_.names == known.table_.names and not old.is_lost_.any()
