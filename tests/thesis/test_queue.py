import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import locked
from semrl.training import RunFolder, train
from semrl.training.config import MODELS, merge
from semrl_thesis.ledger import read_ledger
from semrl_thesis.queue import Queue
from semrl_thesis.scores import SWEEPS, TABLE
from semrl_thesis.sweep import CHEAPEST, RunSpec, Sweep, cheapest_first

TINY = {spec.id: spec for spec in SWEEPS["tiny"].runs()}["semrl-semantic-map-0"]
TINY_SETTINGS = merge(TINY.overrides, TINY.overrides["models"]["semantic-map"])
SPEC = RunSpec(preset="semrl", model="semantic", seed=3, decisions=300, overrides=TINY_SETTINGS)
NOTHING = read_ledger([])


def test_a_sweep_is_all_its_runs():
    sweep = Sweep(
        decisions={"thesis": 2, "semrl": 2},
        models=tuple(TABLE),
        seeds={"thesis": ((0,), (0,)), "semrl": ((0,), (0, 1, 2))},
    )
    runs = sweep.runs()
    assert len({run.id for run in runs}) == len(runs) == 7 + 3 + 4 * 3
    assert [run.model for run in runs[:7]] == list(TABLE)
    assert set(TABLE) < set(CHEAPEST) == set(MODELS)
    assert [run.id for run in cheapest_first(runs)][:5] == [
        "thesis-ram-0", "semrl-ram-0", "semrl-ram-1", "semrl-ram-2", "thesis-semantic-0",
    ]  # fmt: skip


@pytest.mark.parametrize("scale", SWEEPS)
def test_every_run_of_a_sweep_has_a_configuration(scale):
    for spec in SWEEPS[scale].runs():
        config = spec.config()
        assert (config.model, config.seed, config.decisions) == (
            spec.model,
            spec.seed,
            SWEEPS[scale].decisions[spec.preset],
        )


def test_a_stopped_queue_goes_on_and_ends_as_if_nothing_had_happened(tmp_path):
    said = []

    def say(text):
        said.append(text)
        if len(said) == 1:
            os.kill(os.getpid(), signal.SIGTERM)

    with pytest.raises(SemrlError, match="the same command goes on"):
        Queue(tmp_path, workers=2, say=say).run_all([SPEC], NOTHING)
    assert said == ["run 1 of 1: semrl-semantic-3, 300 decisions"]
    queue = Queue(tmp_path, workers=1, say=said.append)
    queue.run_all([SPEC], read_ledger([tmp_path]))
    ledger = read_ledger([tmp_path])
    score = ledger.score(SPEC)
    assert not queue.failed
    assert score is not None
    assert len(ledger.episodes(SPEC)) == score.episodes > 0
    queue.run_all([SPEC], ledger)  # nothing to be done, so nothing is said
    assert len(said) == 3

    other = tmp_path / "unbroken"  # a run that is trained already is only entered
    (other / "runs").mkdir(parents=True)
    train(other / "runs" / SPEC.id, SPEC.config())
    Queue(other, workers=1, say=said.append).run_all([SPEC], NOTHING)
    unbroken = read_ledger([other]).score(SPEC)
    assert len(said) == 4
    assert replace(unbroken, seconds=score.seconds) == score


@pytest.mark.slow
def test_a_worker_does_not_outlive_who_started_it(tmp_path):
    """Standard input is at its end from the beginning, as when the queue was killed."""
    words = [sys.executable, "-m", "semrl_thesis.worker", str(tmp_path / "run"), str(tmp_path / "none.toml"), "[]"]
    ended = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=120, check=False)
    assert ended.returncode != 0


def test_a_run_that_fails_is_told_and_the_others_are_done(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    queue = Queue(tmp_path, workers=2, say=lambda _: None)
    queue.run_all([SPEC], NOTHING)
    assert queue.failed == {SPEC.id: "exit status 1"}


def test_a_run_with_other_settings_is_not_gone_on_with(tmp_path):
    (tmp_path / "runs").mkdir()
    RunFolder.create(tmp_path / "runs" / SPEC.id, TINY.config())
    with pytest.raises(UsageError, match="begun with other settings"):
        Queue(tmp_path, workers=1, say=lambda _: None).run_all([SPEC], NOTHING)


def test_two_queues_do_not_share_a_folder(tmp_path):
    with locked(tmp_path / "lock", ""), pytest.raises(UsageError, match="worked on by another process"):
        Queue(tmp_path, workers=1, say=lambda _: None).run_all([SPEC], NOTHING)
