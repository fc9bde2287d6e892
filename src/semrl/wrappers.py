"""Symbols for other people's agents: Gymnasium wrappers around any environment with RGB frames."""

import copy
from collections.abc import Sequence
from itertools import compress
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Observation
from semrl.core.errors import UsageError
from semrl.envs import rom_name
from semrl.evaluation import load_pipeline
from semrl.perception.config import MODELS
from semrl.perception.embedding import build_scene_graph
from semrl.perception.pipeline import Pipeline


class SemanticObservation(gym.ObservationWrapper[NDArray[Any], Any, Any], gym.utils.RecordConstructorArgs):
    """Show an agent the scene that trained perception sees, instead of raw frames.

    Parameters
    ----------
    env
        Its observations are RGB frames, ``(height, width, 3)`` uint8; `make_env` gives such
        environments with frame skip.
    encoder
        Folder of a trained run of a model that sees objects (``birch``, ``semantic``, ``semantic-map``, ``objects``,
        ``objects-map``; ``birch`` has no vectors), or its `Pipeline`, which stays as it is.
    output
        ``"vector"``: the embedding of the scene, or the slots of tracked objects, and its difference to the
        previous one (§3.2.3), ``(2 d,)`` float32; `feature_names` tells which number is what. ``"labels"``: every pixel
        in the grey level of its object's class, ``(84, 84, 1)`` uint8.

    Attributes
    ----------
    feature_names : tuple of str
        Of the numbers of a vector; those of labels have none.
    pipeline : Pipeline
        What it sees with.

    Raises
    ------
    UsageError
        When the frames are no RGB images, the run has not learned what the output needs, or was trained on another
        Atari game.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        encoder: str | Path | Pipeline,
        output: Literal["vector", "labels"] = "vector",
    ) -> None:
        # Gymnasium makes a wrapped environment again from its recorded arguments.
        gym.utils.RecordConstructorArgs.__init__(self, encoder=encoder, output=output, _disable_deepcopy=True)
        gym.ObservationWrapper.__init__(self, env)
        _check_frames(env.observation_space)
        # What was learned may be shared; the tracks of an episode may not.
        self.pipeline = copy.copy(encoder) if isinstance(encoder, Pipeline) else load_pipeline(encoder)
        self.output = output
        self._previous: NDArray[np.float32] | None = None
        _check_learned(self.pipeline, output)
        _check_game(self.pipeline, rom_name(env))
        self.feature_names = _feature_names(self.pipeline) if output == "vector" else ()
        if output == "labels":
            self.observation_space = gym.spaces.Box(0, 255, (IMAGE_SIZE_PX, IMAGE_SIZE_PX, 1), np.uint8)
        else:
            self.observation_space = _vector_space(self.pipeline)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Reset; the first difference is zero."""
        self._previous = None
        self.pipeline.begin_episode()
        return super().reset(seed=seed, options=options)

    def observation(self, observation: NDArray[np.uint8]) -> NDArray[Any]:
        """Elevate one frame."""
        frame = Observation(frame=observation)
        if self.output == "labels":
            return self.pipeline.class_image(self.pipeline.detect(frame))[:, :, None]
        current = self.pipeline.encode(frame)
        previous = current if self._previous is None else self._previous
        self._previous = current
        return np.concatenate([current, current - previous])


