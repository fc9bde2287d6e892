"""How long each stage takes, from the emulator to a gradient step, on the same frames of Pong.

Perception has the settings of the preset ``semrl`` and is trained on random play until it is stable; then some
hundred further frames are gathered, each stage gets what the stages before it make of them, and is timed over
all of them. Stages take turns, one pass each in every round, so that whatever else the machine does meanwhile
meets all alike; a stage's time is the median of its rounds. Everything runs in one process on one thread.

    python benchmarks/stages.py [--frames N] [--rounds N] [--json]
"""

import itertools
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.agent import DQN
from semrl.embedding import Doc2VecConfig, build_scene_graph, document
from semrl.pipeline import MODELS, Pipeline, PipelineConfig
from semrl.runs import PRESETS, preset
from semrl.runs.session import limited_threads
from semrl.stability import StabilityConfig
from semrl.stages import Schooling
from semrl.state import Game, make_env, to_grey
from semrl.types import Observation

DOC2VEC_SCENES = 500
"""Scenes that doc2vec is trained on here; inferring hardly depends on their number."""

UPDATES = 5
"""Updates in one pass."""

REPLAY = 500
"""Observations in the replay buffer of the agents."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Time every stage on the same frames of Pong."""

    frames: int = 300
    """Frames in one pass."""
    rounds: int = 7
    """Passes of every stage; the median counts."""
    json: bool = False
    """Print one JSON object and nothing else."""


@dataclass(frozen=True)
class Stage:
    """Something to be timed: a call and how often it is made in one pass."""

    name: str
    call: Callable[[Any], Any]
    inputs: list[Any]


def main(arguments: Arguments) -> None:
    """Prepare, measure, tell."""
    with limited_threads(1):
        pipeline, game = learn_to_see()
        observations = list(itertools.islice(play(game), arguments.frames))
        stages = [*perception_stages(pipeline, game, observations), *agent_stages(observations)]
        microseconds = measure(stages, arguments.rounds)
        kind = machine.describe()
    if arguments.json:
        rows = [{"name": name, "microseconds": us, "per_second": 1e6 / us} for name, us in microseconds.items()]
        print(json.dumps({"machine": kind, **vars(arguments), "stages": rows}))
        return
    table = Table("stage", "µs", "per second", box=None, padding=(0, 2, 0, 0))
    for column in table.columns[1:]:
        column.justify = "right"
    for name, us in microseconds.items():
        table.add_row(name, f"{us:,.1f}", f"{1e6 / us:,.0f}")
    console = Console()
    console.print(table)
    console.print(f"Medians of {arguments.rounds} passes over {arguments.frames} frames of Pong.", highlight=False)
    console.print(machine.sentence(kind), highlight=False)


def learn_to_see() -> tuple[Pipeline, Game]:
    """Train threshold, PCA and Birch on random play until they are stable."""
    pipeline, game = Pipeline(preset("semrl", "semantic").pipeline, "embedding", "pong"), Game(make_env(), seed=0)
    schooling = Schooling(pipeline, StabilityConfig())
    for observation in play(game):
        schooling.learn(observation)
        if not schooling.current:
            break
    return pipeline, game


def play(game: Game) -> Iterator[Observation]:
    """Act at random and yield what is seen."""
    rng = np.random.default_rng(0)
    observation = game.reset()
    while True:
        yield observation
        outcome = game.step(int(rng.integers(game.n_actions)))
        observation = game.reset() if outcome.done else outcome.observation


