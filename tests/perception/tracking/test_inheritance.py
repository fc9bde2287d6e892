"""What looks new and behaves like something known is taken for it."""

from dataclasses import replace

import numpy as np
import pytest
from walkers import N_CLASSES, objects

from semrl.core.errors import UsageError
from semrl.core.things import KIND
from semrl.perception.tracking import (
    Inheritance,
    InheritanceConfig,
    SlotAssigner,
    SlotAssignerConfig,
    TrackingConfig,
    follow,
    no_tracks,
)

GREEN, BROWN, WHITE, BLUE = [92, 186, 92], [213, 130, 74], [236, 236, 236], [84, 92, 214]
PADDLE, BALL, OTHER = range(3)
OWN, ENEMY, FLYING = (PADDLE, GREEN), (PADDLE, BROWN), (BALL, WHITE)
FRAMES, LATER = 120, 60


def episode(frames, enemy=ENEMY, ball=FLYING, wanders=False):
    """An own paddle on the right, another on the left, a ball between them; the left one may go anywhere."""
    tracks = no_tracks(N_CLASSES)
    rng = np.random.default_rng(0)
    for t in range(frames):
        up = abs(20 - t % 40)
        column = rng.uniform(5, 80) if wanders and t % 4 == 0 else 9
        places = [(20 + (3 * up) % 50, 74), (30 + up, column), (20 + t % 40, 20 + 1.2 * (t % 40))]
        looks = [OWN, enemy(t) if callable(enemy) else enemy, ball]
        classes = np.array([number for number, _ in looks])
        seen = replace(objects(places), colours=np.array([colour for _, colour in looks], np.float32))
        features = 2 * np.eye(N_CLASSES, dtype=np.float32)[classes]
        tracks = follow(tracks, seen, classes, features, TrackingConfig(gate_px=12.0))
        roles = yield tracks
        tracks = replace(tracks, roles=roles)
        yield tracks


def played(assigner, inheritance=None, frames=LATER, **looks):
    """Play; yield what is known of the tracks at each decision, with their roles."""
    steps = episode(frames, **looks)
    for tracks in steps:
        known = inheritance.as_known(tracks) if inheritance else tracks
        if inheritance is None:
            assigner.partial_fit(tracks, 0)
        roles = assigner.predict(known)
        steps.send(roles)
        yield replace(known, roles=roles)


@pytest.fixture(scope="module")
def learned():
    assigner = SlotAssigner(SlotAssignerConfig(frames=FRAMES))
    for _ in played(assigner, frames=FRAMES):
        pass
    assert len(assigner.slots_) == 3
    return assigner


def slot_seen(assigner, column, **given):
    """At which of the last decisions the slot that stays in a column is had by what is there."""
    slot = int(np.abs(assigner.means_px_[assigner.slots_][:, 1] - column).argmin())
    inheritance = Inheritance(assigner, given.pop("config", InheritanceConfig()))
    had = []
    for tracks in played(assigner, inheritance, **given):
        holder = np.flatnonzero(tracks.roles == assigner.slots_[slot])
        had.append(len(holder) == 1 and abs(tracks.centres_px[holder[0], 1] - column) < 3)
    return had, inheritance


def test_a_recoloured_thing_has_the_slot_of_what_behaves_like_it(learned):
    had, inheritance = slot_seen(learned, 9, enemy=(OTHER, BLUE))
    assert all(had[12:]) and not any(had[5:8])
    (remark,) = inheritance.remarks()
    assert remark.startswith("class 2 in the colour #545cd6 is taken for ") and "since decision" in remark


def test_without_it_the_slot_is_lost(learned):
    had, inheritance = slot_seen(learned, 9, enemy=(OTHER, BLUE), config=InheritanceConfig(decisions=0))
    assert not any(had[5:]) and inheritance.remarks() == ()


def test_its_kind_is_that_of_what_it_is_taken_for(learned):
    inheritance = Inheritance(learned, InheritanceConfig())
    *_, tracks = played(learned, inheritance, enemy=(OTHER, BLUE))
    *_, usual = played(learned, Inheritance(learned, InheritanceConfig()))
    assert learned.things(tracks)[:, KIND].tolist() == learned.things(usual)[:, KIND].tolist()


def test_its_colour_is_one_that_the_other_had_and_no_mean_of_two():
    assigner = SlotAssigner(SlotAssignerConfig(frames=FRAMES))
    for _ in played(assigner, frames=FRAMES, enemy=lambda t: (PADDLE, BROWN if t % 3 else WHITE)):
        pass
    *_, tracks = played(assigner, Inheritance(assigner, InheritanceConfig()), enemy=(OTHER, BLUE))
    (left,) = np.flatnonzero(tracks.centres_px[:, 1] < 10)
    np.testing.assert_array_equal(tracks.colours[left], BROWN)


def test_a_class_that_misleads_is_corrected(learned):
    """In grey the other paddle in another colour may look as the ball does."""
    had, inheritance = slot_seen(learned, 9, enemy=(BALL, BLUE))
    assert all(had[12:]) and len(inheritance.remarks()) == 1


def test_what_behaves_like_nothing_known_is_taken_for_nothing(learned):
    _, inheritance = slot_seen(learned, 9, enemy=(OTHER, BLUE), wanders=True, config=InheritanceConfig(fit=1.0))
    assert inheritance.remarks() == ()


def test_what_is_known_stays_what_it_is_bit_for_bit(learned):
    inheritance = Inheritance(learned, InheritanceConfig())
    steps = zip(episode_of(learned), played(learned, inheritance), strict=True)
    for plain, known in steps:
        for name in ("classes", "colours", "roles"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(known, name))
    assert inheritance.remarks() == ()


def episode_of(assigner):
    """The same play without it."""
    return played(assigner, Inheritance(assigner, InheritanceConfig(decisions=0)))


def test_an_episode_goes_on_where_it_was_saved(learned):
    one, other = (Inheritance(learned, InheritanceConfig()) for _ in range(2))
    for i, tracks in enumerate(played(learned, one, enemy=(OTHER, BLUE))):
        if i == 5:
            other.from_arrays(one.to_arrays())
        if i > 5:
            other.as_known(replace(tracks, classes=restored(tracks, OTHER), colours=restored(tracks, BLUE)))
    assert other.remarks() == one.remarks() != ()


def restored(tracks, look):
    """Classes or colours as they were seen: those of what stays on the left are the new ones."""
    left = tracks.centres_px[:, 1] < 10
    return np.where(left, look, tracks.classes) if look == OTHER else np.where(left[:, None], look, tracks.colours)


def test_runs_that_know_no_habits_inherit_nothing(learned):
    older = SlotAssigner(SlotAssignerConfig(frames=FRAMES))
    arrays = {name: array for name, array in learned.to_arrays().items() if not name.endswith("habits")}
    older.from_arrays(arrays)
    _, inheritance = slot_seen(older, 9, enemy=(OTHER, BLUE))
    assert inheritance.remarks() == ()


@pytest.mark.parametrize("wrong", [{"decisions": -1}, {"fit": 0.0}])
def test_wrong_settings_are_told(wrong):
    with pytest.raises(UsageError, match="inheritance"):
        InheritanceConfig(**wrong)
