import shutil
from dataclasses import replace

import numpy as np
import pytest

from semrl.core.errors import SemrlError
from semrl.evaluation import evaluate
from semrl.training.metrics import read_metrics
from semrl_thesis.ledger import Score, enter, read_ledger, read_table, score_of, settings_of, summed_up
from semrl_thesis.sweep import RunSpec
from semrl_thesis.trials import Outcome, Trial, outcome_of

SPEC = RunSpec(preset="thesis", model="ram", seed=0, decisions=1000)
SCORE = Score(
    id=SPEC.id, preset="thesis", model="ram", seed=0, decisions=1000, episodes=2, mean=-20.5, max=-20.0, min=-21.0,
    std=0.7, planner=None, seconds=1.5, versions="python=3.11, x=1", machine="Linux", weights="abc",
    settings=settings_of(SPEC.config()),
)  # fmt: skip
EPISODES = np.array([[900.0, -21.0], [1000.0, -20.0]])


def test_the_deviation_is_that_of_a_sample_as_in_the_thesis():
    """Table 4.1: eight wins by 21 and two by 20 are 20.8 ± 0.42; the deviation of a population would be 0.40."""
    row = summed_up(np.array([21.0] * 8 + [20.0] * 2))
    assert {name: round(value, 2) for name, value in row.items()} == {"mean": 20.8, "max": 21, "min": 20, "std": 0.42}
    assert set(summed_up(np.zeros(0)).values()) == {None}


def test_what_is_entered_is_read_again(tmp_path):
    enter(tmp_path, SCORE, EPISODES)
    enter(tmp_path, SCORE, EPISODES)  # again: it stands there once
    ledger = read_ledger([tmp_path])
    assert read_table(tmp_path / "runs.csv", Score) == [SCORE]
    assert ledger.score(SPEC) == SCORE
    np.testing.assert_array_equal(ledger.episodes(SPEC), EPISODES)
    np.testing.assert_array_equal(ledger.last_returns(SPEC), EPISODES[:, 1])


def test_trials_stand_beside_the_run(tmp_path):
    trials = [Trial(), Trial(policy="planner", sticky_actions=0.25)]
    outcomes = [
        Outcome(
            id=SPEC.id, decisions=1000, trial=trial.name, episodes=3, mean=-1.5, max=2.0, min=-4.0, std=3.0, different=2
        )
        for trial in trials
    ]
    enter(tmp_path, SCORE, EPISODES, outcomes)
    enter(tmp_path, replace(SCORE, id="other"), EPISODES, [replace(outcomes[0], id="other")])
    enter(tmp_path, SCORE, EPISODES, outcomes)
    ledger = read_ledger([tmp_path])
    assert [ledger.outcome(SPEC, trial) for trial in trials] == outcomes
    assert ledger.outcome(SPEC, Trial(at=100)) is None
    assert len(read_table(tmp_path / "trials.csv", Outcome)) == 3


def test_a_run_is_done_when_its_trials_were_held(tmp_path):
    spec = replace(SPEC, trials=(Trial(),))
    held = Outcome(id=SPEC.id, decisions=1000, trial=Trial().name, episodes=3, mean=0, max=0, min=0, std=0, different=1)
    enter(tmp_path, SCORE, EPISODES)
    ledger = read_ledger([tmp_path])
    assert (ledger.is_done(SPEC), ledger.is_done(spec)) == (True, False)
    enter(tmp_path, SCORE, EPISODES, [held])
    assert read_ledger([tmp_path]).is_done(spec)
    assert not read_ledger([tmp_path]).is_done(replace(spec, seed=1))


def test_other_settings_are_another_run(tmp_path):
    enter(tmp_path, SCORE, EPISODES)
    ledger = read_ledger([tmp_path])
    assert ledger.score(replace(SPEC, overrides={"dqn": {"batch_size": 33}})) is None
    same = {"threads": 2, "evaluation": {"episodes": 3}, "dqn": {"batch_size": 32}}  # the last is the default
    assert ledger.score(replace(SPEC, overrides=same)) == SCORE


