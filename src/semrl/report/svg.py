"""Charts as ``<svg>`` elements that take their colours from the page, so that they read in light and in dark."""

import io
import re
import zlib
from typing import Any

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

# Stand-ins that become CSS variables of the page.
INK, FAINT = "#010203", "#030201"
_VARIABLES = {INK: "var(--chart-ink)", FAINT: "var(--chart-line)"}
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "semrl",  # the same chart has the same ids
    "font.size": 12,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": FAINT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.spines.left": False,
}
_PX_PER_INCH = 72  # the unit of matplotlib's SVG
_DOTS_PER_INCH = 220  # of what is drawn as a picture inside the chart


def new_figure(size_px: tuple[int, int]) -> tuple[Figure, Axes]:
    """Make an empty chart, inside ``mpl.rc_context(STYLE)``."""
    figure = Figure(figsize=(size_px[0] / _PX_PER_INCH, size_px[1] / _PX_PER_INCH), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot()
    axes.grid(axis="y", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(length=0, pad=6)
    return figure, axes


def label_axes(axes: Axes, xlabel: str, ylabel: str, *, integer: bool = True) -> None:
    """Name both axes quietly: the lower one at its end, the other above the chart."""
    axes.set_xlabel(xlabel, loc="right")
    axes.set_title(ylabel, loc="left", fontsize=12, pad=8)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=integer, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    axes.xaxis.set_major_formatter(FuncFormatter(_thousands))


def _thousands(value: float, _: Any) -> str:
    """Write 12,500 as 12.5k and 2,000,000 as 2M."""
    for size, unit in ((1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:g}{unit}"
    return f"{value:g}"


def as_svg(figure: Figure, title: str) -> Markup:
    """Write a figure as an ``<svg>`` element that scales, has a title, and shares no ids with others."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", dpi=_DOTS_PER_INCH, metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)
    for stand_in, variable in _VARIABLES.items():
        text = text.replace(stand_in, variable)
    text = re.sub(r'font-family: [^;"]*', "font-family: inherit", text)  # the page's
    text = re.sub(r"<[^>]+>", _coarser, text)
    text = _own_ids(text, title)
    label = Markup('<svg role="img" aria-label="{}" ').format(title)
    return label + Markup(text.removeprefix("<svg").lstrip())


def _coarser(tag: re.Match[str]) -> str:
    """Cut coordinates off at hundredths of a pixel; what is written between the tags stays as it is."""
    return re.sub(r"(\d\.\d\d)\d+", r"\1", tag[0])


def _own_ids(text: str, title: str) -> str:
    """Drop ids that nothing refers to and mark the others, so that charts on one page do not mix."""
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    prefix = f"chart{zlib.crc32((title + text).encode()):08x}-"
    text = re.sub(r' id="([^"]+)"', lambda match: match[0] if match[1] in used else "", text)
    return re.sub(r'(id="|url\(#|href="#)', lambda match: match[1] + prefix, text)
