"""The whole upper line: the same bits however it is asked, and something sensible for whatever it is shown."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semrl.core import Observation
from semrl.core.errors import DataError
from semrl.core.files import write_arrays
from semrl.envs import Game, make_env
from semrl.perception.config import PipelineConfig
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import (
    HashedEmbedding,
    HashedEmbeddingConfig,
    WordsConfig,
    build_scene_graph,
    position_words,
    wl_hashes,
)
from semrl.perception.embedding.word_hashes import word_hash
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.training import preset
from semrl_thesis.perception import by_frame

QUICK = StabilityConfig(batches=4, max_batches=12)
PROCESS = """
import sys
import cv2, numpy as np
from semrl.core.arrays import digest
from semrl.perception.pipeline import Pipeline
from semrl_thesis.perception import by_frame
from semrl.core.files import read_arrays
from semrl.envs import Game, make_env
from semrl.core import Observation

learned, n, batch, threads = sys.argv[1], *map(int, sys.argv[2:])
cv2.setNumThreads(threads)
pipeline = Pipeline(by_frame("semrl").pipeline, "embedding")
pipeline.from_arrays(read_arrays(learned))
game, rng, seen = Game(make_env(), seed=1), np.random.default_rng(1), []
observation = game.reset()
vectors = []
for _ in range(n):
    seen.append(observation)
    outcome = game.step(int(rng.integers(2)))
    observation = game.reset() if outcome.done else outcome.observation
    if len(seen) == batch:
        vectors.append(pipeline.encode_batch(seen))
        seen = []
