"""One episode of the training, from its beginning to wherever it stands."""

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semrl.core import Observation
from semrl.core.arrays import Arrays


class Episode:
    """Where an episode of the training stands, as it can be saved between any two decisions.

    Parameters
    ----------
    observation
        What was seen last.
    state : array, shape (2, *shape), or None
        What the agent is shown now and was shown before; none while perception learns.
    planned
        Whether the planner plays.

    Attributes
    ----------
    action : int or None
        While perception learns, the one that led here.
    total : float
        Rewards so far.
    length : int
        Decisions of the agent's so far.
    """

    def __init__(self, observation: Observation, state: NDArray[Any] | None, *, planned: bool) -> None:
        self.observation = observation
        self.state = state
        self.planned = planned
        self.action: int | None = None
        self.total = 0.0
        self.length = 0

    def advance(self, observation: Observation, seen: NDArray[Any], reward: float) -> None:
        """Move on by one decision."""
        assert self.state is not None
        self.observation = observation
        self.state = np.stack([seen, self.state[0]])
        self.total += reward
        self.length += 1

    def to_arrays(self) -> Arrays:
        """Return everything but the observation, which the game keeps."""
        state = {} if self.state is None else {"state": self.state}
        action = {} if self.action is None else {"action": np.array(self.action)}
        own = {"total": np.array(self.total), "length": np.array(self.length), "planned": np.array(self.planned)}
        return own | state | action

    @classmethod
    def from_arrays(cls, observation: Observation, arrays: Arrays) -> Self:
        """Make the episode again."""
        episode = cls(observation, arrays.get("state"), planned=bool(arrays["planned"]))
        episode.total = float(arrays["total"])
        episode.length = int(arrays["length"])
        episode.action = int(arrays["action"]) if "action" in arrays else None
        return episode
