"""The gallery of a run: arrays that hold all a report shows of its perception."""

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from semrl.concepts import SceneBuilder
from semrl.concepts.scenes import CONCEPT
from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Image, Sight, State, StateSpace
from semrl.core.arrays import Arrays, json_to_array, nest, ragged_to_arrays
from semrl.core.files import write_arrays
from semrl.core.things import LEFT
from semrl.envs import Game
from semrl.evaluation.player import Player, load_player
from semrl.evaluation.rule_check import check_rules
from semrl.evaluation.rules import learned_of
from semrl.evaluation.sight import CLASS_COLOURS, look
from semrl.perception.detection import OtsuDetector
from semrl.perception.detection.grey import to_grey
from semrl.perception.encoders import Encoder
from semrl.perception.perception import Perception
from semrl.perception.reduction import ObjectPCA
from semrl.training.loop import Frames, play
from semrl.training.session import limited_threads

GALLERY_DECISIONS = 1000
GALLERY_SAMPLES = 4


def save_gallery(run: Path, seed: int) -> Path:
    """Play at random with a run's perception and write ``gallery.npz``: all that a report shows of it.

    The file holds ``frames (s, h, w, 3)``, ``greys (s, 84, 84)`` and, where the model has them, ``shown
    (s, 84, 84)`` or ``vectors (s, d)``, of which only the named numbers where there are names; ``boxes``,
    ``classes`` and ``edges`` of these frames as ragged arrays; ``threshold`` in grey levels;
    ``explained_variance_ratio``; ``n_clusters``, ``class_numbers (k,)``, ``centres (k, 8, 8)`` and
    ``class_counts (k,)``, how many objects of each class were seen; ``pictures/name (h, w, 3)``, a thing of each
    concept, as large as any was seen; ``palette (c, 3)``, the RGB that class i
    is drawn in (modulo c); and ``meta``, with what was learned of each concept.

    Parameters
    ----------
    run
        Folder of the run.
    seed
        Of the game and the random actions.
    """
    player = load_player(run)
    rng = np.random.default_rng(seed)
    counts: Counter[int] = Counter()
    samples: list[_Sample] = []
    pictures = _Pictures(player)
    best = -1.0
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        for i, sample in enumerate(_wander(Game(env, seed), player.encoder, rng)):
            sight = sample.sight
            counts.update(sight.classes.tolist())
            pictures.look(sample)
            richness = len(np.unique(sight.classes)) + len(sight.boxes_px) / 1000
            if i % (GALLERY_DECISIONS // GALLERY_SAMPLES) == 0:  # of each stretch the richest frame is kept
                samples.append(sample)
                best = richness
            elif richness > best:
                samples[-1], best = sample, richness
    meta = {
        "encoder": player.config.encoder_name,
        "names": player.encoder.space.names,
        "seed": seed,
        "decisions": player.decisions,
        "played": GALLERY_DECISIONS,
        "learned": [asdict(one) for one in learned_of(player, check_rules(player))],
    }
    learned = _learned(player.encoder.perception, counts) if player.encoder.perception else {}
    path = Path(run) / "gallery.npz"
    write_arrays(
        path,
        {
            "meta": json_to_array(meta),
            **_sampled(samples, player.encoder.space),
            **learned,
            **nest(pictures=pictures.found),
        },
    )
    return path


@dataclass(frozen=True, kw_only=True, slots=True)
class _Sample:
    """A frame, what an agent is shown of it (None where that is not learned), and what is seen in it."""

    frame: Frame
    state: State | None
    sight: Sight


class _Pictures:
    """Cuts a picture of each concept out of the frames: of its largest thing."""

    def __init__(self, player: Player) -> None:
        concepts = player.planning.concepts if player.planning else None
        self.concepts = concepts if concepts and concepts.is_fitted else None
        self.found: dict[str, Frame] = {}
        self._areas: dict[str, float] = {}

    def look(self, sample: _Sample) -> None:
        """Keep a picture of what is larger than all of its concept before."""
        things = None if sample.state is None else sample.state.things
        if self.concepts is None or things is None or not len(things):
            return
        names = self.concepts.table_.names
        objects = SceneBuilder(self.concepts).newest([things])
        for one, edges in zip(objects, things[:, LEFT:], strict=True):
            if one[CONCEPT] < 0:
                continue
            name = names[int(one[CONCEPT])]
            area = float(np.prod(edges[2:] - edges[:2]))
            if area > self._areas.get(name, 0.0):
                self._areas[name], self.found[name] = area, _cut(sample.frame, edges)


def _cut(frame: Frame, edges_px: Floats) -> Frame:
    """Return what lies between left, top, right and bottom, in pixels of the 84×84 image."""
    left, top, right, bottom = edges_px / IMAGE_SIZE_PX
    height, width = frame.shape[:2]
    rows = slice(int(top * height), max(int(np.ceil(bottom * height)), int(top * height) + 1))
    columns = slice(int(left * width), max(int(np.ceil(right * width)), int(left * width) + 1))
    return frame[rows, columns].copy()


def _wander(game: Game, encoder: Encoder, rng: np.random.Generator) -> Iterator[_Sample]:
    """Act at random and yield what is seen, over as many episodes as it takes."""
    seen = 0
    while True:
        episode = encoder.begin()
        for step in play(game, Frames(), lambda _: int(rng.integers(game.n_actions))):
            state, sight = look(episode, step.observation)
            yield _Sample(frame=step.observation.frame, state=state, sight=sight)
            seen += 1
            if seen == GALLERY_DECISIONS:
                return


def _sampled(samples: Sequence[_Sample], space: StateSpace) -> Arrays:
    """Write the sample frames and what is seen in them as arrays."""
    greys: list[Image] = [to_grey(sample.frame) for sample in samples]
    sights = [sample.sight for sample in samples]
    arrays: Arrays = {
        "frames": np.stack([sample.frame for sample in samples]),
        "greys": np.stack(greys),
        "palette": np.array(CLASS_COLOURS, np.uint8),
    }
    shown = [sample.state for sample in samples if sample.state is not None]
    if len(shown) == len(samples):
        named = len(space.names)  # numbers that people can read stand in the place of the vector
        arrays["shown" if len(space.shape) == 2 else "vectors"] = np.stack(
            [state.facts[:named] if named else state.vector for state in shown]
        )
    return arrays | nest(
        boxes=ragged_to_arrays([s.boxes_px for s in sights], like=np.empty((0, 4), np.int64)),
        classes=ragged_to_arrays([s.classes for s in sights], like=np.empty(0, np.int64)),
        edges=ragged_to_arrays([s.edges for s in sights], like=np.empty((0, 2), np.int64)),
    )


def _learned(perception: Perception, counts: Mapping[int, int]) -> Arrays:
    """Write what the stages of perception have learned, as far as they came."""
    arrays: Arrays = {}
    detector, reducer, clusterer = perception.detector, perception.reducer, perception.clusterer
    if isinstance(detector, OtsuDetector) and detector.is_fitted:
        arrays["threshold"] = np.array(detector.threshold_)
    if isinstance(reducer, ObjectPCA) and reducer.is_fitted:
        arrays["explained_variance_ratio"] = reducer.explained_variance_ratio_
    if clusterer.is_fitted:
        size = detector.crop_size_px
        arrays["class_numbers"] = clusterer.classes_
        arrays["centres"] = reducer.inverse_transform(clusterer.centres_).reshape(-1, size, size)
        arrays["class_counts"] = np.array([counts[number] for number in clusterer.classes_.tolist()])
        arrays["n_clusters"] = np.array(clusterer.n_clusters_)
    return arrays
