"""What two runs know and do differently, as lines and as a page."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from semrl.core.files import require_writable, write_text
from semrl.core.strict_json import dumps
from semrl.evaluation.comparison import Comparison, Decider, Interval, Score, Words
from semrl.report.phrases import named
from semrl.report.scenes import data_uri
from semrl.report.templates import render_page
from semrl.report.wording import interval, number
from semrl.world_model.rules import sentence

Section = tuple[str, Sequence[str]]


def write_comparison(comparison: Comparison, out: Path) -> Path:
    """Write one page about two runs; it needs nothing else.

    Raises
    ------
    UsageError
        When the page may not be written there.
    SemrlError
        When writing fails (full disk).
    """
    require_writable(out)
    texts = dict(sections(comparison))
    (game, *_) = texts.pop(GAME)
    page = render_page(
        "compare.html",
        title="Two runs compared",
        sections=texts,
        game=game,
        partings=[
            (parting, data_uri(parting.frame), list(zip(comparison.runs, map(why, parting.deciders), strict=True)))
            for parting in comparison.partings
        ],
    )
    write_text(out, page)
    return out


GAME = "In one same game"


def sections(comparison: Comparison) -> Iterator[Section]:
    """Tell a comparison: a title and its lines, one after the other."""
    c = comparison
    yield (
        "Runs",
        [f"{run}: {model}, {number(n)} decisions" for run, model, n in zip(c.runs, c.models, c.decisions, strict=True)],
    )
    yield (
        "Settings that differ",
        [f"{name}: {dumps(a)} → {dumps(b)}" for name, (a, b) in c.settings.items()] or ["none"],
    )
    yield "Numbers that each reasons about", _words(c.names)
    yield "Concepts", _words(c.concepts)
    yield "Rules", list(_rules(c))
    yield "Maps", _maps(c)
    yield "Scores", [_score(score) for score in c.scores] or ["neither was evaluated: semrl eval RUN"]
    yield GAME, list(_game(c))


def why(decider: Decider) -> str:
    """Say what one of them would do, and why."""
    said = f"{decider.action}; values: {named(decider.values.items())}."
    if decider.planned is None or decider.predicted_return is None:
        return f"{said} There is no plan."
    predicted = number(decider.predicted_return, 2)
    return f"{said} The plan begins with {decider.planned} and predicts {predicted}. {decider.reason}"


def _words(words: Words) -> list[str]:
    if not (words.both or words.first or words.second):
        return ["none"]
    sides = (("both", words.both), ("only the first", words.first), ("only the second", words.second))
    return [f"{who}: {', '.join(them)}" for who, them in sides if them]


def _rules(c: Comparison) -> Iterator[str]:
    r = c.rules
    yield f"{r.same} say the same, {len(r.changed)} changed, {len(r.lost)} lost, {len(r.added)} added"
    for before, after in r.changed:
        yield f"changed  {before.about} {sentence(before)}  →  {sentence(after)}"
    yield from (f"lost     {rule.about} {sentence(rule)}" for rule in r.lost)
    yield from (f"added    {rule.about} {sentence(rule)}" for rule in r.added)


def _maps(c: Comparison) -> list[str]:
    if c.maps is None:
        return ["at least one of them has no map"]
    m = c.maps
    lines = [
        f"nodes: {number(m.nodes[0])} and {number(m.nodes[1])}; edges: {number(m.edges[0])} and {number(m.edges[1])}"
    ]
    if m.agreement is not None:
        lines.append(
            f"the game that both watched meets {m.met[0]} nodes of the first and {m.met[1]} of the second; adjusted "
            f"mutual information {number(m.agreement, 2)} (1: both divide its states alike)"
        )
    return lines


def _score(score: Score) -> str:
    first, second = (_mean(iqm, n) for iqm, n in zip(score.iqm, score.episodes, strict=True))
    return f"{score.name}: {first} → {second}"


def _mean(iqm: Interval | None, episodes: int) -> str:
    if iqm is None:
        return "not evaluated"
    mean, ends = interval(*iqm)
    return f"{mean} (95 % {ends}, {episodes} episode{'' if episodes == 1 else 's'})"


def _game(c: Comparison) -> Iterator[str]:
    if c.no_game or c.agreed is None:
        yield f"not watched: {c.no_game}"
        return
    yield (
        f"seed {c.seed}, {number(c.watched)} decisions of the first one's {c.policy}: "
        f"both would do the same in {number(100 * c.agreed, 0)} % of them"
    )
    for parting in c.partings:
        yield f"decision {parting.step}, return so far {number(parting.return_so_far)}"
        yield from (f"    {run}: {why(side)}" for run, side in zip(c.runs, parting.deciders, strict=True))
