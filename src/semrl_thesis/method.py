"""Figures of the method (chapter 3), from live perception: what each step makes of a frame, and the networks."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from semrl.agents.networks import QNetwork
from semrl.core import Image, Observation
from semrl.envs import Game, make_env, rom_name
from semrl.evaluation.sight import CLASS_COLOURS
from semrl.perception.detection import OtsuDetector
from semrl.perception.detection.grey import to_grey
from semrl.perception.encoders import ENCODERS, Encoder
from semrl.training import RunConfig
from semrl.training.config import MODELS
from semrl.world_model import NextStateNetwork
from semrl_thesis.base import Context, Experiment
from semrl_thesis.figures import Figure, Layers, Picture, Pictures, Scene
from semrl_thesis.perception import by_frame, new_run, pretrain
from semrl_thesis.results import Result


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is looked at.

    Attributes
    ----------
    frame
        Number of the frame in a random episode: the ball is in play.
    overrides
        Nested settings on top of each preset.
    """

    frame: int = 60
    overrides: Mapping[str, Any] = field(default_factory=dict)


def measure(settings: Settings, context: Context) -> Result:
    """Take one frame through every step."""
    context.say("figures of the method")
    config = _config("thesis", settings)
    detector = pretrain(config, "scene").perception.detector
    assert isinstance(detector, OtsuDetector)
    observation = _frame(config, settings)
    graphs = tuple(
        (f"preset {name}", _scene(pretrain(_config(name, settings), "scene").encoder, observation))
        for name in ("thesis", "semrl")
    )
    return Result(
        values={},
        figures=(
            *_steps(detector, observation),
            Figure(
                number="3.6",
                title="The frame as a graph",
                says="Objects are nodes, coloured by class, and near ones are joined; preset semrl joins no scenery.",
                panels=graphs,
            ),
            *_networks(config),
        ),
    )


def _config(name: str, settings: Settings) -> RunConfig:
    """Return a preset whose embedding needs nothing: no vector is drawn."""
    return by_frame(name, settings.overrides, {"perception": {"embedder": "hashed"}})


def _frame(config: RunConfig, settings: Settings) -> Observation:
    return next(islice(new_run(config, None), settings.frame, None))


def _steps(detector: OtsuDetector, observation: Observation) -> tuple[Figure, ...]:
    """Draw Figs. 3.1 – 3.4."""
    grey = to_grey(observation.frame)
    components, objects = detector.components(grey), detector.detect(grey)
    foreground = ((grey > detector.threshold_) * 255).astype(np.uint8)
    steps = (
        ("3.1", "A frame of Pong", "What the environment shows: 210 × 160 pixels in colour.", observation.frame),
        ("3.2", "Otsu's threshold", "Scaled to 84 × 84 pixels, grey: what is brighter than Otsu's threshold, lowered "
         "by a tenth.", foreground),
        ("3.3", "Connected components", f"Pixels that touch are one object: {components.max()} of them, a colour each.",
         _coloured(components)),
        ("3.4", "Cut", f"Large components cut into equal parts of at most 8 × 8 pixels: {len(objects)} objects.",
         _coloured(objects.labels)),
    )  # fmt: skip
    return tuple(
        Figure(number=number, title=title, says=says,
               panels=(("", Pictures(pictures=(Picture(caption="", image=image),))),))
        for number, title, says, image in steps
    )  # fmt: skip


def _coloured(labels: NDArray[np.int32]) -> Image:
    """Give every label a colour, the background black, ``(84, 84, 3)``."""
    colours = np.array(CLASS_COLOURS, np.uint8)
    return np.where(labels[..., None] > 0, colours[(labels - 1) % len(colours)], np.uint8(0))


def _scene(encoder: Encoder, observation: Observation) -> Scene:
    episode = encoder.begin()
    episode.encode(observation)
    sight = episode.look()
    return Scene(
        frame=observation.frame,
        boxes_px=sight.boxes_px,
        classes=sight.classes,
        edges=sight.edges,
        palette=CLASS_COLOURS,
    )


def _networks(config: RunConfig) -> tuple[Figure, ...]:
    """Draw Figs. 3.8 and 3.9 from the networks as they are built."""
    env = make_env(config.env, config.environment)
    n_actions = Game(env, 0).n_actions
    shown = {
        model: ENCODERS.load(MODELS[model].encoder)(config.perception, rom=rom_name(env), planning=False).space.shape
        for model in ("baseline", "semantic")
    }
    dimension = shown["semantic"][0]
    networks = tuple(
        (f"model {model}", _layers(QNetwork(shape, n_actions, config.dqn.network, seed=0).modules(), _input(shape)))
        for model, shape in shown.items()
    )
    model = NextStateNetwork(config.planning.networks.next_state, dimension, n_actions)
    inputs = f"state {dimension}, difference {dimension}, action {n_actions}"
    return (
        Figure(
            number="3.8",
            title="The agent's networks",
            says="Three convolutions and a dense layer for images; the dense layer alone for embeddings.",
            panels=networks,
        ),
        Figure(
            number="3.9",
            title="The network that predicts the next state",
            says="State, difference and action go in, the next state comes out.",
            panels=(("", _layers(model.network.layers, inputs)),),
        ),
    )


def _input(shape: tuple[int, ...]) -> str:
    size = " × ".join(map(str, shape))
    return f"{size} × 2: state and difference"


def _layers(modules: Iterable[nn.Module], inputs: str) -> Layers:
    layers = [("input", inputs)]
    for module in modules:
        if isinstance(module, nn.Conv2d):
            size, stride = module.kernel_size[0], module.stride[0]
            layers.append(("convolution", f"{module.out_channels} channels, kernel {size} × {size}, stride {stride}"))
        elif isinstance(module, nn.Linear):
            layers.append(("dense", f"{module.out_features} neurons"))
        elif isinstance(module, nn.ReLU):
            layers[-1] = (layers[-1][0], f"{layers[-1][1]}, ReLU")
    return Layers(layers=(*layers[:-1], ("output", layers[-1][1].replace(" neurons", " values"))))


EXPERIMENT = Experiment(
    name="method",
    place=0,
    title="The method",
    section="chapter 3",
    numbers=(),
    settings={
        "full": Settings(),
        "quick": Settings(),
        "tiny": Settings(
            overrides={
                "perception": {"otsu": {"threshold_frames": 5}, "scene": {"scenery_frames": 5}},
                "stability": {"batches": 5, "max_batches": 20},
            }
        ),
    },
    measure=measure,
)