vectors.append(pipeline.encode_batch(seen))
print(digest({"vectors": np.concatenate(vectors)}))
"""


@pytest.fixture(scope="module")
def pipeline() -> Pipeline:
    """Perception that saw some random play of Pong."""
    config = by_frame("semrl").pipeline
    return schooled(
        replace(
            config,
            detection=replace(config.detection, threshold_frames=10),
            scene=replace(config.scene, scenery_frames=60),
        )
    )


@pytest.fixture(scope="module")
def tracked() -> Pipeline:
    """The same for scenes of tracked objects."""
    config = preset("semrl", "semantic").pipeline
    foreground, roles = replace(config.foreground, background_frames=100), replace(config.roles, frames=100)
    return schooled(replace(config, foreground=foreground, roles=roles))


def schooled(config: PipelineConfig) -> Pipeline:
    pipeline, game, rng = Pipeline(config, "embedding"), Game(make_env(), seed=0), np.random.default_rng(0)
    schooling, observation = Schooling(pipeline, QUICK), game.reset()
    while schooling.current:
        schooling.learn(observation)
        observation = game.step(int(rng.integers(2))).observation
    return pipeline


def digests(pipeline: Pipeline, tmp_path: Path, frames: int) -> set[str]:
    learned = tmp_path / "learned.npz"
    write_arrays(learned, pipeline.to_arrays())
    found = set()
    for hash_seed, batch, threads in (("1", "1", "1"), ("2", "7", "2")):
        run = subprocess.run(
            [sys.executable, "-c", PROCESS, str(learned), str(frames), batch, threads],
            env={**os.environ, "PYTHONHASHSEED": hash_seed, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        )
        found.add(run.stdout.strip())
    return found


def test_the_same_bits_in_every_process_batch_and_number_of_threads(pipeline: Pipeline, tmp_path: Path) -> None:
    assert len(digests(pipeline, tmp_path, 200)) == 1


@pytest.mark.slow
def test_the_same_bits_for_ten_thousand_frames(pipeline: Pipeline, tmp_path: Path) -> None:
    assert len(digests(pipeline, tmp_path, 10_000)) == 1


def test_several_at_once_are_one_after_the_other(pipeline: Pipeline) -> None:
    rng = np.random.default_rng(0)
    seen = [Observation(frame=rng.integers(0, 256, (210, 160, 3)).astype(np.uint8)) for _ in range(3)]
    one_by_one = np.stack([pipeline.encode(one) for one in seen])
    np.testing.assert_array_equal(pipeline.encode_batch(seen), one_by_one)
    assert pipeline.encode_batch([]).shape == (0, 128)


def test_classes_that_are_remembered_are_forgotten_when_more_is_learned(pipeline: Pipeline) -> None:
    copy, fresh = (Pipeline(pipeline.config, "embedding") for _ in range(2))
    copy.from_arrays(pipeline.to_arrays())
    game = Game(make_env(), seed=3)
    game.reset()
    frames = [game.step(0).observation.frame for _ in range(70)]
    objects = copy.detector.detect(to_grey(frames[-1]))
    before = copy.classes(objects)
    reduced = copy.pca.transform(objects.features)
    copy.birch.partial_fit(np.concatenate([reduced + shift for shift in (0.1, 3.0, 9.0)]))
    for box in (copy.birch, copy.pca):  # learned, then restored: both count as something new
        fresh.from_arrays(copy.to_arrays())
        np.testing.assert_array_equal(copy.classes(objects), fresh.classes(objects))
        box.from_arrays(getattr(pipeline, "birch" if box is copy.birch else "pca").to_arrays())
    np.testing.assert_array_equal(copy.classes(objects), before)


NOISE = np.random.default_rng(0).integers(0, 2, (42, 42)).astype(np.uint8) * 255


@pytest.mark.parametrize(
    "frame",
    [
        np.zeros((210, 160, 3), np.uint8),
        np.full((210, 160, 3), 255, np.uint8),
        np.full((33, 500, 3), (12, 200, 7), np.uint8),
        np.kron(np.ones((42, 42), np.uint8) * 255, np.array([[1, 0], [0, 0]], np.uint8))[..., None].repeat(3, axis=2),
        np.kron(NOISE, np.ones((5, 5), np.uint8))[..., None].repeat(3, axis=2),
        np.zeros((1, 1, 3), np.uint8),
    ],
    ids=["black", "white", "one colour, other size", "1764 dots", "noise, other size", "one pixel"],
)
def test_whatever_is_shown_has_a_finite_vector(pipeline: Pipeline, frame: np.ndarray) -> None:
    first = pipeline.encode(Observation(frame=frame))
    assert first.shape == (128,) and first.dtype == np.float32 and np.isfinite(first).all()
    np.testing.assert_array_equal(pipeline.encode(Observation(frame=frame)), first)


@pytest.mark.parametrize("what", ["black", "white", "noise"])
def test_tracked_scenes_of_strange_frames_have_finite_vectors(tracked: Pipeline, what: str) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (210, 160, 3)).astype(np.uint8)
    frame = {"black": np.zeros_like(noise), "white": np.full_like(noise, 255), "noise": noise}[what]
    tracked.begin_episode()
    for _ in range(8):
        vector = tracked.encode(Observation(frame=frame))
        assert vector.shape == (128,) and vector.dtype == np.float32 and np.isfinite(vector).all()


def test_tracked_scenes_are_of_frames_of_one_size(tracked: Pipeline) -> None:
    with pytest.raises(DataError, match="the background is of frames") as error:
        tracked.encode(Observation(frame=np.zeros((33, 500, 3), np.uint8)))
    assert "\n" not in str(error.value)


def test_a_frame_without_objects_is_zeros(pipeline: Pipeline) -> None:
    assert not pipeline.encode(Observation(frame=np.zeros((210, 160, 3), np.uint8))).any()


@pytest.mark.parametrize(
    "frame",
    [
        np.full((210, 160, 3), np.nan),
        np.zeros((210, 160), np.uint8),
        np.zeros((210, 160, 4), np.uint8),
        np.zeros((0, 160, 3), np.uint8),
    ],
    ids=["not a number", "grey", "four channels", "empty"],
)
def test_what_is_no_frame_is_told_in_one_line(pipeline: Pipeline, frame: np.ndarray) -> None:
    with pytest.raises(DataError) as error:
        pipeline.encode(Observation(frame=frame))
    assert "\n" not in str(error.value)


def test_five_thousand_objects_and_words_never_met_have_a_vector() -> None:
    rng = np.random.default_rng(0)
    scene = build_scene_graph(rng.integers(0, 900, 5000), rng.uniform(-3000, 3000, (5000, 2)), 20.0)
    vector = HashedEmbedding().transform(scene)
    assert np.isfinite(vector).all() and vector.any()


def readable(scene, config: HashedEmbeddingConfig) -> np.ndarray:
    """Signed hashing as its definition says it: word by word, position by position."""
    total = np.zeros(config.dimension)

    def count(word: str, weight: float) -> None:
        index, negative = divmod(word_hash(word, config.seed), 2)
        total[index % config.dimension] += -weight if negative else weight

    reach = config.spread_px
    window = [1.0] if not reach else [max(0.0, 1 - abs(p) / reach) for p in range(-40, 41)]
    length = np.sqrt(np.square(window).sum()) * np.sum(window)
    for number, centre, hashes in zip(
        scene.classes.tolist(), scene.centres_px, wl_hashes(scene, config.words.wl_iterations), strict=True
    ):
        row, column = np.round(centre * 2) / 2
        count(str(number), length)
        for word in hashes:
            count(word, length * config.neighbourhood_weight)
        for r in range(int(row) - 40, int(row) + 41) if reach else [int(row)]:
            for c in range(int(column) - 40, int(column) + 41) if reach else [int(column)]:
                weight = max(0.0, 1 - abs(r - row) / reach) * max(0.0, 1 - abs(c - column) / reach) if reach else 1.0
                for word in position_words(number, r, c, config.words)[1:] if weight else ():
                    count(word, weight)
    return total / (length * np.sqrt(config.words.words_per_object))


@pytest.mark.parametrize("spread_px", [0.0, 1.0, 2.5, 6.0])
def test_the_embedding_is_what_its_definition_says(spread_px: float) -> None:
    rng = np.random.default_rng(3)
    config = HashedEmbeddingConfig(
        spread_px=spread_px, neighbourhood_weight=0.25, words=WordsConfig(coarse_px=3), seed=9
    )
    scene = build_scene_graph(rng.integers(0, 9, 5), rng.uniform(-10, 84, (5, 2)), 20.0)
    np.testing.assert_allclose(HashedEmbedding(config).transform(scene), readable(scene, config), atol=0.02, rtol=0.02)
