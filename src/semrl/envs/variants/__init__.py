"""The same game, altered a little: small named modifications, to see what an agent has understood."""

from functools import reduce
from typing import Protocol

from semrl.core.errors import UsageError
from semrl.core.registry import Registry
from semrl.envs.actions import Env, rom_name, title

_PONG = "semrl.envs.variants.pong:"
_FRAMES = "semrl.envs.variants.frames:"
_SECOND = "semrl.envs.variants.second_ball:"


class Variant(Protocol):
    """A wrapper around an environment of which one step is one frame, and that shows RGB frames."""

    roms: tuple[str, ...]
    """Of which Atari games it is a variant; empty: of everything."""

    def __call__(self, env: Env) -> Env:
        """Return the altered environment."""
        ...


VARIANTS: Registry[Variant] = Registry(
    "variants",
    {
        "recoloured": f"{_FRAMES}Recoloured",
        "mirrored": f"{_FRAMES}Mirrored",
        "upside_down": f"{_FRAMES}UpsideDown",
        "frozen_enemy": f"{_PONG}FrozenEnemy",
        "slow_enemy": f"{_PONG}SlowEnemy",
        "fast_enemy": f"{_PONG}FastEnemy",
        "lazy_enemy": f"{_PONG}LazyEnemy",
        "two_speeds": f"{_PONG}TwoSpeeds",
        "recoloured_ball": f"{_PONG}RecolouredBall",
        "recoloured_enemy": f"{_PONG}RecolouredEnemy",
        "dark_ball": f"{_PONG}DarkBall",
        "second_ball": f"{_SECOND}SecondBall",
    },
)


def names_of(variant: str) -> tuple[str, ...]:
    """Return the modifications that a setting names, such as ``lazy_enemy+recoloured``, checked.

    Raises
    ------
    UsageError
        When one of them is unknown.
    """
    names = tuple(variant.split("+")) if variant else ()
    for name in names:
        VARIANTS.check(name)
    return names


def varied(env: Env, variant: str) -> Env:
    """Alter an environment of which one step is one frame.

    Raises
    ------
    UsageError
        When a modification is unknown, or is one of other games.
    """
    return reduce(_altered, names_of(variant), env)


def _altered(env: Env, name: str) -> Env:
    made = VARIANTS.load(name)
    roms, rom = getattr(made, "roms", ()), rom_name(env)
    if roms and rom not in roms:
        raise UsageError(f"the variant '{name}' is one of {', '.join(roms)}, not of {title(env)}")
    wrapped: Env = made(env)  # type: ignore[assignment]
    return wrapped
