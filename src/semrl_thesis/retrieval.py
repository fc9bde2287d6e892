"""Embedding test (§4.1.3): does the most similar vector belong to a scene that is near?

Any embedding behind the protocol can be tested: it is an entry of `CANDIDATES`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from semrl.core import Floats, SceneGraph
from semrl.core.errors import MissingExtraError
from semrl.perception.embedding.protocol import Embedder
from semrl.training import RunConfig
from semrl_thesis.base import Context, Experiment
from semrl_thesis.graph_distance import graph_distances
from semrl_thesis.perception import PLAY_SEED, by_frame, make_embedder, new_run, pretrain, random_play, scenes_of
from semrl_thesis.results import Number, Result
from semrl_thesis.retrieval_figures import EmbeddingTest, Validation, draw
from semrl_thesis.similarity import (
    Retrieval,
    cosine_similarities,
    embed,
    learned_vectors,
    retrieve,
    search,
)

DISTANCES = (5, 100, 200)
"""Graph distances that count as near: an object a few pixels off; none missing; one missing."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """An embedding to be tested.

    Attributes
    ----------
    preset
        Whose perception gives the scenes.
    perception
        Nested settings of perception on top of it: which embedding, and how it is set.
    self_only
        Whether the validation run is left out, as the thesis does for PV-DM.
    """

    preset: str
    perception: Mapping[str, Any] = field(default_factory=dict)
    self_only: bool = False


CANDIDATES: dict[str, Candidate] = {
    "pv-dm": Candidate(
        preset="thesis",
        perception={"embedder": "doc2vec", "doc2vec": {"words": {"form": "pv-dm"}}},
        self_only=True,
    ),
    "pv-dbow": Candidate(preset="thesis", perception={"embedder": "doc2vec"}),
    "hashed": Candidate(preset="thesis", perception={"embedder": "hashed"}),
    "semrl": Candidate(preset="semrl"),
}
"""The thesis's two, plain signed hashing on the same scenes, and what the preset `semrl` does on its own scenes."""

THESIS_SELF = {"pv-dm": (0.138, 0.218)}
"""How often the training set retrieves itself: exactly, nearer than 5. Others are held against PV-DBOW."""


def _numbers() -> tuple[Number, ...]:
    """Return the thesis's numbers, for each candidate those of PV-DBOW but for PV-DM."""
    numbers = [Number(id="embedding/vocabulary", thesis=9277, unit="words", better="near")]
    for name, candidate in CANDIDATES.items():
        exact, near = THESIS_SELF.get(name, (0.965, 0.999))
        numbers += [
            Number(id=f"embedding/{name}/exact", thesis=exact, unit="share"),
            Number(id=f"embedding/{name}/within-5", thesis=near, unit="share"),
        ]
        if candidate.self_only:
            continue
        numbers += [
            Number(id=f"embedding/{name}/{what}/within-{distance}", thesis=thesis, unit="share")
            for what, shares in (("validation", (0.665, 0.840, 0.969)), ("ratio", (0.789, 0.841, 0.969)))
            for distance, thesis in zip(DISTANCES, shares, strict=True)
        ]
        numbers += [
            Number(id=f"embedding/{name}/{what}", thesis=-0.463, better="lower")
            for what in ("pearson", "pearson-in-play")
        ]
    return (
        *numbers,
        *(
            Number(id=f"embedding/direct-search/within-{distance}", thesis=thesis, unit="share", better="near")
            for distance, thesis in zip(DISTANCES, (0.843, 0.999, 1.0), strict=True)
        ),
    )


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is looked at.

    Attributes
    ----------
    documents
        Scenes that embeddings learn from and that are searched.
    self_every
        Of these every so many is searched for itself.
    frames
        Most frames of the validation run; None for a whole episode.
    overrides
        Nested settings on top of each preset.
    """

    documents: int = 30_000
    self_every: int = 1
    frames: int | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Scenes:
    """Scenes of a preset's perception: to learn from, of the validation run, and the best that a search can find."""

    documents: Sequence[SceneGraph]
    validation: Sequence[SceneGraph]
    best: Retrieval


