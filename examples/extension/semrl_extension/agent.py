"""An agent: Q-learning with values that are linear in what it is shown."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from semrl.core import AgentObservation, Floats, StateSpace
from semrl.core.arrays import Arrays, array_to_rng, rng_to_array


@dataclass(frozen=True, kw_only=True)
class LinearConfig:
    learning_rate: float = 0.01  # as a share of the error
    discount: float = 0.95
    exploration: float = 0.1


class LinearAgent:
    Config = LinearConfig

    def __init__(self, config: LinearConfig, *, space: StateSpace, n_actions: int, seed: int, plan_size: int, **_: Any):
        self.config = config
        self.weights = np.zeros((n_actions, 2 * int(np.prod(space.shape)) + plan_size + 1))
        self.last = np.zeros(self.weights.shape[1] + 2)  # features, action and reward of the newest decision
        self.rng = np.random.default_rng(seed)

    def act(self, shown: AgentObservation, advised: int | None = None) -> int:
        by_chance = self.rng.random() < self.config.exploration
        return int(self.rng.integers(len(self.weights))) if by_chance else self.best_action(shown)

    def best_action(self, shown: AgentObservation) -> int:
        return int(self.action_values(shown).argmax())

    def action_values(self, shown: AgentObservation) -> Floats:
        return self.weights @ np.append(np.concatenate([*shown.vectors.reshape(2, -1), shown.plan]), 1)

    def observe(self, shown: AgentObservation, action: int, reward: float, **_: Any) -> None:
        self.end_episode(shown)
        self.last = np.concatenate([*shown.vectors.reshape(2, -1), shown.plan, [1, action, reward]])

    def end_episode(self, shown: AgentObservation) -> None:
        (*_, action, reward), x = self.last, self.last[:-2]
        error = reward + self.config.discount * self.action_values(shown).max() - self.weights[int(action)] @ x
        self.weights[int(action)] += self.config.learning_rate * error * x / (x @ x + 1e-9)
        self.last = np.zeros_like(self.last)

    def measured(self) -> dict[str, Any]:
        return {"weights_norm": float(np.linalg.norm(self.weights))}

    def inference_arrays(self) -> Arrays:
        return {"weights": self.weights.copy()}

    def to_arrays(self) -> Arrays:
        return self.inference_arrays() | {"last": self.last.copy(), "rng": rng_to_array(self.rng)}

    def from_arrays(self, arrays: Arrays) -> None:
        self.weights, self.last = arrays["weights"].copy(), arrays.get("last", self.last).copy()
        self.rng = array_to_rng(arrays["rng"]) if "rng" in arrays else self.rng
