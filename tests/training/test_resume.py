"""Interrupted runs end as if nothing had happened."""

import itertools
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from semrl.core.arrays import digest
from semrl.core.files import read_arrays, write_arrays
from semrl.training import RunFolder, build_trainer, train
from semrl.training.config import write_toml
from semrl.training.metrics import read_metrics
from semrl.training.session import limited_threads

SEMRL = [sys.executable, "-c", "import sys; from semrl.cli import main; sys.exit(main())"]
DOC2VEC = {
    "perception__embedder": "doc2vec",
    "perception__doc2vec__documents": 12,
    "perception__doc2vec__epochs": 2,
    "perception__doc2vec__dimension": 8,
}
REHEARSAL = {"planning__networks__rehearsal_states": 60, "planning__networks__reward__kind": "network"}
OBJECTS = {
    "planning__world_model": "trees",
    "planning__planner_every": 2,
    "planning__keeping__decisions": 3,
    "planning__keeping__tolerance": 0.05,
    "planning__scenarios__scenarios": 6,
    "planning__trees__first_decisions": 40,
    "planning__trees__new_decisions": 30,
}
THESIS_MODELS = {
    "planning__networks__rehearsal_states": 0,
    "planning__networks__reward__kind": "svm",
    "planning__networks__next_state__predict_change": False,
}
TRACKED = OBJECTS | {"encoder": "tracked_scene"}
TRACKED_DOC2VEC = DOC2VEC | {"encoder": "tracked_scene"}
LIFTED = {
    "planning__world_model": "lifted",
    "planning__lifted__first_decisions": 40,
    "planning__lifted__new_decisions": 30,
}
STORED = {"stability__decisions": 45}
RICH_AGENT = {"dqn__heads": 3, "dqn__head_decisions": 5, "dqn__reward_share": 0.5}


LEARNED = ("detection", "reduction", "clustering")


class Rows:
    """Remembers what was measured."""

    def __init__(self):
        self.rows = []

    def on_decision(self, trainer):
        pass

    def on_row(self, row):
        told = {name: value for name, value in row.items() if not name.startswith("seconds")}
        self.rows.append(repr(told))  # as text: nan equals nan


@pytest.mark.parametrize(
    ("model", "changes", "phases"),
    [
        ("baseline", {}, {"agent"}),
        ("otsu", {}, {"detection", "agent"}),
        ("birch", {}, {*LEARNED, "agent"}),
        ("semantic", RICH_AGENT, {*LEARNED, "scenery", "agent"}),
        ("semantic", DOC2VEC, {*LEARNED, "scenery", "embedding", "agent"}),
        ("semantic", TRACKED_DOC2VEC, {*LEARNED, "roles", "embedding", "agent"}),
        ("semantic-map", REHEARSAL, {*LEARNED, "scenery", "agent"}),
        ("semantic-map", THESIS_MODELS, {*LEARNED, "scenery", "agent"}),
        ("semantic-map", TRACKED, {*LEARNED, "roles", "agent"}),
        ("objects", RICH_AGENT, {*LEARNED, "roles", "agent"}),
        ("objects-map", OBJECTS | STORED, {"play", "agent"}),
        ("objects-map", OBJECTS | STORED | LIFTED, {"play", "agent"}),
        ("ram", RICH_AGENT, {"agent"}),
        ("ram-map", OBJECTS, {"agent"}),
    ],
    ids=[
        "baseline",
        "otsu",
        "birch",
        "semantic",
        "semantic-doc2vec",
        "semantic-tracked-doc2vec",
        "semantic-map",
        "semantic-map-svm",
        "semantic-map-tracked",
        "objects",
        "objects-map-stored",
        "objects-map-lifted",
        "ram",
        "ram-map",
    ],
)
def test_state_moved_through_files_goes_on_bit_for_bit(tmp_path, tiny, model, changes, phases):
    """Every few decisions a fresh trainer takes over what the one before has written."""
    if "perception__embedder" in changes:
        pytest.importorskip("gensim")
    config = tiny(model, decisions=130 if changes.get("encoder") else 110, **changes)
    whole, parts = Rows(), Rows()
    with limited_threads(1):
        unbroken = build_trainer(config, [whole])
        unbroken.run()
        seen, path = set(), tmp_path / "state.npz"
        for until in itertools.count(1, 36 if model.startswith("ram") else 9):  # an emulator starts slowly
            trainer = build_trainer(config, [parts])
            if path.exists():
                trainer.from_arrays(read_arrays(path))
            seen.add(trainer.phase)
            trainer.decisions = min(until, config.decisions)
            trainer.run()
            write_arrays(path, trainer.to_arrays())
            if until >= config.decisions:
                break
    assert seen == phases
    assert parts.rows == whole.rows
    assert trainer.returns_ == unbroken.returns_
    assert digest(trainer.to_arrays()) == digest(unbroken.to_arrays())


