import csv

import pytest

from semrl.core.errors import SemrlError
from semrl.training.metrics import COLUMNS, MetricsFile, read_metrics


def row(decisions):
    return {"phase": "agent", "decisions": decisions, "return": -1.5}


@pytest.fixture
def path(tmp_path):
    metrics = MetricsFile(tmp_path / "metrics.csv")
    for i in range(5):
        metrics.write(row(i))
    metrics.close()
    return metrics.path


def test_rows_come_back(path):
    rows = read_metrics(path)
    assert [int(r["decisions"]) for r in rows] == list(range(5))
    assert all(tuple(r) == COLUMNS and r["return"] == "-1.5" and r["clusters"] == "" for r in rows)
    with path.open(newline="") as file:
        assert list(csv.DictReader(file)) == rows


def test_a_column_that_is_new_is_added_to_all_rows(path):
    metrics = MetricsFile(path, n_rows=5)
    metrics.write(row(5) | {"loss": 0.25, "map_nodes": 3})
    assert [r["loss"] for r in read_metrics(path)] == [""] * 5 + ["0.25"]  # at once: people watch the file grow
    metrics.write(row(6) | {"map_nodes": 4, "seconds_map": 1.5})
    metrics.write(row(7))
    metrics.close()
    rows = read_metrics(path)
    assert all(tuple(r) == (*COLUMNS, "loss", "map_nodes", "seconds_map") for r in rows)
    assert [r["decisions"] for r in rows] == [str(i) for i in range(8)]
    assert [r["map_nodes"] for r in rows] == [""] * 5 + ["3", "4", ""]
    assert metrics.n_rows == 8 and all(r["return"] == "-1.5" for r in rows)


@pytest.mark.parametrize("kept", [3, 6, 7])
def test_columns_are_there_again_after_a_resume(path, kept):
    """Those that only rows have which no checkpoint knows go with them, or stay empty; the same are written again."""
    metrics = MetricsFile(path, n_rows=5)
    for i in (5, 6):
        metrics.write(row(i) | {"loss": 0.25 * i})
    metrics.close()
    again = MetricsFile(path, n_rows=kept)
    for i in range(kept, 8):
        again.write(row(i) | ({"loss": 0.25 * i} if i > 4 else {}))
    again.close()
    rows = read_metrics(path)
    assert [r["loss"] for r in rows] == [""] * 5 + ["1.25", "1.5", "1.75"]
    assert [r["decisions"] for r in rows] == [str(i) for i in range(8)]


def test_rows_that_no_checkpoint_knows_are_dropped(path):
    metrics = MetricsFile(path, n_rows=3, seconds=100.0)
    assert metrics.n_rows == 3 and metrics.seconds >= 100
    metrics.write(row(77))
    metrics.close()
    assert [int(r["decisions"]) for r in read_metrics(path)] == [0, 1, 2, 77]


def test_rows_that_a_checkpoint_knows_must_be_there(path):
    with pytest.raises(SemrlError, match=r"is damaged: it has 5 rows, where the checkpoint knows of 6"):
        MetricsFile(path, n_rows=6)


def test_a_new_file_forgets_the_old_one(path):
    MetricsFile(path).close()
    assert read_metrics(path) == []


def test_a_half_written_line_is_left_out(path):
    text = path.read_text()
    path.write_text(text[:-4])
    assert len(read_metrics(path)) == 4
    path.write_text(text[:20])
    assert read_metrics(path) == []


def test_no_file_has_no_rows(tmp_path):
    assert read_metrics(tmp_path / "none.csv") == []


@pytest.mark.parametrize("damage", [b"\xff\xfe\xfd\n", b"agent,1\n", b"a" * 10 + b",1" * 40 + b"\n"])
def test_damage_is_told(path, damage):
    path.write_bytes(path.read_bytes() + damage)
    with pytest.raises(SemrlError, match=r"metrics\.csv is damaged"):
        MetricsFile(path, n_rows=6)


def test_other_columns_are_told(path):
    path.write_text("a,b\n1,2\n")
    with pytest.raises(SemrlError, match="does not begin with the columns"):
        read_metrics(path)


def test_a_full_disk_is_told(path):
    metrics = MetricsFile(path)
    metrics._file.close()
    metrics._file = open("/dev/full", "w")  # noqa: PTH123, SIM115 - stays open, as the metrics do
    metrics._writer = csv.DictWriter(metrics._file, COLUMNS)
    with pytest.raises(SemrlError, match=r"cannot write .*metrics\.csv: No space left"):
        metrics.write(row(0))
    with pytest.raises(SemrlError, match="No space left"):
        metrics.flush()
    metrics.close()
    assert metrics._file.closed
