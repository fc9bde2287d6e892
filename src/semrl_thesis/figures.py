"""What a figure shows, as arrays: experiments yield them, reports draw them, files keep them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints

Numbers = NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One line of a chart: ``x (n,)`` and ``y (n,)``."""

    label: str
    x: Numbers
    y: Numbers


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Lines over a common axis; `goal` is a level to be reached."""

    xlabel: str
    ylabel: str
    curves: tuple[Curve, ...]
    goal: float | None = None


@dataclass(frozen=True, kw_only=True)
class Bars:
    """A bar for each of ``n`` labels, ``heights (n,)``."""

    xlabel: str
    ylabel: str
    labels: tuple[str, ...]
    heights: Numbers
    logarithmic: bool = False


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Points: ``x``, ``y``, a group that gives the colour and a weight that gives the area, ``(n,)`` each.

    `line` is the slope and the offset of a straight line through them.
    """

    xlabel: str
    ylabel: str
    x: Numbers
    y: Numbers
    groups: Ints
    weights: Numbers
    line: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Matrix:
    """A confusion matrix, ``(k, k)``: a row for each true label, shares that sum to 1."""

    labels: tuple[str, ...]
    values: Numbers


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A grey ``(h, w)`` or RGB ``(h, w, 3)`` uint8 image with its caption."""

    caption: str
    image: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """Images side by side."""

    pictures: tuple[Picture, ...]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A frame with its objects and graph: ``boxes_px (n, 4)``, ``classes (n,)``, ``edges (m, 2)``."""

    frame: NDArray[np.uint8]
    boxes_px: Ints
    classes: Ints
    edges: Ints
    palette: tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, kw_only=True)
class Network:
    """A map of states: ``positions (n, 2)`` and edges, ``(m,)`` each, with the sign of their rewards."""

    xlabel: str
    ylabel: str
    positions: Numbers
    sources: Ints
    targets: Ints
    signs: Ints


@dataclass(frozen=True, kw_only=True)
class Layers:
    """Layers of a neural network from input to output, each a name and what it makes of its input."""

    layers: tuple[tuple[str, str], ...]


Panel = Curves | Bars | Scatter | Matrix | Pictures | Scene | Network | Layers


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One figure of the thesis, made again.

    Attributes
    ----------
    number
        Of the thesis's figure, such as ``"4.5"``.
    title
        A few words.
    says
        What it shows, one sentence.
    panels
        One drawing, or several side by side, each with a caption or ``""``.
    """

    number: str
    title: str
    says: str
    panels: tuple[tuple[str, Panel], ...]
