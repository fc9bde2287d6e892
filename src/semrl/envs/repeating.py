"""Whether an environment repeats itself, on which resuming and explaining rest."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.envs.actions import Env

DECISIONS = 30
"""That are played twice: environments that do not repeat themselves differ at once, or within an episode."""


def repeats_itself(env: Env, seed: int, decisions: int = DECISIONS) -> bool:
    """Play random decisions twice from one seed; return whether frames, rewards and ends were the same.

    Parameters
    ----------
    env
        As `make_env` returns it; afterwards it is to be reset with a seed.
    seed
        Of its episodes, which are begun anew when they end, and of the actions.
    decisions
        To be played, each time.
    """
    actions = np.random.default_rng(seed).integers(env.action_space.n, size=decisions)  # type: ignore[attr-defined]
    plays = [_play(env, seed, actions) for _ in range(2)]
    return all(np.array_equal(one[0], other[0]) and one[1:] == other[1:] for one, other in zip(*plays, strict=True))


def _play(env: Env, seed: int, actions: Ints) -> list[tuple[NDArray[np.uint8], float, bool, bool]]:
    """Return what is seen, paid and ended at every decision."""
    played = [(env.reset(seed=seed)[0], 0.0, False, False)]
    for number, action in enumerate(actions.tolist()):
        if played[-1][2] or played[-1][3]:
            played.append((env.reset(seed=seed + number)[0], 0.0, False, False))
        frame, reward, terminated, truncated, _ = env.step(action)
        played.append((frame, float(reward), terminated, truncated))
    return played
