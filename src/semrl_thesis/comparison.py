"""Which embedding is best: the thesis's two, signed hashing, online graph2vec, places as phases, a plain list.

All but the score is measured on scenes of single frames; the agents see tracked scenes, as the preset `semrl` has them.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semrl.core import SceneGraph
from semrl.core.errors import MissingExtraError
from semrl.perception.embedding import OnlineEmbedding
from semrl.perception.embedding.protocol import Embedder
from semrl.training import RunConfig
from semrl.training.config import merge
from semrl_thesis.base import Context, Experiment, Scale
from semrl_thesis.drift import cosines_to, probes_of
from semrl_thesis.embedding_evaluation import Evaluator, call_judge
from semrl_thesis.perception import NEW_RUN_SEED, PLAY_SEED, by_frame, make_embedder, pretrain
from semrl_thesis.results import Number, Result
from semrl_thesis.similarity import embed
from semrl_thesis.sweep import RunSpec
from semrl_thesis.watching import COORDINATES, Watched, watch

CANDIDATES: dict[str, Mapping[str, Any]] = {
    "pv-dbow": {"embedder": "doc2vec"},
    "pv-dm": {"embedder": "doc2vec", "doc2vec": {"words": {"form": "pv-dm"}}},
    "hashed": {"embedder": "hashed"},
    "words-online": {"embedder": "online", "online": {"prior": 0.0, "anchor": 0.0}},
    "online": {"embedder": "online"},
    "fractional": {"embedder": "fractional"},
    "slots": {"embedder": "slots"},
}
"""Settings of perception on top of the preset `semrl`, whose perception gives all of them the same scenes."""

THESIS = {"ratio": 0.789, "pearson": -0.463}
"""Of PV-DBOW, on scenes with everything in them (§4.1.3)."""

MEASURED = (
    "ratio",
    "pearson",
    *(f"r2-{name.replace('_', '-')}" for name in COORDINATES),
    "drift",
    "microseconds",
    "score",
)
LOWER_IS_BETTER = ("pearson", "microseconds")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is looked at, in decisions of four frames.

    Attributes
    ----------
    documents
        Scenes that embeddings learn from and that are searched.
    validation
        Scenes of new episodes.
    drift
        Scenes after which vectors of the same scenes are compared, before and after: an online embedding goes on
        learning in between.
    timed
        Scenes that are timed, and how often.
    overrides
        Nested settings on top of the preset.
    """

    documents: int = 30_000
    validation: int = 5_000
    drift: tuple[int, int] = (12_500, 125_000)
    timed: tuple[int, int] = (1_000, 7)
    overrides: Mapping[str, Any] = field(default_factory=dict)


def measure(settings: Settings, context: Context) -> Result:
    """Measure every candidate on the same scenes."""
    base = candidate_config(settings.overrides, {"embedder": "hashed"})
    perception = pretrain(base, "scene").perception
    context.say("play to learn from")
    most = max(settings.documents, settings.drift[1])
    stream = watch(perception, base, most, base.seed + PLAY_SEED)
    validation = watch(perception, base, settings.validation, base.seed + NEW_RUN_SEED)
    evaluator = call_judge(stream.first(settings.documents), validation)
    values: dict[str, float | None] = {"comparison/direct-search/within-5": evaluator.best.within(5)}
    notes, lacks = [], set()
    for name, candidate in CANDIDATES.items():
        context.say(f"embedding {name}")
        try:
            embedder = make_embedder(candidate_config(settings.overrides, candidate))
        except MissingExtraError as error:
            notes.append(f"{name} was left out: {error}")
            lacks.add(error.extra)
            continue
        found = _measure(embedder, evaluator, stream, settings)
        values |= {f"comparison/{name}/{what}": value for what, value in found.items()}
    played = [(spec, context.ledger.score(spec)) for spec in RUNS[context.scale]]
    values |= {f"comparison/{spec.variant}/score": score.mean for spec, score in played if score}
    notes += [f"{spec.id} is not finished yet" for spec, score in played if not score]
    return Result(values=values, notes=tuple(notes), lacks=tuple(sorted(lacks)))


