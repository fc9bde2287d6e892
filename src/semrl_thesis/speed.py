"""How fast a frame is elevated: stage by stage, beside the emulator and the thesis's libraries, and how it grows.

Perception has the settings of the preset ``semrl`` and is trained on random play until it is stable; then some
hundred further frames are recorded, and each stage gets what the stages before it make of them. Stages take turns,
one pass each in every round, so that whatever else the machine does meanwhile meets all alike; what counts is the
median of the rounds. Everything runs in one process on one thread, and what is counted is processor time of that
thread: a rate is per second of one core.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from semrl.core import IMAGE_SIZE_PX, Frame, Observation, SceneGraph
from semrl.core.errors import UsageError
from semrl.perception.detection import OtsuDetector
from semrl.perception.detection.grey import to_grey
from semrl.perception.embedding import HashedEmbedding, build_scene_graph, sentences
from semrl.perception.embedding.protocol import Embedder
from semrl.perception.encoders import Encoder
from semrl.perception.encoders.scene import SceneEncoder
from semrl.perception.perception import Perception
from semrl.training import preset
from semrl.training.session import limited_threads
from semrl_thesis.peers import ThesisStack, require_peers
from semrl_thesis.perception import PLAY_SEED, by_frame, pretrain, random_play
from semrl_thesis.timing import ELEVATION, EMBEDDING, EMULATOR, STACK, Speed, Stage, medians

BATCH = 8
"""Environments whose frames are elevated together."""

OBJECT_COUNTS = (10, 30, 100, 300, 1000)
GROWTH_FRAMES = 4
"""Frames of each number of objects."""

VOCABULARIES = (1_000, 10_000, 100_000, 1_000_000)
OBJECTS, KINDS = 25, 16
"""Of each scene of a vocabulary."""
MET_BEFORE, GROWTH_SCENES = 500, 1000
"""Scenes of a vocabulary, those that are embedded before the measurement and those of one pass."""


@dataclass(frozen=True, kw_only=True)
class SpeedConfig:
    """How much is measured."""

    frames: int = 300
    """Recorded frames of Pong."""
    rounds: int = 7
    """Passes of every stage over them; the median counts."""
    seed: int = 0
    """Of the random play."""

    def __post_init__(self) -> None:
        if self.frames < 10 or self.rounds < 1:
            raise UsageError(f"frames must be 10 or more and rounds 1 or more, not {self.frames} and {self.rounds}")
        if self.seed < 0:
            raise UsageError(f"seed must be 0 or more, not {self.seed}")


def measure_speed(config: SpeedConfig, *, peers: bool, say: Callable[[str], None]) -> Speed:
    """Measure everything.

    Parameters
    ----------
    config
        How much.
    peers
        Whether the thesis's stack is measured as well.
    say
        Is told what is done now.

    Raises
    ------
    MissingExtraError
        If the thesis's stack is asked for and gensim is not installed.
    """
    if peers:
        require_peers()  # now, not after perception was trained
    with limited_threads(1):
        say("learning to see")
        encoder, play = learn_to_see(config.seed)
        frames = [seen.frame for seen in itertools.islice(play, config.frames)]
        stages = upper_line(encoder, play, frames)
        tracked = _Episode(learn_to_see(config.seed, tracked=True)[0])
        shown = [Observation(frame=frame) for frame in frames]
        stages.append(Stage(f"{ELEVATION}, tracked scenes", tracked.encode, shown, prepare=tracked.begin))
        stack = None
        if peers:
            say("training the thesis's stack")
            stack = make_stack(frames, encoder)
            stages += stack_stages(stack, frames)
        say("measuring stages")
        times = medians(stages, config.rounds)
        say("measuring how the cost grows")
        return Speed(
            stages=times,
            by_objects=_by_objects(encoder, stack, config),
            by_vocabulary=_by_vocabulary(config),
        )


def learn_to_see(seed: int, *, tracked: bool = False) -> tuple[Encoder, Iterator[Observation]]:
    """Train perception on random play of Pong; return it, and other random play.

    Scenes are of tracked objects, as in the preset `semrl`, or of single frames.
    """
    config = preset("semrl", "semantic", {"seed": seed}) if tracked else by_frame("semrl", {"seed": seed})
    return pretrain(config, config.encoder_name).encoder, random_play(config, seed + PLAY_SEED)


def make_stack(frames: Sequence[Frame], encoder: Encoder) -> ThesisStack:
    """Train the thesis's stack on frames, with the threshold that an encoder of single frames has found."""
    assert encoder.perception is not None
    detector = encoder.perception.detector
    assert isinstance(detector, OtsuDetector), "what sees single frames in the preset"
    return ThesisStack(frames, detector.threshold_, detector.crop_size_px)


