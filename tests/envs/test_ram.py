"""What is read from RAM is what is seen: coordinates measured in Pong's frames."""

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.envs import Game, make_env, ram_feature_names, ram_features

COLOURS = {"player": (92, 186, 92), "enemy": (213, 130, 74), "ball": (236, 236, 236)}
SIZES_PX = {"player": 64, "enemy": 64, "ball": 8}  # area, when nothing is cut off
FIELD_ROWS = slice(34, 194)


def corners(frame):
    """Row and column of the upper left corner of each of the three; None unless all are seen whole."""
    found = {}
    for name, colour in COLOURS.items():
        rows, columns = np.nonzero((frame[FIELD_ROWS] == colour).all(axis=2))
        if len(rows) != SIZES_PX[name]:
            return None
        found[f"{name}_y"], found[f"{name}_x"] = rows.min(), columns.min()
    return found


def test_pongs_ram_tells_the_positions_in_the_frame():
    game = Game(make_env("PongNoFrameskip-v4"), seed=0)
    game.reset()
    rng = np.random.default_rng(0)
    seen, read = [], []
    for _ in range(500):
        observation = game.step(int(rng.integers(2))).observation
        features = ram_features("pong", observation.ram)
        assert features.dtype == np.float32 and features.min() >= 0 and features.max() <= 1
        if (found := corners(observation.frame)) is not None:
            read.append(features * 255)
            seen.append([found[name] for name in ram_feature_names("pong")])
    seen, read = np.array(seen, dtype=float), np.array(read, dtype=float)
    assert len(seen) > 200
    for name, pixels, bytes_ in zip(ram_feature_names("pong"), seen.T, read.T, strict=True):
        slope, offset = np.polyfit(bytes_, pixels, 1)
        assert slope == pytest.approx(1, abs=0.01), name
        # The console draws rows in pairs, so a row may be one off; columns fit exactly.
        assert np.abs(slope * bytes_ + offset - pixels).max() < (1e-9 if name == "ball_x" else 1.0), name
        assert np.corrcoef(bytes_, pixels)[0, 1] > 0.999, name


def test_the_thesis_needs_both_paddles_and_the_ball():
    assert ram_feature_names("pong") == ("player_y", "enemy_y", "ball_x", "ball_y")


@pytest.mark.parametrize("read", [ram_feature_names, lambda game: ram_features(game, np.zeros(128, np.uint8))])
def test_other_games_are_refused_with_a_hint(read):
    with pytest.raises(UsageError, match=r"'breakout' is not mapped .*pong.*sees pixels"):
        read("breakout")
