"""What works: the five models, settings from everywhere, one JSON object, help."""

import dataclasses
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from semrl import __version__
from semrl.cli import doctor
from semrl.cli.main import COMMANDS
from semrl.training import RunConfig, RunFolder, preset
from semrl.training.metrics import read_metrics

TRAIN_KEYS = {"run", "model", "env", "seed", "frames", "decisions", "episodes", "return_mean_last10", "seconds"}
EVAL_KEYS = {"run", "policy", "episodes", "mean", "std", "min", "max", "returns", "lengths", "rewards", "conditions"}


ROOT = Path(__file__).parents[2]


def only_json(result):
    """Return the one JSON object that is all of standard output."""
    assert result.status == 0, result.err
    assert result.out.count("\n") == 1
    return json.loads(result.out)


def documented(command):
    """Return the keys that docs/json.md names."""
    (row,) = re.findall(rf"^\| `{command}` \| (.*) \|$", (ROOT / "docs" / "json.md").read_text(), re.MULTILINE)
    return set(re.findall(r"`(\w+)`", row))


@pytest.mark.parametrize("command", ["predict --decisions 10", "explain --step 3", "rules", "map", "doctor", "report"])
def test_the_keys_of_json_are_documented(call, ram_map_run, tmp_path, command):
    run = shutil.copytree(ram_map_run, tmp_path / "run")
    name, *flags = command.split()
    told = only_json(call(name, *([] if name == "doctor" else [run]), *flags, "--json"))
    assert told.keys() == documented(name)


def test_rules_are_printed_with_how_they_did_in_new_play(call, tracked_run):
    printed = call("rules", tracked_run, "--check", 40).out
    assert "agrees with the world model in" in printed
    assert "agrees with" not in call("rules", tracked_run, "--check", 0).out
    told = only_json(call("rules", tracked_run, "--check", 40, "--json"))
    assert told.keys() == documented("rules") and told["checks"]
    assert {"agreed", "right", "world_model_right"} < told["checks"][0].keys()


def test_the_keys_of_training_and_evaluation_are_documented():
    assert documented("train") == TRAIN_KEYS and documented("eval") == EVAL_KEYS
    assert documented("reproduce") == {"page", "results"}


@pytest.mark.parametrize("model", ["baseline", "otsu", "birch", "semantic", "semantic-map", "ram"])
def test_all_models_train_and_play(call, tmp_path, tiny_toml, model):
    run = tmp_path / "run"
    told = only_json(
        call("train", "--model", model, "--config", tiny_toml(model, decisions=80), "--run", run, "--json")
    )
    assert told.keys() == TRAIN_KEYS
    assert told["run"] == str(run) and told["model"] == model and told["seed"] == 0
    assert told["frames"] == 320 and told["decisions"] == 80 and told["seconds"] > 0
    assert told["env"] == ("PongNoFrameskip-v4" if model == "ram" else "semrl/Catch-v0")
    returns = [float(row["return"]) for row in read_metrics(run / "metrics.csv") if row["phase"] == "agent"]
    assert told["episodes"] == len(returns)
    assert told["return_mean_last10"] == (pytest.approx(np.mean(returns[-10:])) if returns else None)
    if model != "ram":  # an episode of Pong is long
        played = only_json(call("eval", run, "--episodes", 2, "--seed", 3, "--json"))
        assert played.keys() == EVAL_KEYS and played["policy"] == "agent"
        assert played["episodes"] == len(played["returns"]) == 2


def test_the_planner_plays_alone(call, tmp_path, map_run):
    run = shutil.copytree(map_run, tmp_path / "run")
    played = only_json(call("eval", run, "--policy", "planner", "--episodes", 3, "--seed", 3, "--json"))
    assert played.keys() == EVAL_KEYS and played["policy"] == "planner" and len(played["returns"]) == 3
    written = json.loads((run / "evaluation-planner.json").read_text())
    assert {name: written[name] for name in EVAL_KEYS} == played and not (run / "evaluation.json").exists()
    assert only_json(call("eval", run, "--episodes", 1, "--json"))["policy"] == "agent"
    assert (run / "evaluation.json").exists()
    told = call("eval", run, "--policy", "planner", "--episodes", 1)
    assert told.status == 0 and re.search(r"^episodes +1 *$", told.out, re.M)


