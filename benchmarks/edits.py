"""What the planner scores with a wrong rule of a person's, and with a learned rule switched off; then without, and on.

    python benchmarks/edits.py RUN --forbid 'touches(ball, own)' --off r1c0ffee

All in one process, as the live page edits; the run is copied, so that its own knowledge stays as it is.
"""

import itertools
import json
import shutil
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import machine
import numpy as np
import tyro

from semrl.evaluation.knowledge import load_knowledge
from semrl.evaluation.player import Player, load_player
from semrl.knowledge.edits import Edit, edited
from semrl.knowledge.hermit import has_hermit, require_possible_to_hermit
from semrl.training.session import limited_threads
from semrl.watch.teaching import Teaching

WRONG = "Wrong"


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Edit, play, take it back, play."""

    run: tyro.conf.Positional[Path]
    """A trained run with a map whose world model is made of trees."""
    forbid: str
    """The wrong rule: a class of scenes that plans keep out of."""
    off: tuple[str, ...]
    """Names of learned rules, see `semrl rules`, that are switched off together."""
    episodes: int = 3
    """Games of each condition, the same ones."""
    decisions: int = 600
    """Of each game that are played."""
    seed: int = 10_000
    """Of the games."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What the planner scores after an edit."""

    after: str
    seconds: float | None
    processor_seconds: float | None
    """Both: until the next plan can be made, without HermiT."""
    returns: list[float]


def main(arguments: Arguments) -> None:
    """Edit and play, in turn."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        shutil.copytree(arguments.run, run)
        (run / "knowledge.jsonl").unlink(missing_ok=True)
        player = load_player(run, memory=True)
        with limited_threads(player.config.threads):
            rows = measured(arguments, player, run)
        with_hermit = hermit_seconds(arguments, run)
    print(json.dumps({
        "machine": machine.describe(), "run": str(arguments.run), "forbid": arguments.forbid, "off": arguments.off,
        "decisions": arguments.decisions, "rows": [asdict(one) for one in rows],
        "hermit_seconds": with_hermit,
    }))  # fmt: skip


def measured(arguments: Arguments, player: Player, run: Path) -> list[Row]:
    """Play as learned, and after each edit."""
    teaching = Teaching(player, run)
    rows = [
        Row(after="as learned", seconds=None, processor_seconds=None, returns=returns(arguments, teaching.player()))
    ]

    def after_edits(after: str, *edits: Edit) -> None:
        began = np.array([time.perf_counter(), time.process_time()])
        for edit in edits:
            teaching.add(edit)
        changed = teaching.player()
        took = (np.array([time.perf_counter(), time.process_time()]) - began) / len(edits)
        seconds, processor = took.round(3).tolist()
        rows.append(Row(after=after, seconds=seconds, processor_seconds=processor, returns=returns(arguments, changed)))

    after_edits("wrong rule added", Edit(do="add", name=WRONG, text=arguments.forbid, forbidden=True))
    after_edits("wrong rule taken back", Edit(do="undo"))
    after_edits("learned rules off", *(Edit(do="disable", name=name) for name in arguments.off))
    after_edits("learned rules on", *(Edit(do="enable", name=name) for name in arguments.off))
    return rows


def returns(arguments: Arguments, player: Player) -> list[float]:
    """Return what the planner gains in the first decisions of some games."""
    games = [player.episode(number, arguments.seed, "planner") for number in range(arguments.episodes)]
    return [list(itertools.islice(game, arguments.decisions + 1))[-1].total for game in games]


def hermit_seconds(arguments: Arguments, run: Path) -> float | None:
    """Return how long HermiT takes to judge the wrong rule, as `semrl knowledge` asks it; None where it is not here."""
    if not has_hermit():
        return None
    known = load_knowledge(run)
    edit = Edit(do="add", name=WRONG, text=arguments.forbid, forbidden=True)
    after = edited(known.learned, (*known.edits, edit)).words
    began = time.perf_counter()
    require_possible_to_hermit(known.now.words, after, "the edit")
    return round(time.perf_counter() - began, 3)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
