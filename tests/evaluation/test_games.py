"""Games of an evaluation that are played side by side are those that are played one after the other."""

import contextlib

import pytest

from semrl.core.errors import UsageError
from semrl.evaluation import evaluate, games


@pytest.mark.parametrize("workers", [2, 3])
def test_more_processes_play_the_same_games(semantic_run, workers):
    one_by_one = evaluate(semantic_run, episodes=5, seed=5)
    returns, stepped = [], set()
    side_by_side = evaluate(
        semantic_run,
        episodes=5,
        seed=5,
        workers=workers,
        on_episode=lambda total, decisions: returns.append((total, decisions)),
        on_step=lambda episode, _: stepped.add(episode),
    )
    assert side_by_side == one_by_one
    assert returns == list(zip(one_by_one.returns, one_by_one.lengths, strict=True))
    assert 0 in stepped  # which is filmed


def fail(asked, line):
    line.recv()
    raise SystemExit("of nobody's interest")


def test_a_game_that_fails_elsewhere_is_played_here(semantic_run, monkeypatch):
    one_by_one = evaluate(semantic_run, episodes=4, seed=5)
    monkeypatch.setattr(games, "_serve", fail)
    stepped = set()
    again = evaluate(semantic_run, episodes=4, seed=5, workers=2, on_step=lambda episode, _: stepped.add(episode))
    assert again == one_by_one and stepped == {0, 1, 2, 3}


def test_a_game_that_others_finish_first_counts(semantic_run, monkeypatch):
    theirs = games.PlayedGame(total=7.0, decisions=3, rewards=[(2, 7.0)], is_cut=False)

    class FinishedMeanwhile(dict):
        def get(self, episode):
            return None

    @contextlib.contextmanager
    def elsewhere(asked, waiting, processes):
        yield FinishedMeanwhile({1: theirs})

    monkeypatch.setattr(games, "_elsewhere", elsewhere)
    result = evaluate(semantic_run, episodes=2, seed=5, workers=2)
    assert result.returns[1] == 7 and result.lengths[1] == 3 and result.rewards[1] == [(2, 7.0)]


def test_somebody_must_play(semantic_run):
    with pytest.raises(UsageError, match="workers must be 1 or more, not 0"):
        evaluate(semantic_run, workers=0)
