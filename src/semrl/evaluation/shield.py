"""A shield: plans keep out of the classes that people have forbidden, and actions that lead there are exchanged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, MapGraph, Plan
from semrl.evaluation.player import Player, load_player
from semrl.evaluation.rules import switch_rules
from semrl.evaluation.words import RunWords, knowledge_of, words_of_run
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.edits import Edited, enabled_forbidden, read_log
from semrl.planning.goal_planner import GoalPlanner, Verdicts
from semrl.training.loop import Step


@dataclass(frozen=True, kw_only=True, slots=True)
class Forbidden:
    """Judges what is imagined by how often it is of a forbidden class (`GoalJudge`)."""

    words: RunWords
    classifier: Classifier
    names: tuple[str, ...]

    @classmethod
    def of(cls, words: RunWords, names: Sequence[str]) -> "Forbidden":
        """Make a judge of some classes of scenes."""
        return cls(words=words, classifier=Classifier(words.words), names=tuple(names))

    def entered(self, states: Floats, previous: Floats) -> NDArray[np.bool_]:
        """Return which of ``(b, d)`` states are of a forbidden class, ``(b,)``."""
        scenes = self.words.reader.read(states, previous)
        return np.asarray(self.classifier.of_scenes(scenes, self.names).any(axis=1))

    def judge(self, states: Floats, start: Floats) -> Verdicts:
        """Judge ``(s, t, d)`` imagined states that follow the state ``(d,)``."""
        s, t, d = states.shape
        previous = np.concatenate([np.broadcast_to(start, (s, 1, d)), states[:, :-1]], axis=1)
        entered = self.entered(states.reshape(-1, d), previous.reshape(-1, d)).reshape(s, t)
        weights = np.arange(t, 0, -1)  # what comes soon counts more: there is time to think of the rest
        return Verdicts(
            broken=np.zeros(s, np.int64),
            reached=np.zeros(s, np.int64),
            progress=np.zeros(s),
            distances=(entered * weights).sum(axis=1).astype(np.float64),
        )

    def nodes(self, graph: MapGraph) -> None:
        """Leave the ways on the map as they are."""
        del graph

    def cost(self, plan: Plan, start: Floats) -> float:
        """Return how soon and how often the best scenario of a plan is of a forbidden class."""
        return float(self.judge(plan.scenarios.states[:1], start).distances[0])


def shielded(player: Player, run: str | Path) -> Player:
    """Return a player that obeys what people have forbidden or switched off in a run; the same one where nothing is.

    Plans are ranked by how soon and how often they are of a forbidden class before anything else. What the agent would
    do is exchanged for what is planned where it leads there sooner.

    Raises
    ------
    UsageError
        When something is forbidden or switched off and the run cannot predict.
    """
    if not any(edit.forbidden or edit.do == "disable" for edit in read_log(Path(run))):
        return player
    player.require_predictions(run)
    words = words_of_run(player, run)
    return keeping_out(player, words, knowledge_of(words, run))


def load_shielded(run: str | Path, at: int | None = None, **conditions: Any) -> Player:
    """Return a player as `load_player` does, under some conditions of evaluation; it keeps out of what is forbidden.

    Raises
    ------
    UsageError
        As `load_player` and `shielded`.
    """
    memory = bool(read_log(Path(run)))  # from it classes are learned, of which people may have spoken
    return shielded(load_player(run, at, memory=memory).under(**conditions), run)


def keeping_out(player: Player, words: RunWords, known: Edited) -> Player:
    """Return a player with a map that keeps out of what is forbidden; the same one where nothing is. See `shielded`.

    Rules that are switched off count for nothing in its world model.
    """
    switch_rules(player, known.disabled)
    names, planning = enabled_forbidden(known), player.planning
    if not names or planning is None:
        return player
    forbidden = Forbidden.of(replace(words, words=known.words), names)
    planning.planner = GoalPlanner(planning.planner, forbidden, planning.config.long_term)

    def exchanged(action: int, step: Step) -> int:
        record = step.record
        if record is None or record.plan is None or record.plan.actions[0] == action:
            return action
        other, start = planning.plan(record.history, first=action), record.history.states[0]
        worse = other is not None and forbidden.cost(other, start) > forbidden.cost(record.plan, start)
        return int(record.plan.actions[0]) if worse else action

    return replace(player, shield=exchanged)
