"""Tiny runs that many tests share, and a way to call the command line without a process."""

import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from semrl.cli import main
from semrl.training import RunConfig, preset, train
from semrl.training.config import write_toml

SETTINGS: dict[str, Any] = {
    "env": "semrl/Catch-v0",
    "decisions": 150,
    "checkpoint_seconds": 1e6,
    "perception.embedder": "hashed",
    "perception.hashed.dimension": 16,
    "perception.otsu.threshold_frames": 4,
    "perception.scene.scenery_frames": 12,
    "perception.foreground.background_frames": 12,
    "perception.slot_assigner.frames": 30,
    "stability.batches": 4,
    "stability.decisions": 0,
    "stability.max_batches": 12,
    "stability.max_difference": 0.0,  # never reached: PCA and Birch take 12 batches each
    "stability.min_agreement": 1.0,
    "dqn.batch_size": 8,
    "dqn.learning_starts": 20,
    "dqn.train_freq": 4,
    "dqn.replay_capacity": 60,
    "dqn.network.hidden_units": [8],
    "planning.networks.next_state.epochs": 2,
    "planning.networks.next_state.hidden_units": [16],
    "planning.scenarios.depth": 3,
    "planning.plan_features.parts": ["actions", "state", "reward"],
    "planning.plan_features.decisions": 0,
    "evaluation.episodes": 2,
    "evaluation.exploration": 0.0,
}
"""Of a run that goes through all phases in a second."""

BY_NETWORKS: dict[str, Any] = {
    "planning.world_model": "networks",
    "planning.planner_every": 0,
    "planning.scenarios.scenarios": 0,
    "planning.networks.next_state.predict_change": True,
}
"""Of `semantic-map` as the thesis has it, whose vectors are predicted by networks."""

BY_TREES: dict[str, Any] = {
    "planning.scenarios.depth": 4,
    "planning.scenarios.scenarios": 6,
    "planning.trees.first_decisions": 40,
    "planning.trees.new_decisions": 30,
}
"""Of a map model that predicts tracked objects."""


@pytest.fixture(scope="session", autouse=True)
def _heed_ctrl_c() -> Iterator[None]:
    """Let SIGINT do what it does in a terminal: a shell starts background jobs with it ignored, and theirs too."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def tiny(model: str = "semantic", **changes: Any) -> RunConfig:
    """Configure a tiny run; changes are named ``dqn__batch_size``."""
    atari = {"env": "PongNoFrameskip-v4"} if model.startswith("ram") else {}
    scenes = {"encoder": "scene"} if model.startswith("semantic") else {}  # of single frames
    predicted = BY_NETWORKS if model == "semantic-map" else {}
    nested: dict[str, Any] = {}
    for name, value in {**SETTINGS, **atari, **scenes, **predicted, **changes}.items():
        *tables, key = name.replace("__", ".").split(".")
        table = nested
        for part in tables:
            table = table.setdefault(part, {})
        table[key] = value
    return preset("semrl", model, nested)


@dataclass(frozen=True)
class Call:
    """What a call of the command line gave back."""

    status: int
    out: str
    err: str

    @property
    def message(self) -> str:
        """The one line that says what went wrong; progress may stand before it, nothing after it."""
        lines = self.err.splitlines()
        assert "Traceback" not in self.out + self.err
        assert [line for line in lines if line.startswith("semrl: ")] == lines[-1:], self.err
        return lines[-1].removeprefix("semrl: ")


@pytest.fixture(scope="session", name="tiny")
def tiny_fixture() -> Callable[..., RunConfig]:
    return tiny


@pytest.fixture
def tiny_toml(tmp_path: Path) -> Callable[..., str]:
    """Write a tiny configuration to a file and return its path."""

    def write(model: str = "semantic", **changes: Any) -> str:
        path = tmp_path / f"{model}.toml"
        path.write_text(write_toml(tiny(model, **changes)))
        return str(path)

    return write


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Callable[..., Call]:
    """Call the command line as a person does, in this process."""

    def run(*argv: object) -> Call:
        capsys.readouterr()
        status = main([str(word) for word in argv])
        said = capsys.readouterr()
        return Call(status, said.out, said.err)

    return run


@pytest.fixture(scope="session")
def semantic_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run with perception. Read only."""
    path = tmp_path_factory.mktemp("runs") / "semantic"
    train(path, tiny("semantic"))
    return path


@pytest.fixture(scope="session")
def map_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run with perception and a map. Read only."""
    path = tmp_path_factory.mktemp("runs") / "semantic-map"
    train(path, tiny("semantic-map"))
    return path


@pytest.fixture(scope="session")
def tracked_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run that plans with the tracked objects of its scenes. Read only."""
    path = tmp_path_factory.mktemp("runs") / "tracked"
    changes = {**BY_TREES, "encoder": "tracked_scene", "planning.world_model": "trees", "planning.planner_every": 2}
    train(path, tiny("semantic-map", decisions=250, **changes))
    return path


@pytest.fixture(scope="session")
def ram_map_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run on an Atari game, with a map and without perception. Read only."""
    path = tmp_path_factory.mktemp("runs") / "ram-map"
    train(path, tiny("ram-map", decisions=2000))
    return path


@pytest.fixture(scope="session")
def baseline_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run without perception. Read only."""
    path = tmp_path_factory.mktemp("runs") / "baseline"
    train(path, tiny("baseline", decisions=75))
    return path


@pytest.fixture(scope="session")
def objects_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run that follows objects. Read only."""
    path = tmp_path_factory.mktemp("runs") / "objects"
    train(path, tiny("objects"))
    return path
