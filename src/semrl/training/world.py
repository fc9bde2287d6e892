"""What a run notes of its environment, so that what was learned can be read where the environment is not."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import msgspec

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, action_meanings, rom_name
from semrl.envs.actions import Env
from semrl.envs.environment import pooled_frames, sticky_actions
from semrl.envs.flicker import Pooling


@dataclass(frozen=True, kw_only=True)
class World:
    """What was really played: an id has defaults of its own."""

    actions: tuple[str, ...]
    """Names of the actions, by number."""
    rom: str | None
    """Name of an Atari game's ROM; None for other environments."""
    frame_skip: int
    """Frames for which an action is held."""
    max_frames: int
    """Of these, so many at the end are pooled into what is shown."""
    pooling: Pooling = "brightest"
    """What is shown of these at each pixel."""
    sticky_actions: float
    """Probability that a frame repeats the previous action."""
    repeats: bool = True
    """Whether it plays alike from a seed and actions, so that the run can be resumed."""
    slots: int = 0
    """For how many things a state has room; 0: as many as are configured, in runs from before it was counted."""

    @classmethod
    def of(cls, env: Env, config: EnvironmentConfig) -> Self:
        """Return what is to be noted of an environment that `make_env` made."""
        frames, pooling = pooled_frames(env)
        return cls(
            actions=tuple(action_meanings(env)),
            rom=rom_name(env),
            frame_skip=config.frame_skip,
            max_frames=frames,
            pooling=pooling,
            sticky_actions=sticky_actions(env),
        )

    def shown_alike(self, config: EnvironmentConfig) -> EnvironmentConfig:
        """Return how to play so that frames are pooled as they were, whatever random play would show now."""
        return replace(config, max_frames=self.max_frames, pooling=self.pooling)

    def to_dict(self) -> dict[str, Any]:
        """Return it as the manifest holds it."""
        return asdict(self)


def read_world(manifest: Mapping[str, Any], run: object) -> World:
    """Read what a run has noted of its environment.

    Raises
    ------
    UsageError
        When it has not, or the manifest is damaged.
    """
    try:
        return msgspec.convert(manifest["environment"], World)
    except (KeyError, msgspec.ValidationError) as error:
        raise UsageError(f"the manifest of {run} does not say which environment was played ({error})") from None
