import errno
import json
import os
import shutil
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch

from semrl.core import files
from semrl.core.arrays import digest
from semrl.core.errors import SemrlError, UsageError
from semrl.training import RunFolder, train
from semrl.training.config import write_toml
from semrl.training.metrics import read_metrics
from semrl.training.parts import Parts, build_trainer


class AtDecision:
    """Does something after a decision."""

    def __init__(self, decision, action):
        self.decision = decision
        self.action = action

    def on_decision(self, trainer):
        if trainer.decisions_ == self.decision:
            self.action()

    def on_row(self, row):
        pass


def hashes(path):
    return RunFolder.open(path).manifest()["hashes"]


def rows(path):
    return [{**row, "seconds": ""} for row in read_metrics(path / "metrics.csv")]


def test_a_run_tells_what_it_did(semantic_run, tiny):
    manifest = RunFolder.open(semantic_run).manifest()
    result = manifest["result"]
    assert manifest["status"] == "finished" and manifest["hashes"].keys() == {"state", "weights"}
    assert result["decisions"] == 150 and result["frames"] == 600
    table = read_metrics(semantic_run / "metrics.csv")
    phases = [row["phase"] for row in table]
    assert sorted(set(phases), key=phases.index) == ["detection", "reduction", "clustering", "scenery", "agent"]
    returns = [float(row["return"]) for row in table if row["phase"] == "agent"]
    assert len(returns) == result["episodes"] > 0
    assert result["return_mean_last10"] == pytest.approx(np.mean(returns[-10:]))
    decisions = [int(row["decisions"]) for row in table]
    assert decisions == sorted(set(decisions)) and decisions[-1] <= 150


def test_the_same_seed_gives_the_same_run_and_another_does_not(tmp_path, tiny, baseline_run):
    train(tmp_path / "again", tiny("baseline", decisions=75))
    train(tmp_path / "other", tiny("baseline", decisions=75, seed=1))
    assert hashes(tmp_path / "again") == hashes(baseline_run)
    assert rows(tmp_path / "again") == rows(baseline_run)
    assert hashes(tmp_path / "other")["weights"] != hashes(baseline_run)["weights"]


def test_a_finished_run_tells_its_result_again(semantic_run):
    before = (semantic_run / "manifest.json").read_bytes()
    result = train(semantic_run)
    assert result.__dict__ == json.loads(before)["result"] | {"run": str(semantic_run)}
    assert (semantic_run / "manifest.json").read_bytes() == before


def test_a_finished_run_without_its_result_is_refused(tmp_path, baseline_run):
    run = RunFolder.open(shutil.copytree(baseline_run, tmp_path / "run"))
    run.update_manifest(result=None)
    with pytest.raises(UsageError, match="does not hold the result"):
        train(run.path)


def test_no_finished_episode_has_no_mean(tmp_path, tiny):
    result = train(tmp_path / "run", tiny("baseline", decisions=2))
    assert result.decisions == 2 and result.episodes == 0 and result.return_mean_last10 is None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("decision", [2, 17, 60])
def test_signals_are_granted_between_two_decisions(tmp_path, tiny, semantic_run, number, decision):
    before = signal.getsignal(number)
    path = tmp_path / "run"
    with pytest.raises(
        SemrlError, match=rf"stopped by {number.name} after {decision} decisions.*--run {path} --resume"
    ):
        train(path, tiny(), observers=[AtDecision(decision - 1, lambda: signal.raise_signal(number))])
    assert signal.getsignal(number) is before
    assert RunFolder.open(path).manifest()["status"] == "interrupted"
    assert int(RunFolder.open(path).load().arrays["decisions"]) == decision
    train(path)
    assert hashes(path) == hashes(semantic_run) and rows(path) == rows(semantic_run)


def test_a_loss_that_is_no_number_fails_and_keeps_the_checkpoint(tmp_path, tiny):
    path = tmp_path / "run"
    with pytest.raises(SemrlError, match=r"diverged; try a smaller --dqn\.learning-rate"):
        train(path, tiny(dqn__learning_rate=1e30, checkpoint_seconds=0.0))
    run = RunFolder.open(path)
    assert run.manifest()["status"] == "failed"
    kept = run.load().arrays
    assert all(np.isfinite(value).all() for name, value in kept.items() if name.startswith("agent/network/"))
    build_trainer(run.config()).from_arrays(kept)


