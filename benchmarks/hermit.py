"""Whether the learned classes of scenes, as they are decided on arrays, hold where HermiT says they do: scenes of play.

Each scene is told to HermiT with its world closed, and with a class `Wrong` of which the scene is where any answer is
not as the arrays have it. HermiT is asked whether the scene is possible at all, and whether anything can be in `Wrong`:
if the first is so and the second is not, all answers follow. Only where something can is it asked for each answer.
Needs the extra `dl` and Java.

    python benchmarks/hermit.py RUN… --scenes 100
"""

import json
import resource
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest
from pathlib import Path

import machine
import numpy as np
import pyoxigraph as ox
import tyro
from numpy.typing import NDArray

from semrl.core import Trajectory
from semrl.core.errors import UsageError
from semrl.evaluation.player import load_player
from semrl.evaluation.words import RunWords, words_of_run
from semrl.knowledge.closed import SCENE_NAME, closed_scene
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.expressions import Expression, Named, Not, Top, conjunction
from semrl.knowledge.hermit import ask_hermit, has_hermit
from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.ontology import Definition, Ontology
from semrl.knowledge.owl import Triples, node, write_owl
from semrl.knowledge.scene_classes import SceneClassesConfig, learn_scene_classes
from semrl.knowledge.writing import write_condition
from semrl.world_model.protocol import Remembering

SETTINGS = [
    SceneClassesConfig(within_decisions=within, purity=purity) for within in (5, 15, 40) for purity in (0.3, 0.6, 0.9)
]
"""With which classes are learned: the run's own, and others, since few rewards in a game are sure to come."""

BASE = "urn:semrl:scene#"
HERE, WRONG = "Here", "Wrong"
"""The classes of the one scene that is asked about, and of it where an answer is not as the arrays have it."""
NOT_POSSIBLE = "is not satisfiable"


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Compare what is decided on arrays with HermiT, in scenes of the play of runs."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Trained runs with a map."""
    scenes: int = 100
    """Drawn from what the world model of each remembers."""
    seconds: float = 600.0
    """After which no more scenes of a run are asked about."""
    ranges: bool = True
    """Whether HermiT is told the learned bounds of numbers: what lies beyond them contradicts the ontology."""
    batch: int = 50
    """Scenes of one call of Java."""
    seed: int = 0
    """Of the draw."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What came of one run."""

    run: str
    classes: dict[str, str]
    """Name → definition."""
    scenes: int
    things: float
    """Mean number of individuals of a scene, itself and the borders included."""
    held: dict[str, int]
    """Scenes of each class, as decided on arrays."""
    disagreements: int
    """Answers, one a scene and class, that differ."""
    impossible: int
    """Scenes that contradict the ontology, as HermiT says, so that there is no answer."""
    seconds_a_scene: float
    """Of HermiT, Java's start and reading included."""
    processor_seconds_a_scene: float
    """Of the same, without waiting for others on the machine."""
    microseconds_compiled: float
    """Of the classifier, a scene, all at once."""


def main(arguments: Arguments) -> None:
    """Compare, and print one JSON object."""
    if not has_hermit():
        raise UsageError("HermiT needs the extra 'dl' and Java")
    rows = [compared(run, arguments) for run in arguments.runs]
    print(json.dumps({"machine": machine.describe(), "rows": [asdict(row) for row in rows]}))


def compared(run: Path, arguments: Arguments) -> Row:
    """Ask both about scenes of a run."""
    player = load_player(run, memory=True)
    known = words_of_run(player, run)
    assert player.planning is not None
    world = player.planning.world_model
    assert isinstance(world, Remembering)
    episodes = [episode for episode in world.experience.episodes() if len(episode)]
    words = known.words.having(**learned(known, episodes))
    told = words if arguments.ranges else replace(words, ranges={})
    names = list(words.definitions)
    classifier = Classifier(words)
    scenes = drawn(known, episodes, classifier, names, arguments)
    classifier.of_scenes(scenes, names)
    began = time.perf_counter()
    held = classifier.of_scenes(scenes, names)
    compiled = time.perf_counter() - began
    began, spent, asked, wrong, impossible = time.perf_counter(), processor_seconds(), 0, 0, 0
    while asked < len(held) and time.perf_counter() - began < arguments.seconds:
        places = range(asked, min(asked + arguments.batch, len(held)))
        for place, follows in zip(places, checked(told, scenes, places, names, held), strict=True):
            impossible += follows is None
            if follows is False:
                found = answers(told, scenes, place)
                wrong += sum((name in found) != said for name, said in zip(names, held[place].tolist(), strict=True))
        asked = places.stop
    return Row(
        run=run.name,
        classes={name: write_condition(words.definitions[name].expression, words) for name in names},
        scenes=asked,
        things=float(scenes.present[:asked].sum(axis=1).mean()),
        held=dict(zip(names, held[:asked].sum(axis=0).tolist(), strict=True)),
        disagreements=wrong,
        impossible=impossible,
        seconds_a_scene=round((time.perf_counter() - began) / asked, 3),
        processor_seconds_a_scene=round((processor_seconds() - spent) / asked, 3),
        microseconds_compiled=round(1e6 * compiled / len(held), 1),
    )


