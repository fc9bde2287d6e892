"""``semrl events``: what happens in an episode."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console
from semrl.core.errors import UsageError
from semrl.core.strict_json import dumps
from semrl.evaluation.happenings import load_events
from semrl.evaluation.player import Policy
from semrl.knowledge.events import KINDS, Event


@dataclass(frozen=True, kw_only=True)
class EventsArguments:
    """Play one episode and print what happens in it: what touches, bounces, appears, vanishes, is gained or lost.

    Things are named by their concept, as the run has learned them (``own`` is what the actions move), and told apart by
    a number in the episode.

    Example:  semrl events runs/first --kinds bounce gain loss
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run (a model that follows objects and has a map)."""
    episode: int = 1
    """Which of the episodes that `semrl eval` plays."""
    policy: Policy = "agent"
    """Who plays."""
    seed: int | None = None
    """Of the episodes [default: one that training did not use]."""
    at: int | None = None
    """Ask the run as it was after so many decisions: one of its milestones [default: as it is now]."""
    kinds: tuple[str, ...] = ()
    """Which events [default: all]."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, print."""
    arguments = parse(EventsArguments, argv, command="events")
    if unknown := [kind for kind in arguments.kinds if kind not in KINDS]:
        raise UsageError(f"there is no kind of event '{unknown[0]}'; there are {', '.join(KINDS)}")
    happened = load_events(
        arguments.run, episode=arguments.episode, seed=arguments.seed, policy=arguments.policy, at=arguments.at
    )
    events = [event for event in happened if not arguments.kinds or event.kind in arguments.kinds]
    if arguments.json:
        print(dumps({"run": str(arguments.run), "events": [asdict(event) for event in events]}))
        return
    for event in events:
        console.print(f"{event.decision:6,}  {_line(event)}", soft_wrap=True, markup=False, highlight=False)
    counts = Counter(event.kind for event in events)
    summary = ", ".join(f"{kind} {counts[kind]:,}" for kind in KINDS if counts[kind]) or "nothing happened"
    console.print(summary, highlight=False)


def _line(event: Event) -> str:
    numbers = " ".join(f"#{number}" for number in event.things)
    return f"{event.sentence}  {numbers}".rstrip()
