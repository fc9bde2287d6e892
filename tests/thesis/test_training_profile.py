"""Where the time of a training goes: what is counted for whom, and what the command says."""

import json

import numpy as np
import pytest

from semrl_thesis import training_profile
from semrl_thesis.training_profile import PARTS, REST, Meter


class Inner:
    def __init__(self, now):
        self.now = now

    def work(self, seconds):
        self.now[0] += seconds
        return seconds

    def fail(self):
        self.now[0] += 1
        raise ValueError


@pytest.mark.parametrize(("outer", "inner"), [(3.0, 2.0), (0.5, 7.0)])
def test_a_moment_counts_for_the_innermost_call_alone(outer, inner):
    now = [0.0]
    meter, part = Meter(clock=lambda: now[0]), Inner(now)
    meter.watch("inner", part, "work", "fail")

    def plan():
        part.work(inner)
        now[0] += outer

    now[0] += 1
    meter.timed("plan", plan)()
    with pytest.raises(ValueError):
        part.fail()
    now[0] += 4
    meter.switch(REST)
    assert meter.seconds == {REST: 5.0, "plan": outer, "inner": inner + 1}


def test_bench_tells_the_shares_of_a_training(call, monkeypatch):
    monkeypatch.setattr(training_profile, "STRETCH", 40)
    monkeypatch.setattr(training_profile, "ALONE_DECISIONS", 10)
    flags = ["bench", "--training", "--model", "ram-map", "--decisions", 120]
    told = json.loads(call(*flags, "--json").out)
    assert tuple(told["shares"]) == PARTS and np.isclose(sum(told["shares"].values()), 1)
    assert 0 < told["training_per_second"] < told["emulator_per_second"]
    assert told["shares"]["emulator"] > 0.01 and told["shares"]["perception, learning"] == 0
    assert "a second of one core" in call(*flags).out


@pytest.mark.parametrize("flags", [["--decisions", 0], ["--model", "none"], ["--peers"], ["--html", "a.html"],
                                   ["--model", "birch", "--decisions", 20]])  # fmt: skip
def test_wrong_calls_cost_one_line(call, flags):
    result = call("bench", "--training", *flags)
    assert result.status == 2 and result.message
