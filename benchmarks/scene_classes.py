"""What the learned classes Danger and Chance change: returns with them on, off and with their rules shuffled.

    python benchmarks/scene_classes.py RUN… --rows FILE

A run and a way to play that FILE has already are not played again, so that a measurement can be made in pieces.
"""

import json
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import get_args

import machine
import numpy as np
import tyro

from semrl.core import Floats
from semrl.evaluation import evaluate
from semrl.evaluation.player import load_player
from semrl.evaluation.words import words_of_run
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.scene_classes import CHANCE, DANGER, SceneClassesConfig, soon
from semrl.knowledge.writing import write_condition
from semrl.training.config import ClassesMode
from semrl.training.loop import Step

COMPARED = (("on", "off"), ("shuffled", "off"), ("on", "shuffled"))
RESAMPLES = 5_000


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play each run in each way, from the same starts."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Trained runs with a map, one a seed."""
    rows: Path
    """Where what was played is kept."""
    modes: tuple[ClassesMode, ...] = get_args(ClassesMode)
    """Ways to play."""
    episodes: int = 5
    """Of each."""
    max_decisions: int = 600
    """After which a game is cut."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One run, played in one way."""

    run: str
    mode: str
    returns: list[float]
    lengths: list[int]
    changed: float | None
    classes: dict[str, str] = field(default_factory=dict)
    told: dict[str, dict[str, float]] = field(default_factory=dict)
    """Class → how well it tells rewards of play that it was not learned from."""


def main(arguments: Arguments) -> None:
    """Play what was not played yet; sum up all."""
    kept = arguments.rows.read_text().splitlines() if arguments.rows.exists() else []
    rows = [Row(**json.loads(line)) for line in kept]
    for run in arguments.runs:
        for mode in arguments.modes:
            if not any(row.run == run.name and row.mode == mode for row in rows):
                rows.append(played(run, mode, arguments))
                with arguments.rows.open("a") as file:
                    file.write(json.dumps(asdict(rows[-1])) + "\n")
    print(json.dumps({"machine": machine.describe(), "rows": [asdict(row) for row in rows], **summed_up(rows)}))


def played(source: Path, mode: ClassesMode, arguments: Arguments) -> Row:
    """Play some games with a copy of a run."""
    facts: list[list[Floats]] = []
    rewards: list[list[float]] = []

    def on_step(_episode: int, step: Step) -> None:
        assert step.state is not None
        if step.action is None:
            facts.append([])
            rewards.append([])
        else:
            rewards[-1].append(step.reward)
        facts[-1].append(step.state.facts)

    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        shutil.copytree(source, run)
        result = evaluate(
            run,
            episodes=arguments.episodes,
            policy="planner",
            max_decisions=arguments.max_decisions,
            classes=mode,
            on_step=on_step,
        )
        classes, told = judged(run, facts, rewards) if mode == "off" else ({}, {})
    changed = result.conditions.get("changed")
    return Row(
        run=source.name,
        mode=mode,
        returns=result.returns,
        lengths=result.lengths,
        changed=changed,
        classes=classes,
        told=told,
    )


def judged(
    run: Path, facts: Sequence[Sequence[Floats]], rewards: Sequence[Sequence[float]]
) -> tuple[dict[str, str], dict[str, dict[str, float]]]:
    """Return the learned classes of a run, and how well they tell what came in games."""
    words = words_of_run(load_player(run, memory=True), run)
    names = [name for name in (DANGER, CHANCE) if name in words.words.definitions]
    states = np.concatenate([own[:-1] for own in facts])
    previous = np.concatenate([[own[0], *own[:-2]] for own in facts])
    held = Classifier(words.words).of_scenes(words.reader.read(states, previous), names)
    within = SceneClassesConfig().within_decisions
    told = {}
    for name, of in zip(names, held.T, strict=True):
        comes = soon([np.array(own) for own in rewards], -1 if name == DANGER else 1, within)
        told[name] = {
            "share": float(of.mean()),
            "precision": float(comes[of].mean()) if of.any() else 0.0,
            "recall": float(of[comes].mean()) if comes.any() else 0.0,
            "comes": float(comes.mean()),
        }
    return {name: write_condition(words.words.definitions[name].expression, words.words) for name in names}, told


def summed_up(rows: Sequence[Row]) -> dict[str, object]:
    """Return mean returns and the differences of each two modes, each with a 95 % bootstrap interval."""
    modes = list(dict.fromkeys(row.mode for row in rows))
    by_run = {
        run: {row.mode: np.array(row.returns) for row in rows if row.run == run}
        for run in dict.fromkeys(row.run for row in rows)
    }
    whole = [own for own in by_run.values() if len(own) == len(modes)]
    if not whole:
        return {}
    rng = np.random.default_rng(0)
    drawn: dict[str, list[float]] = {mode: [] for mode in modes}
    for _ in range(RESAMPLES):
        some = [whole[i] for i in rng.integers(len(whole), size=len(whole))]
        games = [rng.integers(len(own[modes[0]]), size=len(own[modes[0]])) for own in some]
        for mode in modes:
            drawn[mode].append(float(np.mean([own[mode][place] for own, place in zip(some, games, strict=True)])))
    means = {mode: float(np.mean([own[mode] for own in whole])) for mode in modes}
    told = {mode: {"mean": means[mode], "interval": _interval(np.array(drawn[mode]))} for mode in modes}
    differences = {
        f"{one} - {other}": {
            "mean": means[one] - means[other],
            "interval": _interval(np.array(drawn[one]) - np.array(drawn[other])),
        }
        for one, other in COMPARED
        if {one, other} <= set(modes)
    }
    return {"runs": len(whole), "returns": told, "differences": differences}


def _interval(values: np.ndarray) -> list[float]:
    return np.quantile(values, [0.025, 0.975]).round(2).tolist()


if __name__ == "__main__":
    main(tyro.cli(Arguments))
