"""Sprites that blink: drawn in some of the frames of a skip only, they may be in none of those that are shown.

The emulator's hardware draws few sprites a line, so games with more draw them in turns. The pixel-wise maximum over the
last frames (Mnih et al. 2015) shows those that are brighter than what is behind them; what differs most from the
background shows them all. Where nothing blinks, either only draws trails behind what moves.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import cv2
import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.envs.actions import Env

Pooling = Literal["brightest", "farthest"]
"""What of several frames is shown at a pixel: the brightest, or what is farthest from the background."""

SEEDS, DECISIONS = 4, 120
"""Episodes and random decisions of each that are played for a look: much begins to blink only after a while, or does so
in some games and not in others."""

EVERY = 8
"""Of these decisions, a pair of neighbours in so many is looked at."""

BLINKING = 0.01
"""Share of what is lit that may blink unseen; more, and an environment is said to blink."""

_SURELY = 0.6
"""So much of that share is allowed where frames are chosen, since longer play may blink more."""

STEADY_FRAMES = 8
"""What a pixel shows for so many frames is behind what blinks, which changes sooner."""

STEP_PX = 3
"""What moves goes at most so far in one frame; what is no nearer to anything lit in the next frame has vanished."""

MOST_PIXELS = 40_000
"""Of a frame that are looked at: rows and columns of larger ones are left out evenly."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Flicker:
    """What the frames of a skip light, as shares of all pixels that are lit in any of them.

    Attributes
    ----------
    unshown
        Lit in some frame and not in what is shown: it blinked, moved on, or ended.
    blinking
        Of these, pixels of things that blink: they vanished within the skip and are back in the next.
    trails
        Shown, though what was lit there had moved on.
    """

    unshown: float
    blinking: float
    trails: float


