"""The words of a run: its ontology, and what reads its facts as scenes."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semrl.core import Sight, Trajectory
from semrl.core.errors import UsageError
from semrl.evaluation.player import Player
from semrl.knowledge.edits import Edited, edited, read_log
from semrl.knowledge.ontology import Ontology
from semrl.knowledge.scene_classes import SceneClassesConfig, learn_scene_classes
from semrl.knowledge.slots import NUMBERS, SlotReader, kinds_of, slots_of, words_of
from semrl.planning.module import PlanningModule
from semrl.world_model.protocol import Remembering, WorldModel
from semrl.world_model.tree_world import TreeWorld

_SIDE_PX = 84
_MOST_DECISIONS = 20_000
"""From which classes of scenes are learned, the newest ones."""

_SLACK = 3.0
"""Percent by which numbers may leave the range in which they were met: play to come goes a little further."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RunWords:
    """What can be said of the scenes of a run."""

    words: Ontology
    reader: SlotReader

    def measure(self, sight: Sight) -> None:
        """Take over how large the things are that are seen."""
        places = {slot.name: place for place, slot in enumerate(self.reader.slots)}
        for (_, _, height, width), name in zip(sight.boxes_px.tolist(), sight.names, strict=False):
            place = places.get(name.partition(":")[0].replace(" ", ""))
            if place is not None:
                self.reader.sizes[place] = 100 * width / _SIDE_PX, 100 * height / _SIDE_PX


def words_of_run(player: Player, run: str | Path) -> RunWords:
    """Return the words of a run with a map.

    Classes of scenes are learned from what its world model remembers: see `load_player` with `memory`.

    Raises
    ------
    UsageError
        When its facts do not say where things are.
    """
    planning, space = player.require_predictions(run), player.encoder.space
    try:
        slots = slots_of(space.names)
    except UsageError as error:
        raise UsageError(f"{run}: {error}") from None
    kinds = [kinds_of(slot, _flying(planning, space.n_facts)) for slot in slots]
    words = words_of(slots, kinds)
    percent = 1 / (space.unit or 0.01)
    reader = SlotReader(slots, kinds, words, percent=percent)
    bounds = planning.extent.bounds_.astype(np.float32)
    met = reader.read(bounds, bounds).numbers[:, :2, 1 + len(words.individuals) :]  # (2, 2, k): lowest and highest
    reader.arena[:] = *np.nanmin(met[0], axis=1), *np.nanmax(met[1], axis=1)
    ranges: dict[tuple[str, str], tuple[float, float]] = {}
    for place, axis in np.argwhere(~np.isnan(met[0].T)).tolist():
        first, last = met[0, axis, place] - _SLACK, met[1, axis, place] + _SLACK
        for key in ((kind, list(NUMBERS)[axis]) for kind in kinds[place]):
            below, above = ranges.get(key, (first, last))
            ranges[key] = float(min(below, first)), float(max(above, last))
    return _with_learned_classes(RunWords(words=replace(words, ranges=ranges), reader=reader), planning.world_model)


def _with_learned_classes(run: RunWords, world_model: WorldModel) -> RunWords:
    """Return the words and the classes of scenes that the play teaches, where a player has its memory."""
    episodes = list(world_model.experience.episodes()) if isinstance(world_model, Remembering) else []
    recent: list[Trajectory] = []
    while episodes and sum(map(len, recent)) < _MOST_DECISIONS:
        recent.insert(0, episodes.pop())
    decisions = [episode.transitions for episode in recent if len(episode)]
    if not decisions:
        return run
    scenes = run.reader.read(
        np.concatenate([own.states for own in decisions]), np.concatenate([own.previous for own in decisions])
    )
    learned = learn_scene_classes(run.words, scenes, [own.rewards for own in decisions], SceneClassesConfig())
    return replace(run, words=run.words.having(**learned))


def knowledge_of(words: RunWords, run: str | Path) -> Edited:
    """Return what a run knows with what people have added to it.

    Raises
    ------
    UsageError
        When that does not go with what the run has learned since.
    """
    return edited(words.words, read_log(Path(run)))


def _flying(planning: PlanningModule, dimension: int) -> NDArray[np.bool_]:
    """Return which numbers mostly change as they just did, ``(d,)``, where the model of the world knows."""
    flying = np.zeros(dimension, np.bool_)
    if isinstance(planning.world_model, TreeWorld):
        features = planning.world_model.features
        flying[features.varying_] = features.inertia_ > 0
    return flying
