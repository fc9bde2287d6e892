"""Play as a data set that others learn from offline, in Minari's format: facts, concepts, and frames if wanted."""

import contextlib
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from semrl.concepts import SceneBuilder
from semrl.concepts.scenes import CONCEPT, PLACE
from semrl.core import Ints
from semrl.core.errors import MissingExtraError, UsageError
from semrl.core.files import make_folder
from semrl.evaluation.games import ready_player
from semrl.evaluation.player import Player, Policy
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.training.loop import Step
from semrl.training.session import limited_threads


@dataclass(frozen=True, kw_only=True)
class ExportedPlay:
    """What was written."""

    dataset: str
    """As ``minari.load_dataset`` takes it, when MINARI_DATASETS_PATH is the folder."""
    folder: str
    """In which data sets are kept."""
    episodes: int
    decisions: int
    facts: list[str]
    """Names of the numbers of an observation's ``facts``."""
    slots: list[str]
    """What each place of ``concepts`` is about; none where the run knows no concepts."""
    concepts: list[str]
    """Names of the numbers in ``concepts``; −1 there: not seen, or of none."""


def export_play(
    run: str | Path,
    to: str | Path,
    *,
    episodes: int = 10,
    policy: Policy = "agent",
    seed: int | None = None,
    frames: bool = False,
    on_episode: Callable[[float], None] = lambda _: None,
) -> ExportedPlay:
    """Let a trained run play, and write it as a data set ``semrl/RUN-v0`` that Minari loads (extra ``minari``).

    Each observation is a dictionary with the state's ``facts``, ``(d,)`` float32, where the run knows concepts with
    those of the things in its slots, ``concepts``, ``(slots,)`` int64, and, if wanted, with the ``frame``.

    Parameters
    ----------
    run
        Folder of the run; its newest checkpoint plays.
    to
        Folder of data sets, as in ``MINARI_DATASETS_PATH``; it is made where it is not there.
    episodes, policy, seed
        As of `evaluate`, whose episodes these are.
    frames
        Whether the frames are written as well.
    on_episode
        Called with the return of each episode.

    Raises
    ------
    UsageError
        When there is no such run, its states have no facts with names, the data set is there already, or nothing may be
        written.
    MissingExtraError
        When Minari is not installed.
    """
    _require_minari()
    if episodes < 1 or (seed is not None and seed < 0):
        raise UsageError(f"episodes must be 1 or more and seed 0 or more, not {episodes} and {seed}")
    player = ready_player(run, policy)
    writer = _EpisodeWriter(player, run, frames=frames)
    name = _new_name(run, Path(to))
    make_folder(Path(to))
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    played = []
    with limited_threads(player.config.threads), contextlib.closing(player.new_env()) as env:
        for number in range(episodes):
            steps = list(player.episode(number, seed, policy, env))
            played.append({"id": number, "seed": seed, **writer.episode(steps)})
            on_episode(steps[-1].total)
    writer.write(Path(to), name, played, policy)
    return ExportedPlay(
        dataset=name,
        folder=str(to),
        episodes=episodes,
        decisions=sum(len(one["actions"]) for one in played),
        facts=list(writer.facts),
        slots=list(writer.slots),
        concepts=list(writer.concepts),
    )


def _require_minari() -> None:
    try:
        import h5py  # noqa: F401 - in whose files Minari keeps what it is given
        import minari  # noqa: F401
    except ImportError:
        raise MissingExtraError("minari", "semrl export") from None


def _new_name(run: str | Path, folder: Path) -> str:
    """Return the name of a run's data set, which is not there yet."""
    name = f"semrl/{re.sub(r'[^A-Za-z0-9_.-]+', '-', Path(run).resolve().name).strip('-') or 'run'}-v0"
    if (folder / name).exists():
        raise UsageError(f"{folder / name} is there already; delete it, or write to another folder")
    return name


