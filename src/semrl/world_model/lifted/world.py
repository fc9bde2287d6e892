"""A model of the world in concepts, learned while the game goes on (§3.4.3): any number of things."""

from collections.abc import Callable

import numpy as np

from semrl.concepts import Concepts, SceneBuilder
from semrl.concepts.scenes import CONCEPT, PLACE, WIDTH, X
from semrl.core import Floats, History, Ints, Scenarios, Trajectory
from semrl.core.arrays import Arrays, nest, unnest
from semrl.core.errors import UsageError
from semrl.core.named import IMAGE_SIZE_PX
from semrl.core.things import SLOT_NUMBERS
from semrl.world_model.ensemble import GrownEnsemble
from semrl.world_model.lifted.config import LiftedConfig
from semrl.world_model.lifted.features import PAST_ACTIONS, Kinds
from semrl.world_model.lifted.growing import Member, Seen, find_reward_concept, grow_member
from semrl.world_model.lifted.play import Play
from semrl.world_model.lifted.relations import relations_of
from semrl.world_model.lifted.rolling import Trees, roll


class LiftedWorld(GrownEnsemble[Play]):
    """Trees for the next velocity, the vanishing and the reward of things, one set a concept, shared by its instances.

    They look at relative features: see `semrl.world_model.lifted.features`. So any number of things is predicted, and
    what was learned of one ball holds for another. Several members, each grown from its own draw of the play, are
    asked; what they disagree about is uncertain.

    Parameters
    ----------
    config
        See `LiftedConfig`.
    dimension
        Length of the facts, a list of tracked objects: x, y and whether it is seen, for each slot.
    discount
        What a reward counts one decision later.
    seed
        Of the draws that the trees are grown from.

    Attributes
    ----------
    kinds_ : Kinds
        Which concepts move, by actions or not, and which relation is about them, when the trees were grown.
    families_ : ndarray
        ``(r,)`` int64: a concept of the family that each relation is about.
    reward_concept_ : int
        The concept that rewards are credited to; −1: none.
    grown_ : ndarray
        ``(members,)`` int64, decisions after which each member was grown; 0 before.
    """

    reads_things = True
    """It needs an encoder that follows things."""

    def __init__(
        self,
        config: LiftedConfig,
        dimension: int,
        n_actions: int = 0,
        *,
        seed: int = 0,
        discount: float = 1.0,
        axes: Ints | None = None,
    ) -> None:
        if axes is not None and (axes > 1).any():
            raise UsageError("the lifted world model reasons about places alone: do without slot_assigner.sizes")
        del n_actions  # an action is a number among others to a tree; slots say themselves what they are
        super().__init__(config, Play(config.capacity), seed=seed, discount=discount)
        self.config = config
        self.dimension = dimension
        self.concepts = Concepts()
        self._learns_concepts = True
        self.kinds_ = Kinds(np.zeros(0, np.int64), np.zeros(0, np.bool_), np.zeros(0, np.bool_))
        self.families_: Ints = np.zeros(0, np.int64)
        self.reward_concept_ = -1
        self._members: list[Member] = []
        self._trees: list[Trees] = []

    @property
    def play(self) -> Play:
        """What trees are grown from."""
        return self.memory

    def share(self, concepts: Concepts) -> None:
        """Take over what the things are; they are no longer learned here."""
        self.concepts, self._learns_concepts = concepts, False

    def partial_fit(self, trajectory: Trajectory) -> dict[str, float]:
        """Remember an episode and, when there is enough new, grow a member anew.

        Raises
        ------
        UsageError
            When the episode lists no things.
        """
        if not trajectory.things:
            raise UsageError("the world model 'lifted' needs lists of things: choose an encoder that follows them")
        if self._learns_concepts:
            self.concepts.partial_fit(trajectory.things)
        return super().partial_fit(trajectory)

    def imagine(self, history: History, sequences: Ints) -> Scenarios:
        """Roll ``(s, t)`` sequences of actions forward from a moment; rewards and values are the members' mean.

        Where some members screen, only the sequences that they think best of come back.
        """
        objects = self._relevant(SceneBuilder(self.concepts).newest(history.things))
        past = history.recent(PAST_ACTIONS)
        relations = len(self.families_)

        def roll_some(tried: Ints, members: slice) -> tuple[Floats, Floats, Floats]:
            rolled = [roll(trees, self.kinds_, objects, past, tried, relations) for trees in self._trees[members]]
            rewards, values = (np.concatenate([each[k] for each in rolled]) for k in (1, 2))
            return rolled[0][0], rewards, values

        imagined = self._imagined(roll_some, sequences)
        return imagined.scenarios(self._as_facts(history.states[0], objects, imagined.predicted))

    def to_arrays(self) -> Arrays:
        """Return trees and memory."""
        return self.inference_arrays() | nest(play=self.play.to_arrays())

    def inference_arrays(self) -> Arrays:
        """Return the trees, and the concepts where they are learned here."""
        own = {
            "counts": np.array([self.seen_, self.reward_concept_, *self.grown_]),
            "families": self.families_,
            **nest(kinds=self.kinds_._asdict()),
        }
        parts = {str(i): member.to_arrays() for i, member in enumerate(self._members)}
        concepts = {"concepts": self.concepts.to_arrays()} if self._learns_concepts else {}
        return own | nest(**parts, **concepts)

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on exactly where `to_arrays` was called; of the trees alone, predict as they did there."""
        if play := unnest(arrays, "play"):
            self.play.from_arrays(play)
        if concepts := unnest(arrays, "concepts"):
            self.concepts.from_arrays(concepts)
        self.seen_, self.reward_concept_ = (int(number) for number in arrays["counts"][:2])
        self.grown_ = arrays["counts"][2:].copy()
        self.families_, self.kinds_ = arrays["families"], Kinds(**unnest(arrays, "kinds"))
        parts = [unnest(arrays, str(i)) for i in range(self.config.members)]
        self._members = [Member.from_arrays(part) for part in parts if part]
        self._pack()

    def training_set(self, play: Play) -> dict[int, Seen]:
        """Return what was seen of each concept that moves; it decides which families things are related to."""
        objects = play.objects(self.concepts)
        self.kinds_, self.families_ = relations_of(self.concepts, objects, self.config.relations)
        return {
            int(concept): play.rows(objects, int(concept), self.kinds_, self.discount)
            for concept in np.flatnonzero(self.kinds_.moving)
        }

    def _relevant(self, objects: Floats) -> Floats:
        """Return the objects that are predicted, or that others are related to."""
        concepts = objects[:, CONCEPT].astype(np.int64)
        known = (concepts >= 0) & (concepts < len(self.kinds_.moving))
        known[known] = self.kinds_.moving[concepts[known]] | (self.kinds_.relation_of[concepts[known]] >= 0)
        return objects[known]

    def _as_facts(self, present: Floats, objects: Floats, paths: Floats) -> Floats:
        """Write predicted places, ``(s, t, k, 3)``, as the list of tracked objects, ``(s, t, d)``."""
        states = np.empty((*paths.shape[:2], self.dimension), np.float32)
        states[:] = present
        last = np.float32(IMAGE_SIZE_PX - 1)
        for i, one in enumerate(objects):
            at = int(one[PLACE]) * SLOT_NUMBERS
            if at < 0:
                continue
            bounds = self.concepts.bounds_px_[int(one[CONCEPT])]
            for axis in range(2):
                size, now = one[WIDTH + axis], one[X + axis]
                limits = bounds[axis], bounds[axis + 2]
                offset = present[at + axis] * last - _shown(now, size, limits)
                states[:, :, at + axis] = (_shown(paths[:, :, i, axis], size, limits) + offset) / last
            states[:, :, at + 2] = paths[:, :, i, 2]
        return states

    def _is_due(self, seen: int) -> bool:
        return super()._is_due(seen) and self.concepts.is_fitted

    def _prepared(self, memory: Play, rng: np.random.Generator) -> tuple[Callable[[int | None], None], bool]:
        c, before = self.config, (*self.kinds_, self.families_, np.array(self.reward_concept_))
        seen = {concept: _some(rows, c.most_rows, rng) for concept, rows in self.training_set(memory).items()}
        self.reward_concept_ = find_reward_concept(seen, c)
        after = *self.kinds_, self.families_, np.array(self.reward_concept_)

        def grow(member: int | None) -> None:
            if member is None:
                self._members = [Member.empty()] * c.members
            for i in range(c.members) if member is None else (member,):
                self._members[i] = grow_member(seen, len(self.concepts), self.reward_concept_, c, rng, draws=i > 0)
            self._pack()

        return grow, all(np.array_equal(old, new) for old, new in zip(before, after, strict=True))

    def _pack(self) -> None:
        """Note the trees as the compiled code wants them."""
        self._trees = [(member.nodes, member.roots[None]) for member in self._members]


def _shown(middle: Floats, size: float, limits: tuple[float, float]) -> Floats:
    """Return the middle of what is seen of intervals between the limits, as places of pixels."""
    low, high = np.maximum(middle - size / 2, limits[0]), np.minimum(middle + size / 2, limits[1])
    places: Floats = np.where(high - low > 0.25 * size, (low + high) / 2, middle) - np.float32(0.5)
    return places


def _some(seen: Seen, most: int, rng: np.random.Generator) -> Seen:
    """Return so many rows at most, drawn."""
    rows, targets = seen
    if len(rows) <= most:
        return seen
    drawn = np.sort(rng.choice(len(rows), most, replace=False))
    return rows[drawn], targets[drawn]
