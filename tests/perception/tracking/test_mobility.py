"""What moves is told from scenery by its kind as well."""

import numpy as np
import pytest
from walkers import followed

from semrl.core.things import STILL
from semrl.perception.tracking import SlotAssigner, SlotAssignerConfig
from semrl.perception.tracking.mobility import RESTING_DECISIONS, Mobility
from semrl.perception.tracking.tints import LEAST_SEEN

WALKER, POST, MARCHER = 0, 1, 2
KINDS = np.arange(3)[:, None]  # of each class, in the one colour


def world(t):
    """A walker, a post, and one that goes a step every twelfth decision."""
    return [(WALKER, 10, 10 + t % 60), (POST, 40, 40), (MARCHER, 70, 10 + 3 * (t // 12 % 20))]


def learned(frames, numbers=KINDS):
    mobility = Mobility()
    for tracks in followed(frames):
        mobility.learn(tracks, np.zeros(len(tracks), np.int64))
    mobility.settle(numbers)
    return mobility


def judged(mobility, frames):
    """Whether the first object is scenery at the end of some frames."""
    *_, tracks = followed(frames)
    return bool(mobility.stays(tracks, tracks.classes)[0])


def test_a_kind_moves_as_often_as_its_things_do():
    shares = learned([world(t) for t in range(60)]).shares_
    assert shares[[WALKER, POST]].tolist() == [1, 0]
    assert 0.05 < shares[MARCHER] < 0.1


def test_what_is_of_a_kind_that_moves_is_no_scenery_before_its_first_step():
    mobility = learned([world(t) for t in range(60)])
    for kind, still in ((WALKER, False), (MARCHER, False), (POST, True)):
        assert judged(mobility, [[(kind, 20, 20)]]) == still
        assert judged(Mobility(), [[(kind, 20, 20)]])


@pytest.mark.parametrize(("ages", "still"), [(RESTING_DECISIONS, False), (RESTING_DECISIONS + 2, True)])
def test_what_stands_for_long_is_scenery_whatever_its_kind(ages, still):
    assert judged(learned([world(t) for t in range(60)]), [[(WALKER, 20, 20)]] * ages) == still


def test_what_has_become_something_that_stays_is_scenery():
    frames = [[(WALKER, 10, 10 + t)] for t in range(30)] + [[(POST, 10, 40)]] * 3
    assert judged(learned([world(t) for t in range(60)]), frames)
    assert not judged(Mobility(), frames)


@pytest.mark.parametrize(("times", "known"), [(LEAST_SEEN, False), (LEAST_SEEN + 1, True)])
def test_a_kind_that_was_hardly_seen_says_nothing(times, known):
    mobility = learned([world(t) for t in range(times)])  # at the first decision nothing can have moved
    assert np.isfinite(mobility.shares_).tolist() == [known] * 3
    assert judged(mobility, [[(WALKER, 20, 20)]]) != known


def test_classes_of_one_kind_are_counted_together():
    mobility = learned([world(t) for t in range(60)], np.array([[0], [0], [1]]))
    assert mobility.shares_[0] == 0.5


def test_a_class_that_was_not_seen_when_kinds_were_settled_goes_by_its_steps():
    mobility = learned([world(t)[:1] for t in range(60)], np.array([[0]]))
    assert judged(mobility, [[(POST, 20, 20)]])
    assert not judged(mobility, [[(POST, 20, 20 + t)] for t in range(5)])


def test_it_goes_on_where_it_was_saved_and_older_runs_go_by_steps_alone():
    frames = [world(t) for t in range(60)]
    whole, part = Mobility(), Mobility()
    for t, tracks in enumerate(followed(frames)):
        if t == 17:
            part, before = Mobility(), part
            part.from_arrays(before.to_arrays())
        for one in (whole, part):
            one.learn(tracks, np.zeros(3, np.int64))
    whole.settle(KINDS)
    part.settle(KINDS)
    np.testing.assert_array_equal(whole.shares_, part.shares_)
    older = Mobility()
    older.from_arrays({})
    assert judged(older, [[(WALKER, 20, 20)]])


def test_things_say_so_from_the_first_decision_on():
    slots = SlotAssigner(SlotAssignerConfig(frames=60, slots=1))
    for tracks in followed([world(t) for t in range(61)]):
        slots.partial_fit(tracks, 0)
    first = next(followed([[*world(0), (WALKER, 60, 60)]]))
    assert slots.stays(first).tolist() == [False, True, False, False]
    assert slots.things(first)[:, STILL].tolist() == [0, 1, 0, 0]
