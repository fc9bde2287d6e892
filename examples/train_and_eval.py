"""Train an agent and let it play, from Python."""

import tempfile
from pathlib import Path

import tyro

from semrl import evaluate, preset, train


def main(model: str = "ram", env: str = "PongNoFrameskip-v4", decisions: int = 2_000, episodes: int = 1) -> None:
    """Train for so many decisions (far too few to win at Pong) and play some episodes."""
    run = Path(tempfile.mkdtemp()) / "run"
    config = preset("semrl", model, {"env": env, "decisions": decisions, "stability": {"batches": 50}})
    trained = train(run, config)
    print(f"{trained.decisions:,} decisions in {trained.seconds:.0f} s, last returns {trained.return_mean_last10}")
    played = evaluate(run, episodes=episodes)
    print(f"mean return {played.mean:.1f} over {played.episodes} episodes; everything is in {run}")


if __name__ == "__main__":
    tyro.cli(main)
