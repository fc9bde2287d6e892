"""A package of somebody else's boxes, installed, trains, resumes, plays and explains without an edit of semrl."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

EXTENSION = Path(__file__).parents[1] / "examples" / "extension"
OPTIONS = """
[perception.otsu]
threshold_frames = 4
[perception.scene]
scenery_frames = 12
[perception.options.bright]
level = 60
[perception.options.leader]
radius = 0.4
[perception.options.grid]
cells = 4
[planning.options.hold]
decisions = 3
[planning.networks.next_state]
epochs = 2
hidden_units = [16]
[stability]
batches = 4
max_batches = 12
decisions = 0
[options.linear]
learning_rate = 0.05
"""
BOXES = [
    "--model", "semantic-map", "--encoder", "scene", "--perception.detector", "bright",
    "--perception.clusterer", "leader", "--perception.embedder", "grid", "--planning.planner", "hold",
    "--planning.world-model", "networks", "--agent", "linear",
]  # fmt: skip


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Install the package into a folder of its own, beside what is there."""
    target = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target"]
    subprocess.run([*command, str(target), str(EXTENSION)], check=True, capture_output=True, timeout=120)
    return target


def semrl(installed, *words, status=0):
    path = os.pathsep.join([str(installed), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-m", "semrl", *map(str, words)], env=environment, capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip
    assert done.returncode == status, done.stderr
    return done


def test_all_five_boxes_train_resume_play_and_explain(installed, tmp_path):
    (tmp_path / "options.toml").write_text(OPTIONS)
    run = tmp_path / "run"
    words = [
        "train",
        "--run",
        run,
        "--config",
        tmp_path / "options.toml",
        "--env",
        "semrl/Catch-v0",
        "--decisions",
        300,
    ]
    result = json.loads(semrl(installed, *words, *BOXES, "--json").stdout)
    assert result["decisions"] == 300 and result["episodes"] > 0
    assert "weights_norm" in (run / "metrics.csv").read_text().splitlines()[0]
    assert json.loads(semrl(installed, "train", "--run", run, "--resume", "--json").stdout)["decisions"] == 300
    played = json.loads(semrl(installed, "eval", run, "--episodes", 1, "--json").stdout)
    assert played["episodes"] == 1
    planned = json.loads(semrl(installed, "eval", run, "--episodes", 1, "--policy", "planner", "--json").stdout)
    assert planned["policy"] == "planner"
    explained = json.loads(semrl(installed, "explain", run, "--episode", 0, "--step", 3, "--json").stdout)
    assert all(len(scenario["actions"]) == 3 for scenario in explained["scenarios"])


def test_what_does_not_fit_is_one_line(installed, tmp_path):
    (tmp_path / "wrong.toml").write_text("[perception.options.leader]\nwidth = 1\n")
    words = ["train", "--run", tmp_path / "run", "--env", "semrl/Catch-v0", "--decisions", 20]
    wrong = semrl(installed, *words, "--config", tmp_path / "wrong.toml", *BOXES, status=2)
    assert "options.leader" in wrong.stderr and len(wrong.stderr.strip().splitlines()) == 1
    unknown = semrl(installed, *words, "--perception.clusterer", "leaders", status=2)
    assert "did you mean 'leader'" in unknown.stderr
    assert not (tmp_path / "run").exists()


def test_every_box_is_one_short_file():
    for path in (EXTENSION / "semrl_extension").glob("*.py"):
        assert len(path.read_text().splitlines()) <= 60, path.name
