"""A tiny run that plans with tracked objects, watched by each test anew."""

import contextlib

import pytest

from semrl.evaluation.player import load_player
from semrl.watch.session import WatchSession


@pytest.fixture(scope="session")
def watched_player(tracked_run):
    return load_player(tracked_run)


@pytest.fixture
def session(watched_player, tracked_run):
    with contextlib.closing(WatchSession(watched_player, "tracked", folder=tracked_run)) as session:
        yield session