def test_how_far_it_sees_ahead_is_told_and_written(call, tmp_path, map_run):
    run = shutil.copytree(map_run, tmp_path / "run")
    told = only_json(call("predict", run, "--decisions", 50, "--seed", 3, "--json"))
    written = json.loads((run / "predictions.json").read_text())
    assert told.pop("run") == str(run)
    assert written["conditions"] == {"learned_from": 150, "seed": 3, "policy": "agent", "exploration": 0.01}
    assert written == told and told["decisions"] == 50 and np.sum(told["confusion"]) == told["decisions"]
    result = call("predict", run, "--decisions", 50, "--seed", 3)
    assert result.status == 0 and f"{told['explained']['1']:.1%} of the variance" in result.out
    assert f"{told['confusion'][2][2]} of {sum(told['confusion'][2])}" in result.out


def test_people_are_told_as_well(call, tmp_path, tiny_toml):
    run = tmp_path / "run"
    trained = call("train", "--config", tiny_toml("otsu", decisions=100), "--run", run)
    assert trained.status == 0 and "100 decisions (400 frames)" in trained.out
    assert "otsu on semrl/Catch-v0, seed 0" in trained.err and "detection" in trained.err
    played = call("eval", run, "--episodes", 1)
    assert played.status == 0 and re.search(r"^episodes +1 *$", played.out, re.M)


def test_going_on_with_a_finished_run_tells_its_result(call, semantic_run):
    result = call("train", "--resume", "--run", semantic_run, "--json")
    assert only_json(result)["decisions"] == 150 and result.err == ""


def test_flags_win_over_the_file_and_the_file_over_the_preset(call, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'model = "baseline"\nenv = "semrl/Catch-v0"\ndecisions = 2\nseed = 5\n'
        "[dqn]\nn_steps = 2\nreplay_capacity = 50\n"
    )
    run = tmp_path / "run"
    assert call("train", "--config", path, "--seed", 6, "--dqn.batch-size=7", "--run", run).status == 0
    config = RunFolder.open(run).config()
    expected = preset("semrl", "baseline")
    dqn = dataclasses.replace(expected.dqn, n_steps=2, replay_capacity=50, batch_size=7)
    assert config == dataclasses.replace(expected, env="semrl/Catch-v0", decisions=2, seed=6, dqn=dqn)


def test_the_preset_is_the_thesis_when_asked_for(call, tmp_path):
    run = tmp_path / "run"
    flags = ["--env", "semrl/Catch-v0", "--decisions", "2", "--dqn.replay-capacity", "50"]
    assert call("train", "--preset", "thesis", "--model", "otsu", *flags, "--run", run).status == 0
    dqn = dataclasses.replace(RunConfig().dqn, replay_capacity=50)
    assert RunFolder.open(run).config() == RunConfig(model="otsu", env="semrl/Catch-v0", decisions=2, dqn=dqn)


def test_a_run_gets_a_name_of_its_own(call, tmp_path, tiny_toml, monkeypatch):
    settings = tiny_toml("baseline", decisions=2)
    monkeypatch.chdir(tmp_path)
    told = only_json(call("train", "--config", settings, "--json"))
    assert re.fullmatch(r"runs/baseline-catch-v0-0-\d{8}-\d{6}", told["run"])
    assert RunFolder.open(tmp_path / told["run"]).manifest()["status"] == "finished"


def test_tensorboard_gets_every_number(call, tmp_path, tiny_toml):
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    run = tmp_path / "run"
    assert call("train", "--config", tiny_toml("semantic"), "--run", run, "--tensorboard").status == 0
    events = EventAccumulator(str(run / "tensorboard"))
    events.Reload()
    written = [(event.step, event.value) for event in events.Scalars("agent/return")]
    rows = [row for row in read_metrics(run / "metrics.csv") if row["phase"] == "agent"]
    assert written == [(int(row["decisions"]), float(row["return"])) for row in rows]
    assert {"reduction/batches", "clustering/clusters", "agent/length"} <= set(events.Tags()["scalars"])


