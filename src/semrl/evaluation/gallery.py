"""The gallery of a run: arrays that hold all a report shows of its perception."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from semrl.core import Image, Ints, Observation
from semrl.core.arrays import Arrays, json_to_array, nest, ragged_to_arrays
from semrl.core.files import write_arrays
from semrl.envs import Game
from semrl.evaluation.player import load_player
from semrl.evaluation.sight import CLASS_COLOURS, Sight, look
from semrl.perception.detection.grey import to_grey
from semrl.perception.pipeline import Pipeline
from semrl.training.session import limited_threads

GALLERY_DECISIONS = 1000
GALLERY_SAMPLES = 4


def save_gallery(run: Path, seed: int) -> Path:
    """Play at random with a run's perception and write ``gallery.npz``: all that a report shows of it.

    The file holds ``frames (s, h, w, 3)``, ``greys (s, 84, 84)`` and, where the model has them, ``seen
    (s, 84, 84)`` or ``vectors (s, d)``; ``boxes``, ``classes`` and ``edges`` of these frames as ragged
    arrays; ``threshold`` in grey levels; ``explained_variance_ratio``; ``n_leaves``, ``class_numbers
    (k,)``, ``centres (k, 8, 8)`` and ``class_counts (k,)``, how many objects of each class were seen;
    ``palette (c, 3)``, the RGB that class i is drawn in (modulo c); and ``meta``.

    Parameters
    ----------
    run
        Folder of the run.
    seed
        Of the game and the random actions.
    """
    player = load_player(run)
    rng = np.random.default_rng(seed)
    counts = np.zeros(player.config.pipeline.birch.max_classes, np.int64)
    samples: list[tuple[Observation, Sight]] = []
    best = -1.0
    with limited_threads(player.config.threads):
        for i, observation in enumerate(_wander(player.new_game(seed), player.pipeline, rng)):
            sight = look(player.pipeline, observation)
            counts += np.bincount(sight.classes, minlength=len(counts))
            richness = len(np.unique(sight.classes)) + len(sight.boxes_px) / 1000
            if i % (GALLERY_DECISIONS // GALLERY_SAMPLES) == 0:  # of each stretch the richest frame is kept
                samples.append((observation, sight))
                best = richness
            elif richness > best:
                samples[-1], best = (observation, sight), richness
    meta = {
        "view": player.pipeline.view,
        "names": player.pipeline.names,
        "seed": seed,
        "decisions": player.decisions,
        "played": GALLERY_DECISIONS,
    }
    path = Path(run) / "gallery.npz"
    write_arrays(path, {"meta": json_to_array(meta), **_sampled(samples), **_learned(player.pipeline, counts)})
    return path


def _wander(game: Game, pipeline: Pipeline, rng: np.random.Generator) -> Iterator[Observation]:
    """Act at random and yield what is seen, over as many episodes as it takes."""
    observation = None
    for _ in range(GALLERY_DECISIONS):
        if observation is None:
            pipeline.begin_episode()
            observation = game.reset()
        yield observation
        outcome = game.step(int(rng.integers(game.n_actions)))
        observation = None if outcome.done else outcome.observation


def _sampled(samples: Sequence[tuple[Observation, Sight]]) -> Arrays:
    """Write the sample frames and what is seen in them as arrays."""
    frames = [observation.frame for observation, _ in samples]
    sights = [sight for _, sight in samples]
    greys: list[Image] = [to_grey(frame) for frame in frames]
    arrays: Arrays = {
        "frames": np.stack(frames),
        "greys": np.stack(greys),
        "palette": np.array(CLASS_COLOURS, np.uint8),
    }
    seen = [sight.seen for sight in sights if sight.seen is not None]
    if len(seen) == len(samples):
        arrays["seen" if seen[0].ndim == 2 else "vectors"] = np.stack(seen)
    return arrays | nest(
        boxes=ragged_to_arrays([s.boxes_px for s in sights], like=np.empty((0, 4), np.int64)),
        classes=ragged_to_arrays([s.classes for s in sights], like=np.empty(0, np.int64)),
        edges=ragged_to_arrays([s.edges for s in sights], like=np.empty((0, 2), np.int64)),
    )


def _learned(pipeline: Pipeline, counts: Ints) -> Arrays:
    """Write what the stages of perception have learned, as far as they came."""
    arrays: Arrays = {}
    if pipeline.view in ("grey", "ram"):
        return arrays
    if pipeline.detector.is_fitted:
        arrays["threshold"] = np.array(pipeline.detector.threshold_)
    if pipeline.pca.is_fitted:
        arrays["explained_variance_ratio"] = pipeline.pca.explained_variance_ratio_
    if pipeline.birch.n_leaves_:
        numbers = pipeline.birch.classes_
        size = pipeline.crop_size_px
        centres = pipeline.pca.inverse_transform(pipeline.birch.centres_).reshape(-1, size, size)
        arrays |= {"class_numbers": numbers, "centres": centres, "class_counts": counts[numbers]}
        arrays["n_leaves"] = np.array(pipeline.birch.n_leaves_)
    return arrays
