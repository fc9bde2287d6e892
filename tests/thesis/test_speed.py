"""The measurement of speed: what it calls and what it says, on a small scale."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

from semrl.core import Observation
from semrl.perception.detection import OtsuDetector
from semrl.training import preset
from semrl_thesis import speed
from semrl_thesis.perception import by_frame
from semrl_thesis.timing import ELEVATION, EMULATOR, STACK, Stage, medians

KEYS = {"stages", "elevation_per_second", "emulator_per_second", "thesis_stack_per_second"}


@pytest.fixture
def small(monkeypatch):
    """Less of everything: perception is not stable, few objects, few words."""
    soon = {"stability": {"batches": 4, "max_batches": 12}}
    monkeypatch.setattr(speed, "by_frame", lambda name, *settings: by_frame(name, *settings, soon))
    monkeypatch.setattr(speed, "preset", lambda name, model, settings: preset(name, model, settings | soon))
    monkeypatch.setattr(speed, "OBJECT_COUNTS", (3, 10))
    monkeypatch.setattr(speed, "VOCABULARIES", (1000, 2000))
    monkeypatch.setattr(speed, "MET_BEFORE", 2)
    monkeypatch.setattr(speed, "GROWTH_SCENES", 2)


GENSIM = pytest.mark.skipif(find_spec("gensim") is None, reason="its extra is not installed")


@pytest.mark.parametrize("peers", [pytest.param(False, marks=pytest.mark.slow), pytest.param(True, marks=GENSIM)])
def test_bench_tells_every_stage_and_draws_it(call, tmp_path, small, peers):
    page = tmp_path / "speed.html"
    flags = ["--frames", 20, "--rounds", 1, "--html", page, "--json", *(["--peers"] if peers else [])]
    result = call("bench", *flags)
    assert result.status == 0, result.err
    told = json.loads(result.out)
    assert told.keys() >= KEYS
    rates = {stage["name"]: stage["per_second"] for stage in told["stages"]}
    assert all(rate > 0 for rate in rates.values())
    assert rates[ELEVATION] == told["elevation_per_second"] and rates[EMULATOR] == told["emulator_per_second"]
    assert told["thesis_stack_per_second"] == (rates[STACK] if peers else None)
    assert f"{ELEVATION}, tracked scenes" in rates
    assert {row["objects"] for row in told["by_objects"]} == {3, 10}
    assert page.read_text().count("<svg") == 3 and ("thesis's stack" in page.read_text().replace("&#39;", "'")) == peers


def test_bench_for_a_person(call, small):
    result = call("bench", "--frames", 20, "--rounds", 1)
    assert result.status == 0 and "times as fast as the emulator" in result.out


@pytest.mark.parametrize("flags", [["--frames", 0], ["--rounds", 0], ["--html", "/nowhere/at/all.html"]])
def test_wrong_calls_cost_one_line(call, flags):
    result = call("bench", *flags)
    assert result.status == 2 and result.message


def test_what_peers_need_is_told_when_it_is_missing(call, monkeypatch, small):
    monkeypatch.setattr("semrl_thesis.peers.find_spec", lambda name: None)
    result = call("bench", "--peers", "--frames", 20, "--rounds", 1)
    assert result.status == 2 and "pip install" in result.message and "'gensim>=" in result.message


def test_stages_take_turns():
    calls = []
    stages = [Stage(name, calls.append, [name, name], prepare=lambda: calls.append("!")) for name in "ab"]
    times = medians(stages, 2)
    assert "".join(calls) == "ab" + 2 * "!aa!bb" and times.keys() == {"a", "b"}


def test_dots_are_objects():
    frame = speed.dotted_frame(50, np.random.default_rng(0))
    detector = OtsuDetector()
    for _ in range(detector.frames_needed):
        detector.partial_fit(frame)
    assert len(detector.detect(frame)) == 50


@pytest.mark.skipif(find_spec("gensim") is None, reason="its extra is not installed")
def test_the_thesis_finds_the_objects_that_we_find(small):
    encoder, play = speed.learn_to_see(0)
    frames = [next(play).frame for _ in range(12)]
    stack, episode = speed.make_stack(frames, encoder), encoder.begin()
    for frame in frames:
        ours = encoder.perception.detector.detect(frame)
        crops, centres_px = stack.detect(frame)
        np.testing.assert_array_equal(crops, ours.features)
        np.testing.assert_array_equal(centres_px, ours.centres_px)
        assert stack.elevate(frame).shape == episode.encode(Observation(frame=frame)).vector.shape
