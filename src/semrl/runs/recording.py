"""Keeping what perception sees: a video of an episode, and a gallery of arrays for the report."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import cv2
import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

from semrl.arrays import Arrays, json_to_array, nest, ragged_to_arrays
from semrl.embedding import build_scene_graph
from semrl.errors import DataError, SemrlError, UsageError
from semrl.pipeline import Pipeline
from semrl.runs.evaluation import Step, load_player
from semrl.runs.files import write_arrays
from semrl.runs.session import limited_threads
from semrl.state import Game, ram_feature_names, to_grey
from semrl.types import IMAGE_SIZE_PX, Frame, Image, Ints, Observation

CLASS_COLOURS: tuple[tuple[int, int, int], ...] = (
    (59, 142, 234), (242, 169, 59), (53, 183, 121), (232, 87, 90), (167, 123, 220),
    (63, 193, 201), (241, 120, 182), (201, 201, 74), (181, 131, 90), (154, 165, 177),
)  # fmt: skip
"""RGB of class 0, 1, …; later classes begin again."""

VIDEO_RATE = 30
"""Decisions a second in videos: twice the speed of a game of 60 frames a second and frame skip 4."""
MAX_VIDEO_FRAMES = 60 * VIDEO_RATE
GALLERY_DECISIONS = 1000
GALLERY_SAMPLES = 4

_CODECS = ("libx264", "libopenh264", "mpeg4")  # the first that this build of FFmpeg has
_DARK, _LIGHT = 20, (214, 218, 224)
_GAP_PX, _LINE_PX = 24, 32


@dataclass(frozen=True, kw_only=True, slots=True)
class Sight:
    """What perception makes of one frame; everything it has not learned stays empty.

    Attributes
    ----------
    boxes_px
        ``(n, 4)`` int64, top, left, height and width in the 84×84 image.
    classes
        ``(n,)`` int64, or ``(0,)`` where objects have no classes.
    edges
        ``(m, 2)`` int64, pairs of objects that the scene graph joins.
    labels
        ``(84, 84)`` int64: 0 for the background, class + 1 for objects.
    seen
        What the agent is shown: an image, a vector, or None while that is not learned.
    """

    boxes_px: Ints
    classes: Ints
    edges: Ints
    labels: Ints
    seen: NDArray[Any] | None


def look(pipeline: Pipeline, observation: Observation) -> Sight:
    """Look at one frame as a run's perception does."""
    with contextlib.suppress(DataError):
        return _look(pipeline, observation, pipeline.encode(observation))
    return _look(pipeline, observation, None)


def _look(pipeline: Pipeline, observation: Observation, seen: NDArray[Any] | None) -> Sight:
    classes, edges = np.empty(0, np.int64), np.empty((0, 2), np.int64)
    if pipeline.view in ("grey", "ram") or not pipeline.detector.is_fitted:
        blank = np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX), np.int64)
        return Sight(boxes_px=np.empty((0, 4), np.int64), classes=classes, edges=edges, labels=blank, seen=seen)
    objects = pipeline.detector.detect(to_grey(observation.frame))
    if pipeline.birch.n_leaves_:
        classes = pipeline.classes(objects)
    if pipeline.view == "embedding" and len(classes):
        edges = build_scene_graph(classes, objects.centres_px, pipeline.config.scene.proximity_px).edges
    numbers = classes if len(classes) else np.zeros(len(objects), np.int64)
    labels = np.append(0, numbers + 1)[objects.labels]
    return Sight(boxes_px=objects.boxes_px, classes=classes, edges=edges, labels=labels, seen=seen)


