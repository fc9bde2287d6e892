"""A video of an episode: the frame with its objects and what the planner imagines, beside what the agent sees."""

import contextlib
import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from PIL import Image as Picture

from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Ints, Sight, StateSpace
from semrl.core.beside import in_turn
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import temporary_name
from semrl.evaluation.player import load_player
from semrl.evaluation.sight import CLASS_COLOURS, look
from semrl.training.loop import Step

VIDEO_RATE = 30
"""Decisions a second in videos: twice the speed of a game of 60 frames a second and frame skip 4."""
MAX_VIDEO_FRAMES = 300 * VIDEO_RATE
GIF_RATE = 15
"""Pictures a second in a GIF, every other decision."""
MAX_GIF_FRAMES = 12 * GIF_RATE

_CODECS = ("libx264", "libopenh264", "mpeg4")  # the first that this build of FFmpeg has
_QUICKLY = {"preset": "veryfast"}
"""Options of libx264 that the others do not know: its usual effort takes twice the processor time of this."""
_MOST_WAITING = 512
"""Moments that play may be ahead of the film, 0.1 MB each in a game of Atari."""
_DARK, _LIGHT = 20, (214, 218, 224)
_GAP_PX, _LINE_PX = 24, 32


@contextlib.contextmanager
def recorder(run: Path, video: Path | None) -> Iterator[Callable[[int, Step], None]]:
    """Make an observer for `evaluate` that films the first episode: the frame, and what is seen in it.

    Parameters
    ----------
    run
        Whose perception looks at the frames.
    video
        An ``.mp4`` or ``.gif`` file, written whole or not at all; five minutes at most, twelve seconds at half the size
        of a GIF; later decisions are left out. None films nothing.

    Raises
    ------
    UsageError
        When the file is no ``.mp4`` or ``.gif`` or cannot be written, before anything is played.
    SemrlError
        When writing fails later (full disk).
    """
    if video is None:
        yield lambda _episode, _step: None
        return
    with _filming(video) as film:
        encoder = load_player(run).encoder
        eyes = encoder.begin()

        def on_step(episode: int, step: Step) -> None:
            if episode == 0 and step.number < MAX_VIDEO_FRAMES:
                film(encoder.space, step, look(eyes, step.observation)[1])

        yield on_step


def write_video(video: Path, space: StateSpace, moments: Iterable[tuple[Step, Sight]]) -> None:
    """Write what was played and seen as an ``.mp4`` or ``.gif`` file; see `recorder`."""
    with _filming(video) as film:
        for step, sight in itertools.islice(moments, MAX_VIDEO_FRAMES):
            film(space, step, sight)


