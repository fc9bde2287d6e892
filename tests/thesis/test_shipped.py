"""Results that come with the package: found beside the code, whole, and about experiments that there are."""

from pathlib import Path

import semrl_thesis
from semrl_thesis.ledger import Score, read_ledger, read_table
from semrl_thesis.reproduction import SHIPPED, discover
from semrl_thesis.results import read_result


def test_they_lie_in_the_package():
    assert SHIPPED.is_relative_to(Path(semrl_thesis.__file__).parent)


def test_every_run_has_its_row_and_its_returns():
    rows = read_table(SHIPPED / "runs.csv", Score)
    ledger = read_ledger([SHIPPED])
    assert len(rows) == len(ledger.scores) > 0
    assert {path.stem for path in (SHIPPED / "returns").glob("*.csv")} >= {row.id for row in rows}
    assert all(len(ledger.returns[key]) == score.episodes for key, score in ledger.scores.items())


def test_every_experiment_has_a_result_of_its_own_numbers():
    for name, experiment in discover().items():
        values = read_result(SHIPPED / f"{name}.npz").values
        assert {id_.partition("@")[0] for id_ in values} <= {number.id for number in experiment.numbers}, name
