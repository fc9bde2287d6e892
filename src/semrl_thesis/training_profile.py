"""Where the time of a training goes: part by part, beside the emulator alone in the same run.

A run is trained in memory. Each part's calls are timed without the calls of other parts in them, in processor time of
the process, so that what else the machine does counts little. Every so many decisions a second environment of the same
kind plays at random with nothing else around it: its rate is the emulator's own, and met the same machine.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from typing import Any

import numpy as np

from semrl.core.errors import UsageError
from semrl.envs import Game, make_env
from semrl.training import RunConfig, build_trainer
from semrl.training.session import limited_threads
from semrl.training.trainer import Row, Trainer

PARTS = (
    "emulator", "perception, learning", "perception", "plan", "imagine", "network inference", "update",
    "fitting the world model", "map", "rest",
)  # fmt: skip
"""Of a training, as they are told."""

REST, ALONE = "rest", "emulator alone"
STRETCH, ALONE_DECISIONS = 1_000, 200
"""Decisions between two measurements of the emulator alone, and those of one."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingProfile:
    """What was measured."""

    config: RunConfig
    training_per_second: float
    """Decisions a second of processor time, perception included."""
    agent_per_second: float
    """The same, once perception was ready."""
    emulator_per_second: float
    """Decisions a second of the emulator alone, the median of its stretches; NaN of a run shorter than one."""
    shares: dict[str, float]
    """Part → share of the training's time; they add up to 1."""


@dataclass(kw_only=True)
class Meter:
    """Counts time for the part that was called last and has not returned: no moment counts twice."""

    clock: Callable[[], float] = time.process_time
    seconds: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._part = REST
        self._since = self.clock()

    def switch(self, part: str) -> str:
        """Count for another part from now on; return the one before."""
        now, before = self.clock(), self._part
        self.seconds[before] = self.seconds.get(before, 0.0) + now - self._since
        self._part, self._since = part, now
        return before

    def watch(self, part: str, owner: Any, *names: str) -> None:
        """Count calls of an object's methods for a part."""
        for name in names:
            setattr(owner, name, self.timed(part, getattr(owner, name)))

    def timed(self, part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that counts for a part."""

        @wraps(call)
        def counted(*args: Any, **kwargs: Any) -> Any:
            before = self.switch(part)
            try:
                return call(*args, **kwargs)
            finally:
                self.switch(before)

        return counted


class _Stretches:
    """Measures the emulator alone between stretches of a training."""

    def __init__(self, meter: Meter, config: RunConfig) -> None:
        self.meter = meter
        self.seconds: list[float] = []
        self.ready: tuple[int, float] | None = None  # decisions and seconds when perception was
        self._game = Game(make_env(config.env, config.environment), config.seed)
        self._rng = np.random.default_rng(config.seed)
        self._game.reset()

    def on_decision(self, trainer: Trainer) -> None:
        before = self.meter.switch(ALONE)
        if self.ready is None and not trainer.perceiving:
            self.ready = trainer.decisions_, self.trained
        if trainer.decisions_ % STRETCH == 0:
            self.seconds.append(self._play() / ALONE_DECISIONS)
        self.meter.switch(before)

    def on_row(self, row: Row) -> None:
        """Need nothing of what was measured."""

    @property
    def trained(self) -> float:
        """Seconds of the training so far."""
        return sum(seconds for part, seconds in self.meter.seconds.items() if part != ALONE)

    def _play(self) -> float:
        began = self.meter.clock()
        for action in self._rng.integers(self._game.n_actions, size=ALONE_DECISIONS).tolist():
            if self._game.step(action).done:
                self._game.reset()
        return self.meter.clock() - began


def profile_training(config: RunConfig) -> TrainingProfile:
    """Train a run in memory and tell where its time went.

    Raises
    ------
    UsageError
        When its perception would not be ready before its budget is spent.
    """
    with limited_threads(config.threads):
        meter = Meter()
        stretches = _Stretches(meter, config)
        trainer = build_trainer(config, [stretches])
        _watch(meter, trainer)
        meter.switch(REST)
        meter.seconds.clear()
        trainer.run()
        meter.switch(ALONE)
    if stretches.ready is None:
        raise UsageError(f"after {config.decisions:,} decisions perception is not ready; try more with --decisions")
    decisions, seconds = stretches.ready
    whole = stretches.trained
    return TrainingProfile(
        config=config,
        training_per_second=config.decisions / whole,
        agent_per_second=(config.decisions - decisions) / (whole - seconds) if config.decisions > decisions else 0.0,
        emulator_per_second=1 / float(np.median(stretches.seconds)) if stretches.seconds else float("nan"),
        shares={part: meter.seconds.get(part, 0.0) / whole for part in PARTS},
    )


def _watch(meter: Meter, trainer: Trainer) -> None:
    """Let every part of a training count for itself."""
    meter.watch("emulator", trainer.game, "step", "begin")
    meter.watch("perception, learning", trainer.schedule, "learn")
    begin = trainer.encoder.begin

    def begin_watched() -> Any:
        episode = begin()
        meter.watch("perception", episode, "encode")
        return episode

    setattr(trainer.encoder, "begin", begin_watched)  # noqa: B010 - a method of a protocol
    meter.watch("network inference", trainer.agent, "act")
    meter.watch("update", trainer.agent, "observe", "end_episode")
    if trainer.planning:
        meter.watch("plan", trainer.planning, "plan_step")
        meter.watch("map", trainer.planning, "learn")
        meter.watch("imagine", trainer.planning.world_model, "imagine")
        meter.watch("fitting the world model", trainer.planning.world_model, "partial_fit", "update_online")
