"""Somebody else's agent on our symbols: DQN of Stable-Baselines3 (extra ``sb3``)."""

import tempfile
from pathlib import Path

import tyro
from stable_baselines3 import DQN
from stable_baselines3.common.evaluation import evaluate_policy

from semrl import SemanticObservation, make_env, preset, train


def train_tiny(env: str) -> Path:
    """Train just enough of a run that its perception is ready."""
    run = Path(tempfile.mkdtemp()) / "run"
    train(run, preset("semrl", "semantic", {"env": env, "decisions": 1_500, "stability": {"batches": 50}}))
    return run


def main(run: Path | None = None, /, env: str = "PongNoFrameskip-v4", decisions: int = 2_000) -> None:
    """Learn to play on what the perception of a run sees; without a run a tiny one is trained first."""
    symbols = SemanticObservation(make_env(env), encoder=run or train_tiny(env))
    agent = DQN("MlpPolicy", symbols, buffer_size=10_000, learning_starts=500, seed=0)
    agent.learn(decisions)
    mean, _ = evaluate_policy(agent, symbols, n_eval_episodes=1, warn=False)
    print(f"one game after {decisions:,} decisions on vectors of {symbols.observation_space.shape}: {mean:.0f}")


if __name__ == "__main__":
    tyro.cli(main)
