"""The whole upper line: the same bits however it is asked, and something sensible for whatever it is shown."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from seeing import schedule_of

from semrl.core.files import write_arrays
from semrl.envs import Game, make_env
from semrl.perception.embedding import (
    HashedEmbedding,
    HashedEmbeddingConfig,
    WordsConfig,
    build_scene_graph,
    position_words,
    wl_hashes,
)
from semrl.perception.embedding.words import word_hash
from semrl.perception.encoders import ENCODERS, Encoder
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.training import preset

QUICK = StabilityConfig(batches=4, max_batches=12)
PROCESS = """
import sys
import cv2, numpy as np
from semrl.core.arrays import digest
from semrl.core.files import read_arrays
from semrl.envs import Game, make_env
from semrl.perception.encoders import ENCODERS
from semrl.training import preset

name, learned, n, side_by_side, threads = *sys.argv[1:3], *map(int, sys.argv[3:])
cv2.setNumThreads(threads)
encoder = ENCODERS.load(name)(preset("semrl", "semantic").perception)
encoder.from_arrays(read_arrays(learned))
games = [Game(make_env(), seed=seed) for seed in range(2)]
rngs = [np.random.default_rng(seed) for seed in range(2)]
vectors = {}

def play(which, count):
    episode, observation = encoder.begin(), games[which].reset()
    for i in range(count):
        vectors[which, i] = episode.encode(observation).vector
        yield
        observation = games[which].step(int(rngs[which].integers(2))).observation

plays = [play(which, n) for which in range(2)]
if side_by_side:
    for _ in zip(*plays):
        pass
else:
    for one in plays:
        for _ in one:
            pass
print(digest({"vectors": np.stack([vectors[key] for key in sorted(vectors)])}))
"""


@pytest.fixture(scope="module", params=["scene", "tracked_scene"])
def encoder(request: pytest.FixtureRequest) -> tuple[str, Encoder]:
    """An encoder that saw some random play of Pong, and its name."""
    config = preset("semrl", "semantic").perception
    config = replace(
        config,
        otsu=replace(config.otsu, threshold_frames=10),
        scene=replace(config.scene, scenery_frames=60),
        foreground=replace(config.foreground, background_frames=100),
        slot_assigner=replace(config.slot_assigner, frames=100),
    )
    encoder = ENCODERS.load(request.param)(config)
    game, rng = Game(make_env(), seed=0), np.random.default_rng(0)
    schedule, observation, action = schedule_of(encoder, QUICK), game.reset(), None
    while schedule.current:
        schedule.learn(observation, action)
        action = int(rng.integers(2))
        observation = game.step(action).observation
    return request.param, encoder


def digests(encoder: tuple[str, Encoder], tmp_path: Path, frames: int) -> set[str]:
    learned = tmp_path / "learned.npz"
    write_arrays(learned, encoder[1].to_arrays())
    found = set()
    for hash_seed, side_by_side, threads in (("1", "0", "1"), ("2", "1", "2")):
        run = subprocess.run(
            [sys.executable, "-c", PROCESS, encoder[0], str(learned), str(frames), side_by_side, threads],
            env={**os.environ, "PYTHONHASHSEED": hash_seed, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        )
        found.add(run.stdout.strip())
    return found


def test_the_same_bits_in_every_process_episode_and_number_of_threads(
    encoder: tuple[str, Encoder], tmp_path: Path
) -> None:
    """Episodes one after the other, and side by side."""
    assert len(digests(encoder, tmp_path, 100)) == 1


@pytest.mark.slow
def test_the_same_bits_for_ten_thousand_frames(encoder: tuple[str, Encoder], tmp_path: Path) -> None:
    assert len(digests(encoder, tmp_path, 5_000)) == 1


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
