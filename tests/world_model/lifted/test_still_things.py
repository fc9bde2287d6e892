"""Bricks and walls are what a ball bounces off, and a brick that is touched brings its reward."""

import numpy as np
import pytest
from bricks import bricks
from rallies import history_of, trajectory_of

from semrl.core.things import STILL
from semrl.world_model import LiftedConfig, LiftedWorld

CONFIG = LiftedConfig(members=2, screening=0, first_decisions=200)


def blind(tables):
    """What is seen by who takes all that stands still for background."""
    return [things[things[:, STILL] == 0] for things in tables]


def learned(see):
    world = LiftedWorld(CONFIG, 6, seed=1, discount=0.95)
    for seed in range(3):
        tables, actions, rewards = bricks(600, seed)
        world.partial_fit(trajectory_of(see(tables), actions, rewards))
    return world


def told_rewards(world, see):
    """Rewards that came within six decisions, that were told rightly of them, and that were told."""
    tables, actions, rewards = bricks(900, 9)
    play = trajectory_of(see(tables), actions, rewards)
    came = right = told = 0
    for t in range(5, 880, 2):
        first = np.flatnonzero(play.rewards[t : t + 6])
        said = np.flatnonzero(np.rint(world.imagine(history_of(play, t), play.actions[None, t : t + 6]).rewards[0]))
        came, told = came + (len(first) > 0), told + (len(said) > 0)
        right += len(first) > 0 and len(said) > 0 and abs(first[0] - said[0]) <= 1
    return came, right, told


@pytest.fixture(scope="module")
def seeing():
    return learned(list)


def test_rewards_of_bricks_are_foretold(seeing):
    came, right, told = told_rewards(seeing, list)
    assert came > 25 and right > 0.8 * came and right > 0.8 * told


def test_without_them_it_could_not_know(seeing):
    _, right, told = told_rewards(seeing, list)
    _, blind_right, blind_told = told_rewards(learned(blind), blind)
    assert right > blind_right and right / told > blind_right / max(blind_told, 1)
