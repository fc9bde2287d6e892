import sys
from dataclasses import replace

import pytest

from semrl.training import train
from semrl.training.config import MODELS, merge
from semrl_thesis.ledger import read_ledger
from semrl_thesis.queue import train_all
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


def test_finished_runs_are_entered_into_the_ledger(tmp_path):
    said = []
    assert train_all([SPEC], tmp_path, NOTHING, workers=1, say=said.append) == {}
    ledger = read_ledger([tmp_path])
    score = ledger.score(SPEC)
    assert score is not None
    assert len(ledger.episodes(SPEC)) == score.episodes > 0
    assert said[0] == "run 1 of 1: semrl-semantic-3, 300 decisions"
    assert said[-1].startswith("semrl-semantic-3 finished after")
    again = []
    train_all([SPEC], tmp_path, ledger, workers=1, say=again.append)  # nothing to be done, so nothing is said
    assert again == []

    other = tmp_path / "unbroken"  # a run that is trained already is only entered
    (other / "runs").mkdir(parents=True)
    train(other / "runs" / SPEC.id, SPEC.config())
    train_all([SPEC], other, NOTHING, workers=1, say=again.append)
    unbroken = read_ledger([other]).score(SPEC)
    assert len(again) == 1
    assert replace(unbroken, seconds=score.seconds) == score


def test_a_run_that_fails_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert train_all([SPEC], tmp_path, NOTHING, workers=2, say=lambda _: None) == {SPEC.id: "exit status 1"}
