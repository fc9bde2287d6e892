"""Many runs side by side end as if each had been trained alone, whatever happens to their workers."""

import os
import signal
import subprocess
import sys

import pytest

from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import locked
from semrl.sweep import LocalPool, RayPool, Task, Trial, run_all
from semrl.sweep import engine as engines
from semrl.training import RunFolder, train
from semrl.training.metrics import read_metrics

DECISIONS = 250


@pytest.fixture(scope="module")
def configs(tiny):
    """Of two runs that save all the time."""
    return [tiny("semantic", seed=seed, decisions=DECISIONS, checkpoint_seconds=0.05) for seed in (3, 4)]


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory, configs):
    """What the two come to when nothing happens to them."""
    folder = tmp_path_factory.mktemp("unbroken")
    for config in configs:
        train(folder / str(config.seed), config)
    return [ended(folder / str(config.seed)) for config in configs]


def ended(run):
    rows = read_metrics(run / "metrics.csv")
    told = [{name: value for name, value in row.items() if not name.startswith("seconds")} for row in rows]
    return RunFolder.open(run).manifest()["hashes"], told


def tasks_of(configs, folder, **of_task):
    return [
        Task(id=f"run-{config.seed}", run=folder / "runs" / str(config.seed), config=config, **of_task)
        for config in configs
    ]


def test_a_run_whose_worker_is_killed_goes_on_and_ends_like_the_unbroken_one(tmp_path, configs, unbroken):
    tasks = tasks_of(configs, tmp_path, trials=(Trial(episodes=1),))
    said, killed, finished = [], [], []

    def kill_once(states):
        task = states[0].task
        if states[0].status == "running" and task.reached() > 60 and not killed:
            killed.append(task.worker())
            os.kill(int(task.worker().rpartition(":")[2]), signal.SIGKILL)

    states = run_all(tasks, LocalPool(2), tmp_path, say=said.append, show=kill_once, on_finished=finished.append)
    assert [state.status for state in states] == ["finished", "finished"]
    assert len(killed) == 1 and [line for line in said if "lost its worker" in line]
    assert [line.partition(", from")[0] for line in said].count(f"run 1 of 2: run-3, {DECISIONS} decisions") == 2
    assert killed != [tasks[0].worker()]
    assert [ended(task.run) for task in tasks] == unbroken
    assert all(task.is_done() for task in tasks) and len(finished) == 2
    assert run_all(tasks, LocalPool(2), tmp_path, say=said.append)[0].status == "finished"


@pytest.mark.slow
def test_a_stopped_sweep_goes_on_and_ends_as_if_nothing_had_happened(tmp_path, configs, unbroken):
    said = []

    def say(text):
        said.append(text)
        if len(said) == 1:
            os.kill(os.getpid(), signal.SIGTERM)

    tasks = tasks_of(configs, tmp_path)
    with pytest.raises(SemrlError, match="the same command goes on"):
        run_all(tasks, LocalPool(1), tmp_path, say=say)
    assert said == [f"run 1 of 2: run-3, {DECISIONS} decisions"]
    run_all(tasks, LocalPool(2), tmp_path)
    assert [ended(task.run) for task in tasks] == unbroken


class LosingPool:
    """Loses every worker that is started."""

    def __init__(self):
        self.started = []
        self.over = []

    def has_room(self):
        return not self.over

    def start(self, task):
        self.started.append(task.id)
        self.over.append(engines.Ended(task=task, problem="its machine is gone", lost=True))

    def ended(self):
        over, self.over = self.over, []
        return over

    def stop(self, *, now=False):
        pass

    def close(self):
        pass


def test_a_run_that_loses_every_worker_fails_in_the_end(tmp_path, configs, monkeypatch):
    monkeypatch.setattr(engines, "POLL_SECONDS", 0.001)
    pool = LosingPool()
    states = run_all(tasks_of(configs, tmp_path), pool, tmp_path)
    assert [(state.status, state.problem) for state in states] == [("failed", "its machine is gone")] * 2
    assert pool.started == ["run-3"] * (engines.LOSSES + 1) + ["run-4"] * (engines.LOSSES + 1)


def test_a_run_that_fails_is_told_and_the_others_are_done(tmp_path, configs, tiny):
    broken = Task(id="broken", run=tmp_path / "runs" / "broken", config=tiny("baseline", env="Nowhere-v0"))
    tasks = [broken, *tasks_of(configs[:1], tmp_path)]
    states = run_all(tasks, LocalPool(2), tmp_path)
    assert [state.status for state in states] == ["failed", "finished"]
    assert "Nowhere-v0" in states[0].problem


def test_a_run_with_other_settings_is_not_gone_on_with(tmp_path, configs):
    tasks = tasks_of(configs, tmp_path)
    (tmp_path / "runs").mkdir()
    RunFolder.create(tasks[1].run, configs[0])
    with pytest.raises(UsageError, match="begun with other settings than run-4"):
        run_all(tasks, LocalPool(1), tmp_path)
    assert not tasks[0].run.exists()


def test_two_sweeps_do_not_share_a_folder(tmp_path, configs):
    with locked(tmp_path / "lock", ""), pytest.raises(UsageError, match="worked on by another process"):
        run_all(tasks_of(configs, tmp_path), LocalPool(1), tmp_path)


@pytest.mark.slow
def test_a_worker_does_not_outlive_who_started_it(tmp_path):
    """Standard input is at its end from the beginning, as when the queue was killed."""
    words = [sys.executable, "-m", "semrl.sweep.worker", "id", str(tmp_path / "run"), str(tmp_path / "none.toml"), "[]"]
    over = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=120, check=False)
    assert over.returncode != 0


@pytest.mark.slow
def test_runs_of_a_cluster_that_loses_a_machine_end_like_the_unbroken_ones(tmp_path, configs, unbroken):
    """Two machines, simulated; one of them is killed while it trains."""
    ray = pytest.importorskip("ray", reason="needs the extra 'ray'")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    lost = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, logging_level="ERROR", log_to_driver=False)
    said, killed = [], []

    def kill_a_machine(states):
        if not killed and all(state.task.reached() > 60 for state in states):
            killed.append([state.task.worker() for state in states])
            cluster.remove_node(lost, allow_graceful=False)

    try:
        tasks = tasks_of(configs, tmp_path, trials=(Trial(episodes=1),))
        states = run_all(tasks, RayPool(), tmp_path, say=said.append, show=kill_a_machine)
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert killed and [state.status for state in states] == ["finished", "finished"], said
    assert len([line for line in said if "lost its worker" in line]) == 1, said
    assert [ended(task.run) for task in tasks] == unbroken
