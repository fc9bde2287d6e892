"""The list of tracked objects: the models `objects` and `objects-map`."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace

import numpy as np

from semrl.core import IMAGE_SIZE_PX, Floats, Observation, Sight, State, StateSpace
from semrl.core.arrays import Arrays, nest, unnest
from semrl.perception.encoders.through import ThroughPerception
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import ClustererStage, DetectorStage, ReducerStage, SlotsStage, Stage
from semrl.perception.tracking import AXES, Inheritance, SharedSlots, restored_tracks

PERCENT = 0.01
"""Of the image: the unit in which people are shown places."""


class ObjectsEncoder(ThroughPerception):
    """Shows where objects that move are: x, y, whether it is seen, and its size where that counts, for each slot."""

    tracked = True

    @property
    def space(self) -> StateSpace:
        """What its states have in common; names are known when roles are."""
        return listed_space(self.perception)

    @property
    def is_fitted(self) -> bool:
        """Whether roles are known."""
        return self.perception.slot_assigner.is_fitted

    def stages(self, config: StabilityConfig) -> Sequence[Stage]:
        """Return those of detector, reducer, clusterer and roles."""
        return tracking_stages(self.perception, config)

    def begin(self) -> "TrackedEpisode":
        """Begin an episode."""
        return TrackedEpisode(self.perception)


def _as_state(facts: Floats, things: Floats) -> State:
    return State(vector=facts, facts=facts, things=things)


class TrackedEpisode:
    """The tracks of one episode.

    Parameters
    ----------
    perception
        Sees and follows.
    write
        Makes a state of the list of tracked objects, ``(k,)`` float32, and all things, ``(n, 9)`` float32; by default
        one that shows the list.
    """

    def __init__(self, perception: Perception, write: Callable[[Floats, Floats], State] = _as_state) -> None:
        self._perception = perception
        self._write = write
        self._ground = perception.ground
        self._there = self._ground.begin() if self._ground else np.zeros((0, 0), np.bool_)
        self.tracks = perception.begin()
        self._known = self.tracks  # the same, what is new as what it is taken for
        self._inheritance = Inheritance(perception.slot_assigner, perception.config.inheritance)
        self._shared = SharedSlots(perception.slot_assigner, on=perception.config.inheritance.shares)

    def encode(self, observation: Observation) -> State:
        """Move the tracks on by one observation and list what moves."""
        facts = self.facts(observation)
        things = self._perception.slot_assigner.things(self._known)
        if self._ground:
            self._there = self._ground.look(self._there, observation.frame)
            things = np.concatenate([things, self._ground.patches(self._there)])
        return replace(self._write(facts, things), lists=self._shared.lists(self._known, facts))

    def facts(self, observation: Observation) -> Floats:
        """Move the tracks on by one observation and return the list, ``(k,)`` float32; see `SlotAssigner.transform`."""
        tracks = self._perception.track(self.tracks, observation)
        self._known = self._perception.assign(self._inheritance.as_known(tracks))
        self.tracks = replace(tracks, roles=self._known.roles)
        return self._perception.slot_assigner.transform(self.tracks)

    def look(self) -> Sight:
        """Show the tracks that have a slot, each with its role's name and its identity; say what is taken for what."""
        tracks, roles = self.tracks, self._perception.slot_assigner
        slots = roles.slots_.tolist()
        listed = np.flatnonzero(tracks.visible & np.isin(tracks.roles, slots))
        labels = np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX), np.int64)
        boxes, classes = tracks.boxes_px[listed], tracks.classes[listed]
        for (top, left, height, width), number in zip(boxes.tolist(), classes, strict=True):
            labels[top : top + height, left : left + width] = number + 1
        names = tuple(f"{roles.names_[slots.index(tracks.roles[i])]}: {tracks.ids[i]}" for i in listed)
        return Sight(boxes_px=boxes, classes=classes, labels=labels, names=names, remarks=self._inheritance.remarks())

    def to_arrays(self) -> Arrays:
        """Return the tracks, what the new ones are taken for, and where the ground is."""
        known = nest(inheritance=self._inheritance.to_arrays(), shared=self._shared.to_arrays())
        return nest(tracks=asdict(self.tracks)) | known | {"there": self._there}

    def from_arrays(self, arrays: Arrays) -> None:
        """Go on with the tracks that were saved."""
        self.tracks = restored_tracks(unnest(arrays, "tracks"))
        self._there = arrays.get("there", self._there)  # older checkpoints knew no ground
        if inheritance := unnest(arrays, "inheritance"):  # nor did they inherit
            self._inheritance.from_arrays(inheritance)
            self._shared.from_arrays(unnest(arrays, "shared"))


def listed_space(perception: Perception, before: int = 0) -> StateSpace:
    """Return the space of states that are a list of tracked objects, behind so many other numbers."""
    roles = perception.slot_assigner
    slots, numbers = roles.config.slots, roles.config.numbers
    axes = np.tile([AXES.index(name) if name in AXES else -1 for name in numbers], slots)
    return StateSpace(
        shape=(before + roles.dimension,),
        n_facts=roles.dimension,
        names=tuple(f"{role} {name}" for role in roles.names_ for name in numbers),
        axes=axes,
        seen=np.repeat(len(numbers) * np.arange(slots) + numbers.index("seen"), len(numbers)),
        unit=PERCENT,
        has_things=True,
    )


def tracking_stages(perception: Perception, config: StabilityConfig) -> list[Stage]:
    """Return what must be learned before objects can be listed."""
    return [
        DetectorStage(perception),
        ReducerStage(perception, config),
        ClustererStage(perception, config),
        SlotsStage(perception),
    ]
