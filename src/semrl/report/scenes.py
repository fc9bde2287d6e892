"""What perception sees, drawn: sample frames with their objects and graph, and the kinds of objects."""

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Ints
from semrl.core.arrays import Arrays, array_to_json, arrays_to_ragged, unnest

Palette = Sequence[str]
"""CSS colours of class 0, 1, …; later classes begin again."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One frame and what is made of it: pictures as SVG or data URIs, None where there is none."""

    scene: Markup
    grey: str
    shown: str | None
    numbers: Sequence[tuple[str, float]]
    objects: int
    kinds: int
    joined: int


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One class of objects: its number, its centre as a picture, how many objects of it were seen."""

    number: int
    colour: str
    picture: str
    count: int
    log_share: float


@dataclass(frozen=True, kw_only=True)
class Concept:
    """A concept, or the reward: what moves it, one of its things as a picture, and the rules about it."""

    name: str
    moved: str
    picture: str | None
    rules: Sequence[str]


def meta(gallery: Arrays) -> dict[str, Any]:
    """Return the gallery's notes: encoder, seed, decisions; empty without gallery."""
    return dict(array_to_json(gallery["meta"])) if "meta" in gallery else {}


def samples(gallery: Arrays) -> list[Sample]:
    """Draw every sample frame of a gallery."""
    if "frames" not in gallery:
        return []
    parts = [arrays_to_ragged(unnest(gallery, name)) for name in ("boxes", "classes", "edges")]
    names = meta(gallery).get("names", ())
    drawn = []
    for i, frame in enumerate(gallery["frames"]):
        boxes, classes, edges = (part[i] for part in parts)
        shown, numbers = _shown(gallery, i, names)
        drawn.append(
            Sample(
                scene=scene(frame, boxes, classes, edges, palette(gallery)),
                grey=data_uri(gallery["greys"][i]),
                shown=shown,
                numbers=numbers,
                objects=len(boxes),
                kinds=len(np.unique(classes)),
                joined=len(edges),
            )
        )
    return drawn


def kinds(gallery: Arrays) -> list[Kind]:
    """Return all classes of a gallery, most frequent first."""
    if "centres" not in gallery:
        return []
    counts = gallery["class_counts"]
    colours = palette(gallery)
    highest = np.log10(max(int(counts.max()), 1) + 1)
    order = np.argsort(-counts, kind="stable")
    return [
        Kind(
            number=int(gallery["class_numbers"][i]),
            colour=colours[int(gallery["class_numbers"][i]) % len(colours)],
            picture=data_uri(np.clip(gallery["centres"][i] * 255, 0, 255).astype(np.uint8)),
            count=int(counts[i]),
            log_share=float(np.log10(int(counts[i]) + 1) / highest),
        )
        for i in order.tolist()
    ]


def concepts(gallery: Arrays) -> list[Concept]:
    """Return what was learned of the reward and of concepts, with a picture of each; nothing without gallery."""
    pictures = unnest(gallery, "pictures")
    return [
        Concept(
            name=one["name"],
            moved=one["moved"],
            picture=data_uri(pictures[one["name"]]) if one["name"] in pictures else None,
            rules=one["says"],
        )
        for one in meta(gallery).get("learned", ())
    ]


def palette(gallery: Arrays) -> Palette:
    """Return the colours of the classes."""
    return css_colours(gallery["palette"].tolist())


def css_colours(rgb: Iterable[tuple[int, int, int]]) -> Palette:
    """Write RGB as CSS does."""
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in rgb]


def scene(frame: NDArray[np.uint8], boxes: Ints, classes: Ints, edges: Ints, colours: Palette) -> Markup:
    """Draw boxes and graph over a frame, as an ``<svg>`` element.

    Parameters
    ----------
    frame
        ``(h, w, 3)`` uint8 RGB.
    boxes
        ``(n, 4)`` top, left, height, width, in pixels of the 84×84 image.
    classes
        ``(n,)``, or empty: then all boxes have the first colour.
    edges
        ``(m, 2)`` pairs of boxes whose centres are joined.
    colours
        Of the classes.
    """
    height, width = frame.shape[:2]
    scaled = boxes * (np.array([height, width] * 2) / IMAGE_SIZE_PX)  # (n, 4)
    centres = scaled[:, :2] + scaled[:, 2:] / 2  # (n, 2) row, column
    own = [colours[int(c) % len(colours)] for c in classes] if len(classes) else [colours[0]] * len(boxes)
    shapes = [
        f'<rect x="{left:.1f}" y="{top:.1f}" width="{w:.1f}" height="{h:.1f}" stroke="{colour}"/>'
        for (top, left, h, w), colour in zip(scaled.tolist(), own, strict=True)
    ]
    lines = "".join(
        f"M{centres[a, 1]:.1f} {centres[a, 0]:.1f}L{centres[b, 1]:.1f} {centres[b, 0]:.1f}" for a, b in edges.tolist()
    )
    if lines:
        shapes.append(f'<path class="joined" d="{lines}"/>')
        shapes += [
            f'<circle cx="{column:.1f}" cy="{row:.1f}" r="2" fill="{colour}"/>'
            for (row, column), colour in zip(centres.tolist(), own, strict=True)
        ]
    title = f"Frame with {len(boxes)} objects" if len(boxes) else "Frame"
    picture = f'<image href="{data_uri(frame)}" width="{width}" height="{height}"/>'
    return Markup(  # numbers and colours only: nothing in it comes from a person
        f'<svg role="img" aria-label="{title}" class="scene" viewBox="0 0 {width} {height}">'
        f"{picture}{''.join(shapes)}</svg>"
    )


def data_uri(image: NDArray[np.uint8]) -> str:
    """Write a grey ``(h, w)`` or RGB ``(h, w, 3)`` image as a PNG inside a URI."""
    _, encoded = cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1])
    return "data:image/png;base64," + base64.b64encode(encoded.tobytes()).decode()


def _shown(gallery: Arrays, i: int, names: Sequence[str]) -> tuple[str | None, list[tuple[str, float]]]:
    """Return what the agent is shown of a sample, as a picture or as named numbers."""
    if "shown" in gallery:
        return data_uri(gallery["shown"][i]), []
    if "vectors" not in gallery:
        return None, []
    vector = gallery["vectors"][i]
    if names:
        return None, list(zip(names, vector.tolist(), strict=True))
    # Zero is the middle grey; the rows are as long as makes the picture about square.
    side = int(np.ceil(np.sqrt(len(vector))))
    cells = np.zeros(side * -(-len(vector) // side))
    cells[: len(vector)] = vector / max(float(np.abs(vector).max()), 1e-9)
    return data_uri((127.5 + 127.5 * cells).astype(np.uint8).reshape(-1, side)), []
