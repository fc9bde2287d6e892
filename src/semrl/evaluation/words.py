"""The words of a run: its ontology, and what reads its facts as scenes."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints, MapGraph, Sight, Trajectory
from semrl.core.errors import UsageError
from semrl.evaluation.player import Player
from semrl.knowledge.edits import Edited, edited, read_log
from semrl.knowledge.ontology import Ontology
from semrl.knowledge.scene_classes import SceneClassesConfig, learn_scene_classes
from semrl.knowledge.slots import NUMBERS, SlotReader, kinds_of, slots_of, words_of
from semrl.planning.module import PlanningModule
from semrl.world_model.protocol import Remembering, WorldModel

_SIDE_PX = 84
_MOST_DECISIONS = 20_000
"""From which classes of scenes are learned, the newest ones."""

_RARE = 0.002
"""Share of the states at either end that bounds of a number leave out."""

_SLACK = 3.0
"""Percent by which numbers may leave the range in which they were seen: nodes of the map are means."""


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
    graph = planning.state_map.graph_
    states, previous = node_states(graph, planning.config.velocity_weight, space.n_facts)
    scenes = reader.read(states, previous)
    seen = scenes.numbers[:, :2, 1 + len(words.individuals) :]  # (b, 2, k)
    low, high = np.nanmin(seen, axis=(0, 2)), np.nanmax(seen, axis=(0, 2))
    reader.arena[:] = *low, *high
    ranges: dict[tuple[str, str], tuple[float, float]] = {}
    for place, axis in np.ndindex(len(slots), 2):
        if np.isnan(values := seen[:, axis, place]).all():
            continue
        first, last = _bounds(values, graph.node_counts)
        for key in ((kind, list(NUMBERS)[axis]) for kind in kinds[place]):
            below, above = ranges.get(key, (first, last))
            ranges[key] = min(below, first), max(above, last)
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


def _bounds(values: NDArray[np.float64], counts: Ints) -> tuple[float, float]:
    """Return between which bounds nearly all states have a number: tracks are mixed up now and then."""
    order = np.argsort(values)  # what is not seen is NaN, and stands last
    order = order[~np.isnan(values[order])]
    below = np.cumsum(counts[order]) / counts[order].sum()
    first, last = np.searchsorted(below, [_RARE, 1 - _RARE])
    low, high = values[order[first]], values[order[min(last, len(order) - 1)]]
    return float(low) - _SLACK, float(high) + _SLACK


def knowledge_of(words: RunWords, run: str | Path) -> Edited:
    """Return what a run knows with what people have added to it.

    Raises
    ------
    UsageError
        When that does not go with what the run has learned since.
    """
    return edited(words.words, read_log(Path(run)))


def node_states(graph: MapGraph, weight: float, dimension: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the facts that each node of a map stands for, and those before them, ``(n, d)`` each."""
    states = graph.node_means[:, :dimension].astype(np.float32)
    if weight <= 0:
        return states, states
    return states, (states - graph.node_means[:, dimension:] / weight).astype(np.float32)


def _flying(planning: PlanningModule, dimension: int) -> NDArray[np.bool_]:
    """Return which numbers mostly change as they just did, ``(d,)``, where the model of the world knows."""
    flying = np.zeros(dimension, np.bool_)
    varying = getattr(planning.world_model, "varying_", None)
    if varying is not None:
        flying[varying] = planning.world_model.inertia_ > 0  # type: ignore[attr-defined]
    return flying
