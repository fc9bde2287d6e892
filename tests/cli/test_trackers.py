"""Numbers that go to MLflow, and a tracker that is lost while a run is trained."""

import pytest

from semrl.cli.trackers import Tracker
from semrl.core.errors import SemrlWarning
from semrl.training import train
from semrl.training.metrics import read_metrics


def test_mlflow_gets_every_number_and_goes_on_in_the_same_run(call, tmp_path, tiny_toml, monkeypatch):
    mlflow = pytest.importorskip("mlflow", reason="needs the extra 'mlflow'")
    uri = (tmp_path / "mlruns").as_uri()
    for name, value in {"TRACKING_URI": uri, "ALLOW_FILE_STORE": "true", "EXPERIMENT_NAME": "tiny"}.items():
        monkeypatch.setenv(f"MLFLOW_{name}", value)
    run = tmp_path / "run"
    done = call("train", "--config", tiny_toml("baseline", decisions=75), "--run", run, "--mlflow")
    assert done.status == 0 and "nothing more is tracked" not in done.err, done.err
    client = mlflow.MlflowClient(tracking_uri=uri)
    (found,) = client.search_runs([client.get_experiment_by_name("tiny").experiment_id])
    assert (found.info.status, found.info.run_name, found.data.params["dqn.batch_size"]) == ("FINISHED", "run", "8")
    returns = client.get_metric_history(found.info.run_id, "agent/return")
    rows = [row for row in read_metrics(run / "metrics.csv") if row["return"]]
    assert [(one.step, one.value) for one in returns] == [(int(r["decisions"]), float(r["return"])) for r in rows]
    assert call("train", "--run", run, "--resume", "--mlflow").status == 0
    assert len(client.search_runs([client.get_experiment_by_name("tiny").experiment_id])) == 1


class Lost:
    """Takes one row, then its server is gone."""

    def __init__(self):
        self.written = []

    def write(self, values, decisions):
        if self.written:
            raise ConnectionError("the server is gone\nwith a long story")
        self.written.append((values, decisions))

    def close(self, *, failed):
        raise AssertionError("a tracker that is lost is not spoken to any more")


def test_a_tracker_that_is_lost_ends_no_training(tmp_path, tiny):
    lost = Lost()
    with (
        pytest.warns(SemrlWarning, match="the server is gone; training goes on") as warned,
        Tracker(lambda: lost) as it,
    ):
        train(tmp_path / "run", tiny("semantic", decisions=60), observers=[it])
    assert len([one for one in warned if one.category is SemrlWarning]) == 1
    ((values, decisions),) = lost.written
    assert decisions > 0 and all("/" in name for name in values)


@pytest.mark.parametrize("failed", [False, True])
def test_a_tracker_says_how_the_training_ended(failed):
    class Kept(Lost):
        def close(self, *, failed):
            self.failed = failed

    kept = Kept()
    try:
        with Tracker(lambda: kept) as tracker:
            tracker.on_row({"phase": "agent", "decisions": 3, "return": 1.0, "policy": "agent"})
            if failed:
                raise RuntimeError
    except RuntimeError:
        pass
    assert kept.written == [({"agent/return": 1.0}, 3)] and kept.failed == failed
