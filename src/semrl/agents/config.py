"""Parameters of deep Q-learning."""

import math
from dataclasses import dataclass, field

from semrl.core.errors import UsageError

MAX_FREQUENCIES = 16


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """Shape of the Q-network."""

    hidden_units: tuple[int, ...] = (256,)
    """Width of each dense layer."""
    layer_norm: bool = False
    """Normalise each dense layer before its activation (Ba et al. 2016)."""
    normalise_input: bool = False
    """Bring each number of a vector to mean 0 and standard deviation 1, as measured when learning starts."""
    frequencies: int = 0
    """Show each number of a vector as sines and cosines as well, of so many frequencies, each twice the one before."""

    def __post_init__(self) -> None:
        if not 0 <= self.frequencies <= MAX_FREQUENCIES:
            raise UsageError(f"dqn.network.frequencies must lie in 0 … {MAX_FREQUENCIES}, not {self.frequencies}")
        if any(units < 1 for units in self.hidden_units):
            raise UsageError(f"dqn.network.hidden_units must all be 1 or more, not {self.hidden_units}")


@dataclass(frozen=True, kw_only=True)
class DQNConfig:
    """Parameters of learning; the defaults are the thesis's (§3.3), else those of the DQN paper."""

    exploration_decisions: int = 30_000
    """Decisions until exploration has fallen to its minimum, by a constant factor at each."""
    exploration_max: float = 1.0
    """Probability of a random action at the beginning."""
    exploration_min: float = 0.01
    """Probability of a random action from then on."""
    final_exploration: float = 1.0
    """What is left of it at the end of the budget, as a share; it falls evenly through the second half.

    The agent's own decisions are held against the whole budget: after perception it has not all of it to fall."""
    heads: int = 1
    """Estimates of the values side by side (bootstrapped DQN, Osband et al. 2016); one at a time is followed."""
    head_decisions: int = 100
    """Decisions after which the head to follow is drawn anew, on average; after a reward it always is."""
    ensemble_share: float = 0.0
    """Share of the decisions at the end of the budget that all of them together make, by their mean; it grows evenly
    through the second half, as exploration falls."""
    learning_rate: float = 1e-4
    """Step size of Adam."""
    final_learning_rate: float = 1.0
    """What is left of it at the end of the budget, as a share; it falls as exploration does."""
    adam_beta1: float = 0.99
    """Adam's memory of gradients."""
    adam_beta2: float = 0.999
    """Adam's memory of squared gradients."""
    adam_epsilon: float = 1e-8
    """Added to Adam's denominator."""
    batch_size: int = 32
    """Transitions in one update."""
    replay_capacity: int = 100_000
    """Observations kept for replay."""
    learning_starts: int = 10_000
    """Decisions gathered before the first update."""
    discount: float = 0.99
    """What a reward one decision later counts."""
    train_freq: int = 1
    """Decisions between two updates."""
    reward_share: float = 0.0
    """Share of a batch that is drawn from the decisions shortly before rewards; the rest is uniform."""
    n_steps: int = 1
    """Decisions whose rewards are summed before the target network is asked."""
    double: bool = False
    """Choose the next action by the online network, value it by the target network (van Hasselt et al. 2016)."""
    tau: float = 1.0
    """Share of the online weights taken over at each renewal of the target network."""
    target_update_interval: int = 1000
    """Updates between two renewals of the target network."""
    advice_margin: float = 0.0
    """By how much the action that a planner advised should be worth more than others (Hester et al. 2018)."""
    advice_weight: float = 0.0
    """What falling short of that counts, beside the temporal difference."""
    clip_rewards: bool = True
    """Learn from the sign of the reward only."""
    network: NetworkConfig = field(default_factory=NetworkConfig)
    """Shape of the Q-network."""

    def __post_init__(self) -> None:
        for name in _COUNTS:
            if getattr(self, name) < 1:
                raise UsageError(f"dqn.{name} must be 1 or more, not {getattr(self, name)}")
        for name in _SHARES:
            if not 0 <= getattr(self, name) <= 1:
                raise UsageError(f"dqn.{name} must lie between 0 and 1, not {getattr(self, name)}")
        for name in ("adam_beta1", "adam_beta2"):
            if not 0 <= getattr(self, name) < 1:
                raise UsageError(f"dqn.{name} must be 0 or more and below 1, not {getattr(self, name)}")
        for name in _POSITIVE:
            if not 0 < getattr(self, name) < math.inf:
                raise UsageError(f"dqn.{name} must be above 0, not {getattr(self, name)}")
        if not (0 <= self.advice_margin < math.inf and 0 <= self.advice_weight < math.inf):
            raise UsageError("dqn.advice_margin and dqn.advice_weight must be 0 or more")
        if self.exploration_min > self.exploration_max:
            raise UsageError("dqn.exploration_min must not exceed dqn.exploration_max")
        if self.replay_capacity <= self.n_steps:
            raise UsageError(f"dqn.replay_capacity must exceed dqn.n_steps, {self.n_steps}")
        if self.learning_starts < 2:
            raise UsageError(
                f"dqn.learning_starts must be 2 or more, not {self.learning_starts}: one needs a next state"
            )


_COUNTS = (
    "exploration_decisions", "heads", "head_decisions", "batch_size", "learning_starts", "train_freq",
    "n_steps", "target_update_interval",
)  # fmt: skip
_SHARES = (
    "exploration_min", "exploration_max", "final_exploration", "ensemble_share", "final_learning_rate", "discount",
    "reward_share", "tau",
)  # fmt: skip
_POSITIVE = ("learning_rate", "adam_epsilon", "tau")
