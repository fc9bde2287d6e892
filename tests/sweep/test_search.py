"""A search proposes what its seed and what is known say, goes on where it was, and finds what is best."""

import json

import pytest
import tomli_w

from semrl.core.errors import SemrlError, UsageError
from semrl.sweep.rows import RunRow
from semrl.sweep.search import LOG, Proposal, best_of, propose, read_proposals, valued, with_trials, write_proposals
from semrl.sweep.specification import Search, Searched, Sweep, read_sweep
from semrl.training.config import to_dict

pytest.importorskip("optuna", reason="the extra 'optuna' is not installed")

SPACE = {
    "dqn.learning_rate": Searched(low=1e-4, high=1e-2, log=True),
    "dqn.n_steps": Searched(low=1, high=4),
    "dqn.network.hidden_units": Searched(choices=("8", "16")),
}


def lived(search, value, most):
    """Search with a known answer; return the trials."""
    known = []
    while len(known) < most and (fresh := propose(search, known)):
        known += [Proposal(number=one.number, settings=one.settings, value=value(one.settings)) for one in fresh]
    return known


def row(variant, returns, seconds=1.0, seed=0):
    return RunRow(
        id=f"{variant}-{seed}", model="ram", game="g", variant=variant, seed=seed, decisions=1, episodes=1,
        seconds=seconds, worker="", returns={"agent": returns}, state="", weights="",
    )  # fmt: skip


def test_proposals_follow_from_the_seed_and_what_is_known():
    search = Search(settings=SPACE, trials=12, seed=3, at_once=3, random_trials=4)
    trials = lived(search, lambda settings: -settings["dqn.n_steps"], 12)
    assert [one.number for one in trials] == list(range(12))
    for one in trials:
        assert 1e-4 <= one.settings["dqn.learning_rate"] <= 1e-2 and one.settings["dqn.n_steps"] in (1, 2, 3, 4)
    assert propose(search, trials[:6]) == [Proposal(number=one.number, settings=one.settings) for one in trials[6:9]], (
        "who goes on after six proposes what was proposed after six"
    )
    assert propose(search, trials) == []
    other = Search(settings=SPACE, trials=12, seed=4, at_once=3, random_trials=4)
    assert propose(other, [])[0].settings != trials[0].settings


@pytest.mark.parametrize(("objective", "sign"), [("return", 1), ("seconds", -1)])
def test_it_finds_what_is_best(objective, sign):
    search = Search(settings={"x.y": Searched(low=0.0, high=1.0)}, trials=30, objective=objective, random_trials=8)
    trials = lived(search, lambda settings: -sign * (settings["x.y"] - 0.7) ** 2, 30)
    best = best_of(search, trials)
    assert abs(best.settings["x.y"] - 0.7) < 0.1
    late = [abs(one.settings["x.y"] - 0.7) for one in trials[15:]]
    assert sum(late) / len(late) < 0.2, "what is known is used: by chance the distance would be 0.29"


def test_values_are_means_over_seeds_and_what_is_missing_has_failed():
    search = Search(settings={"x.y": Searched(low=0.0, high=1.0)}, trials=2)
    trial = Proposal(number=1, settings={"x.y": 0.5})
    rows = [row("trial-001", [1, 3]), row("trial-001", [4], seed=1), row("trial-000", [100])]
    assert valued(search, trial, rows, "agent", 2).value == 3.0
    assert valued(search, trial, rows[1:], "agent", 2).failed
    assert valued(search, trial, [row("trial-001", [])], "agent", 1).failed
    fast = Search(settings=search.settings, trials=2, objective="seconds")
    assert valued(fast, trial, [row("trial-001", [], 7.0)], "agent", 1).value == 7.0
    assert best_of(search, [Proposal(number=0, settings={}, failed=True)]) is None


def test_the_log_is_read_as_it_was_written_and_damage_is_told(tmp_path):
    trials = [Proposal(number=0, settings={"a.b": 1, "c": "x"}, value=0.5), Proposal(number=1, settings={"a.b": 2})]
    write_proposals(tmp_path, trials)
    assert read_proposals(tmp_path) == trials and read_proposals(tmp_path / "none") == []
    assert [one.is_open for one in trials] == [False, True]
    (tmp_path / LOG).write_text('{"number": 0')
    with pytest.raises(SemrlError, match="damaged"):
        read_proposals(tmp_path)
    with pytest.raises(UsageError, match="other settings"):
        propose(Search(settings=SPACE, trials=3), trials)