LENGTHS = {"detection": 100, "reduction": 100, "clustering": 100, "roles": 60, "agent": 250}
"""Decisions of the phases of the run that is killed: no stability test is ever passed."""
N_DECISIONS = sum(LENGTHS.values())


@pytest.fixture
def slow_config(tiny):
    """Of a run with all that there is to save: tracks, an agent, a map, a world model."""
    return tiny(
        "semantic-map",
        decisions=N_DECISIONS,
        checkpoint_seconds=0.03,
        perception__foreground__background_frames=LENGTHS["detection"],
        perception__slot_assigner__frames=LENGTHS["roles"],
        stability__batches=20,
        stability__max_batches=LENGTHS["reduction"],
        **TRACKED,
    )


@pytest.mark.slow
@pytest.mark.parametrize("kills", [3, 20])
def test_a_run_killed_at_random_moments_ends_like_the_unbroken_one(tmp_path, slow_config, kills):
    train(tmp_path / "unbroken", slow_config)
    run, settings = tmp_path / "killed", tmp_path / "settings.toml"
    settings.write_text(write_toml(slow_config))
    rng = np.random.default_rng()
    reached, n_killed = [], 0
    for i in range(kills):  # one moment in each stretch of most of the run, so that all phases are met
        target = 0.85 * N_DECISIONS * rng.uniform(i, i + 0.9) / kills
        n_killed += kill(start(run, settings), run, target, rng.uniform(0, 0.05))
        reached.append(decisions(run))
    assert n_killed >= kills - 1  # on a busy machine the last may come too late, when the run has ended
    ended = start(run, settings)
    _, said = ended.communicate(timeout=300)
    assert ended.returncode == 0, said.decode()
    ends = np.cumsum(list(LENGTHS.values()))
    phases = {list(LENGTHS)[k] for k in np.searchsorted(ends[:-1], reached, side="right")}
    assert len(phases) == len(LENGTHS) if kills >= 8 else len(phases) >= 2, reached
    assert RunFolder.open(run).manifest()["hashes"] == RunFolder.open(tmp_path / "unbroken").manifest()["hashes"]
    assert measured(run) == measured(tmp_path / "unbroken")
    assert not list(run.rglob("*.tmp"))


def start(run, settings):
    how = ["--resume"] if run.exists() else ["--config", str(settings)]
    argv = [*SEMRL, "train", "--run", str(run), *how]
    return subprocess.Popen(argv, stderr=subprocess.PIPE, env=os.environ | {"OMP_NUM_THREADS": "1"})


def kill(process, run, target, delay):
    """Kill when the run has reached a decision, a moment later; return whether it still ran."""
    while decisions(run) < target and process.poll() is None:
        time.sleep(0.002)
    time.sleep(delay)
    process.kill()
    process.communicate()
    return process.returncode == -9


def decisions(run):
    return max([int(path.stem) for path in (run / "checkpoints").glob("*.npz")], default=0)


def measured(run):
    rows = read_metrics(run / "metrics.csv")
    return [{name: value for name, value in row.items() if not name.startswith("seconds")} for row in rows]
