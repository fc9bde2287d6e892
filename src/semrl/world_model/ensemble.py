"""What an ensemble of models makes of scenarios: means, what they disagree about, and which are worth asking all of."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints, Scenarios, Trajectory
from semrl.core.kernels import compiled

FEWEST_SCREENED = 8
"""Scenarios; of fewer all members are asked about all."""

Roll = Callable[[Ints, slice], tuple[NDArray[Any], Floats, Floats]]
"""Rolls ``(s, t)`` sequences forward in some members: what the first of them predicts, ``(s, t, …)``, and
``(members, s, t)`` rewards and ``(members, s)`` values."""


class Imagined(NamedTuple):
    """What was imagined, of all sequences or the best quarter of them."""

    sequences: Ints
    predicted: NDArray[Any]
    rewards: Floats
    """``(s, t)``, means."""
    values: Floats
    """``(s,)``, means."""
    uncertainties: Floats
    """``(s,)``, standard deviation of the discounted return."""

    def scenarios(self, states: Floats) -> Scenarios:
        """Return them as scenarios, given the states ``(s, t, d)`` that what is predicted means."""
        return Scenarios(
            actions=self.sequences,
            states=states,
            rewards=self.rewards,
            values=self.values,
            uncertainties=self.uncertainties,
        )


def imagine_all(roll: Roll, sequences: Ints, *, members: int, screening: int, discount: float) -> Imagined:
    """Ask some members about all sequences, the others about the best quarter; where none screen, all about all."""
    screened = 0 < screening < members and len(sequences) >= FEWEST_SCREENED
    predicted, rewards, values = roll(sequences, slice(screening if screened else None))
    if screened:
        best = _best(_returns(rewards, values, discount), len(sequences) // 4)
        sequences = sequences[best]
        _, more_rewards, more_values = roll(sequences, slice(screening, None))
        predicted = predicted[best]
        rewards = np.concatenate([rewards[:, best], more_rewards])
        values = np.concatenate([values[:, best], more_values])
    return Imagined(sequences, predicted, *_averaged(rewards, values, _returns(rewards, values, discount)))


def _best(returns: NDArray[np.float64], count: int) -> Ints:
    """Return which scenarios have the best mean of ``(members, s)`` returns, ascending; of equal ones the first."""
    best: Ints = np.sort(np.argsort(-returns.mean(axis=0), kind="stable")[:count])
    return best


@compiled
def _averaged(rewards: Floats, values: Floats, returns: NDArray[np.float64]) -> tuple[Floats, Floats, Floats]:
    """Return mean rewards, ``(s, t)``, mean values, ``(s,)``, and the standard deviation of the returns, ``(s,)``.

    Sums are taken member by member, as numpy does.
    """
    members, n, length = rewards.shape
    mean_rewards, mean_values = np.zeros((n, length), np.float32), np.zeros(n, np.float32)
    means, squares = np.zeros(n), np.zeros(n)
    for member in range(members):
        mean_rewards += rewards[member]
        mean_values += values[member]
        means += returns[member]
    means /= members
    for member in range(members):
        for s in range(n):
            squares[s] += (returns[member, s] - means[s]) ** 2
    count = np.float32(members)
    return mean_rewards / count, mean_values / count, np.sqrt(squares / members).astype(np.float32)


def _returns(rewards: Floats, values: Floats, discount: float) -> NDArray[np.float64]:
    """Return what each member makes of each scenario, ``(members, s)``."""
    length = rewards.shape[2]
    weights = discount ** np.arange(length)
    return np.asarray((rewards * weights).sum(axis=2) + discount**length * values)


class Memory(Protocol):
    """Remembers play."""

    def add(self, trajectory: Trajectory) -> None:
        """Remember an episode."""
        ...

    def joined(self, trajectory: Trajectory) -> Self:
        """Return all that is remembered and one more episode; this one stays as it is."""
        ...


class Growth(Protocol):
    """When members are grown, and which of them are asked."""

    @property
    def members(self) -> int:
        """How many there are."""
        ...

    @property
    def screening(self) -> int:
        """How many are asked about all scenarios; 0: all of them."""
        ...

    @property
    def first_decisions(self) -> int:
        """Decisions before the first growth."""
        ...

    @property
    def new_decisions(self) -> int:
        """Fewest new decisions before a member is grown anew."""
        ...

    @property
    def new_share(self) -> float:
        """The same as a share of those that the newest was grown from."""
        ...


M = TypeVar("M", bound=Memory)


class GrownEnsemble(ABC, Generic[M]):
    """Members that are grown anew, the oldest first, whenever there is enough new to learn from.

    Attributes
    ----------
    memory
        The play that they are grown from.
    seen_ : int
        Decisions seen.
    grown_ : ndarray
        ``(members,)`` int64, decisions after which each member was grown; 0 before.
    screens : bool
        Whether some members may screen scenarios, where the configuration says so.
    """

    def __init__(self, growth: Growth, memory: M, *, seed: int, discount: float) -> None:
        self.memory = memory
        self.seed = seed
        self.discount = discount
        self.screens = True
        self.seen_ = 0
        self.grown_: Ints = np.zeros(growth.members, np.int64)
        self._growth = growth

    @property
    def is_fitted(self) -> bool:
        """Whether trees were grown yet."""
        return bool(self.grown_.all())

    def partial_fit(self, trajectory: Trajectory) -> dict[str, float]:
        """Remember an episode and, when there is enough new, grow a member anew."""
        self.memory.add(trajectory)
        self.seen_ += len(trajectory)
        if self._is_due(self.seen_):
            self._grow(self.memory, self.seen_)
        return {}

    def update_online(self, so_far: Trajectory) -> None:
        """Grow a member anew, when there is enough new, from all that is remembered and the episode so far."""
        seen = self.seen_ + len(so_far)
        if self._is_due(seen):
            self._grow(self.memory.joined(so_far), seen)

    def _imagined(self, roll: Roll, sequences: Ints) -> Imagined:
        """Ask the members about sequences; see `imagine_all`."""
        growth, discount = self._growth, self.discount
        screening = growth.screening if self.screens else 0
        return imagine_all(roll, sequences, members=growth.members, screening=screening, discount=discount)

    def _is_due(self, seen: int) -> bool:
        """Whether there is enough new after so many decisions to grow a member."""
        growth, newest = self._growth, int(self.grown_.max())
        if not newest:
            return seen >= growth.first_decisions
        return seen - newest >= max(growth.new_decisions, growth.new_share * newest, self._fewest_new(seen))

    def _fewest_new(self, seen: int) -> float:
        """Return how many new decisions there must be, after so many in all, for growing a member to be worth it."""
        del seen
        return 0.0

    def _grow(self, memory: M, seen: int) -> None:
        rng = np.random.default_rng([self.seed, seen])
        grow, alike = self._prepared(memory, rng)
        oldest = int(self.grown_.argmin()) if self.is_fitted and alike else None
        grow(oldest)
        self.grown_[oldest] = seen  # of all of them where there is no oldest

    @abstractmethod
    def _prepared(self, memory: M, rng: np.random.Generator) -> tuple[Callable[[int | None], None], bool]:
        """Lay out what is to be learned; return what grows one member or, given None, all, and whether one will do.

        It will not where the others were grown from other numbers.
        """