@pytest.mark.parametrize("milestones", [(), (50, 65)])
def test_weights_that_are_no_numbers_are_never_saved(tmp_path, tiny, milestones):
    path = tmp_path / "run"

    class Spoiler(AtDecision):
        def on_decision(self, trainer):
            if trainer.decisions_ == 60:
                next(trainer.agent.network.parameters()).data.fill_(np.nan)

    config = replace(tiny(dqn__learning_starts=10_000, decisions=75), milestones=milestones)
    with pytest.raises(SemrlError, match="no longer numbers"):
        train(path, config, observers=[Spoiler(0, None)])
    assert int(RunFolder.open(path).load().arrays["decisions"]) < 60
    assert list(RunFolder.open(path).milestones()) == [m for m in milestones if m < 60]


@pytest.mark.parametrize("part", ["next_state", "reward"])
def test_models_of_the_world_that_are_no_numbers_are_never_saved(tmp_path, tiny, part):
    class Spoiler(AtDecision):
        def on_decision(self, trainer):
            if trainer.decisions_ == 60:
                network = getattr(trainer.planning.world_model, part).network
                next(network.layers.parameters()).data.fill_(np.nan)

    config = tiny("semantic-map", decisions=75, planning__networks__reward__kind="network")
    with pytest.raises(SemrlError, match="the world model's weights are no longer numbers"):
        train(tmp_path / "run", config, observers=[Spoiler(0, None)])


def test_a_full_disk_keeps_the_checkpoint(tmp_path, tiny, monkeypatch, semantic_run):
    path = tmp_path / "run"
    real, calls = os.fsync, []

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) > 60:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(descriptor)

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(SemrlError, match=r"cannot write .*No space left on device"):
            train(path, tiny(checkpoint_seconds=0.0))
    run = RunFolder.open(path)
    assert not list(path.rglob("*.tmp"))
    assert 10 < int(run.load().arrays["decisions"]) < 40
    train(path)
    assert hashes(path) == hashes(semantic_run)


def test_a_crash_at_any_write_costs_nothing(tmp_path, tiny, monkeypatch):
    """Every file is followed by a crash once: before it has its name, and after."""
    config = tiny("otsu", decisions=12, checkpoint_seconds=0.0)
    train(tmp_path / "whole", config)

    class Crash(BaseException):
        pass

    real, calls = files._sync_folder, []
    limit = [0]

    def crash(folder):
        calls.append(folder)
        if len(calls) == limit[0]:
            raise Crash
        real(folder)

    monkeypatch.setattr(files, "_sync_folder", crash)
    train(tmp_path / "counted", config)
    n_writes = len(calls)
    for limit[0] in [4, 5, 9, *range(n_writes - 4, n_writes + 1)]:
        calls.clear()
        path = tmp_path / f"crash-{limit[0]}"
        with pytest.raises(Crash):
            train(path, config)
        train(path)
        assert hashes(path) == hashes(tmp_path / "whole") and rows(path) == rows(tmp_path / "whole")
        kept = RunFolder.open(path).load(play_only=True).arrays
        assert digest(kept) == hashes(path)["weights"]


def test_a_checkpoint_of_another_configuration_is_refused(tmp_path, tiny, baseline_run):
    run = RunFolder.create(tmp_path / "run", tiny("birch"))
    with pytest.raises(SemrlError, match="stopped"):
        train(baseline_run.with_name("part"), tiny("baseline"), observers=[AtDecision(9, _interrupt)])
    part = RunFolder.open(baseline_run.with_name("part"))
    (run.path / "checkpoints" / "0000000010.npz").write_bytes(part.checkpoints()[-1].read_bytes())
    with pytest.raises(SemrlError, match=r"0000000010\.npz does not fit this run's configuration"):
        train(run.path)


def _interrupt():
    signal.raise_signal(signal.SIGINT)


def test_what_cannot_work_leaves_no_folder(tmp_path, tiny):
    for config in (tiny(env="semrl/FourRooms-v0"), tiny(env="NoSuch-v0")):
        with pytest.raises(UsageError):
            train(tmp_path / "run", config)
    assert list(tmp_path.iterdir()) == []


