"""Variants: the same game, altered a little."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl.envs.variants import VARIANTS, pong, second_ball

FRAME = EnvironmentConfig(frame_skip=1)
LEFT = 1


def play(variant, steps=400, env="PongNoFrameskip-v4", config=FRAME, seed=0):
    """Return frames and RAM of play that follows from the seed alone."""
    game = make_env(env, replace(config, variant=variant))
    rng = np.random.default_rng(seed)
    frames, ram = [game.reset(seed=seed)[0]], []
    for _ in range(steps):
        frames.append(game.step(int(rng.integers(game.action_space.n)))[0])
        ram.append(game.unwrapped.ale.getRAM().copy() if hasattr(game.unwrapped, "ale") else None)
    game.close()
    return np.array(frames), ram


def enemy_steps(variant):
    """Return how far the enemy went by itself, and the ball's way, frame by frame."""
    ram = np.array(play(variant, steps=900)[1]).astype(int)
    moved, ball = (np.diff(ram[:, address]) for address in (pong.ENEMY_ADDRESS, pong.BALL_X_ADDRESS))
    return moved * (np.abs(moved) <= pong.FARTHEST), ball


@pytest.mark.parametrize(
    ("variant", "altered"),
    [
        ("recoloured", lambda x: np.roll(x, 1, axis=-1)),
        ("mirrored", lambda x: np.flip(x, axis=2)),
        ("upside_down", lambda x: np.flip(x, axis=1)),
        ("mirrored+upside_down", lambda x: x[:, ::-1, ::-1]),
    ],
)
@pytest.mark.parametrize("env", ["semrl/Catch-v0", "BreakoutNoFrameskip-v4"])
def test_frames_are_altered_and_nothing_else(variant, altered, env):
    np.testing.assert_array_equal(play(variant, 20, env)[0], altered(play("", 20, env)[0]))


@pytest.mark.parametrize("variant", ["recoloured_ball", "recoloured_enemy", "dark_ball"])
def test_one_thing_has_another_colour(variant):
    thing = VARIANTS.load(variant)
    before, after = play("", 120)[0], play(variant, 120)[0]
    differs = (before != after).any(axis=-1)
    assert differs.any(axis=(1, 2)).mean() > 0.3
    assert (before[differs] == thing.colour).all() and (after[differs] == thing.instead).all()
    assert not differs[:, :34].any() and not differs[:, 194:].any()


def test_a_second_ball_is_drawn_and_counts():
    before, after = play("", 1_500), play("second_ball", 1_500)
    white = np.array([(frame[34:194] == 236).all(axis=2).sum() for frame in after[0]])
    assert (white > 12).mean() > 0.3  # of a ball 8 pixels
    pairs = zip(before[0][:140, 34:194], after[0][:140, 34:194], strict=True)
    drawn = [int((plain != frame).any(axis=2).sum()) for plain, frame in pairs]
    assert max(drawn[:100]) == 0 and drawn[130] == 8
    scores = list(second_ball.SCORE_ADDRESSES.values())
    usual, points = (np.array(ram)[:, scores].astype(int) for _, ram in (before, after))
    assert points[-1].sum() > usual[-1].sum() + 3 and (np.diff(points, axis=0) >= 0).all()


def test_points_of_the_second_ball_are_rewards():
    game = make_env("PongNoFrameskip-v4", replace(FRAME, variant="second_ball"))
    game.reset(seed=0)
    total = sum(game.step(LEFT)[1] for _ in range(1_200))
    ram = game.unwrapped.ale.getRAM()
    enemy, own = (int(ram[address]) for address in second_ball.SCORE_ADDRESSES.values())
    game.close()
    assert total == own - enemy and enemy > 8  # one ball alone loses 8 points in this time at most


def test_an_enemy_goes_as_far_as_its_pace_allows():
    frozen, slow, usual, fast = (
        np.abs(enemy_steps(v)[0]).sum() for v in ("frozen_enemy", "slow_enemy", "", "fast_enemy")
    )
    assert frozen == 0 < slow < usual < fast


def test_a_lazy_enemy_rests_while_the_ball_flies_away():
    moved, ball = enemy_steps("lazy_enemy")
    usual_moved, usual_ball = enemy_steps("")
    assert np.abs(usual_moved[usual_ball > 0]).sum() > 50
    assert np.abs(moved[ball > 0]).sum() == 0 < np.abs(moved[ball < 0]).sum()


def test_an_altered_game_repeats_and_skips_frames():
    config = EnvironmentConfig(max_noops=3)
    first, again = (play("lazy_enemy", 50, config=config, seed=4)[0] for _ in range(2))
    np.testing.assert_array_equal(first, again)
    game = Game(make_env("PongNoFrameskip-v4", replace(config, variant="two_speeds")), 1)
    game.reset()
    assert game.step(LEFT).observation.frame.shape == (210, 160, 3)


@pytest.mark.parametrize(
    ("env", "variant", "said"),
    [
        ("semrl/Catch-v0", "lazy_enemy", "is one of pong"),
        ("BreakoutNoFrameskip-v4", "recoloured_ball", "is one of pong"),
        ("semrl/Catch-v0", "lasy_enemy", "did you mean 'lazy_enemy'"),
        ("semrl/Catch-v0", "recoloured+", "no ''"),
    ],
)
def test_wrong_variants_are_told(env, variant, said):
    with pytest.raises(UsageError, match=said):
        make_env(env, EnvironmentConfig(variant=variant))


def test_what_is_rendered_is_altered_too():
    plain, altered = (
        make_env("semrl/Catch-v0", EnvironmentConfig(variant=v), render_mode="rgb_array") for v in ("", "mirrored")
    )
    for env in (plain, altered):
        env.reset(seed=3)
    np.testing.assert_array_equal(altered.render(), plain.render()[:, ::-1])


def test_an_environment_that_was_made_can_be_altered():
    env = make_env(gym.make("semrl/Catch-v0"), EnvironmentConfig(variant="recoloured"))
    plain = make_env("semrl/Catch-v0")
    np.testing.assert_array_equal(env.reset(seed=2)[0], np.roll(plain.reset(seed=2)[0], 1, axis=-1))