def brightest(frames: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return the pixel-wise maximum of frames."""
    shown: NDArray[np.uint8] = np.maximum.reduce(list(frames))
    return shown


class Ground:
    """What is behind the things that move or blink, followed from frame to frame of an episode.

    Parameters
    ----------
    background
        ``(h, w, 3)``, as far as is known at the beginning, or smaller where rows and columns were left out evenly.
    frame
        ``(h, w, 3)``, the first.

    Attributes
    ----------
    colours : ndarray
        ``(h, w, 3)`` uint8.
    """

    def __init__(self, background: NDArray[np.uint8], frame: NDArray[np.uint8]) -> None:
        height, width = frame.shape[:2]
        stride = -(-height // background.shape[0])
        self.colours = background.repeat(stride, axis=0)[:height].repeat(stride, axis=1)[:, :width].copy()
        self._last, self._steady = frame.copy(), np.ones((height, width), np.int64)

    def see(self, frame: NDArray[np.uint8]) -> None:
        """Take in the next frame."""
        self._steady = np.where((frame == self._last).all(axis=-1), self._steady + 1, 1)
        settled = self._steady >= STEADY_FRAMES
        self.colours[settled] = frame[settled]
        self._last = frame.copy()


def flicker(
    frames: NDArray[np.uint8], grounds: Sequence[NDArray[np.uint8]] | None = None, *, pairs: bool = False
) -> tuple[Flicker, ...]:
    """Measure what is seen of all frames by pooling the last one, the last two, and so on, of each skip.

    A pixel is lit where it differs from its most frequent colour.

    Parameters
    ----------
    frames
        ``(decisions, skip, h, w, 3)``, every frame of every decision, in order.
    grounds
        ``(h, w, 3)`` for each decision, from which what is shown is `farthest`; the `brightest` is shown when None.
    pairs
        Whether only every second decision follows the one before, as `look` has them.
    """
    skip = frames.shape[1]
    background = background_of(frames)
    lit = [(one != background).any(axis=-1) for one in frames]
    counts = np.zeros((skip, 4), np.int64)
    for i in range(0, len(frames) - 1, 2 if pairs else 1):
        one, mask, later = frames[i], lit[i], lit[i + 1]
        gone, union = _gone(mask), mask.any(axis=0)
        back = gone & ~_things(gone, away_from=np.asarray(later.any(axis=0)))
        for number in range(1, skip + 1):
            last = list(one[-number:])
            pooled = brightest(last) if grounds is None else farthest(last, grounds[i])
            shown = (pooled != background).any(axis=-1)
            parts = union, union & ~shown, back & ~shown, shown & ~mask[-1] & ~gone
            counts[number - 1] += [np.count_nonzero(part) for part in parts]
    shares = counts[:, 1:] / np.maximum(counts[:, :1], 1)
    return tuple(Flicker(unshown=u, blinking=b, trails=t) for u, b, t in shares.tolist())


def background_of(frames: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the most frequent colour of each pixel, ``(h, w, 3)``, of ``(decisions, skip, h, w, 3)`` frames."""
    n, skip = frames.shape[:2]
    return _most_frequent(frames[np.arange(n), np.arange(n) % skip])


def needed_frames(measured: Sequence[Flicker]) -> tuple[int, Pooling]:
    """Return how many frames of a skip must be pooled so that what blinks is seen, and how; 1 where nothing does."""
    for number, each in enumerate(measured, 1):
        if each.blinking <= _SURELY * BLINKING:
            return number, "brightest"
    return len(measured), "farthest"


def farthest(frames: Sequence[NDArray[np.uint8]], background: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return at each pixel what is farthest from the background in colour; of equal ones the latest.

    Parameters
    ----------
    frames
        ``(h, w, 3)`` each, in order.
    background
        ``(h, w, 3)``.
    """
    latest = np.stack(frames[::-1])
    choice = np.abs(latest - background.astype(np.int16)).sum(axis=-1).argmax(axis=0)
    shown: NDArray[np.uint8] = np.take_along_axis(latest, choice[None, ..., None], axis=0)[0]
    return shown


def look(env: Env, skip: int) -> NDArray[np.uint8]:
    """Play as `watch` does from several seeds, and return pairs of neighbours, one after the other."""
    plays = [watch(env, skip, seed, DECISIONS, keep=lambda i: i % EVERY < 2) for seed in range(SEEDS)]
    return np.concatenate(plays)


def watch(
    env: Env, skip: int, seed: int, decisions: int, keep: Callable[[int], bool] = lambda _: True
) -> NDArray[np.uint8]:
    """Play at random, each action for some frames, and return ``(decisions, skip, h, w, 3)``, every frame.

    Parameters
    ----------
    env
        Shows RGB frames, one a step, or is the emulator's, however many frames it skips. It is to be reset afterwards.
    skip
        Frames for which an action is held.
    seed
        Of the episode and of the actions.
    decisions
        To be played; an episode that ends is begun anew.
    keep
        Whether a decision's frames are to be returned, by its number.
    """
    rng = np.random.default_rng(seed)
    frame = env.reset(seed=seed)[0]
    stride = int(np.ceil(np.sqrt(frame.shape[0] * frame.shape[1] / MOST_PIXELS)))
    step = _Emulator(env, rng) if hasattr(env.unwrapped, "ale") else _Stepping(env, seed)
    seen = []
    for number in range(decisions):
        frames = [step.frame(hold=i > 0)[::stride, ::stride] for i in range(skip)]
        if keep(number):
            seen.append(frames)
    return np.array(seen, np.uint8)


class _Emulator:
    """Frame after frame of an Atari game."""

    def __init__(self, env: Env, rng: np.random.Generator) -> None:
        self.ale = env.unwrapped.ale  # type: ignore[attr-defined]
        self.actions, self.rng = self.ale.getMinimalActionSet(), rng

    def frame(self, *, hold: bool) -> NDArray[np.uint8]:
        """Go on by a frame, with the action before or another one, and return what is shown."""
        if not hold:
            if self.ale.game_over():
                self.ale.reset_game()
            self.action = self.actions[self.rng.integers(len(self.actions))]
        self.ale.act(self.action)
        screen: NDArray[np.uint8] = self.ale.getScreenRGB()
        return screen


class _Stepping:
    """Frame after frame of any other environment."""

    def __init__(self, env: Env, seed: int) -> None:
        self.env, self.done, self.seed = env, False, seed
        self.space: gym.Space[object] = env.action_space
        self.space.seed(seed)

    def frame(self, *, hold: bool) -> NDArray[np.uint8]:
        """Go on by a frame, with the action before or another one, and return what is shown."""
        if self.done:
            self.seed, self.done = self.seed + 1, False
            return np.asarray(self.env.reset(seed=self.seed)[0])
        if not hold:
            self.action = self.space.sample()
        frame, _, terminated, truncated, _ = self.env.step(self.action)
        self.done = bool(terminated or truncated)
        return np.asarray(frame)


def _most_frequent(frames: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the ``(h, w, 3)`` colour that each pixel has most often, of equal ones the darkest."""
    codes = frames.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
    ordered = np.sort(codes, axis=0)
    length = np.ones(ordered.shape[1:], np.int64)
    longest, best = length.copy(), ordered[0].copy()
    for before, now in pairwise(ordered):
        length = np.where(now == before, length + 1, 1)
        longer = length > longest
        longest[longer], best[longer] = length[longer], now[longer]
    return np.stack([best >> 16 & 255, best >> 8 & 255, best & 255], axis=-1).astype(np.uint8)


def _gone(lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the ``(h, w)`` pixels of what vanished in ``(skip, h, w)`` frames, and did not only move."""
    gone: NDArray[np.bool_] = np.zeros_like(lit[0])
    for before, now in pairwise(lit):
        gone = _things(gone | before, away_from=now)
    return gone


def _things(lit: NDArray[np.bool_], *, away_from: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels of those connected things that are not within a step of anything else that is lit."""
    if not lit.any():
        return lit
    number, labels = cv2.connectedComponents(lit.astype(np.uint8), connectivity=8)
    size = 2 * STEP_PX + 1
    near = cv2.dilate(away_from.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
    touched = np.zeros(number, bool)
    touched[labels[near]] = True
    touched[0] = True
    alone: NDArray[np.bool_] = ~touched[labels]
    return alone
