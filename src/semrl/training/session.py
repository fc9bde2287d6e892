"""A training run from its folder: begin or go on, save on the way, finish."""

import contextlib
import signal
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import cv2
import numpy as np
import torch
from threadpoolctl import threadpool_limits

from semrl.core.arrays import Arrays, digest, unnest
from semrl.core.errors import SemrlError, SemrlWarning, UsageError
from semrl.core.signals import handling
from semrl.envs import make_env
from semrl.envs.actions import Env
from semrl.envs.environment import blinking
from semrl.envs.flicker import BLINKING
from semrl.envs.repeating import repeats_itself
from semrl.training.checkpoint import Checkpoint
from semrl.training.config import RunConfig
from semrl.training.folder import RunFolder
from semrl.training.metrics import MetricsFile
from semrl.training.parts import build_trainer, look_at
from semrl.training.progress_lines import TrainingLines, append_line
from semrl.training.trainer import Observer, Row, Trainer
from semrl.training.world import World, read_world


@dataclass(frozen=True, kw_only=True)
class TrainResult:
    """What `train` returns; ``return_mean_last10`` is None when no episode was finished."""

    run: str
    model: str
    env: str
    seed: int
    frames: int
    decisions: int
    episodes: int
    return_mean_last10: float | None
    seconds: float


def train(
    path: str | Path,
    config: RunConfig | None = None,
    *,
    observers: Sequence[Observer] = (),
    looking: Callable[[], None] | None = None,
) -> TrainResult:
    """Train a run to the end of its budget; a finished one is not trained again, unless what it learned is gone.

    Parameters
    ----------
    path
        Folder of the run.
    config
        Of a new run; None to go on with the one that is there. What comes out is the same, bit for
        bit, however often a run was interrupted (same machine, same number of threads).
    observers
        Watch the training.
    looking
        Is called before a game is looked at for some seconds, where there is to be counted what moves in it.

    Raises
    ------
    UsageError
        When the folder exists (new run) or is no run (resume), or the configuration cannot work.
    SemrlError
        When training fails or is stopped by SIGINT or SIGTERM; the last good checkpoint is kept.

    Examples
    --------
    >>> from semrl import preset
    >>> quick = {"env": "semrl/Catch-v0", "decisions": 100}
    >>> result = train("runs/quick", preset("semrl", "baseline", quick))
    >>> result.decisions, result.frames
    (100, 400)
    """
    path = Path(path)
    folder = None if config else RunFolder.open(path)
    manifest = folder.manifest() if folder else {}
    if folder and manifest["status"] == "finished" and folder.checkpoints():
        return _result_before(manifest, folder)
    noted = read_world(manifest, path) if "environment" in manifest else None
    if noted and not noted.repeats:
        raise UsageError(f"{path} cannot be resumed: its environment does not repeat itself from seed and actions")
    config = config or RunFolder(path).config()
    environment = noted.shown_alike(config.environment) if noted else config.environment
    with limited_threads(config.threads), contextlib.closing(make_env(config.env, environment)) as env:
        world = noted or look_at(env, config, looking)
        trainer = build_trainer(config, env=env, world=world)  # what cannot work is refused before anything is written
        world = noted or _tested(env, config, world)
        folder = folder or RunFolder.create(path, config)
        if noted is None:
            folder.update_manifest(environment=world.to_dict())
        return _Session(folder, config, trainer, observers).run()


@contextlib.contextmanager
def limited_threads(threads: int) -> Iterator[None]:
    """Use so many processor threads and no more, in every library."""
    before = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(threads)
    cv2.setNumThreads(threads)
    try:
        with threadpool_limits(threads):
            yield
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])


