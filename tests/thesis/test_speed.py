"""The measurement of speed: what it calls and what it says, on a small scale."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

from semrl.core import Observation
from semrl.perception.detection.grey import to_grey
from semrl.training import preset
from semrl_thesis import speed
from semrl_thesis.peers import ThesisStack
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


@pytest.mark.parametrize("peers", [False, pytest.param(True, marks=pytest.mark.skipif(
    find_spec("gensim") is None, reason="its extra is not installed"))])  # fmt: skip
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
    assert result.status == 2 and "pip install 'gensim>=" in result.message


def test_stages_take_turns():
    calls = []
    stages = [Stage(name, calls.append, [name, name], prepare=lambda: calls.append("!")) for name in "ab"]
    times = medians(stages, 2)
    assert "".join(calls) == "ab" + 2 * "!aa!bb" and times.keys() == {"a", "b"}


def test_dots_are_objects():
    frame = speed.dotted_frame(50, np.random.default_rng(0))
    pipeline = speed.Pipeline(speed.by_frame("semrl").pipeline, "embedding")
    for _ in range(pipeline.config.detection.threshold_frames):
        pipeline.detector.partial_fit(to_grey(frame))
    assert len(pipeline.detector.detect(to_grey(frame))) == 50


@pytest.mark.skipif(find_spec("gensim") is None, reason="its extra is not installed")
def test_the_thesis_finds_the_objects_that_we_find(small):
    pipeline, play = speed.learn_to_see(0)
    frames = [next(play).frame for _ in range(12)]
    stack = ThesisStack(frames, pipeline.detector.threshold_, pipeline.detector.crop_size_px)
    for frame in frames:
        ours = pipeline.detector.detect(to_grey(frame))
        crops, centres_px = stack.detect(frame)
        np.testing.assert_array_equal(crops, ours.features)
        np.testing.assert_array_equal(centres_px, ours.centres_px)
        assert stack.elevate(frame).shape == pipeline.encode(Observation(frame=frame)).shape