class _EpisodeWriter:
    """Writes steps as Minari's episodes."""

    def __init__(self, player: Player, run: str | Path, *, frames: bool) -> None:
        space, planning = player.encoder.space, player.planning
        if not space.names:
            raise UsageError(f"the numbers of the states of {run} have no names, so there are no facts to export")
        self.player = player
        self.frames = frames
        self.facts = tuple(space.names)
        self.n_facts = space.n_facts
        self.builder = SceneBuilder(planning.concepts) if planning and planning.concepts.is_fitted else None
        self.concepts: tuple[str, ...] = self.builder.concepts.table_.names if self.builder else ()
        first = [name for name in self.facts if name.endswith(" x")]
        self.slots = tuple(name.removesuffix(" x") for name in first) if self.builder else ()
        spaces: dict[str, gym.Space[Any]] = {"facts": gym.spaces.Box(-np.inf, np.inf, (self.n_facts,), np.float32)}
        if self.builder:
            spaces["concepts"] = gym.spaces.Box(-1, np.iinfo(np.int64).max, (len(self.slots),), np.int64)
        if frames:
            with contextlib.closing(player.new_env()) as env:
                assert env.observation_space.shape is not None
                spaces["frame"] = gym.spaces.Box(0, 255, env.observation_space.shape, np.uint8)
        self.space = gym.spaces.Dict(spaces)

    def episode(self, steps: Sequence[Step]) -> dict[str, Any]:
        """Return the columns of an episode; one that does not end by itself was cut."""
        after = steps[1:]
        observations = [self._observation(step) for step in steps]
        return {
            "observations": {key: np.stack([seen[key] for seen in observations]) for key in observations[0]},
            "actions": np.array([step.action for step in after], np.int64),
            "rewards": np.array([step.reward for step in after], np.float64),
            "terminations": np.array([step.terminated for step in after], np.bool_),
            "truncations": np.array([step.truncated or (step is after[-1] and not step.done) for step in after]),
            "infos": {},
        }

    def write(self, folder: Path, name: str, played: Sequence[Mapping[str, Any]], policy: Policy) -> None:
        """Write episodes as a data set."""
        import minari
        from minari.data_collector import EpisodeBuffer

        player = self.player
        with _written_beside(folder, name) as beside, _datasets_in(beside), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of authors and environments that are not named
            made = minari.create_dataset_from_buffers(
                name, [EpisodeBuffer(**one) for one in played], observation_space=self.space,
                action_space=gym.spaces.Discrete(len(player.action_names)),
                algorithm_name=f"semrl {player.config.model}, {policy}", data_format="hdf5", jpeg_encoding=False,
                description=f"{player.config.env}, played by semrl after {player.decisions:,} decisions",
            )  # fmt: skip
            made.storage.update_metadata({f"semrl_{key}": value for key, value in self.metadata().items()})

    def metadata(self) -> dict[str, Any]:
        """Return what numbers mean, for the metadata."""
        player = self.player
        return {
            "env": player.config.env,
            "model": player.config.model,
            "actions": list(player.action_names),
            "facts": list(self.facts),
            "fact_unit": player.encoder.space.unit,
            "slots": list(self.slots),
            "concepts": list(self.concepts),
        }

    def _observation(self, step: Step) -> dict[str, Any]:
        assert step.state is not None
        observation: dict[str, Any] = {"facts": step.state.facts.astype(np.float32)}
        if self.builder:
            observation["concepts"] = self._concepts(step)
        if self.frames:
            observation["frame"] = np.asarray(step.observation.frame)
        return observation

    def _concepts(self, step: Step) -> Ints:
        """Return the concept of what is in each slot, ``(slots,)``."""
        found = np.full(len(self.slots), -1, np.int64)
        if self.builder and step.record is not None:
            objects = self.builder.newest(step.record.history.things)
            placed = objects[(objects[:, PLACE] >= 0) & (objects[:, PLACE] < len(found))]
            found[placed[:, PLACE].astype(np.int64)] = placed[:, CONCEPT].astype(np.int64)
        return found


@contextlib.contextmanager
def _written_beside(folder: Path, name: str) -> Iterator[Path]:
    """Give a folder in which a data set is made; put it in its place when it is whole."""
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as beside:
        yield Path(beside)
        namespace = Path(name).parent
        (folder / namespace).mkdir(exist_ok=True)
        (Path(beside) / name).rename(folder / name)
        about = Path(beside) / namespace / "namespace_metadata.json"
        if about.exists() and not (folder / namespace / about.name).exists():
            shutil.move(about, folder / namespace / about.name)


@contextlib.contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Let Minari keep data sets in a folder; it reads that from an environment variable alone."""
    name = "MINARI_DATASETS_PATH"
    before = os.environ.get(name)
    os.environ[name] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before
