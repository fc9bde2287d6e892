"""Play that varies, with the truth beside it: what embeddings are compared on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Ints, Observation, SceneGraph
from semrl.core.errors import UsageError
from semrl.envs import Game, make_env, rom_name
from semrl.envs.ram import GAMES
from semrl.perception.perception import Perception
from semrl.training import RunConfig

COORDINATES = ("player_y", "enemy_y", "ball_x", "ball_y")
"""What is read from the RAM of Pong, in this order."""

RANDOM_SHARE = 0.3
"""Share of decisions in which the player that follows the ball acts at random."""

BALL_ORIGIN = (13, 49)
"""Row and column that the RAM gives to a ball in the upper left corner of the screen."""

SCREEN = (210, 160)
"""Height and width of the screen in the units of the RAM."""

SEEN_WITHIN_PX = 3.0
"""How near to the ball's true place an object must be found, for the ball to be visible."""


@dataclass(frozen=True, kw_only=True)
class Watched:
    """Scenes of play, one a decision, and the truth about each.

    Attributes
    ----------
    scenes
        ``n`` of them.
    coordinates
        ``(n, 4)`` float64, the bytes of the RAM named in `COORDINATES`.
    starts
        ``(n,)`` bool, whether an episode begins.
    """

    scenes: Sequence[SceneGraph]
    coordinates: NDArray[np.float64]
    starts: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.scenes)

    def first(self, count: int) -> "Watched":
        """Return the beginning of it."""
        return Watched(scenes=self.scenes[:count], coordinates=self.coordinates[:count], starts=self.starts[:count])

    @property
    def adjacent(self) -> Ints:
        """Scenes that are followed by another one of their episode."""
        return np.flatnonzero(~self.starts[1:])

    @property
    def ball_visible(self) -> NDArray[np.bool_]:
        """``(n,)``, whether an object was found where the ball is: not so when it has left or touches something."""
        units_px = IMAGE_SIZE_PX / np.array(SCREEN)
        balls_px = (self.coordinates[:, [3, 2]] - BALL_ORIGIN) * units_px  # (n, 2)
        pairs = zip(self.scenes, balls_px, strict=True)
        return np.array([bool((np.abs(s.centres_px - b) < SEEN_WITHIN_PX).all(axis=1).any()) for s, b in pairs])


def watch(perception: Perception, config: RunConfig, decisions: int, seed: int) -> Watched:
    """Watch Pong for so many decisions: episodes of random play and of a player that follows the ball take turns.

    Raises
    ------
    UsageError
        When the game is not Pong, whose truth alone is known.
    """
    env = make_env(config.env, config.environment)
    if rom_name(env) != "pong":
        raise UsageError(f"embeddings are compared on Pong, where the truth is known, not on {config.env}")
    game, rng = Game(env, seed), np.random.default_rng(seed)
    addresses = [GAMES["pong"].ram_addresses[name] for name in COORDINATES]
    scenes, coordinates, starts = [], [], []
    start, follows, observation = True, False, game.reset()
    for _ in range(decisions):
        truth = _ram(observation)[addresses].astype(np.float64)
        scenes.append(perception.scene(observation))
        coordinates.append(truth)
        starts.append(start)
        follow = follows and rng.random() >= RANDOM_SHARE
        outcome = game.step(_towards_ball(truth) if follow else int(rng.integers(game.n_actions)))
        start, observation = outcome.done, outcome.observation
        if outcome.done:
            follows, observation = not follows, game.reset()
    return Watched(scenes=scenes, coordinates=np.array(coordinates), starts=np.array(starts))


def _ram(observation: Observation) -> NDArray[np.uint8]:
    assert observation.ram is not None, "Pong has RAM"
    return observation.ram


def _towards_ball(truth: NDArray[np.float64]) -> int:
    """Return the action that moves the paddle's middle towards the ball: 0 is RIGHT, which is up."""
    player_y, _, _, ball_y = truth
    return int(ball_y >= player_y + 6)