def test_a_planner_needs_facts(tmp_path, tiny):
    with pytest.raises(UsageError, match="a planner needs facts to reason about, and the encoder 'classes' has none"):
        train(tmp_path / "run", tiny("objects-map", encoder="classes"))
    assert list(tmp_path.iterdir()) == []


def test_a_device_that_is_not_there_is_told_before_anything_is_written(tmp_path, tiny):
    missing = "mps" if torch.cuda.is_available() else "cuda"
    with pytest.raises(UsageError, match=f"device '{missing}' is not there; this machine has cpu"):
        train(tmp_path / "run", tiny("baseline", device=missing))
    assert list(tmp_path.iterdir()) == []
    assert build_trainer(tiny("baseline", device="cpu")).agent.device == torch.device("cpu")


def test_an_encoder_may_be_another_than_the_models(tmp_path, tiny):
    result = train(tmp_path / "run", tiny("baseline", encoder="objects", decisions=100))
    assert result.model == "baseline" and build_trainer(RunFolder.open(tmp_path / "run").config()).encoder.perception
    phases = [row["phase"] for row in read_metrics(tmp_path / "run" / "metrics.csv")]
    assert list(dict.fromkeys(phases))[:4] == ["detection", "reduction", "clustering", "roles"]


@pytest.mark.parametrize("name", ["semantic_run", "tracked_run"])
def test_a_finished_run_keeps_what_play_map_and_world_model_need(request, name):
    folder = RunFolder.open(request.getfixturevalue(name))
    assert len(folder.checkpoints()) == 1
    kept = folder.load()
    trainer = build_trainer(folder.config())
    parts = Parts(encoder=trainer.encoder, agent=trainer.agent, planning=trainer.planning)
    parts.load_inference(kept.arrays)
    assert kept.playable == trainer.inference_arrays().keys()
    assert kept.arrays.keys() == kept.playable | trainer.memory_arrays().keys()
    assert digest({name: kept.arrays[name] for name in kept.playable}) == hashes(folder.path)["weights"]
    assert not any(name.startswith(("agent/replay", "agent/optimiser", "game/")) for name in kept.arrays)


@pytest.mark.parametrize("model", ["semantic", "objects-map"])
def test_a_milestone_holds_what_play_needs_and_no_more(tmp_path, tiny, model):
    """One before perception is ready, one after."""
    train(tmp_path / "run", replace(tiny(model, decisions=120), milestones=(20, 110)))
    folder = RunFolder.open(tmp_path / "run")
    for at, perceiving in ((20, True), (110, False)):
        kept = folder.load(at)
        assert kept.arrays.keys() == kept.playable and bool(kept.arrays["perceiving"]) == perceiving
        assert int(kept.arrays["decisions"]) == at


def test_a_budget_that_is_raised_ends_like_one_that_was_given_at_once(tmp_path, tiny, semantic_run):
    """The run is stopped before its budget is spent: what a finished one has dropped cannot be learned on from."""
    short = tiny(decisions=100)
    with pytest.raises(SemrlError, match="stopped"):
        train(tmp_path / "run", short, observers=[AtDecision(70, _interrupt)])
    (tmp_path / "run" / "config.toml").write_text(write_toml(tiny()))
    train(tmp_path / "run")
    assert hashes(tmp_path / "run") == hashes(semantic_run)


def test_two_processes_cannot_train_one_run(tmp_path, tiny):
    folder = RunFolder.create(tmp_path / "run", tiny())
    with folder.locked(), pytest.raises(UsageError, match="another process"):
        train(folder.path)
    train(folder.path)


def test_a_finished_run_whose_learning_is_lost_is_trained_again(tmp_path, tiny):
    first = train(str(tmp_path / "run"), tiny("otsu", decisions=40))  # a path may be text
    folder = RunFolder.open(tmp_path / "run")
    before = folder.manifest()["hashes"]
    for checkpoint in folder.checkpoints():
        checkpoint.unlink()
    again = train(tmp_path / "run")
    assert folder.manifest()["hashes"] == before and folder.checkpoints()
    assert replace(again, seconds=0) == replace(first, seconds=0)
