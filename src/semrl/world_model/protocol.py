"""What a world model must offer (§3.4.3), and the two halves of the thesis's."""

from collections.abc import Collection, Sequence
from typing import Protocol, Self, runtime_checkable

from semrl.concepts import Concepts
from semrl.core import Floats, History, Ints, Scenarios, Trajectory, Transitions
from semrl.core.protocols import Learner, Persistent
from semrl.world_model.experience import Experience
from semrl.world_model.rules import Rule, RuleBook
from semrl.world_model.switching import SwitchedOff


class DynamicsModel(Persistent, Protocol):
    """Predicts what state comes next (§3.4.3)."""

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        ...

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Floats:
        """Return the next state for each of ``(b, d)`` states, the ones before them and ``(b,)`` actions."""
        ...


class RewardModel(Persistent, Protocol):
    """Predicts the sign of the reward (§3.4.3)."""

    def partial_fit(self, transitions: Transitions) -> Self:
        """Learn in one pass over some transitions."""
        ...

    def predict(self, states: Floats, previous: Floats, actions: Ints) -> Ints:
        """Return −1, 0 or 1 for each of ``(b, d)`` states, the ones before them and ``(b,)`` actions."""
        ...


class WorldModel(Learner, Protocol):
    """Predicts what actions lead to (§3.4.3).

    It is made with its configuration, ``dimension`` (length of the facts) and ``n_actions`` and, by keyword, ``seed``,
    ``discount`` (what a reward counts one decision later) and ``axes`` (see `StateSpace.axes`).
    """

    @property
    def is_fitted(self) -> bool:
        """Whether enough was learned to predict."""
        ...

    def partial_fit(self, trajectory: Trajectory) -> dict[str, float]:
        """Learn from an episode after its end; return columns of the metrics."""
        ...

    def update_online(self, so_far: Trajectory) -> None:
        """Learn from the episode that is going on, when that is worth while; what it shows is not kept."""
        ...

    def imagine(self, history: History, sequences: Ints) -> Scenarios:
        """Predict what ``(s, t)`` sequences of actions lead to; fewer may come back, those that promise most."""
        ...


@runtime_checkable
class Remembering(Protocol):
    """A world model that remembers the facts of the play that it has learned from."""

    @property
    def experience(self) -> Experience:
        """What it remembers; nothing where only what plans need was loaded."""
        ...


@runtime_checkable
class Screening(Protocol):
    """A world model that need not imagine all scenarios, but those alone that promise most reward."""

    screens: bool
    """Whether it may; without, all come back, as one wants them who seeks something else than rewards."""


@runtime_checkable
class ConceptBased(Protocol):
    """A world model that reasons about things of concepts."""

    def share(self, concepts: Concepts) -> None:
        """Take over what the things are; who gives it lets it learn from each episode, before this learns from it."""
        ...


@runtime_checkable
class RuleBased(Protocol):
    """A world model whose predictions can be read as rules."""

    def rules(
        self, names: Sequence[str], actions: Sequence[str], *, most: int = 8, unit: float | None = None
    ) -> list[Rule]:
        """Return the rules for each number of a state, and for the reward."""
        ...


@runtime_checkable
class RulesThatFire(RuleBased, Protocol):
    """A world model that can say which of its rules hold at a decision, and do without some."""

    def rule_book(
        self, names: Sequence[str], actions: Sequence[str], *, most: int = 8, unit: float | None = None
    ) -> RuleBook:
        """Return the same rules, to be asked which of them hold at a decision."""
        ...

    def switch_off(self, rules: Sequence[SwitchedOff]) -> None:
        """Let these rules count for nothing in what is imagined, and all others again."""
        ...


@runtime_checkable
class LearnsAnew(Protocol):
    """A world model that can learn some of what it predicts from new play alone, and keep the rest."""

    def learn_anew(self, play: Sequence[Trajectory], numbers: Collection[int], *, reward: bool) -> None:
        """Replace what it knows of some numbers of a state, and of the reward."""
        ...
