"""Dimension reduction and clustering (§4.1.1, §4.1.2): are the objects that were found of sensible kinds?"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.perception.reduction.protocol import Reducer
from semrl.training import RunConfig, preset
from semrl_thesis.base import Context, Experiment
from semrl_thesis.cluster_indices import davies_bouldin, dunn, silhouette
from semrl_thesis.figures import Bars, Curve, Curves, Figure, Panel, Picture, Pictures, Scatter
from semrl_thesis.perception import Pretrained, new_run, objects_of, pretrain
from semrl_thesis.results import Number, Result

PRESETS = {"thesis": "", "semrl": "@semrl"}
"""Preset → what the ids of its numbers end in."""

DUNN_EVERY = 10
"""The Dunn index is computed on every tenth object (§4.1.2)."""

LEAST_SHARE = 0.02
"""Points that fewer objects of their class share are left out of Fig. 4.6."""

NUMBERS = (
    Number(id="pca/explained-variance", thesis=99, unit="%"),
    Number(id="pca/explained-variance-2-components", thesis=90, unit="%"),
    Number(id="pca/batches", thesis=None, unit="batches", better="near"),
    Number(id="birch/batches", thesis=577, unit="batches", better="near"),
    Number(id="birch/leaves", thesis=14, unit="leaves", better="near"),
    Number(id="birch/classes", thesis=10, unit="classes", better="near"),
    Number(id="new-run/decisions", thesis=1188, unit="decisions", better="near"),
    Number(id="new-run/objects", thesis=94_902, unit="objects", better="near"),
    Number(id="clusters/silhouette", thesis=0.887),
    Number(id="clusters/davies-bouldin", thesis=0.528, better="lower"),
    Number(id="clusters/dunn", thesis=0.114),
)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is looked at.

    Attributes
    ----------
    frames
        Most frames of the new run; None for a whole episode.
    indices_every
        Silhouette and Davies–Bouldin take every so many objects.
    overrides
        Nested settings on top of each preset.
    """

    frames: int | None = None
    indices_every: int = 1
    overrides: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """What perception makes of the new run.

    Attributes
    ----------
    frames
        How many it has.
    reduced, classes
        Its objects, ``(n, k)``, and their classes, ``(n,)``.
    explained
        ``(k,)`` share of the variance of its objects that the first so many components explain.
    """

    frames: int
    reduced: NDArray[np.float32]
    classes: Ints
    explained: NDArray[np.float64]


def measure(settings: Settings, context: Context) -> Result:
    """Pretrain perception in each preset and evaluator it on a new run."""
    values: dict[str, float | None] = {}
    pretrained: dict[str, Pretrained] = {}
    seen: dict[str, _Seen] = {}
    for name, suffix in PRESETS.items():
        context.say(f"perception of preset {name}")
        config = preset(name, "birch", settings.overrides)
        pretrained[name] = pretrain(config, "classes")
        seen[name] = _look(pretrained[name], config, settings.frames)
        measured = _values(pretrained[name], seen[name], settings)
        values |= {f"{id_}{suffix}": value for id_, value in measured.items()}
    return Result(values=values, figures=_figures(pretrained, seen))


def _look(pretrained: Pretrained, config: RunConfig, frames: int | None) -> _Seen:
    perception = pretrained.perception
    found = list(objects_of(perception, new_run(config, frames)))
    features = np.concatenate([objects.features for objects in found])
    reduced = perception.reducer.transform(features)
    return _Seen(
        frames=len(found),
        reduced=reduced,
        classes=perception.clusterer.predict(reduced),
        explained=explained_variance(perception.reducer, features),
    )


def explained_variance(reducer: Reducer, features: NDArray[Any]) -> NDArray[np.float64]:
    """Return the share of the variance of ``(n, d)`` objects that the first 1, 2, … components explain, ``(k,)``."""
    reduced = reducer.transform(features)
    total = np.square(features - features.mean(axis=0, dtype=np.float64)).sum()
    kept = np.tri(reduced.shape[1], dtype=np.float32)  # row i: the first i + 1
    return np.array([1 - np.square(features - reducer.inverse_transform(reduced * k)).sum() / total for k in kept])


