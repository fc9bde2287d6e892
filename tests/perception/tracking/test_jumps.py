"""What jumps is followed; what ends, begins or blinks is not taken for a jump."""

from dataclasses import replace

import numpy as np
import pytest
from walkers import N_CLASSES, followed, objects

from semrl.perception.tracking import Jumps, SlotAssigner, SlotAssignerConfig, TrackingConfig, follow, no_tracks

GATE_PX = TrackingConfig().gate_px


def grid_walk(seed, step_px, n=80, size=4):
    """Walk on a grid at random, standing still now and then; its borders are walls."""
    rng, place = np.random.default_rng(seed), np.array([1, 2])
    for _ in range(n):
        yield tuple(5.0 + step_px * place)
        way = [(0, 1), (1, 0), (0, -1), (-1, 0), (0, 0)][rng.integers(5)]
        place = np.clip(place + way, 0, size - 1)


def learned(frames, every=200):
    """Learn from frames of places; an episode has so many."""
    jumps = Jumps(GATE_PX)
    for t, places in enumerate(frames):
        jumps.partial_fit(np.array(places, np.float32).reshape(-1, 2), begins=t % every == 0)
    return jumps


def tracked(frames, reach_px):
    """Follow frames of (class, row, column) where things jump so far."""
    tracks = no_tracks(N_CLASSES)
    for frame in frames:
        classes = np.array([number for number, *_ in frame], np.int64)
        seen, features = objects([place for _, *place in frame]), 2 * np.eye(N_CLASSES, dtype=np.float32)[classes]
        tracks = follow(tracks, seen, classes, features, TrackingConfig(), reach_px=reach_px)
        yield tracks


@pytest.mark.parametrize("step_px", [10.5, 14, 21, 24])
@pytest.mark.parametrize("seed", range(3))
def test_what_walks_on_a_grid_is_within_reach(step_px, seed):
    walk = list(grid_walk(seed, step_px))
    reach = learned([place] for place in walk).reach_px_
    assert step_px < reach < 1.5 * step_px
    for tracks in tracked([[(0, *place)] for place in walk], reach):
        assert tracks.ids.tolist() == [0]


@pytest.mark.parametrize("n_frames", [2, 4])
def test_cells_that_are_skipped_are_within_reach_too(n_frames):
    walk = list(grid_walk(7, 10.5, n=400, size=8))[::n_frames]
    reach = learned([place] for place in walk).reach_px_
    assert 10.5 < reach < 1.2 * n_frames * 10.5
    last = list(tracked([[(0, *place)] for place in walk], reach))[-1]
    assert int(last.born) <= 1 + 0.05 * len(walk)  # the farthest jumps are not covered


def test_its_looks_may_change_as_it_turns():
    walk = [(t % 3, *place) for t, place in enumerate(grid_walk(1, 21))]
    for tracks in tracked([[one] for one in walk], learned([place] for _, *place in walk).reach_px_):
        assert tracks.ids.tolist() == [0]


def test_a_jump_takes_nothing_from_what_stays():
    walk = list(grid_walk(2, 21))
    still = [(0, 40.0, 80.0), (0, 80.0, 40.0)]
    reach = learned([place, *(at for _, *at in still)] for place in walk).reach_px_
    *_, tracks = tracked([[*still, (0, *place)] for place in walk], reach)
    assert tracks.ids.tolist() == [0, 1, 2] and tracks.moves[:2].tolist() == [0, 0] and tracks.moves[2] > 20


@pytest.mark.parametrize("rate", [0.05, 0.3, 1.0, 3.0, 8.0])
@pytest.mark.parametrize("seed", range(4))
def test_what_ends_and_begins_by_chance_does_not_jump(rate, seed):
    rng, places, frames = np.random.default_rng(seed), np.zeros((0, 2)), []
    for _ in range(400):
        gone = rng.permutation(len(places))[: rng.poisson(rate)]
        places = np.concatenate([np.delete(places, gone, axis=0), rng.uniform(0, 83, (rng.poisson(rate), 2))])[:40]
        frames.append(places)
    assert learned(frames, every=1000).reach_px_ == 0


@pytest.mark.parametrize("every", [2, 3, 5])
def test_what_blinks_or_goes_its_way_does_not_jump(every):
    moving = [[(10 + 0.4 * t, 20), (70 - 0.3 * t, 60)] for t in range(150)]
    assert learned(moving).reach_px_ == 0
    assert learned([places[: 1 + (t % every == 0)] for t, places in enumerate(moving)]).reach_px_ == 0


def test_too_few_jumps_are_chance():
    assert learned([[(10, 10)], [(10, 35)]] * 5).reach_px_ == 0 < learned([[(10, 10)], [(10, 35)]] * 6).reach_px_
    assert learned([[(10, 10)], [(10, 35)]] * 40, every=2).reach_px_ > 25
    assert learned([[(10, 10)], [(10, 35)]] * 40, every=1).reach_px_ == 0  # episodes begin anew


@pytest.mark.parametrize("seed", range(4))
def test_one_that_begins_wherever_another_ends_does_not_jump(seed):
    places = np.random.default_rng(seed).uniform(0, 83, (200, 1, 2))
    assert learned(places).reach_px_ == 0


def test_it_goes_on_where_it_was_and_older_runs_know_of_none():
    walk = [[place] for place in grid_walk(0, 21)]
    first = learned(walk[:40])
    second = Jumps(GATE_PX)
    second.from_arrays(first.to_arrays())
    for place in walk[40:]:
        for jumps in (first, second):
            jumps.partial_fit(np.array(place, np.float32), begins=False)
    assert first.reach_px_ == second.reach_px_ > 0
    second = Jumps(GATE_PX)
    second.from_arrays({})
    assert second.reach_px_ == 0


@pytest.mark.parametrize("every", [1, 2, 3, 5])
def test_what_blinks_has_moved_as_often_as_it_was_found_elsewhere(every):
    frames = [[(0, 10.0 + t, 40.0)] if t % every == 0 else [] for t in range(61)]
    *_, tracks = followed(frames)
    assert tracks.ids.tolist() == [0] and tracks.moves.tolist() == [60 // every]
    np.testing.assert_allclose(tracks.velocities_px, [[1, 0]])
    *_, tracks = followed([[(0, 40.0, 40.0)] if t % every == 0 else [] for t in range(61)])
    assert tracks.ids.tolist() == [0] and tracks.moves.tolist() == [0]


@pytest.mark.parametrize("every", [1, 2, 3, 5])
@pytest.mark.parametrize("seed", range(2))
def test_what_blinks_has_a_slot_and_answers_to_the_action(every, seed):
    rng, tracks, place = np.random.default_rng(seed), no_tracks(N_CLASSES), 40
    roles = SlotAssigner(SlotAssignerConfig(frames=300))
    for t in range(300):
        action = int(rng.integers(3)) if t else None
        place = int(np.clip(place + 2 * (action or 0) - 2 * (t > 0), 5, 78))
        still = [(1, 20.0, 20.0)] if t % 2 else []
        (tracks,) = followed([[*still, *([(0, 23.0, place)] if t % every == 0 else [])]], tracks=tracks)
        roles.partial_fit(tracks, action)
        tracks = replace(tracks, roles=roles.predict(tracks))
    assert roles.kinds_[roles.slots_].tolist() == [0]
    assert roles.seen_[roles.slots_] == pytest.approx(1 / every, abs=0.1)
    if every <= 3:  # beyond, too few of the actions between two sights are the last ones
        assert roles.names_ == ("own",)