def perception_stages(pipeline: Pipeline, game: Game, observations: list[Observation]) -> list[Stage]:
    """List everything between the emulator and the agent."""
    images = [to_grey(observation.frame) for observation in observations]
    objects = [pipeline.detector.detect(image) for image in images]
    classes = [pipeline.classes(found) for found in objects]
    graphs = [pipeline.scene(image) for image in images]
    words = pipeline.config.hashed.words
    proximity = pipeline.config.scene.proximity_px
    others = play(game)
    stages = [
        Stage("emulator, 4 frames", lambda _: next(others), observations),
        Stage("to_grey", lambda seen: to_grey(seen.frame), observations),
        Stage("detect", pipeline.detector.detect, images),
        Stage("PCA and Birch classes", pipeline.classes, objects),
        Stage(
            "scene graph",
            lambda pair: build_scene_graph(pair[0], pair[1].centres_px, proximity),
            list(zip(classes, objects, strict=True)),
        ),
        Stage("words", lambda graph: document(graph, words), graphs),
        Stage("hashed embedding, with words", pipeline.embedder.transform, graphs),
    ]
    learned = pipeline.to_arrays()
    whole = []
    for model, view in MODELS.items():
        encoder = Pipeline(pipeline.config, view, "pong")
        encoder.from_arrays(learned)
        suffix = " (hashed)" if view == "embedding" else ""
        whole.append(Stage(f"encode, {model}{suffix}", encoder.encode, observations))
    if find_spec("gensim"):
        thesis = train_doc2vec(pipeline, others)
        stages.append(Stage("doc2vec embedding, with words", thesis.embedder.transform, graphs))
        whole.append(Stage("encode, semantic (doc2vec)", thesis.encode, observations))
    return stages + whole


def train_doc2vec(pipeline: Pipeline, frames: Iterator[Observation]) -> Pipeline:
    """Return the same perception with the thesis's embedding, trained on a few scenes."""
    config = replace(pipeline.config, embedding="doc2vec", doc2vec=Doc2VecConfig(documents=DOC2VEC_SCENES))
    thesis = Pipeline(config, "embedding", "pong")
    thesis.from_arrays(pipeline.to_arrays())
    scenes = [pipeline.scene(to_grey(seen.frame)) for seen in itertools.islice(frames, DOC2VEC_SCENES)]
    thesis.embedder.fit(scenes)
    return thesis


def agent_stages(observations: list[Observation]) -> list[Stage]:
    """List choosing an action and learning, for both kinds of network in each preset."""
    images = [to_grey(observation.frame) for observation in observations]
    stages = []
    for name, (kind, model) in itertools.product(PRESETS, (("vector", "semantic"), ("image", "baseline"))):
        dimension = PipelineConfig().hashed.dimension
        rng = np.random.default_rng(0)
        seen = images if kind == "image" else list(rng.standard_normal((len(images), dimension), dtype=np.float32))
        config = preset(name, model).agent
        # One update at every decision, as soon as the buffer is filled: `observe` then times exactly one.
        config = replace(config, initial_buffer=REPLAY, replay_capacity=2 * REPLAY, decisions_per_update=1, updates=1)
        agent = DQN(config, seen[0].shape, seen[0].dtype, n_actions=2, frame_skip=4, seed=0)
        for i in range(REPLAY):
            remember(agent, seen[i % len(seen)])
        title = f"{kind} network, {name}"
        stages.append(Stage(f"act, {title}", agent.best_action, [np.stack([one, one]) for one in seen]))
        learn = lambda one, agent=agent: remember(agent, one)  # noqa: E731
        stages.append(Stage(f"update of {config.batch_size}, {title}", learn, seen[:UPDATES]))
    return stages


def remember(agent: DQN, observation: Any) -> None:
    """Show an agent one decision; it learns when its buffer is filled."""
    agent.observe(observation, 0, 0.0, terminated=False, start=False)


def measure(stages: list[Stage], rounds: int) -> dict[str, float]:
    """Return the median time of one call of each stage, in µs."""
    times: dict[str, list[float]] = {stage.name: [] for stage in stages}
    for stage in stages:
        stage.call(stage.inputs[0])  # warm: compiled code, caches of libraries
    for _ in range(rounds):
        for stage in stages:
            start = time.perf_counter()
            for given in stage.inputs:
                stage.call(given)
            times[stage.name].append((time.perf_counter() - start) / len(stage.inputs) * 1e6)
    return {name: float(np.median(values)) for name, values in times.items()}


if __name__ == "__main__":
    main(tyro.cli(Arguments))
