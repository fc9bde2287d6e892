"""Whether the learned classes of scenes, as they are decided on arrays, hold where HermiT says they do: scenes of play.

Each scene is told to HermiT with its world closed. Needs the extra `dl` and Java.

    python benchmarks/hermit.py RUN… --scenes 100
"""

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from itertools import zip_longest
from pathlib import Path

import machine
import numpy as np
import pyoxigraph as ox
import tyro

from semrl.core import Trajectory
from semrl.core.errors import UsageError
from semrl.evaluation.player import load_player
from semrl.evaluation.words import RunWords, words_of_run
from semrl.knowledge.closed import SCENE_NAME, closed_scene
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.hermit import has_hermit
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
HERE = "Here"
"""The class of the one scene that is asked about."""


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
    batch: int = 10
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
    began, asked, wrong, impossible = time.perf_counter(), 0, 0, 0
    while asked < len(held) and time.perf_counter() - began < arguments.seconds:
        places = range(asked, min(asked + arguments.batch, len(held)))
        for place, found in zip(places, answers(told, scenes, places), strict=True):
            if found is None:
                impossible += 1
                continue
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
        microseconds_compiled=round(1e6 * compiled / len(held), 1),
    )


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


def answers(words: Ontology, scenes: Interpretation, places: Sequence[int]) -> list[set[str] | None]:
    """Return the classes of some scenes, as HermiT finds them: what the class of the scene alone is below.

    None stands for a scene that contradicts the ontology.

    Raises
    ------
    UsageError
        When it fails.
    """
    spec = find_spec("owlready2")
    assert spec is not None
    assert spec.origin is not None
    jars = Path(spec.origin).parent / "hermit"
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{place}.owl" for place in places]
        for file, place in zip(files, places, strict=True):
            file.write_bytes(write_owl(asked(closed_scene(words, scenes, place, BASE)), BASE, ".owl"))
        command = ["java", "-Xmx1000M", "-cp", f"{jars}{os.pathsep}{jars / 'HermiT.jar'}"]
        command += ["org.semanticweb.HermiT.cli.CommandLine", f"-S<{BASE}{HERE}>", *(file.as_uri() for file in files)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
    parts = run.stdout.split("super-classes of")[1:]
    if "Inconsistent ontology" in run.stderr:  # it stops there
        return [None] if len(places) == 1 else [answers(words, scenes, [place])[0] for place in places]
    if len(parts) != len(places):
        raise UsageError(f"HermiT gave no answer that can be read: {run.stdout[-500:]} {run.stderr[-500:]}")
    return [
        {line.strip().strip("<>").removeprefix(BASE).lstrip(":") for line in part.splitlines()[1:]} for part in parts
    ]


def asked(triples: list[ox.Triple]) -> list[ox.Triple]:
    """Add the class of which the scene is the only one."""
    told = Triples(BASE, found=triples, blanks=1_000_000)
    told.add(told.own(HERE), "rdf:type", node("owl:Class"))
    alone = told.combined("owl:oneOf", told.list_of([told.own(SCENE_NAME)]))
    told.add(told.own(HERE), "owl:equivalentClass", alone)
    return told.found


if __name__ == "__main__":
    main(tyro.cli(Arguments))
