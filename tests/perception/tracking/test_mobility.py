"""What moves is told from scenery by its kind as well."""

import numpy as np
import pytest
from walkers import followed

from semrl.core.things import STILL
from semrl.perception.tracking import SlotAssigner, SlotAssignerConfig
from semrl.perception.tracking.mobility import MOBILE_SHARE, RESTING_DECISIONS, Mobility
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


def test_kinds_move_whose_things_do_now_or_soon():
    mobility = learned([world(t) for t in range(60)])
    assert mobility.shares_.tolist() == [[59 / 60, 1], [0, 0], [4 / 60, 49 / 60]]  # the last step at decision 48
    assert mobility.ranges_px_[[WALKER, MARCHER]].tolist() == [[10, 10, 10, 69], [70, 10, 70, 22]]


def test_what_is_of_a_kind_that_moves_is_no_scenery_before_its_first_step():
    mobility = learned([world(t) for t in range(60)])
    for kind, still in ((WALKER, False), (MARCHER, False), (POST, True)):
        place = next(place for number, *place in world(40) if number == kind)
        assert judged(mobility, [[(kind, *place)]]) == still
        assert judged(Mobility(), [[(kind, *place)]])
        assert judged(mobility, [[(kind, 80, 80)]])  # where nothing of it goes


@pytest.mark.parametrize(("ages", "still"), [(RESTING_DECISIONS, False), (RESTING_DECISIONS + 2, True)])
def test_what_stands_for_long_is_scenery_whatever_its_kind(ages, still):
    assert judged(learned([world(t) for t in range(60)]), [[(WALKER, 10, 20)]] * ages) == still


def test_what_has_become_something_that_stays_is_scenery():
    frames = [[(WALKER, 10, 10 + t)] for t in range(30)] + [[(POST, 10, 40)]] * 3
    assert judged(learned([world(t) for t in range(60)]), frames)
    assert not judged(Mobility(), frames)


def test_what_stands_in_between_is_no_scenery():
    """Half hidden behind a wall a thing looks otherwise, and stands there for a while."""
    ways = [min(t % 40, 15) if t % 40 < 20 else max(35 - t % 40, 0) for t in range(280)]
    frames = [[(POST if 15 < t % 40 < 20 else WALKER, 10, 10 + 2 * way)] for t, way in enumerate(ways)]
    assert learned(frames, KINDS[:2]).shares_[POST, 1] > MOBILE_SHARE


@pytest.mark.parametrize(("times", "known"), [(LEAST_SEEN - 1, False), (LEAST_SEEN, True)])
def test_a_kind_that_was_hardly_seen_says_nothing(times, known):
    mobility = learned([world(t) for t in range(times)])
    assert np.isfinite(mobility.shares_).tolist() == [[known] * 2] * 3
    assert judged(mobility, [[(WALKER, 10, 15)]]) != known


def test_nothing_seen_is_nothing_told():
    assert learned([[], []], np.zeros((0, 1), np.int64)).shares_.tolist() == []


def test_each_episode_has_tracks_of_its_own():
    mobility = Mobility()
    for _ in range(2):
        for tracks in followed([[(WALKER, 10, 10)]] * LEAST_SEEN):
            mobility.learn(tracks, np.zeros(1, np.int64))
    mobility.settle(KINDS[:1])
    assert mobility.shares_.tolist() == [[0, 0]]


def test_classes_of_one_kind_are_counted_together():
    mobility = learned([world(t) for t in range(60)], np.array([[0], [0], [1]]))
    assert mobility.shares_[:, 1].tolist() == [0.5, 49 / 60]


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
    assert judged(older, [[(WALKER, 10, 20)]])


def test_things_say_so_from_the_first_decision_on():
    slots = SlotAssigner(SlotAssignerConfig(frames=60, slots=1))
    for tracks in followed([world(t) for t in range(61)]):
        slots.partial_fit(tracks, 0)
    first = next(followed([[*world(20), (WALKER, 10, 60)]]))
    assert slots.stays(first).tolist() == [False, True, False, False]
    assert slots.things(first)[:, STILL].tolist() == [0, 1, 0, 0]
