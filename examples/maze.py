"""The maze of Fig. 2.2: Q-learning flat and in two levels, 400 against 208 values (§2.1)."""

import numpy as np
import tyro

from semrl.envs.maze import N_TILES, FourRooms, shortest_steps
from semrl_thesis.hierarchy import MazeHierarchy, MazeHierarchyConfig
from semrl_thesis.tabular import QLearning, QLearningConfig, train


def main(steps: int = 4_000, seed: int = 0) -> None:
    """Train both for so many steps and print how long their ways out were on the way there."""
    flat = QLearning(QLearningConfig(), n_states=N_TILES, n_actions=4)
    for name, learner in (("flat", flat), ("two levels", MazeHierarchy(MazeHierarchyConfig()))):
        returns = train(learner, FourRooms(), steps=steps, rng=np.random.default_rng(seed))
        first, last = -np.mean(returns[:20]), -np.mean(returns[-20:])
        print(f"{name:10} {learner.n_values} values: ways out of {first:.0f} steps at first, {last:.0f} at last")
    print(f"{'shortest':10} {shortest_steps().mean():.0f} steps on average")


if __name__ == "__main__":
    tyro.cli(main)
