"""What is read as rules after little play of the real game: who played it would say the same."""

import pytest

from semrl.evaluation.rules import load_rules
from semrl.training import preset, train
from semrl.world_model.rules import sentence


@pytest.mark.slow
def test_a_dozen_rules_tell_the_game(tmp_path):
    """Both rewards, the bounce off the paddle and off both walls, and what each action does."""
    config = preset("semrl", "objects-map", {"decisions": 6_000})
    train(tmp_path / "run", config)
    said = [f"{rule.about}: {sentence(rule)}" for rule in load_rules(tmp_path / "run")[:12]]
    walls = ("top edge", "bottom edge", "touches still")
    for parts in (
        ("+1 by object", "left edge"),
        ("-1 by object", "right edge"),
        ("vx := −vx", "touches own"),
        ("the action is RIGHT", "up"),
        ("the action is LEFT", "down"),
    ):
        assert any(all(part in line for part in parts) for line in said), (parts, said)
    assert sum("vy := −vy" in line and any(wall in line for wall in walls) for line in said) >= 1, said