def test_doctor_knows_every_package(call):
    told = only_json(call("doctor", "--json"))
    packages = {row["package"]: row for row in told["packages"]}
    assert {"numpy", "torch", "gymnasium", "gensim", "stable-baselines3"} <= packages.keys()
    assert packages["numpy"]["installed"] == np.__version__ and packages["gensim"]["for"] == "thesis"
    assert "numpy" in call("doctor").out


def test_doctor_sees_what_is_missing_or_too_old(call, monkeypatch):
    monkeypatch.setattr(doctor, "requires", lambda _: ["numpy>=99", "no-such-thing>=2; extra == 'sb3'", "torch>=1"])
    result = call("doctor", "--json")
    told = json.loads(result.out)
    assert result.status == 1 and "semrl cannot work without numpy (" in result.message
    assert [row["ok"] for row in told["packages"]] == [False, False, True]
    assert "pip install 'numpy>=99' 'no-such-thing>=2'" in call("doctor").out


@pytest.mark.parametrize("argv", [[], ["--help"], ["-h"], ["--version"], *([name, "--help"] for name in COMMANDS)])
def test_help_is_always_there(call, argv):
    result = call(*argv)
    assert result.status == 0 and result.err == ""
    if argv == ["--version"]:
        assert result.out == f"semrl {__version__}\n"
    elif len(argv) == 2:
        assert f"usage: semrl {argv[0]}" in result.out
        assert ("--json" in result.out) != (argv[0] in ("watch", "completion"))  # for people, for shells
    else:
        assert all(f"semrl {name}" in result.out for name in COMMANDS)


def settings(kind, path=""):
    for field in dataclasses.fields(kind):
        inner = field.default_factory if dataclasses.is_dataclass(field.default_factory) else None
        if inner:
            yield from settings(inner, f"{path}{field.name}.")
        elif field.name != "options":  # what other packages add stands in a file
            yield f"{path}{field.name}"


def test_the_help_explains_every_setting(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")  # one column
    explained, flag = {}, ""
    for line in call("train", "--help").out.splitlines():
        text = line.strip("│| ")
        if text.startswith("--"):
            flag, _, rest = text.partition(" ")
            flag = flag.rstrip(",")
            text = re.sub(r"^(\{\S*\}(\|\w+)?|\[.*\]|[A-Z]+)", "", rest)
        explained[flag] = f"{explained.get(flag, '')} {text}"
    names = list(settings(RunConfig))
    assert len(names) > 60
    for path in names:
        tables, _, last = path.replace("_", "-").rpartition(".")
        stem = f"--{tables}." if tables else "--"
        text = explained.get(f"{stem}{last}", "").strip() or explained.get(f"{stem}no-{last}", "")
        assert text, f"{path} is no flag"
        assert len(text.split("(default")[0].split()) >= 3, f"{path} is not explained"


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_signals_stop_a_process_in_one_line(call, tmp_path, tiny_toml, number):
    run = tmp_path / "run"
    path = tiny_toml("otsu", decisions=1_000_000, checkpoint_seconds=0.05)
    argv = ["train", "--config", path, "--run", str(run), "--json"]
    process = subprocess.Popen(
        [sys.executable, "-c", "import sys; from semrl.cli import main; sys.exit(main())", *argv],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"OMP_NUM_THREADS": "1"}, text=True,
    )  # fmt: skip
    while not list((run / "checkpoints").glob("*.npz")) and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1 and out == "" and "Traceback" not in err
    last = err.splitlines()[-1]
    assert last.startswith(f"semrl: stopped by {number.name} after ")
    assert last.endswith(f"go on with: semrl train --run {run} --resume")
    decisions = int(re.search(r"after ([\d,]+) decisions", last)[1].replace(",", ""))
    folder = RunFolder.open(run)
    assert folder.manifest()["status"] == "interrupted"
    assert int(folder.load().arrays["decisions"]) == decisions
