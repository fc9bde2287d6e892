"""What a forbidden class is worth and costs: share of the decisions at which it is kept out of, and the return.

    python benchmarks/reasoning.py RUN

The run is copied, so that its own knowledge stays as it is.
"""

import json
import shutil
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import machine
import tyro

from semrl.core import Floats
from semrl.evaluation import evaluate
from semrl.evaluation.knowledge import edit_knowledge
from semrl.evaluation.player import Policy, load_player
from semrl.evaluation.shield import Forbidden
from semrl.evaluation.words import RunWords, knowledge_of, words_of_run
from semrl.knowledge.edits import Edit
from semrl.training.loop import Step

NAME = "Shunned"


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Play with and without a shield."""

    run: tyro.conf.Positional[Path]
    """A trained run of Pong with a map."""
    forbidden: str = "own.y < 25"
    """What is forbidden: the upper quarter of the image."""
    policy: Policy = "planner"
    """Who plays."""
    episodes: int = 2
    """Of each."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One way to play."""

    shield: bool
    returns: list[float]
    decisions: int
    kept: float
    """Share of the decisions at which the scene was not of the forbidden class."""


def main(arguments: Arguments) -> None:
    """Play twice, and tell."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        shutil.copytree(arguments.run, run)
        edit_knowledge(run, Edit(do="add", name=NAME, text=arguments.forbidden, forbidden=True))
        words = words_of_run(load_player(run), run)
        judge = Forbidden.of(RunWords(words=knowledge_of(words, run).words, reader=words.reader), (NAME,))
        rows = [played(run, arguments, judge, shield=True)]
        edit_knowledge(run, Edit(do="disable", name=NAME))
        rows.append(played(run, arguments, judge, shield=False))
    told = {"run": str(arguments.run), "forbidden": arguments.forbidden, "policy": arguments.policy}
    print(json.dumps({**told, "machine": machine.describe(), "rows": [asdict(row) for row in rows]}))


def played(run: Path, arguments: Arguments, judge: Forbidden, *, shield: bool) -> Row:
    """Play some games."""
    before: Floats | None = None
    decisions = entered = 0

    def on_step(_episode: int, step: Step) -> None:
        nonlocal before, decisions, entered
        assert step.state is not None
        facts = step.state.facts
        if step.action is not None and before is not None:
            decisions += 1
            entered += bool(judge.entered(facts[None], before[None])[0])
        before = facts

    result = evaluate(run, episodes=arguments.episodes, policy=arguments.policy, on_step=on_step)
    return Row(shield=shield, returns=result.returns, decisions=decisions, kept=1 - entered / max(decisions, 1))


if __name__ == "__main__":
    main(tyro.cli(Arguments))
