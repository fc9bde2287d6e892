"""Rows and summary of a sweep, and its page."""

import numpy as np
import pytest

from semrl.report.sweep import write_sweep
from semrl.sweep.rows import RunRow
from semrl.sweep.scores import summed_up
from semrl.sweep.specification import Reference, Sweep

SWEEP = Sweep(
    models=("ram", "objects"),
    games=("A", "B"),
    seeds=(0, 1),
    reference={"A": Reference(low=0, high=10), "B": Reference(low=-5, high=5)},
)


def row(model, game, seed, returns, **others):
    return RunRow(
        id=f"{model}-{game}-{seed}", model=model, game=game, variant="usual", seed=seed, decisions=5, episodes=9,
        seconds=3.0, worker="<b>host</b>:1", returns={"training": [0.0], **returns}, state="s", weights="w", **others,
    )  # fmt: skip


ROWS = [
    row("ram", "A", 0, {"agent": [0.0, 0.0]}),
    row("ram", "A", 1, {"agent": [4.0, 4.0]}),
    row("ram", "B", 0, {"agent": [-5.0, 5.0]}),
    row("ram", "B", 1, {"agent": [5.0, 5.0]}),
    row("objects", "A", 0, {"agent": [10.0]}),
]


def test_the_summary_is_of_the_first_policy_and_of_what_is_finished():
    summary = summed_up(SWEEP, ROWS)
    cells = {(cell.agent, cell.game): cell for cell in summary.cells}
    assert summary.measure == "agent" and len(cells) == 4
    assert (cells["ram", "A"].iqm, cells["ram", "A"].low, cells["ram", "A"].high) == (2, 0, 4)
    assert cells["ram", "B"].means == (0, 5)
    assert (cells["objects", "A"].runs, cells["objects", "A"].iqm, cells["objects", "A"].low) == (1, 10, None)
    assert (cells["objects", "B"].runs, cells["objects", "B"].iqm, cells["objects", "B"].means) == (0, None, ())
    assert set(summary.profiles) == {"A", "B", "all games"}
    assert set(summary.profiles["A"]) == {"ram", "objects"}
    assert set(summary.profiles["all games"]) == {"ram"}  # objects has played one game only
    whole = summary.profiles["all games"]["ram"]  # shares: 0 and 0.4 in A, 0.5 and 1 in B
    for threshold, share in ((-0.01, 1), (0.2, 0.75), (0.45, 0.5), (0.7, 0.25), (1, 0)):
        at = np.searchsorted(whole.thresholds, threshold, side="right") - 1
        assert whole.share[at] == share


def test_without_tests_the_last_training_episodes_count():
    sweep = Sweep(models=("ram",), games=("A",), seeds=(0, 1), episodes=0)
    summary = summed_up(sweep, ROWS)
    assert (summary.measure, summary.cells[0].means) == ("training", (0, 0))
    assert summed_up(sweep, []).profiles == {}


@pytest.mark.parametrize("rows", [ROWS, []])
def test_the_page_tells_all_and_takes_names_as_text(tmp_path, rows):
    failed = {"objects-B-0": "<script>no</script>"}
    page = write_sweep(summed_up(SWEEP, rows), rows, failed, tmp_path / "page.html", title="<i>many</i>").read_text()
    assert "<script>no" not in page and "<i>many" not in page and "<b>host" not in page
    assert "&lt;script&gt;no" in page and "all games" in page if rows else "1 failed" in page
    assert page.count("<svg") == (3 if rows else 0)
    assert "http" not in page.replace("http://www.w3.org", "")
