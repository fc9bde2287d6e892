"""Classes of scenes that count in plans: what enters danger costs, what enters a chance gains."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats
from semrl.core.errors import UsageError
from semrl.evaluation.player import Player
from semrl.evaluation.words import RunWords, knowledge_of, words_of_run
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.scene_classes import CHANCE, DANGER, shuffled
from semrl.planning.class_planner import ClassPlanner

WORTH = {DANGER: -1.0, CHANCE: 1.0}
"""What a scene of a class is worth, in rewards."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WorthOfClasses:
    """Judges imagined scenes by the classes that they are of (`SceneJudge`)."""

    words: RunWords
    classifier: Classifier
    worths: Mapping[str, float]

    def worth(self, states: Floats, start: Floats) -> NDArray[np.float64]:
        """Return what each of ``(s, t, d)`` imagined states that follow the state ``(d,)`` is worth, ``(s, t)``."""
        s, t, d = states.shape
        previous = np.concatenate([np.broadcast_to(start, (s, 1, d)), states[:, :-1]], axis=1)
        scenes = self.words.reader.read(states.reshape(-1, d), previous.reshape(-1, d))
        held = self.classifier.of_scenes(scenes, tuple(self.worths))
        return np.asarray((held * np.array(list(self.worths.values()))).sum(axis=1).reshape(s, t))


def counting_classes(player: Player, run: str | Path) -> Player:
    """Return a player in whose plans classes of scenes count, as its evaluation is configured.

    Parameters
    ----------
    player
        With what its world model remembers; see `load_player`.
    run
        Its folder.

    Raises
    ------
    UsageError
        When it cannot predict, or nothing was learned, or left enabled, that could count.
    """
    mode = player.config.evaluation.classes
    if mode == "off":
        return player
    planning, words = player.require_predictions(run), words_of_run(player, run)
    known = knowledge_of(words, run)
    names = [name for name in WORTH if name in known.words.definitions and name not in known.disabled]
    if not names:
        raise UsageError(f"{run} knows no class {' or '.join(WORTH)} that could count: it has seen too few rewards")
    if mode == "shuffled":
        known = replace(known, words=shuffled(known.words, tuple(WORTH), disabled=known.disabled))
        names = list(WORTH)
    judge = WorthOfClasses(
        words=replace(words, words=known.words),
        classifier=Classifier(known.words),
        worths={name: WORTH[name] for name in names},
    )
    planning.planner = planner = ClassPlanner(planning.planner, judge, discount=planning.config.discount)
    return replace(player, classes=planner)
