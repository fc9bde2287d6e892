"""The page about speed: what each stage costs, and how the cost grows."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from markupsafe import Markup

from semrl.core.files import require_writable, write_text
from semrl.report.charts import RUN_COLOURS
from semrl.report.svg import STYLE, as_svg, new_figure
from semrl.report.templates import render_page
from semrl_thesis.timing import ELEVATION, EMULATOR, STACK, Speed

OURS, THEIRS = RUN_COLOURS[0], RUN_COLOURS[1]


def write_speed(speed: Speed, out: Path) -> Path:
    """Write one page with the times, a chart of the stages and two of growth.

    Raises
    ------
    UsageError
        When the file may not be written there.
    SemrlError
        When it cannot be written.
    """
    require_writable(out)
    named = {name: [(n, stages[name]) for n, stages in speed.by_objects.items()] for name in _lines(speed)}
    page = render_page(
        "speed.html",
        package="semrl_thesis.report",
        title="The speed of elevation",
        rows=[(name, seconds * 1e6, 1 / seconds) for name, seconds in speed.stages.items()],
        emulator=speed.stages[EMULATOR] / speed.stages[ELEVATION],
        stack=speed.stages[STACK] / speed.stages[ELEVATION] if STACK in speed.stages else None,
        stages=stages_chart(speed.stages),
        legend=list(zip((OURS, THEIRS), named, strict=False)),
        by_objects=growth_chart(named, "objects in a frame"),
        by_vocabulary=growth_chart({"signed hashing": list(speed.by_vocabulary.items())}, "different words"),
    )
    write_text(out, page)
    return out


def _lines(speed: Speed) -> list[str]:
    return list(next(iter(speed.by_objects.values())))


def stages_chart(stages: Mapping[str, float]) -> Markup:
    """Draw the microseconds of every stage as bars on a logarithmic axis."""
    with mpl.rc_context(STYLE):
        figure, axes = new_figure((700, 34 * len(stages) + 50))
        colours = [THEIRS if name in (EMULATOR, STACK) else OURS for name in stages]
        bars = axes.barh(list(stages), [seconds * 1e6 for seconds in stages.values()], color=colours, height=0.62)
        axes.bar_label(bars, fmt="{:,.0f}", padding=5)
        axes.set_xscale("log")
        axes.invert_yaxis()
        axes.grid(visible=False)
        axes.set_xlabel("µs a frame, logarithmic", loc="right")
        return as_svg(figure, "Microseconds that each stage takes for one frame")


def growth_chart(lines: Mapping[str, Sequence[tuple[int, float]]], xlabel: str) -> Markup:
    """Draw times over sizes, both logarithmic."""
    with mpl.rc_context(STYLE):
        figure, axes = new_figure((360, 250))
        for colour, points in zip((OURS, THEIRS), lines.values(), strict=False):
            sizes, seconds = zip(*points, strict=True)
            axes.plot(sizes, [value * 1e6 for value in seconds], "o-", color=colour, linewidth=2, markersize=5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(10, 10**6)
        axes.set_xlabel(xlabel, loc="right")
        axes.set_title("µs", loc="left", fontsize=12, pad=8)
        return as_svg(figure, f"Microseconds over {xlabel}: {', '.join(lines)}")