@contextlib.contextmanager
def _filming(video: Path) -> Iterator[Callable[[StateSpace, Step, Sight], None]]:
    """Give a function that films a moment, beside play; the film is the file when the block ends well, and only then.

    Drawing and writing a picture takes longer than the decision that it shows.
    """
    temporary = _writable(video)
    try:
        kind = _Gif if video.suffix.lower() == ".gif" else _Film
        with contextlib.closing(kind(temporary)) as film, in_turn(_MOST_WAITING) as later:
            yield lambda space, step, sight: later(lambda: film.add(compose(space, step, sight)))
        if film.n_frames:
            temporary.replace(video)
    except av.FFmpegError as error:
        raise SemrlError(f"cannot write {video}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _writable(video: Path) -> Path:
    """Check that a video can be written; return its temporary name, where an empty file now lies."""
    if video.suffix.lower() not in (".mp4", ".gif"):
        raise UsageError(f"--video must name an .mp4 or .gif file, not {video}")
    if video.is_dir():
        raise UsageError(f"cannot write {video}: it is a folder")
    temporary = temporary_name(video)
    try:
        temporary.write_bytes(b"")
    except OSError as error:
        raise UsageError(f"cannot write {video}: {error.strerror}") from None
    return temporary


class _Film:
    """A video that grows frame by frame."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.n_frames = 0
        self._file: Any = None
        self._stream: Any = None

    def add(self, picture: Frame) -> None:
        self._add(picture)
        self.n_frames += 1

    def _add(self, picture: Frame) -> None:
        if self._file is None:
            self._file = av.open(str(self.path), "w", format="mp4")
            self._stream = self._file.add_stream(_codec(), rate=VIDEO_RATE, options=_QUICKLY)
            self._stream.height, self._stream.width, self._stream.pix_fmt = *picture.shape[:2], "yuv420p"
        self._file.mux(self._stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))

    def close(self) -> None:
        if self._file is not None:
            self._file.mux(self._stream.encode(None))
            self._file.close()


class _Gif(_Film):
    """A short animated picture, for pages that show no videos."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._pictures: list[Picture.Image] = []

    def _add(self, picture: Frame) -> None:
        if self.n_frames % (VIDEO_RATE // GIF_RATE) == 0 and len(self._pictures) < MAX_GIF_FRAMES:
            half = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
            self._pictures.append(Picture.fromarray(half).quantize(64))

    def close(self) -> None:
        if self._pictures:
            first, *rest = self._pictures
            first.save(self.path, format="GIF", save_all=True, append_images=rest, duration=1000 // GIF_RATE, loop=0)


def _codec() -> str:
    for name in _CODECS:
        with contextlib.suppress(ValueError):
            av.codec.Codec(name, "w")
            return name
    raise SemrlError(f"this build of FFmpeg has none of {', '.join(_CODECS)}; install another 'av' wheel")


def compose(space: StateSpace, step: Step, sight: Sight) -> Frame:
    """Put a frame with marked objects beside what the agent is shown of it; ``(h, w, 3)`` uint8, h and w even."""
    left = _mark(step.observation.frame, sight)
    _draw_plan(left, space, step)
    side = IMAGE_SIZE_PX * max(1, round(0.8 * left.shape[0] / IMAGE_SIZE_PX))
    right = _shown(space, step, sight, side)
    height = max(left.shape[0], side) + _LINE_PX
    canvas = np.full((height + height % 2, left.shape[1] + _GAP_PX + side, 3), _DARK, np.uint8)
    canvas = canvas[:, : canvas.shape[1] // 2 * 2]
    canvas[: left.shape[0], : left.shape[1]] = left
    top = (height - _LINE_PX - side) // 2
    canvas[top : top + side, left.shape[1] + _GAP_PX :] = right[:, : canvas.shape[1] - left.shape[1] - _GAP_PX]
    _write(canvas, f"return {step.total:g}   decision {step.number}", (8, height - 10))
    return canvas


def _mark(frame: Frame, sight: Sight) -> Frame:
    """Enlarge a frame and draw the boxes of its objects."""
    scale = max(1, round(480 / frame.shape[1]))
    large: Frame = np.asarray(cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST), np.uint8)
    per_px = np.array(large.shape[:2] * 2) / IMAGE_SIZE_PX  # boxes are measured in the 84×84 image
    for i, (top, left, height, width) in enumerate(np.rint(sight.boxes_px * per_px).astype(int).tolist()):
        end = (left + width, top + height)
        cv2.rectangle(large, (left - 1, top - 1), end, _colour(sight.classes, i), 2, cv2.LINE_AA)
        if sight.names:
            _write(large, sight.names[i], (min(end[0] + 6, large.shape[1] - 96), top + height // 2))
    return large


def _draw_plan(canvas: Frame, space: StateSpace, step: Step) -> None:
    """Draw the way that the best scenario predicts for each object whose place is among the facts."""
    for way in imagined_ways(space, step):
        places = np.rint(way * (canvas.shape[1] - 1, canvas.shape[0] - 1)).astype(np.int32)
        cv2.polylines(canvas, [places], False, _LIGHT, 1, cv2.LINE_AA)
        for place in places[1:].tolist():
            cv2.circle(canvas, place, 2, _LIGHT, -1, cv2.LINE_AA)


def imagined_ways(space: StateSpace, step: Step) -> list[Floats]:
    """Return the way that the best scenario predicts for each object that it moves.

    Returns
    -------
    list of ndarray
        ``(t + 1, 2)`` float32 each: x and y as shares of the frame, the present place first. There are none where there
        is no plan, or no object's place is among the facts.
    """
    if step.record is None or step.record.plan is None or space.axes is None:
        return []
    states = np.concatenate([step.record.history.states[:1], step.record.plan.scenarios.states[0]])  # (t + 1, k)
    places = [
        states[:, x : x + 2]
        for x in np.flatnonzero(space.axes[:-1] == 0)[: len(space.names)].tolist()
        if space.axes[x + 1] == 1
    ]
    return [way for way in places if np.ptp(way, axis=0).any()]


def _shown(space: StateSpace, step: Step, sight: Sight, side: int) -> Frame:
    """Draw what the agent is shown: an image, the scene behind a vector, or, without one, the facts themselves."""
    if step.state is not None and step.state.vector.ndim == 2:
        grey = cv2.resize(step.state.vector, (side, side), interpolation=cv2.INTER_NEAREST)
        return np.repeat(grey[:, :, None], 3, axis=2)
    palette = np.array([(0, 0, 0), *CLASS_COLOURS], np.uint8)
    numbers = np.where(sight.labels > 0, (sight.labels - 1) % len(CLASS_COLOURS) + 1, 0)
    panel: Frame = np.asarray(cv2.resize(palette[numbers], (side, side), interpolation=cv2.INTER_NEAREST), np.uint8)
    centres = (sight.boxes_px[:, :2] + sight.boxes_px[:, 2:] / 2)[:, ::-1] * (side / IMAGE_SIZE_PX)  # (n, 2) x, y
    points = np.rint(centres).astype(int).tolist()
    for first, second in sight.edges.tolist():
        cv2.line(panel, points[first], points[second], _LIGHT, 1, cv2.LINE_AA)
    if step.state is not None and space.names and not len(sight.boxes_px):
        for i, (name, value) in enumerate(zip(space.names, step.state.facts, strict=False)):
            _write(panel, f"{name}  {value:.3f}", (16, 40 + 32 * i))
    return panel


def _colour(classes: Ints, i: int) -> tuple[int, int, int]:
    return CLASS_COLOURS[classes[i] % len(CLASS_COLOURS) if len(classes) else 0]


def _write(canvas: Frame, text: str, place: tuple[int, int]) -> None:
    cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.55, _LIGHT, 1, cv2.LINE_AA)