def measure(settings: Settings, context: Context) -> Result:
    """Test every candidate on the scenes of its preset."""
    scenes: dict[str, _Scenes] = {}
    tests: dict[str, EmbeddingTest] = {}
    notes, lacks = [], set()
    for name, candidate in CANDIDATES.items():
        context.say(f"embedding {name}")
        if candidate.preset not in scenes:
            scenes[candidate.preset] = _gather(candidate.preset, settings)
        try:
            embedder = make_embedder(_config(candidate.preset, settings, candidate.perception))
        except MissingExtraError as error:
            notes.append(f"{name} was left out: {error}")
            lacks.add(error.extra)
            continue
        tests[name] = _test(embedder, scenes[candidate.preset], settings, self_only=candidate.self_only)
    values: dict[str, float | None] = {}
    for name, test in tests.items():
        values |= _values(name, test)
    for name, found in scenes.items():
        suffix = "" if name == "thesis" else f"@{name}"
        values |= {f"embedding/direct-search/within-{d}{suffix}": found.best.within(d) for d in DISTANCES}
    return Result(values=values, figures=draw(tests), notes=tuple(notes), lacks=tuple(sorted(lacks)))


def _config(name: str, settings: Settings, perception: Mapping[str, Any]) -> RunConfig:
    """Return a preset with the settings of an experiment and, on top, those of a candidate."""
    return by_frame(name, settings.overrides, {"perception": perception})


def _gather(name: str, settings: Settings) -> _Scenes:
    """Pretrain perception, then play at random for documents and for the validation run."""
    config = _config(name, settings, {"embedder": "hashed"})
    perception = pretrain(config, "scene").perception
    play = islice(random_play(config, config.seed + PLAY_SEED), settings.documents)
    documents, validation = scenes_of(perception, play), scenes_of(perception, new_run(config, settings.frames))
    return _Scenes(documents=documents, validation=validation, best=search(validation, documents))


def _test(embedder: Embedder, scenes: _Scenes, settings: Settings, *, self_only: bool) -> EmbeddingTest:
    embedder.fit(scenes.documents)
    stored = learned_vectors(embedder, scenes.documents)
    sought = np.arange(0, len(scenes.documents), settings.self_every)
    queries = scenes.documents[:: settings.self_every]
    return EmbeddingTest(
        itself=retrieve(embed(embedder, queries), queries, stored, scenes.documents),
        sought=sought,
        vocabulary=getattr(embedder, "vocabulary_size_", None),
        validation=None if self_only else _validate(embedder, stored, scenes),
    )


def _validate(embedder: Embedder, stored: Floats, scenes: _Scenes) -> Validation:
    vectors = embed(embedder, scenes.validation)
    return Validation(
        found=retrieve(vectors, scenes.validation, stored, scenes.documents),
        best=scenes.best,
        similarities=cosine_similarities(vectors[:-1], vectors[1:]),
        distances=graph_distances(scenes.validation[:-1], scenes.validation[1:]),
    )


def _values(name: str, test: EmbeddingTest) -> dict[str, float | None]:
    values: dict[str, float | None] = {
        f"embedding/{name}/exact": float(np.mean(test.itself.places == test.sought)),
        f"embedding/{name}/within-5": test.itself.within(5),
    }
    if name == "pv-dbow":
        values["embedding/vocabulary"] = test.vocabulary
    if test.validation:
        for distance in DISTANCES:
            found, possible = test.validation.found.within(distance), test.validation.best.within(distance)
            values[f"embedding/{name}/validation/within-{distance}"] = found
            values[f"embedding/{name}/ratio/within-{distance}"] = found / possible if possible else None
        values[f"embedding/{name}/pearson"] = test.validation.pearson()
        values[f"embedding/{name}/pearson-in-play"] = test.validation.pearson(1)  # the first frame looks like no other
    return values


EXPERIMENT = Experiment(
    name="retrieval",
    place=2,
    title="Embedding",
    section="§4.1.3",
    numbers=_numbers(),
    settings={
        "full": Settings(),
        "quick": Settings(documents=4000, self_every=8),
        "tiny": Settings(
            documents=60,
            self_every=2,
            frames=30,
            overrides={
                "perception": {
                    "otsu": {"threshold_frames": 5},
                    "scene": {"scenery_frames": 5},
                    "doc2vec": {"dimension": 16, "epochs": 2},
                    "hashed": {"dimension": 32},
                },
                "stability": {"batches": 5, "max_batches": 20},
            },
        ),
    },
    measure=measure,
)
