"""Drawing the panels of a figure: arrays become charts, pictures and tables."""

from collections.abc import Callable
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from semrl.report import scenes
from semrl.report.charts import RUN_COLOURS
from semrl.report.svg import STYLE, as_svg, label_axes, new_figure
from semrl.report.wording import number
from semrl_thesis.figures import Bars, Curve, Curves, Layers, Matrix, Network, Panel, Pictures, Scatter, Scene

GROUP_COLOURS = (
    *RUN_COLOURS, "#7fb2ef", "#f0b477", "#7fcfa6", "#e79093", "#bfa3e6", "#7fd0d6", "#e3a2c4", "#c9c96a",
)  # fmt: skip
"""A colour for each class; more classes begin again."""

SIZE_PX = (360, 250)
MOST_AREA = 260.0
"""Area of the heaviest point of a scatter plot, in square points."""

NODE_COLOUR = "#7a808c"
"""What is drawn as a picture cannot take its colour from the page: a grey that reads on white and on black."""

SIGN_COLOURS = {0: "#c9a227", -1: "#c9484b", 1: "#2c9c69"}
"""Edges of a map by the sign of their reward, in the order they are drawn: rare ones on top."""


def draw(panel: Panel, title: str) -> Markup:
    """Return a panel as HTML; the title is for who cannot see it."""
    return _DRAWERS[type(panel)](panel, title)


def legend(panel: Panel) -> list[tuple[str, str]]:
    """Return colours and names of a panel's lines or groups, where there are several."""
    named: list[tuple[str, str]] = []
    if isinstance(panel, Curves):
        named = [(_colour(i), curve.label) for i, curve in enumerate(panel.curves)]
    if isinstance(panel, Scatter):
        named = [(_group_colour(group), str(group)) for group in np.unique(panel.groups).tolist()]
    return named if len(named) > 1 else []


def _colour(i: int) -> str:
    return RUN_COLOURS[i % len(RUN_COLOURS)]


def _group_colour(group: int) -> str:
    return GROUP_COLOURS[group % len(GROUP_COLOURS)]


def _curves(panel: Curves, title: str) -> Markup:
    def paint(axes: Axes) -> None:
        """Draw the curves and the goal."""
        for i, curve in enumerate(panel.curves):
            _line(axes, curve, _colour(i))
        label_axes(axes, panel.xlabel, panel.ylabel)
        if panel.goal is not None:
            axes.axhline(panel.goal, color=RUN_COLOURS[3], linewidth=1.2, dashes=(4, 3))
            axes.annotate(
                f"goal {panel.goal:g}", (0, panel.goal), xycoords=("axes fraction", "data"), xytext=(4, 4),
                textcoords="offset points", ha="left", color=RUN_COLOURS[3], fontsize=11,
            )  # fmt: skip

    return _chart(paint, title)


def _line(axes: Axes, curve: Curve, colour: str) -> None:
    axes.plot(curve.x, curve.y, color=colour, linewidth=1.6, marker="o" if len(curve.x) == 1 else None)


def _bars(panel: Bars, title: str) -> Markup:
    def paint(axes: Axes) -> None:
        """Draw the bars."""
        places = np.arange(len(panel.heights))
        axes.bar(places, panel.heights, color=RUN_COLOURS[0], width=0.8, log=panel.logarithmic)
        if not panel.logarithmic:
            label_axes(axes, panel.xlabel, panel.ylabel)
        axes.set_xlabel(panel.xlabel, loc="right")
        axes.set_title(panel.ylabel, loc="left", fontsize=12, pad=8)
        axes.set_xticks(places, panel.labels)
        if panel.logarithmic:
            axes.set_ylim(bottom=0.8)  # a single one is seen

    return _chart(paint, title)


