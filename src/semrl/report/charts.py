"""Charts as inline SVG that takes its colours from the page, so that it reads in light and in dark."""

import io
import re
import zlib
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from semrl.report.record import Series, running_mean

RUN_COLOURS = ("#2f7fd8", "#d9822b", "#2c9c69", "#c9484b", "#8a63c9", "#1f9aa3", "#c2568f", "#8b8b2a")
"""A colour for each run, readable on white and on near-black; more runs begin again."""

# Stand-ins that become CSS variables of the page.
_INK, _FAINT = "#010203", "#030201"
_VARIABLES = {_INK: "var(--chart-ink)", _FAINT: "var(--chart-line)"}
_STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "semrl",  # the same chart has the same ids
    "font.size": 12,
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "axes.edgecolor": _FAINT,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "xtick.color": _FAINT,
    "ytick.color": _FAINT,
    "xtick.labelcolor": _INK,
    "ytick.labelcolor": _INK,
    "grid.color": _FAINT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.spines.left": False,
}
_PX_PER_INCH = 72  # the unit of matplotlib's SVG


def learning_curve(runs: Sequence[tuple[str, Series]], *, wide: bool) -> Markup:
    """Draw the return of each episode and its running mean over decisions, one colour a run.

    Parameters
    ----------
    runs
        Name and returns of each.
    wide
        For a desktop or for a phone.
    """
    with mpl.rc_context(_STYLE):
        figure, axes = _figure((700, 330) if wide else (360, 260))
        for i, (_, returns) in enumerate(runs):
            colour = RUN_COLOURS[i % len(RUN_COLOURS)]
            axes.plot(returns.x, returns.y, "o", color=colour, alpha=0.5, markersize=5.5, markeredgewidth=0)
            axes.plot(returns.x, running_mean(returns.y), color=colour, linewidth=2)
        axes.set_xlim(left=0)
        _label(axes, "decisions", "return")
        runs_text = ", ".join(name for name, _ in runs)
        return _svg(figure, f"Return of every episode and running mean of 10 over decisions: {runs_text}")


def stability_path(values: Series, *, goal: float, ylabel: str, title: str) -> Markup:
    """Draw the value of a stability test at each batch, with its goal as a line (Figs. 4.1 and 4.2)."""
    with mpl.rc_context(_STYLE):
        figure, axes = _figure((360, 240))
        axes.plot(values.x, values.y, color=RUN_COLOURS[0], linewidth=1.6)
        axes.axhline(goal, color=RUN_COLOURS[3], linewidth=1.2, dashes=(4, 3))
        axes.annotate(
            f"goal {goal:g}", (0, goal), xycoords=("axes fraction", "data"), xytext=(4, 4),
            textcoords="offset points", ha="left", color=RUN_COLOURS[3], fontsize=11,
        )  # fmt: skip
        axes.set_ylim(bottom=min(0, *axes.get_ylim()))
        _label(axes, "batches", ylabel)
        return _svg(figure, title)


def _figure(size_px: tuple[int, int]) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(size_px[0] / _PX_PER_INCH, size_px[1] / _PX_PER_INCH), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot()
    axes.grid(axis="y", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(length=0, pad=6)
    return figure, axes


def _label(axes: Axes, xlabel: str, ylabel: str) -> None:
    """Name both axes quietly: the lower one at its end, the other above the chart."""
    axes.set_xlabel(xlabel, loc="right")
    axes.set_title(ylabel, loc="left", fontsize=12, pad=8)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    axes.xaxis.set_major_formatter(FuncFormatter(_thousands))


def _thousands(value: float, _: Any) -> str:
    """Write 12,500 as 12.5k and 2,000,000 as 2M."""
    for size, unit in ((1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:g}{unit}"
    return f"{value:g}"


def _svg(figure: Figure, title: str) -> Markup:
    """Write a figure as an ``<svg>`` element that scales, has a title, and shares no ids with others."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)
    for stand_in, variable in _VARIABLES.items():
        text = text.replace(stand_in, variable)
    text = re.sub(r'font-family: [^;"]*', "font-family: inherit", text)  # the page's
    text = re.sub(r"(\d\.\d\d)\d+", r"\1", text)  # hundredths of a pixel are enough
    text = _own_ids(text, title)
    label = Markup('<svg role="img" aria-label="{}" ').format(title)
    return label + Markup(text.removeprefix("<svg").lstrip())


def _own_ids(text: str, title: str) -> str:
    """Drop ids that nothing refers to and mark the others, so that charts on one page do not mix."""
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    prefix = f"chart{zlib.crc32((title + text).encode()):08x}-"
    text = re.sub(r' id="([^"]+)"', lambda match: match[0] if match[1] in used else "", text)
    return re.sub(r'(id="|url\(#|href="#)', lambda match: match[1] + prefix, text)