def upper_line(encoder: Encoder, play: Iterator[Observation], frames: Sequence[Frame]) -> list[Stage]:
    """List everything between the emulator and the vector, then the whole of it."""
    perception, embedder = _boxes(encoder)
    detector = perception.detector
    images = [to_grey(frame) for frame in frames]
    objects = [detector.detect(image) for image in images]
    reduced = [perception.reducer.transform(found.features) for found in objects]
    classes = [perception.clusterer.predict(rows) for rows in reduced]
    graphs = [perception.scene(Observation(frame=image)) for image in images]
    words = partial(sentences, config=perception.config.hashed.words)
    join = partial(build_scene_graph, proximity_px=perception.config.scene.proximity_px)
    shown = [(graph.classes, graph.centres_px) for graph in graphs]
    seen = [Observation(frame=frame) for frame in frames]
    batches = [seen[i : i + BATCH] for i in range(0, len(seen) - BATCH + 1, BATCH)]
    alone, together, newborn = _Episode(encoder), [_Episode(encoder) for _ in range(BATCH)], _Newborn(encoder)

    def encode_all(batch: Sequence[Observation]) -> list[Any]:
        return [one.encode(observation) for one, observation in zip(together, batch, strict=True)]

    return [
        Stage(EMULATOR, lambda _: next(play), frames),
        Stage("grey image", to_grey, frames),
        Stage("objects", detector.detect, images),
        Stage("reduced objects", perception.reducer.transform, [found.features for found in objects]),
        Stage("classes of reduced objects", perception.clusterer.predict, reduced),
        Stage("classes, remembered", perception.classes, objects),
        Stage("scenery", perception.shown, classes),
        Stage("scene graph", lambda pair: join(*pair), shown),
        Stage("words", words, graphs),
        Stage("words and vector", embedder.transform, graphs),
        Stage(ELEVATION, alone.encode, seen),
        Stage(f"{ELEVATION}, {BATCH} frames at once", encode_all, batches, frames=BATCH),
        Stage(f"{ELEVATION}, places never met", newborn.encode, seen, prepare=newborn.forget),
    ]


class _Episode:
    """An encoder and the episode that it is in."""

    def __init__(self, encoder: Encoder) -> None:
        self.encoder = encoder
        self.begin()

    def begin(self) -> None:
        self.episode = self.encoder.begin()

    def encode(self, observation: Observation) -> Any:
        return self.episode.encode(observation)


class _Newborn(_Episode):
    """The same perception of single frames without memories."""

    def forget(self) -> None:
        self.encoder = _copy(self.encoder)
        self.begin()


def _copy(encoder: Encoder, **scene: Any) -> SceneEncoder:
    """Make an encoder of single frames that has learned the same, with other settings of scenes perhaps."""
    config = _boxes(encoder)[0].config
    copy = SceneEncoder(replace(config, scene=replace(config.scene, **scene)))
    copy.from_arrays(encoder.to_arrays())
    return copy


def _boxes(encoder: Encoder) -> tuple[Perception, Embedder]:
    assert encoder.perception is not None, "it sees objects"
    return encoder.perception, encoder.perception.embedder


def stack_stages(stack: ThesisStack, frames: Sequence[Frame]) -> list[Stage]:
    """List what the thesis's libraries do, then the whole of it."""
    objects = [stack.detect(frame) for frame in frames]
    scenes = [(stack.classify(crops), centres_px) for crops, centres_px in objects]
    documents = [stack.describe(*scene) for scene in scenes]
    return [
        Stage("objects, OpenCV", stack.detect, frames),
        Stage("classes, scikit-learn", stack.classify, [crops for crops, _ in objects]),
        Stage("graph and words, networkx", lambda scene: stack.describe(*scene), scenes),
        Stage("vector, gensim", stack.infer, documents),
        Stage("the same steps, compiled", stack.embedding.infer_words, documents),
        Stage(STACK, stack.elevate, frames),
    ]


def _by_objects(encoder: Encoder, stack: ThesisStack | None, config: SpeedConfig) -> dict[int, dict[str, float]]:
    """Time frames with more and more objects, none of them left out as scenery."""
    whole = _Episode(_copy(encoder, omit_scenery=False))
    rng = np.random.default_rng(config.seed)
    found = {}
    for count in OBJECT_COUNTS:
        seen = [Observation(frame=dotted_frame(count, rng)) for _ in range(GROWTH_FRAMES)]
        stages = [Stage(ELEVATION, whole.encode, seen)]
        if stack:
            stages.append(Stage(STACK, stack.elevate, [seen[0].frame]))
        found[count] = medians(stages, config.rounds)
    return found


def dotted_frame(count: int, rng: np.random.Generator) -> Frame:
    """Draw so many white dots that do not touch each other, ``(84, 84, 3)``."""
    frame = np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX, 3), np.uint8)
    cells = IMAGE_SIZE_PX // 2
    rows, columns = np.divmod(rng.permutation(cells * cells)[:count], cells)
    frame[2 * rows, 2 * columns] = 255
    return frame


def _by_vocabulary(config: SpeedConfig) -> dict[int, float]:
    """Time scenes whose words are drawn from more and more."""
    rng = np.random.default_rng(config.seed)
    return {words: medians([_vocabulary(words, rng)], config.rounds)[EMBEDDING] for words in VOCABULARIES}


def _vocabulary(words: int, rng: np.random.Generator) -> Stage:
    """Make scenes of places that have about so many different words; other scenes were embedded before them."""
    edge = round(np.sqrt(words / 2 / KINDS))  # of a place's words two are its own
    embedding = HashedEmbedding()

    def draw() -> SceneGraph:
        classes, centres = rng.integers(KINDS, size=OBJECTS), rng.integers(edge, size=(OBJECTS, 2))
        return build_scene_graph(classes, centres, 0.0)  # none joined: the smaller the place, the more would be

    for _ in range(MET_BEFORE):
        embedding.transform(draw())
    return Stage(EMBEDDING, embedding.transform, [draw() for _ in range(GROWTH_SCENES)])