class SemanticVectorObservation(gym.vector.VectorObservationWrapper):
    """Show an agent the scenes of several environments at once, as `SemanticObservation` does with one.

    Each row is the embedding of an environment's scene and its difference to the one before, which is zero at
    the start of an episode. The bits are those of single environments, however many there are.

    Parameters
    ----------
    env
        A vector environment; its observations are RGB frames, ``(n, height, width, 3)`` uint8.
    encoder
        Folder of a trained run, or its `Pipeline`, as of `SemanticObservation`.

    Attributes
    ----------
    feature_names, pipeline
        As of `SemanticObservation`.

    Raises
    ------
    UsageError
        When the frames are no RGB images, the run has not learned to write scenes as vectors or was trained on another
        Atari game (which environments in other processes do not tell), or environments begin anew otherwise than at
        the next step (Gymnasium's default).
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], encoder: str | Path | Pipeline) -> None:
        mode = env.metadata.get("autoreset_mode", gym.vector.AutoresetMode.NEXT_STEP)
        if mode != gym.vector.AutoresetMode.NEXT_STEP:
            raise UsageError(f"a semantic observation needs environments that begin anew at the next step, not {mode}")
        super().__init__(env)
        _check_frames(env.single_observation_space)
        self.pipeline = encoder if isinstance(encoder, Pipeline) else load_pipeline(encoder)
        _check_learned(self.pipeline, "vector")
        for single in getattr(env.unwrapped, "envs", ()):  # those in other processes do not tell their game
            _check_game(self.pipeline, rom_name(single))
        self.feature_names = _feature_names(self.pipeline)
        self.single_observation_space = _vector_space(self.pipeline)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, env.num_envs)
        self._begins = np.ones(env.num_envs, np.bool_)
        self._previous = np.zeros((env.num_envs, self.pipeline.shape[0]), np.float32)
        # What was learned is shared; each environment has tracks of its own.
        self._watchers = [copy.copy(self.pipeline) for _ in range(env.num_envs if self.pipeline.follows else 0)]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Reset all environments; the first differences are zero."""
        self._begins[:] = True
        return super().reset(seed=seed, options=options)

    def step(self, actions: Any) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Step all environments; one whose episode is over begins anew at the next step."""
        seen, rewards, terminations, truncations, infos = super().step(actions)
        self._begins = terminations | truncations
        return seen, rewards, terminations, truncations, infos

    def observations(self, observations: NDArray[np.uint8]) -> NDArray[Any]:
        """Elevate the frames of all environments."""
        current = self._elevate([Observation(frame=frame) for frame in observations])
        change = np.where(self._begins[:, None], np.float32(0), current - self._previous)
        self._previous = current
        self._begins = np.zeros(len(current), np.bool_)
        return np.concatenate([current, change], axis=1)

    def _elevate(self, seen: Sequence[Observation]) -> NDArray[Any]:
        if not self._watchers:
            return self.pipeline.encode_batch(seen)
        for watcher in compress(self._watchers, self._begins):
            watcher.begin_episode()
        return np.stack([watcher.encode(shown) for watcher, shown in zip(self._watchers, seen, strict=True)])


def _check_frames(space: gym.Space[Any]) -> None:
    shape = space.shape or ()
    if len(shape) != 3 or shape[2] != 3 or space.dtype != np.uint8:
        raise UsageError(f"a semantic observation needs RGB frames of uint8, got {space}")


def _vector_space(pipeline: Pipeline) -> gym.spaces.Box:
    return gym.spaces.Box(-np.inf, np.inf, (2 * pipeline.shape[0],), np.float32)


def _feature_names(pipeline: Pipeline) -> tuple[str, ...]:
    """Name the numbers of a vector, then their differences; those of an embedding mean nothing by themselves."""
    facts, d = pipeline.facts, pipeline.shape[0]
    names = [f"embedding {i}" for i in range(d)]
    if pipeline.names:
        named = pipeline.names[: facts.stop - facts.start]
        free = [f"free slot {i}" for i in range(facts.stop - facts.start - len(named))]
        names[facts] = [*named, *free]
    return (*names, *(f"change of {name}" for name in names))


def _check_game(pipeline: Pipeline, rom: str | None) -> None:
    if pipeline.rom and rom and pipeline.rom != rom:
        raise UsageError(f"this perception has learned to see {pipeline.rom}, not {rom}: train a run on {rom}")


def _check_learned(pipeline: Pipeline, output: str) -> None:
    """Complain of what was not learned; the embedding does so itself when it is shown an empty scene."""
    views = {"labels": ("classes", "embedding", "objects"), "vector": ("embedding", "objects")}
    if output not in views:
        raise UsageError(f"output must be 'vector' or 'labels', not '{output}'")
    if pipeline.view not in views[output]:
        models = ", ".join(model for model, view in MODELS.items() if view in views[output])
        raise UsageError(
            f"output '{output}' needs a run of one of the models {models}; this one sees '{pipeline.view}'"
        )
    detects = pipeline.roles.is_fitted if pipeline.follows else pipeline.detector.is_fitted
    if not (detects and pipeline.pca.is_fitted and pipeline.birch.n_leaves_):
        raise UsageError("this perception has not learned to tell objects apart yet: the run needs more decisions")
    if pipeline.view == "embedding" and output == "vector":
        pipeline.embedder.transform(build_scene_graph(np.empty(0), np.empty((0, 2)), 0.0))
