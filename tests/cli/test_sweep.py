"""`semrl sweep`: from a file to rows, summary and page."""

import json
from pathlib import Path

import pytest
import tomli_w

from semrl.training.config import to_dict

JSON_PAGE = Path(__file__).parents[2] / "docs" / "json.md"


@pytest.fixture
def file(tmp_path, tiny):
    settings = to_dict(tiny("baseline", decisions=60))
    for name in ("model", "env", "seed"):
        del settings[name]
    values = {"models": ["baseline"], "games": ["semrl/Catch-v0"], "seeds": [0, 1], "episodes": 2}
    path = tmp_path / "two.toml"
    path.write_text(tomli_w.dumps(values | {"settings": _without_none(settings)}))
    return path


def _without_none(values):
    return {k: _without_none(v) if isinstance(v, dict) else v for k, v in values.items() if v is not None}


def test_a_sweep_is_trained_summed_up_and_not_done_twice(call, file, tmp_path):
    out = tmp_path / "out"
    done = call("sweep", file, "--out", out, "--workers", 2, "--json")
    assert done.status == 0, done.err
    found = json.loads(done.out)
    rows = [json.loads(line) for line in (out / "rows.jsonl").read_text().splitlines()]
    assert [row["seed"] for row in rows] == [0, 1] and found["rows"] == rows
    assert f"| `sweep` | {', '.join(f'`{key}`' for key in found)} |" in JSON_PAGE.read_text()
    assert all(len(row["returns"]["agent"]) == 2 for row in rows)
    (cell,) = found["cells"]
    assert (found["measure"], cell["runs"], cell["agent"], cell["game"]) == ("agent", 2, "baseline", "semrl/Catch-v0")
    assert (out / "report.html").read_text().count("<svg") == 1
    assert "run 1 of 2: baseline-semrl-catch-v0-0, 60 decisions" in done.err
    again = call("sweep", file, "--out", out)
    assert again.status == 0 and "run 1" not in again.err and "interquartile" in again.out
    assert [json.loads(line) for line in (out / "rows.jsonl").read_text().splitlines()] == rows


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--workers", "0"], "--workers"),
        (["--address", "auto"], "needs --engine ray"),
        (["--engine", "ray", "--address", "auto", "--workers", "2"], "--workers is for this machine"),
        (["--engine", "slurm"], "slurm"),
    ],
)
def test_wrong_calls_are_told_in_one_line(call, file, words, message):
    told = call("sweep", file, *words)
    assert told.status == 2 and message in told.message


def test_a_file_that_is_missing_is_told(call, tmp_path):
    told = call("sweep", tmp_path / "none.toml")
    assert told.status == 2 and "cannot read" in told.message
