"""More things of a kind than there were: each has the slot once."""

from dataclasses import replace

import numpy as np
import pytest
from walkers import N_CLASSES, followed

from semrl.perception.tracking import SharedSlots, SlotAssigner, SlotAssignerConfig, no_tracks
from semrl.perception.tracking.sharing import LEAST_DECISIONS, REMEMBERED

FRAMES = 120


def balls(t, second=False):
    """A paddle, a ball, and a second ball that goes the other way, from the third decision on."""
    seen = [(0, 30 + abs(20 - t % 40), 74), (1, 10 + 1.5 * (t % 40), 20 + t % 40)]
    return [*seen, (1, 70 - 1.5 * (t % 40), 22 + t % 40)] if second and t % 40 > 2 else seen


def play(assigner, frames, *, second=False, learns=False):
    tracks = no_tracks(N_CLASSES)
    for t in range(frames):
        (tracks,) = followed([balls(t, second)], tracks=tracks)
        if learns:
            assigner.partial_fit(tracks, t % 2)
        tracks = replace(tracks, roles=assigner.predict(tracks))
        yield tracks


@pytest.fixture(scope="module", params=[False, True])
def assigner(request):
    learned = SlotAssigner(SlotAssignerConfig(frames=FRAMES, slots=3, sizes=request.param))
    for _ in play(learned, FRAMES, learns=True):
        pass
    assert len(learned.slots_) == 2 and learned.shared_.any()
    return learned


def test_with_one_thing_a_slot_nothing_is_shared(assigner):
    shared = SharedSlots(assigner)
    assert all(shared.lists(tracks, assigner.transform(tracks)) == () for tracks in play(assigner, 100))


def test_each_of_two_has_the_slot_once_with_its_own_past(assigner):
    shared, slot = SharedSlots(assigner), int(np.flatnonzero(assigner.kinds_[assigner.slots_] == 1)[0])
    for t, tracks in enumerate(play(assigner, 30, second=True)):
        facts = assigner.transform(tracks)
        lists = shared.lists(tracks, facts)
        assert len(lists) == (2 if t >= 3 + LEAST_DECISIONS else 0)
    one, other = (each.reshape(REMEMBERED, 3, -1)[:, slot] for each in lists)
    np.testing.assert_array_equal(lists[0][0], facts)
    now = np.arange(29, 29 - REMEMBERED, -1)
    np.testing.assert_allclose(one[:, 1] * 83, 10 + 1.5 * now, atol=1e-4)
    np.testing.assert_allclose(other[:, 1] * 83, 70 - 1.5 * now, atol=1e-4)
    rest = np.delete(lists[0].reshape(REMEMBERED, 3, -1), slot, axis=1)
    np.testing.assert_array_equal(rest, np.delete(lists[1].reshape(REMEMBERED, 3, -1), slot, axis=1))


def test_before_it_began_a_thing_was_not_there(assigner):
    shared, slot = SharedSlots(assigner), int(np.flatnonzero(assigner.kinds_[assigner.slots_] == 1)[0])
    for tracks in play(assigner, 10, second=True):
        lists = shared.lists(tracks, assigner.transform(tracks))
    assert lists[1].reshape(len(lists[1]), 3, -1)[:, slot, -1].tolist() == [1] * 7 + [0] * 3


def test_it_can_be_switched_off(assigner):
    shared = SharedSlots(assigner, on=False)
    assert all(shared.lists(tracks, assigner.transform(tracks)) == () for tracks in play(assigner, 20, second=True))


def test_where_there_were_more_things_than_slots_none_is_shared():
    few = SlotAssigner(SlotAssignerConfig(frames=FRAMES, slots=2))
    tracks = no_tracks(N_CLASSES)
    for t in range(FRAMES):
        (tracks,) = followed([balls(t, second=True)], tracks=tracks)
        few.partial_fit(tracks, t % 2)
        tracks = replace(tracks, roles=few.predict(tracks))
    assert not few.shared_.any()


def test_an_episode_goes_on_where_it_was_saved(assigner):
    one, other = SharedSlots(assigner), SharedSlots(assigner)
    for t, tracks in enumerate(play(assigner, 30, second=True)):
        facts = assigner.transform(tracks)
        if t == 12:
            other.from_arrays(one.to_arrays())
        lists = one.lists(tracks, facts)
        if t >= 12:
            for mine, yours in zip(lists, other.lists(tracks, facts), strict=True):
                np.testing.assert_array_equal(mine, yours)
    assert len(lists) == 2
