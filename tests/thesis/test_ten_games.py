"""Scores of several games, made comparable."""

from types import SimpleNamespace

import pytest

from semrl_thesis.games import ATARI, Played, Tour, measure
from semrl_thesis.trials import Outcome

GAMES = {
    "easy": Played(env="a/Easy-v0", random=0.0, human=10.0),
    "hard": Played(env="a/Hard-v0", random=-20.0, human=20.0),
    "odd": Played(env="a/Odd-v0", random=100.0, human=200.0),
}
TOUR = Tour(games=GAMES, seeds=(0, 1), episodes=2)


def context(means):
    """Hold a mean for some runs, and the games of each within one of it."""

    def outcome(spec, trial):
        if spec.id not in means:
            return None
        mean = means[spec.id] + (trial.policy == "planner")
        return Outcome(
            id=spec.id,
            decisions=100_000,
            trial=trial.name,
            episodes=2,
            mean=mean,
            max=mean + 1,
            min=mean - 1,
            std=1,
            different=2,
        )

    def score(spec):
        return SimpleNamespace(seconds=60.0 * (spec.seed + 1)) if spec.id in means else None

    return SimpleNamespace(ledger=SimpleNamespace(outcome=outcome, score=score))


def ids(*seeds):
    return [spec.id for spec in TOUR.runs() if spec.seed in seeds]


def test_seeds_are_averaged_and_games_normalised():
    easy, hard, odd, easy_1, hard_1, odd_1 = ids(0, 1)
    result = measure(TOUR, context({easy: 4, easy_1: 6, hard: 0, hard_1: 0, odd: 90, odd_1: 110}))
    told = {name.removeprefix("games/"): value for name, value in result.values.items()}
    assert [told[f"easy/agent/{what}"] for what in ("mean", "min", "max", "normalised")] == [5, 3, 7, 0.5]
    assert told["hard/agent/normalised"] == 0.5 and told["odd/agent/normalised"] == 0
    assert told["agent/normalised-mean"] == pytest.approx(1 / 3) and told["agent/normalised-median"] == 0.5
    assert told["planner/normalised-median"] == pytest.approx(21 / 40)
    assert told["easy/minutes"] == 1.5 and not result.notes


def test_what_is_missing_is_named_and_no_mean_is_taken_of_fewer_games():
    easy, hard, _ = ids(0)
    result = measure(TOUR, context({easy: 4, hard: 0}))
    assert result.values["games/easy/agent/mean"] == 4
    assert not any("normalised-" in name or "odd" in name for name in result.values)
    assert all(name in result.notes[0] for name in ids(0, 1) if name not in (easy, hard))


def test_nobody_has_said_what_others_score():
    assert Played(env="a/New-v0").normalised(3.0) is None
    assert [ATARI["pong"].normalised(score) for score in (-20.7, 14.6)] == [0, 1]
