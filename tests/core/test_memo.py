import numpy as np
import pytest

from semrl.core.memo import Memo


class Counting:
    """Two sums of a key, and how often they were asked for."""

    def __init__(self) -> None:
        self.asked: list[list[int]] = []

    def __call__(self, keys: np.ndarray) -> np.ndarray:
        self.asked += keys.tolist()
        return np.stack([keys.sum(1), keys[:, 0] - keys[:, 1]], axis=1)


def look_up(memo: Memo, keys: np.ndarray) -> np.ndarray:
    values, places = memo.look_up(keys)
    return values[places]


@pytest.mark.parametrize("most", [3, 50, 5000])
def test_it_returns_what_the_function_returns(most: int) -> None:
    memo, rng = Memo(Counting(), width=2, most_entries=most), np.random.default_rng(0)
    for size in (0, 1, 40, 200, 40, 3):  # with 3 and 50 entries it has to be emptied and enlarged
        keys = rng.integers(-9, 9, (size, 2)) * rng.integers(1, 2**60, (size, 1))
        np.testing.assert_array_equal(look_up(memo, keys), Counting()(keys).reshape(-1, 2))
        assert len(memo) <= max(most, 200)


def test_a_key_is_asked_for_once() -> None:
    function = Counting()
    memo = Memo(function, width=2)
    keys = np.array([[1, 2], [3, 4], [1, 2]])
    for _ in range(3):
        look_up(memo, keys)
    assert function.asked == [[1, 2], [3, 4]] and len(memo) == 2


def test_a_function_that_fails_leaves_nothing_behind() -> None:
    def fail(keys: np.ndarray) -> np.ndarray:
        if (keys > 5).any():
            raise ValueError("too large")
        return keys

    memo = Memo(fail, width=1)
    assert look_up(memo, np.array([[1]])) == 1
    for _ in range(2):
        with pytest.raises(ValueError, match="too large"):
            look_up(memo, np.array([[1], [6]]))
    assert look_up(memo, np.array([[2]])) == 2