def _scatter(panel: Scatter, title: str) -> Markup:
    def paint(axes: Axes) -> None:
        """Draw the points and the line."""
        areas = np.maximum(MOST_AREA * panel.weights / max(panel.weights.max(initial=0), 1), 6)
        areas = np.full(len(areas), 16) if np.ptp(panel.weights) == 0 else areas
        colours = [_group_colour(group) for group in panel.groups.tolist()]
        axes.scatter(panel.x, panel.y, areas, c=colours, alpha=0.75, linewidths=0, rasterized=True)
        if panel.line:
            ends = np.array([panel.x.min(), panel.x.max()])
            axes.plot(ends, panel.line[0] * ends + panel.line[1], color=RUN_COLOURS[3], linewidth=1.8)
        label_axes(axes, panel.xlabel, panel.ylabel, integer=False)

    return _chart(paint, title)


def _network(panel: Network, title: str) -> Markup:
    def paint(axes: Axes) -> None:
        """Draw the edges by their signs, then the nodes."""
        ends = np.stack([panel.positions[panel.sources], panel.positions[panel.targets]], axis=1)  # (m, 2, 2)
        for sign, colour in SIGN_COLOURS.items():
            some = ends[panel.signs == sign]
            width, alpha = (0.4, 0.35) if sign == 0 else (1.1, 0.9)
            axes.add_collection(
                LineCollection(list(some), colors=colour, linewidths=width, alpha=alpha, rasterized=True)
            )
        axes.scatter(panel.positions[:, 0], panel.positions[:, 1], 3, c=NODE_COLOUR, linewidths=0, rasterized=True)
        label_axes(axes, panel.xlabel, panel.ylabel, integer=False)

    return _chart(paint, title, (360, 300))


def _chart(paint: Callable[[Axes], None], title: str, size_px: tuple[int, int] = SIZE_PX) -> Markup:
    with mpl.rc_context(STYLE):
        figure, axes = new_figure(size_px)
        paint(axes)
        return as_svg(figure, title)


def _pictures(panel: Pictures, title: str) -> Markup:
    cells = [
        Markup('<figure><img class="pixels" src="{}" alt="{}">{}</figure>').format(
            scenes.data_uri(picture.image),
            f"{title} {picture.caption}".strip(),
            Markup("<figcaption>{}</figcaption>").format(picture.caption) if picture.caption else "",
        )
        for picture in panel.pictures
    ]
    kind = "gallery" if len(cells) > 1 else "single"
    return Markup('<div class="{}">{}</div>').format(kind, Markup("").join(cells))


def _scene(panel: Scene, _title: str) -> Markup:
    colours = scenes.css_colours(panel.palette)
    drawn = scenes.scene(panel.frame, panel.boxes_px, panel.classes, panel.edges, colours)
    return Markup('<div class="single">{}</div>').format(drawn)


def _matrix(panel: Matrix, title: str) -> Markup:
    head = Markup("").join(
        Markup('<th scope="col" class="number">{}</th>').format(_signed(label)) for label in panel.labels
    )
    rows = [
        Markup('<tr><th scope="row" class="number">{}</th>{}</tr>').format(
            _signed(label),
            Markup("").join(
                Markup('<td class="number" style="--share:{}%">{}</td>').format(round(100 * share), number(share, 2))
                for share in shares
            ),
        )
        for label, shares in zip(panel.labels, panel.values.tolist(), strict=True)
    ]
    caption = Markup(
        '<table class="matrix" aria-label="{}"><thead><tr><th scope="col">was ╲ predicted</th>{}</tr></thead>'
    )
    return caption.format(title, head) + Markup("<tbody>{}</tbody></table>").format(Markup("").join(rows))


def _signed(label: str) -> str:
    return label.replace("-", "−")


def _layers(panel: Layers, _title: str) -> Markup:
    items = [Markup("<li><b>{}</b><span>{}</span></li>").format(name, detail) for name, detail in panel.layers]
    return Markup('<ol class="layers">{}</ol>').format(Markup("").join(items))


_DRAWERS: dict[type, Callable[[Any, str], Markup]] = {
    Curves: _curves,
    Bars: _bars,
    Scatter: _scatter,
    Network: _network,
    Pictures: _pictures,
    Scene: _scene,
    Matrix: _matrix,
    Layers: _layers,
}
