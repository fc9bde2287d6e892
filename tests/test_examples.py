"""Every example runs, and says something; with the smallest settings that make sense."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
CATCH = ["--env", "semrl/Catch-v0"]
RUNS = {
    "actor_critic": ([*CATCH, "--decisions", "200"], "a game brought"),
    "classify": (["--batches", "20"], "kinds"),
    "detect": (["--decisions", "55"], "objects brighter than"),
    "embed": (["--batches", "20", "--decisions", "3"], "cosine similarity"),
    "maze": (["--steps", "1500"], "208 values"),
    "plan": (["--episodes", "10"], "the agent is shown"),
    "query_map": (["--episodes", "10"], "state losses gaining"),
    "sb3_dqn": ([*CATCH, "--decisions", "200"], "on vectors of (256,)"),
    "scene_words": (["--batches", "20"], "pos_x"),
    "state_map": (["--episodes", "10"], "460 states on"),
    "train_and_eval": ([*CATCH, "--model", "semantic", "--decisions", "1500"], "mean return"),
}


def run(name: str, arguments: list[str], folder: Path) -> str:
    """Run one example in a folder of its own and return what it prints."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1", "TMPDIR": str(folder)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_example_is_run():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(RUNS)


SLOW = {"actor_critic": pytest.mark.slow}


@pytest.mark.parametrize("name", [pytest.param(n, marks=SLOW.get(n, ())) for n in RUNS if n != "sb3_dqn"])
def test_example(name, tmp_path):
    arguments, expected = RUNS[name]
    assert expected in run(name, arguments, tmp_path)


def test_stable_baselines_learns_on_our_symbols(tmp_path):
    pytest.importorskip("stable_baselines3")
    arguments, expected = RUNS["sb3_dqn"]
    assert expected in run("sb3_dqn", arguments, tmp_path)


def test_examples_are_short():
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text().splitlines()) <= 45, path.name