@pytest.mark.parametrize(("preset", "model"), [("thesis", "ram"), ("semrl", "objects-map")])
def test_a_setting_that_is_none_is_like_any_other(preset, model):
    """None is the default of sticky actions: left alone it changes nothing, and what is no default is told from it."""

    def settings(**environment):
        overrides = {"environment": environment} if environment else {}
        return settings_of(RunSpec(preset=preset, model=model, seed=0, decisions=1000, overrides=overrides).config())

    assert settings() == settings(sticky_actions=None)
    assert len({settings(), settings(sticky_actions=0.0), settings(sticky_actions=0.25)}) == 3


def test_another_budget_is_another_run(tmp_path):
    enter(tmp_path, SCORE, EPISODES)
    assert read_ledger([tmp_path]).score(RunSpec(preset="thesis", model="ram", seed=0, decisions=2000)) is None


def test_the_first_folder_counts(tmp_path):
    for name, weights in (("ours", "new"), ("shipped", "old")):
        (tmp_path / name).mkdir()
        enter(tmp_path / name, replace(SCORE, weights=weights), EPISODES)
    found = read_ledger([tmp_path / "ours", tmp_path / "shipped", tmp_path / "nowhere"]).score(SPEC)
    assert found is not None
    assert found.weights == "new"


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("1000", "many"),
        lambda text: text.replace("seed,", ""),
    ],
)
def test_a_damaged_ledger_is_told(tmp_path, damage):
    enter(tmp_path, SCORE, EPISODES)
    path = tmp_path / "runs.csv"
    path.write_text(damage(path.read_text()))
    with pytest.raises(SemrlError, match=r"runs\.csv is damaged"):
        read_ledger([tmp_path])


def test_damaged_returns_are_told(tmp_path):
    enter(tmp_path, SCORE, EPISODES)
    (tmp_path / "returns" / f"{SPEC.id}.csv").write_text("decisions,return\n900,-21\n10")
    with pytest.raises(SemrlError, match=r"thesis-ram-0\.csv is damaged"):
        read_ledger([tmp_path])


def test_games_that_the_planner_played_do_not_count(tracked_run):
    spec = RunSpec(preset="semrl", model="semantic-map", seed=0, decisions=250)
    score, episodes, _ = score_of(spec, tracked_run)
    rows = [row for row in read_metrics(tracked_run / "metrics.csv") if row["phase"] == "agent"]
    own = [float(row["return"]) for row in rows if row["policy"] == "agent"]
    assert score.episodes == len(own) < len(rows)
    assert episodes[:, 1].tolist() == own and score.mean == pytest.approx(np.mean(own[-10:]))


def test_a_trial_is_called_by_what_is_asked(tmp_path):
    assert [trial.name for trial in (Trial(), Trial(at=25_000), Trial(policy="planner", sticky_actions=0.25))] == [
        "agent", "agent-at-25000", "planner-sticky-0.25",
    ]  # fmt: skip
    assert Trial(at=1_234_567).name == "agent-at-1234567"
    assert Trial(policy="planner", at=3000).path(tmp_path) == tmp_path / "evaluation-planner-at-3000.json"


def test_somebody_elses_games_are_no_trial(semantic_run, tmp_path):
    run = shutil.copytree(semantic_run, tmp_path / "run")
    trial = Trial(episodes=2)
    assert not trial.was_held(run)
    for other in ({"episodes": 1}, {"episodes": 2, "seed": 3}):
        evaluate(run, **other)
        assert trial.path(run).exists() and not trial.was_held(run)
    trial.hold(run)
    assert trial.was_held(run) and not Trial(episodes=2, sticky_actions=0.5).was_held(run)
    trial.path(run).write_text("{}")
    with pytest.raises(SemrlError, match="delete it to play again"):
        trial.was_held(run)


def test_a_damaged_trial_is_told(tmp_path):
    Trial().path(tmp_path).write_text('{"mean": 1}')
    with pytest.raises(SemrlError, match=r"evaluation.json is damaged: KeyError.*; delete it to play again"):
        outcome_of(Trial(), tmp_path, id_="run", decisions=1)
