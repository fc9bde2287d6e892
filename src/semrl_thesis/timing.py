"""Stages that take turns, and what their times are written down as."""

import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

EMULATOR, ELEVATION, STACK, EMBEDDING = "emulator, 4 frames", "elevation", "thesis's stack", "embedding"
"""Names that others look for."""


@dataclass(frozen=True, slots=True)
class Stage:
    """Something to be timed: a call for each of its inputs, and what comes before a pass."""

    name: str
    call: Callable[[Any], Any]
    inputs: Sequence[Any]
    prepare: Callable[[], Any] = lambda: None
    frames: int = 1  # that one call takes


def medians(stages: Sequence[Stage], rounds: int) -> dict[str, float]:
    """Let stages take turns; return the median time of one frame in each, in seconds of one core."""
    times: dict[str, list[float]] = {stage.name: [] for stage in stages}
    for stage in stages:
        stage.call(stage.inputs[0])  # warm: compiled code, caches of libraries
    for _, stage in itertools.product(range(rounds), stages):
        stage.prepare()
        start = time.process_time()
        for given in stage.inputs:
            stage.call(given)
        times[stage.name].append((time.process_time() - start) / len(stage.inputs) / stage.frames)
    return {name: float(np.median(values)) for name, values in times.items()}


@dataclass(frozen=True, kw_only=True, slots=True)
class Speed:
    """What was measured; times in seconds of one core.

    Attributes
    ----------
    stages
        By name: one call of each stage, the whole elevation among them.
    by_objects
        Objects in a frame → one elevation, and one pass of the thesis's stack where it was asked for.
    by_vocabulary
        Different words → signed hashing of one scene.
    """

    stages: dict[str, float]
    by_objects: dict[int, dict[str, float]]
    by_vocabulary: dict[int, float]