def processor_seconds() -> float:
    """Return the processor time of programs that were called and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def learned(known: RunWords, episodes: Sequence[Trajectory]) -> dict[str, Definition]:
    """Learn classes of scenes with each of the settings; of equal ones the first stays."""
    transitions = [episode.transitions for episode in episodes]
    scenes = known.reader.read(
        np.concatenate([own.states for own in transitions]), np.concatenate([own.previous for own in transitions])
    )
    found: dict[str, Definition] = {}
    for config in SETTINGS:
        classes = learn_scene_classes(known.words, scenes, [own.rewards for own in transitions], config)
        for name, one in classes.items():
            if all(one.expression != other.expression for other in found.values()):
                found[f"{name}{config.within_decisions}in{config.purity:.0%}".replace("%", "")] = one
    return found


def drawn(
    known: RunWords, episodes: Sequence[Trajectory], classifier: Classifier, names: Sequence[str], arguments: Arguments
) -> Interpretation:
    """Draw scenes of all decisions that a world model remembers, in turn any one and one of each class."""
    transitions = [episode.transitions for episode in episodes]
    states = np.concatenate([own.states for own in transitions])
    previous = np.concatenate([own.previous for own in transitions])
    held = classifier.of_scenes(known.reader.read(states, previous), names)
    rng = np.random.default_rng(arguments.seed)
    pools = [rng.permutation(len(states)), *(rng.permutation(np.flatnonzero(own)) for own in held.T)]
    turns = [place for turn in zip_longest(*(pool.tolist() for pool in pools)) for place in turn if place is not None]
    places = np.array(list(dict.fromkeys(turns))[: arguments.scenes])
    return known.reader.read(states[places], previous[places])


def checked(
    words: Ontology, scenes: Interpretation, places: Sequence[int], names: Sequence[str], held: NDArray[np.bool_]
) -> list[bool | None]:
    """Return of some scenes whether all answers follow, as HermiT finds; None where a scene contradicts the ontology.

    Raises
    ------
    UsageError
        When it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{place}.owl" for place in places]
        for file, place in zip(files, places, strict=True):
            said = zip(names, held[place].tolist(), strict=True)
            right = conjunction(*(Named(name) if holds else Not(Named(name)) for name, holds in said))
            file.write_bytes(write_owl(asked(closed_scene(words, scenes, place, BASE), right), BASE, ".owl"))
        run = ask_hermit([f"-k<{BASE}{WRONG}>"], files)
    found: list[bool | None] = [NOT_POSSIBLE in line for line in run.stdout.splitlines() if "satisfiable" in line]
    if len(found) == len(places):
        return found
    if "Inconsistent ontology" not in run.stderr:
        raise UsageError(f"HermiT gave no answer that can be read: {run.stdout[-500:]} {run.stderr[-500:]}")
    rest = places[len(found) + 1 :]  # it stops at the first of these
    return [*found, None, *(checked(words, scenes, rest, names, held) if rest else [])]


def answers(words: Ontology, scenes: Interpretation, place: int) -> set[str]:
    """Return the classes of a scene, as HermiT finds them: what the class of the scene alone is below.

    Raises
    ------
    UsageError
        When it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.owl"
        file.write_bytes(write_owl(asked(closed_scene(words, scenes, place, BASE), Top()), BASE, ".owl"))
        run = ask_hermit([f"-S<{BASE}{HERE}>"], [file])
    _, found, part = run.stdout.partition("super-classes of")
    if not found:
        raise UsageError(f"HermiT gave no answer that can be read: {run.stdout[-500:]} {run.stderr[-500:]}")
    return {line.strip().strip("<>").removeprefix(BASE).lstrip(":") for line in part.splitlines()[1:]}


def asked(triples: list[ox.Triple], right: Expression) -> list[ox.Triple]:
    """Add the class of which the scene is the only one, and that of the scene where it is not as is thought right."""
    told = Triples(BASE, found=triples, blanks=1_000_000)
    for name in (HERE, WRONG):
        told.add(told.own(name), "rdf:type", node("owl:Class"))
    alone = told.combined("owl:oneOf", told.list_of([told.own(SCENE_NAME)]))
    told.add(told.own(HERE), "owl:equivalentClass", alone)
    told.add(told.own(WRONG), "owl:equivalentClass", told.of(conjunction(Named(HERE), Not(right))))
    return told.found


if __name__ == "__main__":
    main(tyro.cli(Arguments))
