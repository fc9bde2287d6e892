"""What might come, which of it is best and why, and what an agent is shown of it (§3.4.3, §3.4.4)."""

import tyro
from state_map import ACTIONS, random_play

from semrl.core import History
from semrl.planning import reason
from semrl.planning.config import PlanningConfig
from semrl.planning.module import PlanningModule
from semrl.planning.scenario_planner import ScenarioPlannerConfig
from semrl.planning.state_map import StateMapConfig
from semrl.world_model import ModelPairConfig, NextStateConfig, RewardConfig

CONFIG = PlanningConfig(
    state_map=StateMapConfig(node_threshold=0.03, edge_threshold=0.04),
    networks=ModelPairConfig(
        next_state=NextStateConfig(hidden_units=(64,), learning_rate=1e-3, epochs=20, predict_change=True),
        reward=RewardConfig(kind="network", epochs=20),
        rehearsal_states=10_000,
    ),
    scenarios=ScenarioPlannerConfig(depth=3),
)


def main(episodes: int = 100, decision: int = 24) -> None:
    """Learn from random play, then plan at a decision of the last episode, of nine for each ball."""
    planning = PlanningModule(CONFIG, dimension=4, n_actions=len(ACTIONS), seed=0)
    for trajectory in random_play(episodes):
        planning.learn(trajectory)
    plan = planning.plan(History(states=trajectory.states[[decision, decision - 1]]))
    assert plan is not None
    for i, actions in enumerate(plan.scenarios.actions):
        names = ", ".join(ACTIONS[action] for action in actions)
        print(f"{i + 1}. {names}: return {plan.returns[i]:.0f}, ends in node {plan.end_nodes[i]}")
    print(reason(plan))
    print("the agent is shown", *(f"{number:.2g}" for number in planning.grounder.ground(plan)))


if __name__ == "__main__":
    tyro.cli(main)
