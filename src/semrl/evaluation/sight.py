"""Looking at frames as a run's perception does: for videos and reports."""

import contextlib

from semrl.core import Observation, Sight, State
from semrl.core.errors import DataError
from semrl.perception.encoders import EpisodeEncoder

CLASS_COLOURS: tuple[tuple[int, int, int], ...] = (
    (59, 142, 234), (242, 169, 59), (53, 183, 121), (232, 87, 90), (167, 123, 220),
    (63, 193, 201), (241, 120, 182), (201, 201, 74), (181, 131, 90), (154, 165, 177),
    (46, 92, 190), (186, 104, 20), (140, 222, 160), (172, 38, 72), (214, 184, 255), (96, 140, 36),
)  # fmt: skip
"""RGB of class 0, 1, …: as many as the presets have kinds; later classes begin again."""


def look(episode: EpisodeEncoder, observation: Observation) -> tuple[State | None, Sight]:
    """Encode the next observation of an episode, None where that is not learned yet, and return what was seen in it."""
    state = None
    with contextlib.suppress(DataError):
        state = episode.encode(observation)
    return state, episode.look()