@contextlib.contextmanager
def recorder(run: Path, video: Path | None) -> Iterator[Callable[[int, Step], None]]:
    """Make an observer for `evaluate` that films the first episode: the frame, and what is seen in it.

    Parameters
    ----------
    run
        Whose perception looks at the frames.
    video
        An ``.mp4`` file, written whole or not at all; a minute at most, later decisions are left out.
        None films nothing.

    Raises
    ------
    UsageError
        When the file is no ``.mp4`` or cannot be written, before anything is played.
    SemrlError
        When writing fails later (full disk).
    """
    if video is None:
        yield lambda _episode, _step: None
        return
    temporary = _writable(video)
    try:
        film = _Film(temporary, load_player(run).pipeline)
        with contextlib.closing(film):
            yield film.on_step
        if film.n_frames:
            temporary.replace(video)
    except av.FFmpegError as error:
        raise SemrlError(f"cannot write {video}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _writable(video: Path) -> Path:
    """Check that a video can be written; return its temporary name, where an empty file now lies."""
    if video.suffix.lower() != ".mp4":
        raise UsageError(f"--video must name an .mp4 file, not {video}")
    if video.is_dir():
        raise UsageError(f"cannot write {video}: it is a folder")
    temporary = video.with_name(video.name + ".tmp")
    try:
        temporary.write_bytes(b"")
    except OSError as error:
        raise UsageError(f"cannot write {video}: {error.strerror}") from None
    return temporary


class _Film:
    """A video that grows frame by frame."""

    def __init__(self, path: Path, pipeline: Pipeline) -> None:
        self.path = path
        self.pipeline = pipeline
        self.n_frames = 0
        self._file: Any = None

    def on_step(self, episode: int, step: Step) -> None:
        if episode > 0 or self.n_frames >= MAX_VIDEO_FRAMES:
            return
        picture = compose(self.pipeline, step, self.n_frames)
        if self._file is None:
            self._file = iio.imopen(self.path, "w", plugin="pyav", extension=".mp4", container="mp4")
            self._file.init_video_stream(_codec(), fps=VIDEO_RATE)
        self._file.write_frame(picture)
        self.n_frames += 1

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


def _codec() -> str:
    for name in _CODECS:
        with contextlib.suppress(ValueError):
            av.codec.Codec(name, "w")
            return name
    raise SemrlError(f"this build of FFmpeg has none of {', '.join(_CODECS)}; install another 'av' wheel")


def compose(pipeline: Pipeline, step: Step, decision: int) -> Frame:
    """Put a frame with marked objects beside what the agent sees of it; ``(h, w, 3)`` uint8, h and w even."""
    sight = look(pipeline, step.observation)
    left = _mark(step.observation.frame, sight)
    side = IMAGE_SIZE_PX * max(1, round(0.8 * left.shape[0] / IMAGE_SIZE_PX))
    right = _seen(pipeline, sight, side)
    height = max(left.shape[0], side) + _LINE_PX
    canvas = np.full((height + height % 2, left.shape[1] + _GAP_PX + side, 3), _DARK, np.uint8)
    canvas = canvas[:, : canvas.shape[1] // 2 * 2]
    canvas[: left.shape[0], : left.shape[1]] = left
    top = (height - _LINE_PX - side) // 2
    canvas[top : top + side, left.shape[1] + _GAP_PX :] = right[:, : canvas.shape[1] - left.shape[1] - _GAP_PX]
    _write(canvas, f"return {step.total:g}   decision {decision}", (8, height - 10))
    return canvas


def _mark(frame: Frame, sight: Sight) -> Frame:
    """Enlarge a frame and draw the boxes of its objects."""
    scale = max(1, round(480 / frame.shape[1]))
    large = cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    per_px = np.array(large.shape[:2] * 2) / IMAGE_SIZE_PX  # boxes are measured in the 84×84 image
    for i, (top, left, height, width) in enumerate(np.rint(sight.boxes_px * per_px).astype(int).tolist()):
        end = (left + width, top + height)
        cv2.rectangle(large, (left - 1, top - 1), end, _colour(sight.classes, i), 2, cv2.LINE_AA)
    return np.asarray(large, np.uint8)


def _seen(pipeline: Pipeline, sight: Sight, side: int) -> Frame:
    """Draw what the agent is shown: an image, the scene behind a vector, or the numbers themselves."""
    if sight.seen is not None and sight.seen.ndim == 2:
        grey = cv2.resize(sight.seen, (side, side), interpolation=cv2.INTER_NEAREST)
        return np.repeat(grey[:, :, None], 3, axis=2)
    palette = np.array([(0, 0, 0), *CLASS_COLOURS], np.uint8)
    numbers = np.where(sight.labels > 0, (sight.labels - 1) % len(CLASS_COLOURS) + 1, 0)
    panel: Frame = np.asarray(cv2.resize(palette[numbers], (side, side), interpolation=cv2.INTER_NEAREST), np.uint8)
    centres = (sight.boxes_px[:, :2] + sight.boxes_px[:, 2:] / 2)[:, ::-1] * (side / IMAGE_SIZE_PX)  # (n, 2) x, y
    points = np.rint(centres).astype(int).tolist()
    for first, second in sight.edges.tolist():
        cv2.line(panel, points[first], points[second], _LIGHT, 1, cv2.LINE_AA)
    if pipeline.view == "ram" and sight.seen is not None:
        for i, (name, value) in enumerate(zip(ram_feature_names(pipeline.rom), sight.seen, strict=True)):
            _write(panel, f"{name}  {value:.3f}", (16, 40 + 32 * i))
    return panel


def _colour(classes: Ints, i: int) -> tuple[int, int, int]:
    return CLASS_COLOURS[classes[i] % len(CLASS_COLOURS) if len(classes) else 0]


def _write(canvas: Frame, text: str, place: tuple[int, int]) -> None:
    cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.55, _LIGHT, 1, cv2.LINE_AA)


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
        for i, observation in enumerate(_wander(player.new_game(seed), rng)):
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
        "names": ram_feature_names(player.pipeline.rom) if player.pipeline.view == "ram" else (),
        "seed": seed,
        "decisions": player.decisions,
        "played": GALLERY_DECISIONS,
    }
    path = Path(run) / "gallery.npz"
    write_arrays(path, {"meta": json_to_array(meta), **_sampled(samples), **_learned(player.pipeline, counts)})
    return path


def _wander(game: Game, rng: np.random.Generator) -> Iterator[Observation]:
    """Act at random and yield what is seen, over as many episodes as it takes."""
    observation = game.reset()
    for _ in range(GALLERY_DECISIONS):
        yield observation
        outcome = game.step(int(rng.integers(game.n_actions)))
        observation = game.reset() if outcome.done else outcome.observation


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
        size = pipeline.detector.crop_size_px
        centres = pipeline.pca.inverse_transform(pipeline.birch.centres_).reshape(-1, size, size)
        arrays |= {"class_numbers": numbers, "centres": centres, "class_counts": counts[numbers]}
        arrays["n_leaves"] = np.array(pipeline.birch.n_leaves_)
    return arrays
