"""Plain lines of progress: half a minute apart, and what they say."""

import re
from types import SimpleNamespace

import pytest

from semrl.training import train
from semrl.training.progress_lines import ProgressLines, TrainingLines, append_line, duration, last_returns


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def test_there_is_a_line_every_half_minute_and_one_at_the_end(clock):
    said = []
    lines = ProgressLines(said.append, clock=clock)
    for second in range(101):
        clock.now = float(second)
        lines.update("agent", 20 * second, 4000)
    assert said == [
        "agent: 600 of 4,000 decisions, 20/s, 3 min left",
        "agent: 1,200 of 4,000 decisions, 20/s, 2 min left",
        "agent: 1,800 of 4,000 decisions, 20/s, 2 min left",
    ]
    lines.close()
    assert said[3:] == ["agent: 2,000 of 4,000 decisions, 20/s, 2 min left"]
    lines.close()
    assert len(said) == 4


@pytest.mark.parametrize(("done", "seconds", "left"), [(1, 31, "15 min"), (10, 300, "10 min"), (29, 2900, "2 min")])
def test_episodes_tell_their_decisions_too(clock, done, seconds, left):
    said = []
    lines = ProgressLines(said.append, clock=clock)
    lines.update("evaluate", 0, 30, unit="episodes", decisions=0)
    clock.now = float(seconds)
    lines.update("evaluate", done, 30, unit="episodes", decisions=50 * seconds, note=lambda: "last returns 1")
    assert said == [f"evaluate: {done} of 30 episodes, {50 * seconds:,} decisions, 50/s, {left} left; last returns 1"]


def test_nothing_is_known_of_the_time_left_before_anything_is_done(clock):
    said = []
    lines = ProgressLines(said.append, clock=clock)
    for clock.now in (0.0, 31.0):
        lines.update("evaluate", 0, 30, unit="episodes", decisions=int(clock.now))
    lines.update("watch", 5)
    clock.now = 62.0
    lines.update("watch", 67)
    assert said == ["evaluate: 0 of 30 episodes, 31 decisions, 1.0/s", "watch: 67 decisions, 2.0/s"]


def test_training_tells_the_phase_and_what_was_measured(clock):
    said = []
    lines = TrainingLines(said.append, clock=clock)
    trainer = SimpleNamespace(phase="reduction", decisions_=0, decisions=100)
    lines.on_decision(trainer)
    lines.on_row({"phase": "reduction", "batches": 3, "stability": 0.5})
    trainer.decisions_, clock.now = 10, 1.0
    lines.on_decision(trainer)
    trainer.phase = "agent"
    lines.on_decision(trainer)
    for number in range(7):
        lines.on_row({"phase": "agent", "return": float(number)})
    trainer.decisions_, clock.now = 40, 31.0
    lines.on_decision(trainer)
    assert said == [
        "reduction: 10 of 100 decisions, 10/s, 9 s left; batch 3, stability 0.500",
        "agent: 40 of 100 decisions, 1.0/s, 60 s left; last returns 2, 3, 4, 5, 6",
    ]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0 s"), (99.4, "99 s"), (100, "2 min"), (3600, "60 min"), (6000, "1 h 40 min"), (100_000, "27 h 47 min")],
)
def test_times_are_told_as_people_read_them(seconds, text):
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("returns", "text"),
    [([], "no episode finished yet"), ([1.0], "last returns 1"), ([0.5, -2], "last returns 0.5, -2")],
)
def test_returns_are_told(returns, text):
    assert last_returns(returns) == text


@pytest.mark.parametrize("model", ["baseline", "otsu"])
def test_every_training_keeps_its_lines(tmp_path, tiny, model):
    train(tmp_path / "run", tiny(model, decisions=100))
    lines = (tmp_path / "run" / "train.log").read_text().splitlines()
    assert lines and re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d agent: 100 of 100 decisions, .*", lines[-1])
    assert ("detection: " in lines[0]) == (model == "otsu")


def test_a_log_that_cannot_be_written_ends_nothing(tmp_path):
    append_line(tmp_path, "a folder")
    append_line(tmp_path / "none" / "log", "no folder")
    append_line(tmp_path / "log", "Ω")
    append_line(tmp_path / "log", "two")
    assert [line[20:] for line in (tmp_path / "log").read_text(encoding="utf-8").splitlines()] == ["Ω", "two"]