def _values(pretrained: Pretrained, seen: _Seen, settings: Settings) -> dict[str, float | None]:
    clusterer = pretrained.perception.clusterer
    rows, classes = seen.reduced[:: settings.indices_every], seen.classes[:: settings.indices_every]
    return {
        "pca/explained-variance": 100 * float(seen.explained[-1]),
        "pca/explained-variance-2-components": 100 * float(seen.explained[1]),
        "pca/batches": pretrained.batches["reduction"],
        "birch/batches": pretrained.batches["clustering"],
        "birch/leaves": clusterer.n_clusters_,
        "birch/classes": len(clusterer.classes_),
        "new-run/decisions": seen.frames - 1,
        "new-run/objects": len(seen.classes),
        "clusters/silhouette": silhouette(rows, classes),
        "clusters/davies-bouldin": davies_bouldin(rows, classes),
        "clusters/dunn": dunn(seen.reduced[::DUNN_EVERY], seen.classes[::DUNN_EVERY]),
    }


def _figures(pretrained: Mapping[str, Pretrained], seen: Mapping[str, _Seen]) -> tuple[Figure, ...]:
    def each(draw: Any) -> tuple[tuple[str, Panel], ...]:
        return tuple((f"preset {name}", draw(pretrained[name], seen[name])) for name in pretrained)

    return (
        Figure(
            number="4.1",
            title="PCA becomes stable",
            says="How far the same objects moved when they were transformed again 250 batches later; it ends below the "
            "goal.",
            panels=each(lambda s, _: _path(s, "reduction", "mean absolute difference", 0.05)),
        ),
        Figure(
            number="4.2",
            title="Birch becomes stable",
            says="How well the classes of the same objects agree with those of 250 batches earlier; it ends above the "
            "goal.",
            panels=each(lambda s, _: _path(s, "clustering", "balanced accuracy", 0.95)),
        ),
        Figure(
            number="4.3",
            title="Kinds of objects",
            says="The centre of every class, brought back from principal components to pixels.",
            panels=each(lambda s, _: _centres(s)),
        ),
        Figure(
            number="4.4",
            title="How many objects of each kind",
            says="Objects of each class in the new run, on a logarithmic scale: kinds differ by orders of magnitude.",
            panels=each(lambda _, found: _distribution(found)),
        ),
        Figure(
            number="4.5",
            title="Where the kinds lie",
            says="Every object of the new run along the first two principal components, coloured by class.",
            panels=each(lambda _, found: _scatter(found, least_share=0)),
        ),
        Figure(
            number="4.6",
            title="The same, by weight",
            says="Areas are the number of objects at the same point; points that hold less than 2 % of their class are "
            "left out.",
            panels=each(lambda _, found: _scatter(found, least_share=LEAST_SHARE)),
        ),
    )


def _path(pretrained: Pretrained, stage: str, ylabel: str, goal: float) -> Curves:
    values = np.array(pretrained.stability[stage])
    batches = pretrained.batches[stage] - len(values) + 1 + np.arange(len(values))
    return Curves(xlabel="batches", ylabel=ylabel, curves=(Curve(label=stage, x=batches, y=values),), goal=goal)


def _centres(pretrained: Pretrained) -> Pictures:
    perception = pretrained.perception
    size = perception.detector.crop_size_px
    images = perception.reducer.inverse_transform(perception.clusterer.centres_).reshape(-1, size, size)
    grey = np.clip(images * 255, 0, 255).astype(np.uint8)
    return Pictures(
        pictures=tuple(
            Picture(caption=str(number), image=image)
            for number, image in zip(perception.clusterer.classes_.tolist(), grey, strict=True)
        )
    )


def _distribution(seen: _Seen) -> Bars:
    numbers, counts = np.unique(seen.classes, return_counts=True)
    labels = tuple(map(str, numbers.tolist()))
    return Bars(xlabel="class", ylabel="objects", labels=labels, heights=counts, logarithmic=True)


def _scatter(seen: _Seen, *, least_share: float) -> Scatter:
    rows = np.column_stack([seen.classes, seen.reduced[:, :2].round(2)])
    points, counts = np.unique(rows, axis=0, return_counts=True)  # (p, 3) class and place, (p,) objects there
    groups = points[:, 0].astype(np.int64)
    shares = counts / np.bincount(groups, counts)[groups]
    kept = shares >= least_share
    return Scatter(
        xlabel="first component",
        ylabel="second component",
        x=points[kept, 1],
        y=points[kept, 2],
        groups=groups[kept],
        weights=counts[kept] if least_share else np.ones(kept.sum()),
    )


EXPERIMENT = Experiment(
    name="clusters",
    place=1,
    title="Dimension reduction and clustering",
    section="§4.1.1, §4.1.2",
    numbers=NUMBERS,
    settings={
        "full": Settings(),
        "quick": Settings(indices_every=10),
        "tiny": Settings(
            frames=40,
            overrides={
                "perception": {"otsu": {"threshold_frames": 5}, "scene": {"scenery_frames": 5}},
                "stability": {"batches": 5, "max_batches": 20},
            },
        ),
    },
    measure=measure,
)
