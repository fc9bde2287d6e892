"""Settings of the thesis's model of the world, and of trees: who reads settings should not wait for torch."""

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
    within_seen: bool = True
    """Keep every number of a predicted state within the range of those learned from: where a network is fed its own
    predictions, errors grow without bound."""

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


@dataclass(frozen=True, kw_only=True, slots=True)
class TreesConfig:
    """Settings of `TreeWorld`."""

    members: int = 3
    """Forests, each grown from its own draw of the play; a reward counts what they predict on average.

    When it is time, the oldest is grown anew."""
    screening: int = 0
    """Forests that are asked about all scenarios, the others about the best quarter alone; 0: all about all."""
    past_states: int = 4
    """States that are looked at, the present one included."""
    past_actions: int = 3
    """Actions before that are looked at: things that have inertia go on by them."""
    distances: bool = False
    """Whether numbers are compared along an axis alone, and by how far they lie apart as well: a contact is one cut of
    a distance and two of a difference, which counts when there was little play."""
    nearest_from: int = 0
    """Things from which on each is compared with what is nearest to it, whichever that is, and not with each other one:
    what many things do alike is learned once, from fewer numbers; 0: never."""
    counterfactuals_from: int = 0
    """Decisions from which on things that fly by themselves are learned from play in which far things have changed
    places: else trees take what goes together for what causes what (Pitis et al. 2020); 0: never."""
    reward_gap: int = 0
    """Rewards of which most are followed by another within so many decisions do not end what is imagined: the world
    goes on. All others do, as a point does after which the ball is served anew; 0: every reward does."""
    resolution: float = 1 / 255
    """Least difference between two states that means anything; RAM features are bytes divided by 255."""
    least_changes: float = 0.001
    """Share of the decisions at which a number must have changed, else it is taken to stay as it is."""
    leaf_decisions: int = 2
    """Fewest decisions in a leaf."""
    value_leaf_decisions: int = 20
    """The same for the return expected beyond a scenario, which is learned from those that came; 0: none is."""
    capacity: int = 100_000
    """Decisions remembered, the oldest episodes first to go."""
    most_numbers: int = 30_000_000
    """Most numbers that a forest is grown from: of more, a draw of the decisions is laid out (some ten objects at once
    make 600 numbers of a decision, and 100,000 decisions would take minutes a forest)."""
    grown_numbers: int = 0
    """Numbers, of all decisions and to each tree, that growing a forest may look at for each new decision: where there
    is more to see forests are grown less often; 0: any."""
    first_decisions: int = 1_000
    """Decisions before trees are grown for the first time."""
    new_decisions: int = 100
    """Fewest new decisions before a forest is grown anew, which is after the next reward or the end of the episode."""
    new_share: float = 0.03
    """The same as a share of those that the newest was grown from."""

    def leaf_rows(self, targets: int) -> list[int]:
        """Return the fewest decisions in a leaf of each tree, that of the return last."""
        return [self.leaf_decisions] * (targets - 1) + [max(self.value_leaf_decisions, 1)]

    def __post_init__(self) -> None:
        for name in ("members", "leaf_decisions", "capacity", "first_decisions", "new_decisions", "most_numbers"):
            if getattr(self, name) < 1:
                raise UsageError(f"trees.{name} must be 1 or more, not {getattr(self, name)}")
        if not 0 <= self.screening <= self.members:
            raise UsageError(f"trees.screening must lie in 0 … members, {self.members}, not {self.screening}")
        for name in ("nearest_from", "counterfactuals_from", "reward_gap", "grown_numbers"):
            if getattr(self, name) < 0:
                raise UsageError(f"trees.{name} must be 0 or more, not {getattr(self, name)}")
        if self.past_states < 2 or self.past_actions < 0:
            raise UsageError("trees.past_states must be 2 or more and trees.past_actions 0 or more")
        if not (self.resolution > 0 and min(self.new_share, self.value_leaf_decisions, self.least_changes) >= 0):
            raise UsageError(
                "trees.resolution must be above 0, new_share, value_leaf_decisions and least_changes 0 or more"
            )
