"""Results of a run to which nothing may be written, and evaluations that would not end."""

import json
import os
import shutil
import warnings

import gymnasium as gym
import numpy as np
import pytest

from semrl.core.errors import SemrlWarning, UsageError
from semrl.evaluation import evaluate
from semrl.evaluation.prediction import world_model_accuracy
from semrl.training import train
from semrl.training.config import EvaluationConfig


@pytest.fixture
def locked(tmp_path, map_run, monkeypatch):
    """A run to which nothing may be written, whoever asks."""
    run = shutil.copytree(map_run, tmp_path / "locked run")
    real = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: "locked run" not in str(path) and real(path, mode))
    return run


@pytest.mark.parametrize(
    "command", ["eval --episodes 2", "eval --episodes 1 --policy planner", "predict --decisions 20"]
)
@pytest.mark.parametrize("flags", [[], ["--json"]])
def test_the_result_is_told_all_the_same(call, locked, map_run, command, flags):
    before = sorted(path.name for path in locked.iterdir())
    name, *rest = command.split()
    result = call(name, locked, *rest, *flags)
    assert result.status == 0 and result.out
    warned = [line for line in result.err.splitlines() if line.startswith("semrl: warning: ")]
    assert len(warned) == 1 and "nothing may be written to" in warned[0] and "not kept" in warned[0]
    assert sorted(path.name for path in locked.iterdir()) == before
    if flags:
        assert json.loads(result.out)["run"] == str(locked)


@pytest.mark.parametrize(
    "play", [lambda run: evaluate(run, episodes=1), lambda run: world_model_accuracy(run, decisions=9)]
)
def test_it_is_told_before_anything_is_played(locked, monkeypatch, play):
    monkeypatch.setattr("semrl.evaluation.player.Player.episode", lambda *_, **__: pytest.fail("something was played"))
    with warnings.catch_warnings():
        warnings.simplefilter("error", SemrlWarning)
        with pytest.raises(SemrlWarning, match="nothing may be written"):
            play(locked)


@pytest.mark.parametrize(
    "play", [lambda run: evaluate(run, episodes=1), lambda run: world_model_accuracy(run, decisions=9)]
)
def test_a_disk_that_is_full_at_the_end_costs_no_result(tmp_path, map_run, monkeypatch, play):
    run = shutil.copytree(map_run, tmp_path / "run")
    expected = play(run)

    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.warns(SemrlWarning, match="No space left on device"):
        assert play(run) == expected


@pytest.mark.parametrize("flags", [[], ["--out", "OUT"]])
def test_a_page_is_written_where_it_can_be(call, locked, tmp_path, flags):
    out = tmp_path / "page.html"
    result = call("report", locked, *(word.replace("OUT", str(out)) for word in flags))
    if flags:
        assert result.status == 0 and out.is_file() and result.err.count("shows no frames") == 1
    else:
        assert result.status == 2 and "nothing may be written to" in result.message and result.err.count("\n") == 1


class Endless(gym.Env):
    """A dot that moves for ever."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return self._frame(), {}

    def step(self, action):
        self.count += 1
        return self._frame(), float(self.count % 10 == 0), False, False, {}

    def _frame(self):
        frame = np.zeros((84, 84, 3), np.uint8)
        left = self.count % 70
        frame[40:46, left : left + 6] = 255
        return frame


@pytest.fixture(scope="module")
def endless(tmp_path_factory, tiny):
    if "test/Endless-v0" not in gym.registry:
        gym.register("test/Endless-v0", Endless)
    path = tmp_path_factory.mktemp("runs") / "endless"
    train(path, tiny("baseline", env="test/Endless-v0", decisions=100))
    return path


@pytest.mark.parametrize(("episodes", "most"), [(1, 5), (3, 20), (2, 1)])
def test_an_episode_that_does_not_end_is_cut_and_told(call, endless, episodes, most):
    result = call("eval", endless, "--episodes", episodes, "--max-decisions", most, "--json")
    told = json.loads(result.out)
    assert result.status == 0 and told["lengths"] == [most] * episodes
    assert told["conditions"]["max_decisions"] == most and told["conditions"]["cut"] == list(range(episodes))
    warned = [line for line in result.err.splitlines() if "warning" in line]
    assert len(warned) == 1 and f"cut after {most} decisions" in warned[0] and "--max-decisions" in warned[0]


def test_the_cap_is_the_fields_unless_something_else_is_said(endless, tmp_path, tiny):
    assert EvaluationConfig().max_decisions * 4 == 108_000
    config = tiny("baseline", env="test/Endless-v0", decisions=100, evaluation__max_decisions=7)
    train(tmp_path / "run", config)
    with pytest.warns(SemrlWarning, match="2 of 2 episodes were cut after 7 decisions"):
        assert evaluate(tmp_path / "run").lengths == [7, 7]


@pytest.mark.parametrize(("most", "lengths", "cut"), [(44, [44, 44], [0, 1]), (45, [45, 45], []), (46, [45, 45], [])])
def test_an_episode_that_ends_in_time_is_whole(map_run, most, lengths, cut):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if cut else "error")
        result = evaluate(map_run, episodes=2, max_decisions=most)
    assert result.lengths == lengths and result.conditions["cut"] == cut


@pytest.mark.parametrize("most", [0, -1])
def test_a_cap_of_nothing_is_refused(map_run, most):
    with pytest.raises(UsageError, match="max_decisions must be 1 or more"):
        evaluate(map_run, max_decisions=most)
