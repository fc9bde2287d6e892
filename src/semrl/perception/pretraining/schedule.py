"""What perception learns before the agent, one stage after the other (§3.2.3).

    detection → reduction until stable → clustering until stable → scenery → embedding
    detection → reduction until stable → clustering until stable → roles → embedding, where objects are tracked

Actions are random meanwhile: the agent cannot see yet, and chance explores. Either each stage plays on, or all learn
from the same stored play: see `StabilityConfig.decisions`.
"""

from collections.abc import Sequence

import numpy as np

from semrl.core import Observation
from semrl.core.arrays import Arrays, nest, unnest
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import PlayStage, Stage


class PretrainingSchedule:
    """All stages that an encoder needs, in order.

    Parameters
    ----------
    stages
        As `Encoder.stages` returns them.
    config
        How much play is stored, and when a stage ends that is never stable.

    Attributes
    ----------
    stores_play : bool
        Whether all is learned from the same stored play.
    max_batches : int
        Batches after which a stage ends that can go on without being stable.
    """

    def __init__(self, stages: Sequence[Stage], config: StabilityConfig) -> None:
        self.stores_play = bool(config.decisions and stages)
        self.max_batches = config.max_batches
        self.stages: Sequence[Stage] = [PlayStage(config.decisions), *stages] if self.stores_play else stages
        self._position = 0

    @property
    def current(self) -> Stage | None:
        """The stage that is being learned; None when perception is ready."""
        return self.stages[self._position] if self._position < len(self.stages) else None

    @property
    def uses_stored_play(self) -> bool:
        """Whether what comes next is to be learned from the play that was stored."""
        return self.stores_play and 0 < self._position < len(self.stages)

    def learn(self, observation: Observation, action: int | None = None) -> Stage:
        """Learn from one observation and the action that led there, if any; return the stage that did."""
        stage = self.stages[self._position]
        if stage.learn(observation, action):
            self._position += 1
        return stage

    def to_arrays(self) -> Arrays:
        """Return which stage it is, and its state."""
        state = nest(stage=self.current.to_arrays()) if self.current else {}
        return {"position": np.array(self._position), **state}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on where the schedule was."""
        self._position = int(arrays["position"])
        if self.current:
            self.current.from_arrays(unnest(arrays, "stage"))
