"""Whether memory stays flat while frames are elevated: resident memory every 100,000 frames, and its slope.

Perception has the settings of the preset ``semrl`` and is trained on random play of Pong until it is stable. Then the
emulator plays on, at random, and every frame that it shows is elevated; the first 100,000 fill what is remembered.

    python benchmarks/memory.py [--frames N] [--json]
"""

import json
import os
import resource
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from rich.console import Console

from semrl.training.session import limited_threads
from semrl_thesis.speed import learn_to_see

STRETCH_FRAMES = 100_000


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Elevate many frames and watch the memory."""

    frames: int = 1_000_000
    """How many, at least 300,000."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Elevate, look, tell."""
    console = Console(stderr=True)
    with limited_threads(1):
        encoder, play = learn_to_see(seed=0)
        episode = encoder.begin()
        megabytes = []
        for _ in range(max(arguments.frames, 3 * STRETCH_FRAMES) // STRETCH_FRAMES):
            for _ in range(STRETCH_FRAMES):
                episode.encode(next(play))
            megabytes.append(resident_mb())
            console.print(f"{len(megabytes) * STRETCH_FRAMES:,} frames: {megabytes[-1]:.1f} MB", highlight=False)
    slope = float(np.polyfit(np.arange(len(megabytes)), megabytes, 1)[0])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if arguments.json:
        print(json.dumps({"resident_mb": megabytes, "slope_mb_per_100k": slope, "peak_mb": peak}))
        return
    Console().print(f"{slope:+.2f} MB per 100,000 frames, {peak:.0f} MB at most", highlight=False)


def resident_mb() -> float:
    """Return the resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


if __name__ == "__main__":
    main(tyro.cli(Arguments))