def candidate_config(overrides: Mapping[str, Any], perception: Mapping[str, Any]) -> RunConfig:
    """Return the preset `semrl` with the settings of an experiment and, on top, those of a candidate."""
    return by_frame("semrl", overrides, {"perception": perception})


def _measure(embedder: Embedder, evaluator: Evaluator, stream: Watched, settings: Settings) -> dict[str, float | None]:
    embedder.fit(evaluator.documents.scenes)
    return {
        **evaluator.evaluator(embedder),
        "drift": _drift(embedder, stream.scenes, evaluator, settings.drift),
        "microseconds": _microseconds(embedder, evaluator.validation.scenes, *settings.timed),
    }


def _drift(
    embedder: Embedder, scenes: Sequence[SceneGraph], evaluator: Evaluator, between: tuple[int, int]
) -> float | None:
    """Return the mean cosine between the vectors of probe scenes before and after further scenes."""
    if not isinstance(embedder, OnlineEmbedding):
        return 1.0  # learns nothing more, or never did
    start, end = between
    learning, probes = OnlineEmbedding(embedder.config), probes_of(evaluator.validation)
    before = embed(learning.fit(scenes[:start]), probes)
    for scene in scenes[start:end]:
        learning.partial_fit(scene)
    return float(cosines_to(before, embed(learning, probes)).mean())


def _microseconds(embedder: Embedder, scenes: Sequence[SceneGraph], most: int, rounds: int) -> float:
    """Return the median time from a scene to its vector, what is remembered of earlier scenes included."""
    timed, times = scenes[:most], []
    for _ in range(rounds):
        start = time.perf_counter()
        embed(embedder, timed)
        times.append((time.perf_counter() - start) / len(timed) * 1e6)
    return float(np.median(times))


def _agents(decisions: int, names: Sequence[str], overrides: Mapping[str, Any] | None = None) -> tuple[RunSpec, ...]:
    """Return a run of `semantic` with each of some embeddings, exploring to its end."""
    return tuple(
        RunSpec(
            preset="semrl",
            model="semantic",
            seed=0,
            decisions=decisions,
            overrides=merge(overrides or {}, {"dqn": {"final_exploration": 1.0}, "perception": CANDIDATES[name]}),
            variant=name,
        )
        for name in names
    )


def _number(name: str, what: str) -> Number:
    unit = {"ratio": "share", "drift": "cosine", "microseconds": "µs a frame", "score": "return"}.get(what, "")
    better = "lower" if what in LOWER_IS_BETTER else "higher"
    return Number(id=f"comparison/{name}/{what}", thesis=THESIS.get(what), unit=unit, better=better)  # type: ignore[arg-type]


TINY = {
    "perception": {
        "otsu": {"threshold_frames": 5},
        "scene": {"scenery_frames": 5},
        "foreground": {"background_frames": 20},
        "slot_assigner": {"frames": 30},
        "doc2vec": {"dimension": 16, "epochs": 2},
        "online": {"buckets": 512},
    },
    "stability": {"batches": 5, "max_batches": 20},
}
"""Perception and embeddings that learn in a second."""

RUNS: dict[Scale, tuple[RunSpec, ...]] = {
    "full": _agents(50_000, list(CANDIDATES)),
    "quick": (),
    "tiny": _agents(600, ["slots"], TINY | {"dqn": {"network": {"hidden_units": [8]}}}),
}

EXPERIMENT = Experiment(
    name="embedding",
    place=7,
    title="Which embedding",
    section="§4.1.3, and beyond",
    numbers=(
        Number(id="comparison/direct-search/within-5", thesis=0.843, unit="share", better="near"),
        *(_number(name, what) for name in CANDIDATES for what in MEASURED),
    ),
    settings={
        "full": Settings(),
        "quick": Settings(documents=6_000, validation=2_000, drift=(2_500, 12_500), timed=(500, 3)),
        "tiny": Settings(documents=120, validation=60, drift=(60, 120), timed=(10, 1), overrides=TINY),
    },
    measure=measure,
    runs=RUNS,
)
