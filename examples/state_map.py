"""A map of a small world, drawn from random play, and the way on it to the nearest gain (§3.4.1, §3.4.2)."""

from collections.abc import Iterator

import numpy as np
import tyro

from semrl import make_env
from semrl.core import Trajectory
from semrl.planning import LongTermConfig, edges_along, plan_routes
from semrl.planning.state_map import StateMap, StateMapConfig

ACTIONS = ("LEFT", "RIGHT")


def random_play(episodes: int) -> Iterator[Trajectory]:
    """Catch balls at random; a state is the ball's row, column and drift, and the paddle's column, each in 0 … 1."""
    env, rng = make_env("semrl/Catch-v0"), np.random.default_rng(0)
    for seed in range(episodes):
        states, rewards, done = [env.reset(seed=seed)[1]["coordinates"]], [], False
        actions = rng.integers(2, size=45)  # 5 balls, 9 decisions each
        for action in actions:
            _, reward, done, _, info = env.step(action)
            states.append(info["coordinates"])
            rewards.append(reward)
        assert done
        yield Trajectory(states=np.array(states), actions=actions, rewards=np.array(rewards, np.float32))


def main(episodes: int = 100) -> None:
    """Print the size of the map, and the way from where the last episode began."""
    state_map = StateMap(StateMapConfig(node_threshold=0.03, edge_threshold=0.04), dimension=4, n_actions=len(ACTIONS))
    for trajectory in random_play(episodes):
        state_map.partial_fit(trajectory)
    graph, costs = state_map.graph_, LongTermConfig()
    print(f"{graph.node_counts.sum():,} states on {len(graph)} nodes, {len(graph.edge_ids):,} edges between them")
    path = plan_routes(graph, costs).path(int(state_map.locate(trajectory.states[:1])[0]))
    print(f"the nearest gain begins {len(path) - 1} steps away" if len(path) else "no way to a gain is known")
    for edge in edges_along(graph, path, costs):
        action, source, target = ACTIONS[graph.actions[edge].argmax()], graph.sources[edge], graph.targets[edge]
        print(f"node {source:3} → {target:3} by {action:5}  mean reward {graph.rewards[edge]:.1f}")


if __name__ == "__main__":
    tyro.cli(main)
