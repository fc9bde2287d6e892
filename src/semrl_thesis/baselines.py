"""Somebody else's agent on the same game and budget: DQN of Stable-Baselines3, on pixels and on the RAM."""

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX
from semrl.core.errors import MissingExtraError, SemrlError
from semrl.core.files import write_text
from semrl.core.strict_json import dumps
from semrl.envs import EnvironmentConfig, make_env, ram_features, rom_name
from semrl.envs.actions import Env
from semrl.evaluation.scores import EVALUATION_SEED
from semrl_thesis.ledger import deviation
from semrl_thesis.results import digest

View = Literal["pixels", "ram"]
VIEWS: tuple[View, ...] = ("pixels", "ram")

SETTINGS: Mapping[View, Mapping[str, Any]] = {
    "pixels": {
        "policy": "CnnPolicy", "learning_rate": 1e-4, "batch_size": 32, "buffer_size": 100_000, "train_freq": 4,
        "target_update_interval": 1000, "exploration_fraction": 0.1, "exploration_final_eps": 0.01,
    },
    "ram": {"policy": "MlpPolicy", "buffer_size": 100_000, "target_update_interval": 1000},
}  # fmt: skip
"""On pixels the values that its authors tuned for Atari games of 10,000,000 decisions; on the RAM its defaults, but for
buffer and target network."""


NUMBERS = ("mean", "std", "sticky", "minutes")
"""What is kept of a match."""


@dataclass(frozen=True, kw_only=True)
class Match:
    """What the baseline is given.

    Attributes
    ----------
    decisions
        Budget.
    learning_starts
        Decisions before its first update.
    episodes
        Greedy games after training, for each kind of test.
    sticky_actions
        Of the second kind: the usual value (Machado et al. 2018).
    max_noops
        At most so many random no-op decisions at the start of a game, in training and tests, as ours have them.
    env
        The game.
    """

    decisions: int = 100_000
    learning_starts: int = 5_000
    episodes: int = 30
    sticky_actions: float = 0.25
    max_noops: int = 30
    env: str = "PongNoFrameskip-v4"


class RamCoordinates(gym.ObservationWrapper[NDArray[np.float32], Any, Any]):
    """Show the coordinates in the RAM instead of the frame: those of now and of the decision before."""

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        self.rom = rom_name(env) or ""
        self._before: NDArray[np.float32] | None = None
        size = 2 * len(self._coordinates())
        self.observation_space = gym.spaces.Box(-1.0, 1.0, (size,), np.float32)

    def reset(self, **how: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Reset; the first difference is zero."""
        self._before = None
        return super().reset(**how)

    def observation(self, observation: Any) -> NDArray[np.float32]:  # noqa: ARG002 - the frame is not looked at
        """Read the coordinates, and how they changed."""
        now = self._coordinates()
        before = now if self._before is None else self._before
        self._before = now
        return np.concatenate([now, now - before])

    def _coordinates(self) -> NDArray[np.float32]:
        return ram_features(self.rom, self.unwrapped.ale.getRAM())  # type: ignore[attr-defined]


def compete(view: View, match: Match, kept: Path) -> dict[str, float]:
    """Train and test the baseline, if that was not done yet; its numbers are kept in a file.

    Returns
    -------
    dict
        ``mean``, ``std``, ``sticky`` (mean with sticky actions) and ``minutes`` of training.

    Raises
    ------
    MissingExtraError
        When it is not installed.
    SemrlError
        When its file is damaged.
    """
    if kept.exists():
        return _read(kept)
    try:
        from stable_baselines3 import DQN
        from stable_baselines3.common.evaluation import evaluate_policy
    except ImportError:
        raise MissingExtraError("sb3", "the comparison with Stable-Baselines3") from None
    began = time.perf_counter()
    agent = DQN(env=see(view, match), learning_starts=match.learning_starts, seed=0, device="cpu", **SETTINGS[view])
    agent.learn(match.decisions)
    minutes = (time.perf_counter() - began) / 60

    def test(sticky_actions: float) -> NDArray[np.float64]:
        env = see(view, match, sticky_actions)
        env.reset(seed=EVALUATION_SEED)
        returns, _ = evaluate_policy(agent, env, match.episodes, return_episode_rewards=True, warn=False)
        return np.asarray(returns)

    plain, sticky = test(0.0), test(match.sticky_actions)
    result = {"mean": float(plain.mean()), "std": deviation(plain), "sticky": float(sticky.mean()), "minutes": minutes}
    write_text(kept, dumps(result, indent=2) + "\n")
    return result


def result_name(view: View, match: Match) -> str:
    """Return the name of the file in which the numbers of `compete` are kept."""
    return f"sb3-{view}-{match.decisions}-{digest(match, SETTINGS[view])}.json"


def _read(path: Path) -> dict[str, float]:
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        return {name: float(stored[name]) for name in NUMBERS}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SemrlError(f"{path} is damaged: {error!r}; delete it to play again") from None


def see(view: View, match: Match, sticky_actions: float = 0.0) -> Env:
    """Make the game as the baseline sees it: four grey images of 84×84 pixels, or coordinates."""
    env = make_env(match.env, EnvironmentConfig(max_noops=match.max_noops, sticky_actions=sticky_actions))
    if view == "ram":
        return RamCoordinates(env)
    small = gym.wrappers.ResizeObservation(gym.wrappers.GrayscaleObservation(env), (IMAGE_SIZE_PX, IMAGE_SIZE_PX))
    return gym.wrappers.FrameStackObservation(small, 4)
