"""Settings of the thesis's model of the world, by themselves: who reads settings should not wait for torch."""

from dataclasses import dataclass, field
from typing import Literal

from semrl.core.errors import UsageError


@dataclass(frozen=True, kw_only=True, slots=True)
class NextStateConfig:
    """Settings of the next-state model; the defaults are the thesis's (§3.4.3)."""

    hidden_units: tuple[int, ...] = (512,)
    """Width of each dense layer."""
    layer_norm: bool = False
    """Normalise each dense layer before its activation (Ba et al. 2016)."""
    learning_rate: float = 1e-4
    """Step size of Adam."""
    adam_beta1: float = 0.99
    """Adam's memory of gradients."""
    adam_beta2: float = 0.999
    """Adam's memory of squared gradients."""
    batch_size: int = 64
    """Transitions in a mini-batch."""
    epochs: int = 100
    """Passes over an episode after its end."""
    predict_change: bool = False
    """Predict what changes in place of the whole state, inputs and changes scaled as in the first episode, with the
    squared error linear beyond 1."""

    def __post_init__(self) -> None:
        if min(*self.hidden_units, self.batch_size, self.epochs) < 1:
            raise UsageError("next_state.hidden_units, batch_size and epochs must all be 1 or more")
        if not (self.learning_rate > 0 and 0 <= self.adam_beta1 < 1 and 0 <= self.adam_beta2 < 1):
            raise UsageError("next_state.learning_rate must be above 0, and adam_beta1 and adam_beta2 lie in 0 … 1")


@dataclass(frozen=True, kw_only=True, slots=True)
class RewardConfig:
    """Settings of the reward model; the defaults are the thesis's (§3.4.3)."""

    kind: Literal["svm", "network"] = "svm"
    """Three linear machines, one against all, or a network."""
    svm_lambda: float = 1e-4
    """Weight of the margin against the hinge loss."""
    hidden_units: tuple[int, ...] = (128,)
    """Of the network: width of each dense layer."""
    layer_norm: bool = False
    """Of the network: normalise each dense layer before its activation."""
    learning_rate: float = 1e-3
    """Of the network: step size of Adam."""
    batch_size: int = 64
    """Of the network: transitions in a mini-batch."""
    epochs: int = 1
    """Passes over an episode after its end."""

    def __post_init__(self) -> None:
        if min(*self.hidden_units, self.batch_size, self.epochs) < 1:
            raise UsageError("reward.hidden_units, batch_size and epochs must all be 1 or more")
        if not (self.svm_lambda > 0 and self.learning_rate > 0):
            raise UsageError("reward.svm_lambda and learning_rate must be above 0")


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelPairConfig:
    """Settings of `ModelPair`; the defaults are the thesis's (§3.4.3)."""

    next_state: NextStateConfig = field(default_factory=NextStateConfig)
    """How the next state is predicted."""
    reward: RewardConfig = field(default_factory=RewardConfig)
    """How rewards are predicted."""
    rehearsal_states: int = 0
    """States of past episodes that the models rehearse, rewards in equal shares; 0: they see each episode once."""
    rehearsal_reward_share: float = 0.0
    """Share of what the next-state model rehearses that lies shortly before a reward: what happens there is rare."""

    def __post_init__(self) -> None:
        if self.rehearsal_states < 0:
            raise UsageError(f"networks.rehearsal_states must be 0 or more, not {self.rehearsal_states}")
        if not 0 <= self.rehearsal_reward_share <= 1:
            raise UsageError(f"networks.rehearsal_reward_share must lie in 0 … 1, not {self.rehearsal_reward_share}")
