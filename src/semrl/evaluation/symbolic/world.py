"""A discrete world as it was learned from play, and the play itself, cell by cell."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from semrl.core.arrays import Arrays, array_to_json, json_to_array, nest, unnest
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import make_folder, read_arrays, write_arrays
from semrl.envs import Game
from semrl.perception.lattice import Lattice
from semrl.planning.symbolic.appearances import Appearances
from semrl.planning.symbolic.cells import CellConcepts, GridEpisode, learn_concepts
from semrl.planning.symbolic.induction import learn_operators
from semrl.planning.symbolic.operators import Operators

PLAY = "symbols.npz"
"""File in a run's folder: the play that operators are learned from, cell by cell."""


@dataclass(kw_only=True)
class SymbolicWorld:
    """A discrete world as it was learned from play."""

    env: str
    actions: tuple[str, ...]
    lattice: Lattice
    episodes: list[GridEpisode] = field(default_factory=list)

    def learn(self) -> tuple[CellConcepts, Operators]:
        """Learn concepts and operators from all play."""
        concepts = learn_concepts(self.episodes, Appearances(self.lattice.patterns_))
        return concepts, learn_operators(self.episodes, concepts)

    @property
    def decisions(self) -> int:
        """Of the play."""
        return sum(len(episode.actions) for episode in self.episodes)

    def save(self, run: Path) -> None:
        """Write it into a run's folder."""
        make_folder(run)
        meta = {"env": self.env, "actions": self.actions, "ended": [episode.ended for episode in self.episodes]}
        parts: Arrays = {"meta": json_to_array(meta), **nest(lattice=self.lattice.to_arrays())}
        for number, episode in enumerate(self.episodes):
            own = {"grids": episode.grids, "actions": episode.actions, "rewards": np.array(episode.rewards, np.float64)}
            parts |= nest(**{f"episode{number}": own})
        write_arrays(run / PLAY, parts)

    @classmethod
    def load(cls, run: Path) -> "SymbolicWorld":
        """Read it.

        Raises
        ------
        UsageError
            When there is none.
        """
        if not (run / PLAY).exists():
            raise UsageError(f"{run} has no play of a discrete world yet; name one with --env, such as --env ID")
        arrays = read_arrays(run / PLAY)
        try:
            meta, lattice = array_to_json(arrays["meta"]), Lattice()
            lattice.from_arrays(unnest(arrays, "lattice"))
            episodes = [
                GridEpisode(
                    grids=own["grids"], actions=own["actions"], rewards=own["rewards"].tolist(), ended=bool(ended)
                )
                for number, ended in enumerate(meta["ended"])
                for own in [unnest(arrays, f"episode{number}")]
            ]
            return cls(env=meta["env"], actions=tuple(meta["actions"]), lattice=lattice, episodes=episodes)
        except (KeyError, ValueError, TypeError) as error:
            raise SemrlError(f"{run / PLAY} is damaged ({error})") from error


class Record:
    """The episode that is going on."""

    def __init__(self, grid: np.ndarray) -> None:
        self.grids, self.actions, self.rewards = [grid], list[int](), list[float]()
        self.ended = self.over = False

    def take(self, game: Game, action: int, lattice: Lattice) -> None:
        """Act, and take in what comes of it."""
        outcome = game.step(action)
        self.grids.append(lattice.read(outcome.observation.frame))
        self.actions.append(action)
        self.rewards.append(outcome.reward)
        self.ended, self.over = outcome.terminated, outcome.done

    def episode(self) -> GridEpisode:
        """Return it as far as it was played."""
        return GridEpisode(
            grids=np.array(self.grids),
            actions=np.array(self.actions, np.int64),
            rewards=tuple(self.rewards),
            ended=self.ended,
        )
