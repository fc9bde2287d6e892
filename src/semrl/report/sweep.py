"""The page about a sweep: scores with their intervals, performance profiles, and every run."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from semrl.core.files import require_writable, write_text
from semrl.report.charts import RUN_COLOURS, profile_chart
from semrl.report.templates import render_page
from semrl.report.wording import duration, interval, number
from semrl.sweep.rows import RunRow, Summary

MEASURES = {
    "agent": "return of the agent in the games of its test",
    "planner": "return of the planner alone in the games of its test",
    "training": "return of the last ten training episodes",
}


def write_sweep(summary: Summary, rows: Sequence[RunRow], failed: Mapping[str, str], out: Path, *, title: str) -> Path:
    """Write one page about a sweep; it needs nothing else.

    Parameters
    ----------
    summary, rows
        What the finished runs came to.
    failed
        Runs that failed, and why.
    out
        The HTML file; an older one is replaced.
    title
        Of the page.

    Raises
    ------
    UsageError
        When the file may not be written there.
    SemrlError
        When it cannot be written.
    """
    require_writable(out)
    agents = list(dict.fromkeys(cell.agent for cell in summary.cells))
    colours = {agent: RUN_COLOURS[i % len(RUN_COLOURS)] for i, agent in enumerate(agents)}
    page = render_page(
        "sweep.html",
        title=title,
        measure=MEASURES[summary.measure],
        cells=[
            (cell, colours[cell.agent], *interval(cell.iqm, cell.low, cell.high), [number(m) for m in cell.means])
            for cell in summary.cells
        ],
        profiles=[
            (
                game,
                [(colours[agent], agent) for agent in profiles],
                profile_chart(
                    profiles,
                    colours=[colours[agent] for agent in profiles],
                    xlabel="mean return of a run" if game in {cell.game for cell in summary.cells} else "score",
                    title=f"Share of runs that score more than a threshold: {game}",
                ),
            )
            for game, profiles in summary.profiles.items()
        ],
        rows=[(row, duration(row.seconds)) for row in rows],
        failed=failed,
    )
    write_text(out, page)
    return out
