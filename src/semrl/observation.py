"""Symbols for other people's agents: a Gymnasium wrapper around any environment with RGB frames."""

import copy
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.errors import UsageError
from semrl.pipeline import Pipeline
from semrl.runs import load_pipeline
from semrl.types import IMAGE_SIZE_PX, Observation


class SemanticObservation(gym.ObservationWrapper[NDArray[Any], Any, Any], gym.utils.RecordConstructorArgs):
    """Show an agent the scene that trained perception sees, instead of raw frames.

    Parameters
    ----------
    env
        Its observations are RGB frames, ``(height, width, 3)`` uint8; `make_env` gives such
        environments with frame skip.
    encoder
        Folder of a trained run with perception (model ``birch`` or ``semantic``; vectors need ``semantic``
        or ``objects``), or its `Pipeline`, which stays as it is.
    output
        ``"vector"``: the embedding of the scene, or the slots of tracked objects, and its difference to the
        previous one (§3.2.3), ``(2 d,)`` float32. ``"labels"``: every pixel in the grey level of its object's class,
        ``(84, 84, 1)`` uint8.

    Raises
    ------
    UsageError
        When the frames are no RGB images, or the run has not learned what the output needs.
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
        shape = env.observation_space.shape or ()
        if len(shape) != 3 or shape[2] != 3 or env.observation_space.dtype != np.uint8:
            raise UsageError(f"SemanticObservation needs RGB frames of uint8, got {env.observation_space}")
        # What was learned may be shared; the tracks of an episode may not.
        self.pipeline = copy.copy(encoder) if isinstance(encoder, Pipeline) else load_pipeline(encoder)
        self.output = output
        self._previous: NDArray[np.float32] | None = None
        self._check_learned()
        if output == "labels":
            self.observation_space = gym.spaces.Box(0, 255, (IMAGE_SIZE_PX, IMAGE_SIZE_PX, 1), np.uint8)
        else:
            size = (2 * self.pipeline.shape[0],)
            self.observation_space = gym.spaces.Box(-np.inf, np.inf, size, np.float32)

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

    def _check_learned(self) -> None:
        """Complain of what was not learned; the embedding does so itself when it is shown a black frame."""
        views = {"labels": ("classes", "embedding"), "vector": ("embedding", "objects")}
        if self.output not in views:
            raise UsageError(f"output must be 'vector' or 'labels', not '{self.output}'")
        if self.pipeline.view not in views[self.output]:
            raise UsageError(
                f"output '{self.output}' needs perception of a run of model 'semantic'"
                f" or '{'birch' if self.output == 'labels' else 'objects'}'; this one sees '{self.pipeline.view}'"
            )
        p = self.pipeline
        detects = p.roles.is_fitted if p.view == "objects" else p.detector.is_fitted
        if not (detects and p.pca.is_fitted and p.birch.n_leaves_):
            raise UsageError("this perception has not learned to tell objects apart yet: the run needs more frames")
        if p.view == "embedding" and self.output == "vector":
            p.embedder.transform(p.scene(np.zeros((IMAGE_SIZE_PX, IMAGE_SIZE_PX), dtype=np.uint8)))
