"""Does a scene's vector stay where it was, while an online embedding goes on learning?"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orthogonal_procrustes

from semrl.core import Floats, SceneGraph
from semrl.perception.embedding import OnlineEmbedding
from semrl.training import RunConfig
from semrl_thesis.base import Context, Experiment
from semrl_thesis.embedding_evaluation import Evaluator, call_judge
from semrl_thesis.figures import Curve, Curves, Figure
from semrl_thesis.perception import NEW_RUN_SEED, PLAY_SEED, by_frame, make_embedder, pretrain
from semrl_thesis.results import Number, Result
from semrl_thesis.similarity import cosine_similarities, embed
from semrl_thesis.watching import Watched, watch

PROBES = 1_000
"""Scenes whose vectors are looked at; every second of them serves to align, the others are measured."""


@dataclass(frozen=True, kw_only=True)
class Method:
    """A way to keep vectors where they are.

    Attributes
    ----------
    online
        Settings of the embedding.
    aligned
        Whether all vectors are turned so that those of half of the probes come as near as can be to where they were.
    rests_after
        Scenes after which nothing is learned any more; None: never.
    """

    online: Mapping[str, Any]
    aligned: bool = False
    rests_after: int | None = None


_WORDS_ALONE = {"prior": 0.0, "anchor": 0.0, "halving_documents": 0}
METHODS: dict[str, Method] = {
    "nothing": Method(online=_WORDS_ALONE),
    "aligned": Method(online=_WORDS_ALONE, aligned=True),
    "anchored": Method(online={**_WORDS_ALONE, "anchor": 1.0}),
    "falling-rate": Method(online={**_WORDS_ALONE, "halving_documents": 2_000}),
    "rest": Method(online=_WORDS_ALONE, rests_after=5_000),
    "places": Method(online={"anchor": 0.0, "halving_documents": 0}),
    "places-anchored": Method(online={"halving_documents": 0}),
    "places-anchored-falling-rate": Method(online={}),
}
"""Words alone, with one remedy at a time; then words on top of places as phases, with none, one and two."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """When vectors are looked at, in decisions of four frames; the first time is what the others are compared with.

    Attributes
    ----------
    looks
        After so many scenes.
    documents, validation
        Scenes that are searched, and scenes that are sought among them.
    overrides
        Nested settings on top of the preset.
    """

    looks: tuple[int, ...] = (12_500, 25_000, 37_500, 50_000, 75_000, 100_000, 125_000)
    documents: int = 10_000
    validation: int = 2_500
    overrides: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Course:
    """What became of the probes: mean cosine at each look, the lowest hundredth at the last, and how good it was."""

    means: NDArray[np.float64]
    lowest: float
    quality: Mapping[str, float]


def probes_of(watched: Watched) -> list[SceneGraph]:
    """Return scenes spread evenly over what was watched."""
    places = np.linspace(0, len(watched) - 1, min(PROBES, len(watched))).astype(int)
    return [watched.scenes[place] for place in places]


def cosines_to(before: Floats, after: Floats) -> NDArray[np.float64]:
    """Return the cosine of each vector with what it was; scenes without objects have no vector and do not count."""
    some = np.linalg.norm(before, axis=1) > 0
    return cosine_similarities(before[some], after[some])


def turned_back(before: Floats, after: Floats) -> Floats:
    """Turn all vectors so that every second one comes nearest to what it was (Procrustes); return the others.

    Schönemann, "A generalized solution of the orthogonal Procrustes problem", Psychometrika 31, 1966.
    """
    rotation, _ = orthogonal_procrustes(after[::2], before[::2])
    return np.asarray(after[1::2] @ rotation, dtype=np.float32)


def measure(settings: Settings, context: Context) -> Result:
    """Learn from one stream of scenes by every method, and look at the same probes on the way."""
    config = _config(settings, {})
    perception = pretrain(config, "scene").perception
    context.say("play to learn from")
    stream = watch(perception, config, settings.looks[-1], config.seed + PLAY_SEED)
    validation = watch(perception, config, settings.validation, config.seed + NEW_RUN_SEED)
    evaluator = call_judge(stream.first(settings.documents), validation)
    courses = {}
    for name, method in METHODS.items():
        context.say(f"drift, {name}")
        courses[name] = _follow(method, _config(settings, method.online), stream, evaluator, settings.looks)
    values: dict[str, float | None] = {}
    for name, course in courses.items():
        values |= {f"drift/{name}/cosine": float(course.means[-1]), f"drift/{name}/lowest": course.lowest}
        values |= {f"drift/{name}/{what}": course.quality[what] for what in ("ratio", "pearson")}
    return Result(values=values, figures=(_draw(courses, settings.looks),))


def _config(settings: Settings, online: Mapping[str, Any]) -> RunConfig:
    return by_frame("semrl", settings.overrides, {"perception": {"embedder": "online", "online": online}})


def _follow(method: Method, config: RunConfig, stream: Watched, evaluator: Evaluator, looks: Sequence[int]) -> Course:
    embedder = make_embedder(config)
    assert isinstance(embedder, OnlineEmbedding)
    seen = list(_looked_at(embedder, stream.scenes[: method.rests_after], probes_of(evaluator.validation), looks))
    before = seen[0]
    cosines = [
        cosines_to(before[1::2], turned_back(before, after)) if method.aligned else cosines_to(before, after)
        for after in seen
    ]
    return Course(
        means=np.array([each.mean() for each in cosines]),
        lowest=float(np.quantile(cosines[-1], 0.01)),
        quality=evaluator.evaluator(embedder),
    )


def _looked_at(
    embedder: OnlineEmbedding, scenes: Sequence[SceneGraph], probes: Sequence[SceneGraph], looks: Sequence[int]
) -> Iterator[Floats]:
    """Learn from scenes one by one and yield the probes' vectors at each look."""
    learned = 0
    for look in looks:
        for scene in scenes[learned:look]:
            embedder.partial_fit(scene)
        learned = look
        yield embed(embedder, probes)


def _draw(courses: Mapping[str, Course], looks: Sequence[int]) -> Figure:
    frames = 4 * np.array(looks)
    return Figure(
        number="E.1",
        title="Drift of the online embedding",
        says=f"Mean cosine of {PROBES} scenes' vectors with what they were after {frames[0]:,} frames, while words are "
        "learned further.",
        panels=(
            (
                "",
                Curves(
                    xlabel="frames seen",
                    ylabel="cosine",
                    curves=tuple(Curve(label=name, x=frames, y=course.means) for name, course in courses.items()),
                    goal=0.99,
                ),
            ),
        ),
    )


EXPERIMENT = Experiment(
    name="drift",
    place=8,
    title="Drift of the online embedding",
    section="beyond the thesis",
    numbers=tuple(
        Number(
            id=f"drift/{name}/{what}", thesis=None, unit="cosine" if what in ("cosine", "lowest") else "",
            better="lower" if what == "pearson" else "higher",
        )
        for name in METHODS
        for what in ("cosine", "lowest", "ratio", "pearson")
    ),
    settings={
        "full": Settings(),
        "quick": Settings(looks=(2_500, 5_000, 7_500, 12_500), documents=4_000, validation=1_500),
        "tiny": Settings(
            looks=(40, 60),
            documents=60,
            validation=40,
            overrides={
                "perception": {
                    "otsu": {"threshold_frames": 5},
                    "scene": {"scenery_frames": 5},
                    "online": {"buckets": 512},
                },
                "stability": {"batches": 5, "max_batches": 20},
            },
        ),
    },
    measure=measure,
)  # fmt: skip
