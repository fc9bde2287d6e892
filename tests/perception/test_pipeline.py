"""Elevation: each view is what the boxes below it make of the frame."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from semrl.core import Observation
from semrl.core.arrays import digest
from semrl.core.errors import MissingExtraError, UsageError
from semrl.envs import Game, make_env, ram_features
from semrl.evaluation import load_player
from semrl.perception.clustering import BirchConfig
from semrl.perception.config import MODELS, PipelineConfig
from semrl.perception.detection import DetectionConfig, label_image
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import HashedEmbeddingConfig, build_scene_graph
from semrl.perception.pipeline import Pipeline
from semrl.training import build_trainer

CONFIG = PipelineConfig(embedding="hashed", hashed=HashedEmbeddingConfig(dimension=32))
VIEWS = ["grey", "components", "classes", "embedding"]


def observations(env_id="semrl/Catch-v0", n=60, seed=0):
    game, rng = Game(make_env(env_id), seed), np.random.default_rng(seed)
    shown = [game.reset()]
    for _ in range(n):
        outcome = game.step(int(rng.integers(game.n_actions)))
        shown.append(game.reset() if outcome.done else outcome.observation)
    return shown


SHOWN = observations()


def trained(view, config=CONFIG):
    pipeline = Pipeline(config, view)
    images = [to_grey(o.frame) for o in SHOWN]
    for image in images:
        pipeline.detector.partial_fit(image)
    for image in images:
        pipeline.pca.partial_fit(pipeline.detector.detect(image).features)
    for image in images:
        pipeline.birch.partial_fit(pipeline.pca.transform(pipeline.detector.detect(image).features))
    return pipeline


def test_the_models_of_table_4_1():
    assert MODELS == {
        "baseline": "grey",
        "otsu": "components",
        "birch": "classes",
        "semantic": "embedding",
        "semantic-map": "embedding",
        "objects": "objects",
        "objects-map": "objects",
        "ram": "ram",
        "ram-map": "ram",
    }


@pytest.mark.parametrize("view", VIEWS)
def test_what_is_encoded_has_the_shape_and_type_announced(view):
    pipeline = trained(view)
    assert (pipeline.shape, pipeline.dtype) == (((32,), np.float32) if view == "embedding" else ((84, 84), np.uint8))
    for observation in SHOWN[::20]:
        encoded = pipeline.encode(observation)
        assert encoded.shape == pipeline.shape and encoded.dtype == pipeline.dtype


def test_the_baseline_sees_the_grey_image():
    pipeline = Pipeline(CONFIG, "grey")
    np.testing.assert_array_equal(pipeline.encode(SHOWN[7]), to_grey(SHOWN[7].frame))


def test_otsu_sees_components_each_in_a_level_of_its_own():
    pipeline = trained("components")
    image = to_grey(SHOWN[7].frame)
    seen = pipeline.encode(SHOWN[7])
    np.testing.assert_array_equal(seen, label_image(pipeline.detector.components(image)))
    assert len(np.unique(seen)) == 5  # background, two walls, ball, paddle


def test_birch_sees_objects_of_one_kind_in_one_level():
    pipeline = trained("classes")
    for observation in SHOWN[::10]:
        seen = pipeline.encode(observation)
        objects = pipeline.detector.detect(to_grey(observation.frame))
        classes = pipeline.birch.predict(pipeline.pca.transform(objects.features))
        levels = {}
        for i, number in enumerate(classes.tolist()):
            (level,) = np.unique(seen[objects.labels == i + 1])
            assert levels.setdefault(number, level) == level
        assert len({*levels.values()}) == len(levels) and 0 not in levels.values()
        assert (seen[objects.labels == 0] == 0).all()


def test_the_kinds_of_catch_are_told_apart():
    # A leaf of many pieces of wall takes in one ball when the threshold is as large as the thesis's.
    pipeline = trained("classes", replace(CONFIG, birch=BirchConfig(threshold=0.25)))
    objects = pipeline.detector.detect(to_grey(SHOWN[7].frame))
    classes = pipeline.classes(objects)
    _, columns = objects.centres_px.T
    rows = objects.boxes_px[:, 0]
    walls = (columns < 2) | (columns > 81)
    paddle = (rows == 79) & ~walls
    ball = ~walls & ~paddle
    kinds = [{*classes[which].tolist()} for which in (walls, paddle, ball)]
    assert all(kinds) and kinds[0].isdisjoint(kinds[1]) and kinds[1].isdisjoint(kinds[2])
    assert kinds[0].isdisjoint(kinds[2])


def test_semantic_sees_the_embedded_scene():
    pipeline = trained("embedding")
    objects = pipeline.detector.detect(to_grey(SHOWN[7].frame))
    graph = build_scene_graph(pipeline.classes(objects), objects.centres_px, CONFIG.scene.proximity_px)
    np.testing.assert_array_equal(pipeline.encode(SHOWN[7]), pipeline.embedder.transform(graph))
    assert len({pipeline.encode(o).tobytes() for o in SHOWN[:9]}) == 9  # no two states of a falling ball look alike


def test_the_vector_of_a_tracked_scene_follows_from_the_list_of_what_moves(tracked_run):
    steps = list(load_player(tracked_run).episode(0, 1))
    pipeline = load_player(tracked_run).pipeline
    vectors, facts = steps[0].state[0], pipeline.facts
    assert facts == slice(pipeline.embedder.dimension, pipeline.shape[0]) and len(vectors) > facts.stop  # then the goal
    assert len(pipeline.names) <= facts.stop - facts.start
    seen = 0
    for step in steps:
        listed = step.state[0][facts]
        kinds, centres = pipeline.roles.read(listed)
        scene = build_scene_graph(kinds, centres, pipeline.config.scene.proximity_px)
        np.testing.assert_array_equal(step.state[0][: facts.start], pipeline.embedder.transform(scene))
        np.testing.assert_array_equal(step.thought.moment.states[0], listed)
        seen += len(kinds)
    assert seen > len(steps) // 2


def test_without_a_map_the_list_is_not_shown(tiny):
    pipeline = build_trainer(tiny(pipeline__scene__tracked=True)).pipeline
    assert pipeline.follows and pipeline.shape == (16,) and pipeline.facts == slice(0, 16) and pipeline.names == ()


@pytest.mark.parametrize("omit_scenery", [False, True])
def test_scenery_is_only_left_out_when_asked_for(omit_scenery):
    scene = replace(CONFIG.scene, omit_scenery=omit_scenery)
    pipeline = trained("embedding", replace(CONFIG, birch=BirchConfig(threshold=0.25), scene=scene))
    seen = [pipeline.detector.detect(to_grey(observation.frame)) for observation in SHOWN]
    classes = pipeline.classes(seen[-1])
    everything = list(range(len(classes)))
    assert pipeline.shown(classes).tolist() == everything  # nothing was seen to stand still yet
    for objects in seen:
        pipeline.scenery.partial_fit(pipeline.classes(objects), objects.centres_px)
    moving = np.flatnonzero(~np.isin(classes, pipeline.scenery.still_)).tolist()
    assert 0 < len(moving) < len(everything)
    assert pipeline.shown(classes).tolist() == (moving if omit_scenery else everything)
    assert len(pipeline.scene(to_grey(SHOWN[-1].frame))) == len(pipeline.shown(classes))
    assert pipeline.shown(np.empty(0, np.int64)).shape == (0,)


def test_ram_sees_coordinates():
    pipeline = Pipeline(CONFIG, "ram", "pong")
    for observation in observations("PongNoFrameskip-v4", n=3):
        np.testing.assert_array_equal(pipeline.encode(observation), ram_features("pong", observation.ram))
    assert pipeline.shape == (4,) and pipeline.dtype == np.float32


@pytest.mark.parametrize("rom", [None, "breakout"])
def test_ram_needs_a_game_that_is_mapped(rom):
    with pytest.raises(UsageError, match=r"not mapped|no mapped RAM"):
        Pipeline(CONFIG, "ram", rom)


@pytest.mark.parametrize("view", VIEWS)
def test_encoding_learns_nothing_and_repeats(view):
    pipeline = trained(view)
    before = digest(pipeline.to_arrays())
    first = [pipeline.encode(o).tobytes() for o in SHOWN[:15]]
    assert [pipeline.encode(o).tobytes() for o in reversed(SHOWN[:15])] == first[::-1]
    assert digest(pipeline.to_arrays()) == before


@pytest.mark.parametrize("view", VIEWS)
def test_a_restored_pipeline_sees_the_same(view):
    pipeline, restored = trained(view), Pipeline(CONFIG, view)
    restored.from_arrays(pipeline.to_arrays())
    assert digest(restored.to_arrays()) == digest(pipeline.to_arrays())
    for observation in observations(n=20, seed=5):
        np.testing.assert_array_equal(restored.encode(observation), pipeline.encode(observation))


@pytest.mark.parametrize("view", VIEWS)
def test_a_black_frame_is_a_state_without_objects(view):
    pipeline = trained(view)
    encoded = pipeline.encode(Observation(frame=np.zeros((168, 168, 3), np.uint8)))
    assert encoded.shape == pipeline.shape and not encoded.any()


def test_the_extra_is_asked_for_only_where_it_is_needed(monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "semrl.perception.embedding.doc2vec.find_spec", lambda name: None if name == "gensim" else find_spec(name)
    )
    for view in ("grey", "components", "classes"):
        Pipeline(PipelineConfig(), view)
    with pytest.raises(MissingExtraError, match="pip install 'gensim"):
        Pipeline(PipelineConfig(), "embedding")


def test_crops_of_tracked_scenes_are_of_one_size_whatever_otsu_cuts():
    config = replace(CONFIG, detection=DetectionConfig(max_object_share=0.2))
    pipeline = Pipeline(config, "objects")
    pipeline.foreground.partial_fit(np.zeros((168, 168, 3), np.uint8))
    shown = [pipeline.foreground.detect(observation.frame) for observation in SHOWN]
    for objects in shown:
        pipeline.pca.partial_fit(objects.features)
    for objects in shown:
        pipeline.birch.partial_fit(pipeline.pca.transform(objects.features))
    assert all(len(pipeline.classes(objects)) == len(objects) for objects in shown)
