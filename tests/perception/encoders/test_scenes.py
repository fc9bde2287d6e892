"""The encoders of scene graphs: of single frames, and of tracked objects; and the list of the latter."""

from dataclasses import replace

import numpy as np
import pytest
from seeing import CONFIG, bits, encoded, episodes, learned, play

from semrl.core import Observation
from semrl.core.errors import DataError
from semrl.evaluation import load_player
from semrl.perception.embedding import build_scene_graph
from semrl.perception.encoders import ENCODERS
from semrl.perception.tracking import SLOT_NUMBERS
from semrl.training import build_trainer

SHOWN = [observation for observation, _ in play(60, seed=3)]
EPISODE = [observation for observation, _ in episodes(46, seed=3)[0]]


def test_scene_shows_the_embedded_scene():
    encoder = learned("scene")
    seen = encoder.perception
    objects = seen.detector.detect(SHOWN[7].frame)
    graph = build_scene_graph(seen.classes(objects), objects.centres_px, CONFIG.scene.proximity_px)
    (state,) = encoded(encoder, [SHOWN[7]])
    np.testing.assert_array_equal(state.vector, seen.embedder.transform(graph))
    np.testing.assert_array_equal(state.facts, state.vector)
    assert (
        len({bits(state) for state in encoded(encoder, SHOWN[:9])}) == 9
    )  # no two states of a falling ball look alike


@pytest.mark.parametrize("omit_scenery", [False, True])
def test_scenery_is_only_left_out_when_asked_for(omit_scenery):
    scene = replace(CONFIG.scene, omit_scenery=omit_scenery, scenery_frames=60)
    encoder = learned("scene", replace(CONFIG, scene=scene))
    seen = encoder.perception
    objects = seen.detector.detect(SHOWN[-1].frame)
    classes = seen.classes(objects)
    everything = list(range(len(classes)))
    moving = np.flatnonzero(~np.isin(classes, seen.scenery.still_)).tolist()
    assert seen.shown(classes).tolist() == (moving if omit_scenery else everything)
    assert len(moving) == len(everything) if not omit_scenery else 0 < len(moving) < len(everything)
    assert len(seen.scene(SHOWN[-1])) == len(seen.shown(classes))
    assert seen.shown(np.empty(0, np.int64)).shape == (0,)
    episode = encoder.begin()
    episode.encode(SHOWN[-1])
    sight = episode.look()
    assert len(sight.boxes_px) == len(everything)  # scenery is drawn, but not joined
    assert set(sight.edges.ravel().tolist()) <= set(moving if omit_scenery else everything)


def test_objects_shows_the_list_of_what_moves():
    encoder = learned("objects")
    names, episode = encoder.space.names, encoder.begin()
    roles = encoder.perception.slot_assigner
    assert len(names) == len(roles.slots_) * len(SLOT_NUMBERS) and any(name.startswith("own") for name in names)
    for observation in EPISODE:
        state = episode.encode(observation)
        np.testing.assert_array_equal(state.vector, state.facts)
        np.testing.assert_array_equal(state.facts, roles.transform(episode.tracks))
        sight = episode.look()
        assert len(sight.names) == len(sight.boxes_px) == len(sight.classes) <= len(roles.slots_)
        assert all(name.startswith(("own", "object ")) for name in sight.names)
    assert sight.names and encoder.space.axes.tolist()[:2] != [-1, -1]


@pytest.mark.parametrize("planning", [False, True])
def test_the_list_is_shown_where_a_planner_reasons_about_it(planning):
    encoder, lists = learned("tracked_scene", planning=planning), learned("objects")
    dimension = encoder.perception.embedder.dimension
    assert encoder.space.n_facts == (lists.space.n_facts if planning else 0)
    assert encoder.space.shape == (dimension + encoder.space.n_facts,)
    assert encoder.space.names == (lists.space.names if planning else ())
    embedded = []
    for state, listed in zip(encoded(encoder, EPISODE), encoded(lists, EPISODE), strict=True):
        embedded.append(state.vector[:dimension])
        np.testing.assert_array_equal(embedded[-1], encoder.embed(listed.facts))
        np.testing.assert_array_equal(state.vector[dimension:], listed.facts if planning else [])
        np.testing.assert_array_equal(state.facts, listed.facts if planning else [])
    assert any(vector.any() for vector in embedded)


def test_the_vector_of_a_tracked_scene_follows_from_the_list_of_what_moves(tracked_run):
    player = load_player(tracked_run)
    steps, seen = list(player.episode(0, 1)), player.encoder.perception
    dimension, met = seen.embedder.dimension, 0
    for step in steps:
        classes, centres = seen.slot_assigner.read(step.state.facts)
        scene = build_scene_graph(classes, centres, seen.config.scene.proximity_px)
        np.testing.assert_array_equal(step.state.vector[:dimension], seen.embedder.transform(scene))
        np.testing.assert_array_equal(step.state.vector[dimension:], step.state.facts)
        np.testing.assert_array_equal(step.shown.vectors[0], step.state.vector)
        np.testing.assert_array_equal(step.record.history.states[0], step.state.facts)
        met += len(classes)
    assert met > len(steps) // 2


def test_without_a_map_the_list_is_not_shown(tiny):
    trainer = build_trainer(tiny(encoder="tracked_scene"))
    assert trainer.encoder.perception.tracked and trainer.planning is None
    assert trainer.encoder.space.shape == (16,) and trainer.encoder.space.names == ()


def test_tracked_scenes_are_of_frames_of_one_size():
    for name in ("tracked_scene", "objects"):
        with pytest.raises(DataError, match="the background is of frames") as error:
            encoded(learned(name), [Observation(frame=np.zeros((33, 500, 3), np.uint8))])
        assert "\n" not in str(error.value)


NOISE = np.random.default_rng(0).integers(0, 256, (168, 168, 3)).astype(np.uint8)


@pytest.mark.parametrize(
    "frame", [np.zeros_like(NOISE), np.full_like(NOISE, 255), NOISE], ids=["black", "white", "noise"]
)
@pytest.mark.parametrize("planning", [False, True])
def test_whatever_is_tracked_has_a_finite_vector(planning, frame):
    encoder = learned("tracked_scene", planning=planning)
    for state in encoded(encoder, [Observation(frame=frame)] * 8):
        assert state.vector.shape == encoder.space.shape and state.vector.dtype == np.float32
        assert np.isfinite(state.vector).all()


@pytest.mark.parametrize(
    "frame",
    [
        np.zeros((210, 160, 3), np.uint8),
        np.full((210, 160, 3), 255, np.uint8),
        np.full((33, 500, 3), (12, 200, 7), np.uint8),
        np.kron(np.ones((42, 42), np.uint8) * 255, np.array([[1, 0], [0, 0]], np.uint8))[..., None].repeat(3, axis=2),
        np.kron(NOISE[:42, :42, 0] // 128 * 255, np.ones((5, 5), np.uint8))[..., None].repeat(3, axis=2),
        np.zeros((1, 1, 3), np.uint8),
    ],
    ids=["black", "white", "one colour, other size", "1764 dots", "noise, other size", "one pixel"],
)
def test_whatever_is_shown_has_a_finite_vector(frame):
    first, second = encoded(learned("scene"), [Observation(frame=frame)] * 2)
    assert first.vector.shape == (32,) and first.vector.dtype == np.float32 and np.isfinite(first.vector).all()
    assert bits(first) == bits(second)


def test_an_encoder_is_made_for_one_game():
    assert ENCODERS.load("objects")(CONFIG, rom="pong").rom == "pong" and ENCODERS.load("grey")(CONFIG).rom is None