def test_trials_are_variants():
    sweep = Sweep(models=("ram",), seeds=(0, 1), settings={"decisions": 50})
    trials = [Proposal(number=7, settings={"dqn.n_steps": 2, "dqn.batch_size": 9})]
    (cell,) = with_trials(sweep, trials).cells()
    assert cell.id == "ram-pong-trial-007"
    assert cell.settings == {"decisions": 50, "dqn": {"n_steps": 2, "batch_size": 9}}


@pytest.fixture
def file(tmp_path, tiny):
    """Return a function that writes a file which searches over two settings of a tiny agent."""
    whole = to_dict(tiny("baseline", decisions=60))
    settings = {name: value for name, value in whole.items() if name not in ("model", "env", "seed")}

    def plain(values):
        return {k: plain(v) if isinstance(v, dict) else v for k, v in values.items() if v is not None}

    def write(trials):
        dqn = {"n_steps": {"low": 1, "high": 3}, "learning_rate": {"low": 1e-4, "high": 1e-2, "log": True}}
        search = {"trials": trials, "at_once": 2, "random_trials": 2, "settings": {"dqn": dqn}}
        values = {"models": ["baseline"], "games": ["semrl/Catch-v0"], "seeds": [0], "episodes": 1}
        path = tmp_path / "search.toml"
        path.write_text(tomli_w.dumps(values | {"settings": plain(settings), "search": search}))
        return path

    return write


def test_a_search_is_trained_goes_on_and_tells_the_best(call, file, tmp_path, monkeypatch):
    out = tmp_path / "out"

    def stopped(*_arguments, **_options):
        raise SemrlError("stopped")

    with monkeypatch.context() as patched:
        patched.setattr("semrl.cli.sweep.run_all", stopped)
        assert call("sweep", file(3), "--out", out).status == 1
    proposed = read_proposals(out)
    assert len(proposed) == 2 and all(one.is_open for one in proposed)
    told = call("sweep", file(3), "--out", out, "--workers", 2, "--json")
    assert told.status == 0, told.err
    found = json.loads(told.out)
    assert [one["settings"] for one in found["trials"][:2]] == [one.settings for one in proposed]
    assert [row["variant"] for row in found["rows"]] == ["trial-000", "trial-001", "trial-002"]
    for trial, row_ in zip(found["trials"], found["rows"], strict=True):
        assert trial["value"] == sum(row_["returns"]["agent"]) / len(row_["returns"]["agent"])
    assert found["best"]["value"] == max(one["value"] for one in found["trials"])
    again = call("sweep", file(3), "--out", out)
    assert again.status == 0 and "run 1" not in again.err and f"best: trial-{found['best']['number']:03}" in again.out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("trials = 3\n[search.settings]\ndqn.nstep = {low = 1, high = 2}", "nstep"),
        ("trials = 3\n[search.settings]\ndqn.n_steps = {low = 0, high = 2}", "n_steps"),
        ("trials = 3\n[search.settings]\ndqn.n_steps = {low = 3, high = 2}", "low must lie below high"),
        ("trials = 3\n[search.settings]\ndqn.n_steps = {low = 3}", "choices, or low and high"),
        ("trials = 3\n[search.settings]\ndqn.n_steps = {choices = [1], low = 3, high = 4}", "choices, or low and high"),
        ("trials = 3\n[search.settings]\ndqn.learning_rate = {low = 0.0, high = 1.0, log = true}", "above 0"),
        ("trials = 0\n[search.settings]\ndqn.n_steps = {low = 1, high = 2}", "1 or more"),
        ("trials = 3\n[search.settings]", "must name a setting"),
        ("trials = 3\n[search.settings]\nseed = {low = 1, high = 2}", "given by seeds"),
        ("trials = 3\nobjective = 'x'\n[search.settings]\ndqn.n_steps = {low = 1, high = 2}", "objective"),
        (
            "trials = 3\n[search.settings]\ndqn.n_steps = {low = 1, high = 2}\n[variants.a]\ndecisions = 9",
            "makes the variants",
        ),
    ],
)
def test_what_cannot_be_searched_is_told_before(tmp_path, text, said):
    path = tmp_path / "search.toml"
    path.write_text(f'models = ["ram"]\nseeds = [0]\n[search]\n{text}\n')
    with pytest.raises(UsageError, match=said) as told:
        read_sweep(path)
    assert "\n" not in str(told.value)


def test_a_search_is_of_one_model_in_one_game(tmp_path):
    path = tmp_path / "search.toml"
    path.write_text(
        'models = ["ram", "baseline"]\nseeds = [0]\n[search]\ntrials = 1\n'
        'settings = {"dqn.n_steps" = {low = 1, high = 2}}'
    )
    with pytest.raises(UsageError, match="one model in one game"):
        read_sweep(path)