class _Session:
    """One process's share of a run: from its newest checkpoint to the end of the budget."""

    def __init__(self, folder: RunFolder, config: RunConfig, trainer: Trainer, observers: Sequence[Observer]) -> None:
        self.folder = folder
        self.config = config
        self._lines = TrainingLines(partial(append_line, folder.log_path))
        self.trainer = trainer
        trainer.observers += [self, self._lines, *observers]
        self._stopped_by: signal.Signals | None = None
        self._phase = self.trainer.phase
        self._saved_at = time.monotonic()

    def run(self) -> TrainResult:
        """Go on to the end of the budget."""
        with self.folder.locked(), handling(self._stop, signal.SIGINT, signal.SIGTERM):
            self._begin()
            try:
                self.trainer.run()
                return self._finish()
            except Exception:
                with contextlib.suppress(SemrlError):  # a full disk must not hide the first error
                    self.folder.update_manifest(status="interrupted" if self._stopped_by else "failed")
                raise
            finally:
                self.metrics.close()
                self._lines.close()

    def on_row(self, row: Row) -> None:
        """Write what was measured."""
        self.metrics.write(row)

    def on_decision(self, trainer: Trainer) -> None:
        """Save when it is time, at milestones, at the end of each phase, and when asked to stop."""
        if trainer.decisions_ in self.config.milestones:
            self.folder.save_milestone(self._as_checkpoint(self.trainer.inference_arrays()))
        due = time.monotonic() - self._saved_at > self.config.checkpoint_seconds
        if due or trainer.phase != self._phase or self._stopped_by:
            self._phase = trainer.phase
            self._save()
        if self._stopped_by:
            further = f"; go on with: {self.folder.resuming}" if self.folder.resuming else ""
            raise SemrlError(f"stopped by {self._stopped_by.name} after {trainer.decisions_:,} decisions{further}")

    def _begin(self) -> None:
        """Stand where the newest checkpoint stands, if there is one."""
        self.folder.clean()
        checkpoint = self.folder.load()
        if checkpoint:
            self._restore(checkpoint)
        n_rows, seconds = (checkpoint.metrics_rows, checkpoint.seconds) if checkpoint else (0, 0.0)
        self.metrics = MetricsFile(self.folder.metrics_path, n_rows=n_rows, seconds=seconds)
        self._phase = self.trainer.phase
        self._saved_at = time.monotonic()
        self.folder.update_manifest(status="running")

    def _restore(self, checkpoint: Checkpoint) -> None:
        try:
            self.trainer.from_arrays(checkpoint.arrays)
        except (KeyError, ValueError, TypeError, RuntimeError) as error:
            name = self.folder.checkpoints()[-1]
            raise SemrlError(f"{name} does not fit this run's configuration ({error})") from error

    def _save(self) -> None:
        checkpoint = self._as_checkpoint(self.trainer.to_arrays())
        self.metrics.flush()
        self.folder.save(checkpoint)
        self._saved_at = time.monotonic()

    def _as_checkpoint(self, arrays: Arrays) -> Checkpoint:
        check_finite(arrays)
        playable = frozenset(self.trainer.inference_arrays())
        return Checkpoint(
            arrays=arrays, playable=playable, metrics_rows=self.metrics.n_rows, seconds=self.metrics.seconds
        )

    def _finish(self) -> TrainResult:
        """Note the hashes of everything, then keep what play and planning need and drop the rest."""
        if self.trainer.perceiving:
            warnings.warn(
                f"the budget of {self.trainer.decisions_:,} decisions ended in the stage '{self.trainer.phase}' of "
                "perception, and the agent has learned nothing; try more --decisions",
                SemrlWarning,
                stacklevel=4,
            )
        self._save()  # until the manifest says "finished", who goes on needs the whole state
        result = self._result()
        playable = self.trainer.inference_arrays()
        self.folder.update_manifest(
            status="finished",
            hashes={"state": digest(self.trainer.to_arrays()), "weights": digest(playable)},
            result=result.__dict__,
        )
        self.folder.save(self._as_checkpoint(playable | self.trainer.memory_arrays()), keep=1)
        return result

    def _result(self) -> TrainResult:
        returns = self.trainer.returns_
        return TrainResult(
            run=str(self.folder.path),
            model=self.config.model,
            env=self.config.env,
            seed=self.config.seed,
            frames=self.trainer.decisions_ * self.config.environment.frame_skip,
            decisions=self.trainer.decisions_,
            episodes=len(returns),
            return_mean_last10=float(np.mean(returns[-10:])) if returns else None,
            seconds=round(self.metrics.seconds, 1),
        )

    def _stop(self, number: int, _frame: FrameType | None) -> None:
        """Note a person's wish to stop; it is granted between two decisions."""
        self._stopped_by = signal.Signals(number)


def check_finite(arrays: Arrays) -> None:
    """Keep weights that are not numbers out of checkpoints and milestones: the last good one stays.

    Raises
    ------
    SemrlError
        When there are such.
    """
    for part, what in (("agent", "the agent's"), ("planning/world_model", "the world model's")):
        learned = unnest(arrays, part)
        weights = [array for name, array in learned.items() if "/network/" in f"/{name}/" or "/layers/" in f"/{name}/"]
        if not all(np.isfinite(array).all() for array in weights):
            raise SemrlError(
                f"{what} weights are no longer numbers: learning has diverged; try a smaller learning rate"
            )


def _tested(env: Env, config: RunConfig, world: World) -> World:
    """Add whether an environment repeats itself, and warn of what its player should know."""
    world = replace(world, repeats=repeats_itself(env, config.seed))
    if not world.repeats:
        warnings.warn(
            f"{config.env} does not repeat itself: its checkpoints will not resume", SemrlWarning, stacklevel=3
        )
    share = blinking(env, config.environment.frame_skip)
    if share > BLINKING:
        warnings.warn(
            f"{config.env} blinks: {share:.0%} of what is drawn between two decisions is never shown; "
            "try --environment.max-frames 0",
            SemrlWarning,
            stacklevel=3,
        )
    return world


def _result_before(manifest: Mapping[str, Any], folder: RunFolder) -> TrainResult:
    """Return the result that a finished run has noted."""
    try:
        return TrainResult(**manifest["result"] | {"run": str(folder.path)})
    except (KeyError, TypeError):
        raise UsageError(f"{folder.manifest_path} is damaged: it does not hold the result of the run") from None
