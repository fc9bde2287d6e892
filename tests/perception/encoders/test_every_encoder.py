"""What holds for every encoder."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from seeing import BLACK, CONFIG, LEARNED, bits, encoded, episodes, learned, play, relearned, schedule_of

from semrl.core import Observation
from semrl.core.arrays import digest
from semrl.core.errors import DataError, MissingExtraError, UsageError
from semrl.core.protocols import Persistent
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders import ENCODERS
from semrl.training.config import MODELS

CASES = [*((name, False) for name in LEARNED), ("objects", True), ("tracked_scene", True)]
each = pytest.mark.parametrize(("name", "planning"), CASES, ids=[f"{n}{'-planning' * p}" for n, p in CASES])


def frames(count=46, seed=0):
    return [observation for observation, _ in episodes(46, 46, 46, seed=seed)[0][:count]]


def test_the_models_of_table_4_1():
    told = {name: (model.encoder, model.plans) for name, model in MODELS.items()}
    assert told == {
        "baseline": ("grey", False),
        "otsu": ("components", False),
        "birch": ("classes", False),
        "semantic": ("scene", False),
        "semantic-map": ("scene", True),
        "objects": ("objects", False),
        "objects-map": ("objects", True),
        "ram": ("ram", False),
        "ram-map": ("ram", True),
    }
    assert {model.encoder for model in MODELS.values()} | {"tracked_scene"} == set(ENCODERS.names()[:7])


def test_an_unknown_encoder_is_named_with_what_is_close():
    with pytest.raises(UsageError, match="there is no 'object' among the encoders; did you mean 'objects'"):
        ENCODERS.check("object")


@each
def test_states_are_what_the_space_announces(name, planning):
    encoder = learned(name, planning=planning)
    space = encoder.space
    assert isinstance(encoder, Persistent) and isinstance(encoder.begin(), Persistent)
    for state in encoded(encoder, frames(12)):
        assert state.vector.shape == space.shape and state.vector.dtype == space.dtype
        assert state.facts.shape == (space.n_facts,) and state.facts.dtype == np.float32
    assert len(space.names) <= space.n_facts and (space.axes is None or space.axes.shape == (space.n_facts,))
    if len(space.shape) == 2:
        assert space.shape == (84, 84) and space.dtype == np.uint8 and space.n_facts == 0


@each
def test_encoding_learns_nothing_and_repeats(name, planning):
    encoder = learned(name, planning=planning)
    before = digest(encoder.to_arrays())
    first = [bits(state) for state in encoded(encoder, frames(20))]
    assert [bits(state) for state in encoded(encoder, frames(20))] == first
    assert digest(encoder.to_arrays()) == before
    assert len(set(first)) > 5


@each
def test_several_episodes_side_by_side_are_as_each_of_them_alone(name, planning):
    encoder = relearned(name, planning=planning)
    shown = [[observation for observation, _ in episode[:30]] for episode in episodes(46, 46, 46)]
    alone = [[bits(state) for state in encoded(relearned(name, planning=planning), one)] for one in shown]
    side_by_side = [encoder.begin() for _ in shown]
    together = [[] for _ in shown]
    for observations in zip(*shown, strict=True):
        for states, episode, observation in zip(together, side_by_side, observations, strict=True):
            states.append(bits(episode.encode(observation)))
    assert together == alone
    assert [[bits(state) for state in encoded(encoder, one)] for one in shown] == alone  # one after the other


@each
@pytest.mark.parametrize("until", [0, 1, 17])
def test_an_episode_saved_midway_goes_on_bit_for_bit(name, planning, until):
    encoder, other = learned(name, planning=planning), relearned(name, planning=planning)
    straight, restored = encoder.begin(), other.begin()
    for observation in frames(until):
        straight.encode(observation)
    for observation, _ in episodes(46, 46, 46)[1][:9]:  # used before
        restored.encode(observation)
    restored.from_arrays({key: array.copy() for key, array in straight.to_arrays().items()})
    assert digest(restored.to_arrays()) == digest(straight.to_arrays())
    for observation in frames()[until:]:
        assert bits(restored.encode(observation)) == bits(straight.encode(observation))
    assert digest(restored.to_arrays()) == digest(straight.to_arrays())
    one, two = straight.look(), restored.look()
    assert one.names == two.names
    np.testing.assert_array_equal(one.boxes_px, two.boxes_px)
    np.testing.assert_array_equal(one.labels, two.labels)


@each
def test_a_restored_encoder_sees_the_same(name, planning):
    encoder, restored = learned(name, planning=planning), relearned(name, planning=planning)
    assert digest(restored.to_arrays()) == digest(encoder.to_arrays()) and restored.is_fitted
    assert restored.space.names == encoder.space.names
    shown = frames(20, seed=5)
    assert [bits(s) for s in encoded(restored, shown)] == [bits(s) for s in encoded(encoder, shown)]


@each
def test_what_is_not_learned_yet_is_told_at_every_stage(name, planning):
    encoder = ENCODERS.load(name)(CONFIG, planning=planning)
    schedule, shown = schedule_of(encoder), iter(play(600))
    assert encoder.is_fitted == (schedule.current is None)
    while (stage := schedule.current) is not None:
        assert not encoder.is_fitted
        episode = encoder.begin()
        with pytest.raises(DataError) as error:
            episode.encode(frames(1)[0])
        assert "\n" not in str(error.value)
        assert not len(episode.look().names)
        while schedule.current is stage:
            schedule.learn(*next(shown))
    assert encoder.is_fitted


@each
def test_a_black_frame_is_a_state_without_objects(name, planning):
    encoder = learned(name, planning=planning)
    (state,) = encoded(encoder, [BLACK])
    assert state.vector.shape == encoder.space.shape
    if encoder.perception is None or not encoder.perception.tracked:  # tracked, it differs from the background
        assert not state.vector.any()


@each
def test_before_anything_is_shown_nothing_is_seen(name, planning):
    sight = learned(name, planning=planning).begin().look()
    assert not len(sight.boxes_px) and not sight.labels.any() and sight.names == ()


@pytest.mark.parametrize(
    "frame",
    [
        np.full((168, 168, 3), np.nan),
        np.zeros((168, 168), np.uint8),
        np.zeros((168, 168, 4), np.uint8),
        np.zeros((0, 168, 3), np.uint8),
    ],
    ids=["not a number", "grey", "four channels", "empty"],
)
@pytest.mark.parametrize("name", LEARNED)
def test_what_is_no_frame_is_told_in_one_line(name, frame):
    with pytest.raises(DataError) as error:
        encoded(learned(name), [Observation(frame=frame)])
    assert "\n" not in str(error.value)


def test_the_extra_is_asked_for_only_where_it_is_needed(monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "semrl.perception.embedding.doc2vec.find_spec", lambda name: None if name == "gensim" else find_spec(name)
    )
    for name in ("grey", "components", "classes", "objects"):
        ENCODERS.load(name)(PerceptionConfig())
    for name in ("scene", "tracked_scene"):
        with pytest.raises(MissingExtraError, match=r"pip install .*'gensim"):
            ENCODERS.load(name)(PerceptionConfig())


def test_a_detector_that_is_named_takes_the_place_of_the_usual_one():
    usual = {name: type(ENCODERS.load(name)(CONFIG).perception.detector).__name__ for name in ("scene", "objects")}
    assert usual == {"scene": "OtsuDetector", "objects": "ForegroundDetector"}
    other = replace(CONFIG, detector="foreground")
    assert type(ENCODERS.load("scene")(other).perception.detector).__name__ == "ForegroundDetector"
    with pytest.raises(UsageError, match="there is no 'otus' among the detectors; did you mean 'otsu'"):
        replace(CONFIG, detector="otus")
