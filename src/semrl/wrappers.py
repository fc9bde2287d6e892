"""Symbols for other people's agents: Gymnasium wrappers around any environment with RGB frames."""

from itertools import compress
from pathlib import Path
from typing import Any, Literal, SupportsFloat

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Observation
from semrl.core.errors import UsageError
from semrl.envs import observation_of, rom_name
from semrl.evaluation import load_encoder
from semrl.perception.encoders import Encoder
from semrl.perception.encoders.classes import class_image


class SemanticObservation(gym.ObservationWrapper[NDArray[Any], Any, Any], gym.utils.RecordConstructorArgs):
    """Show an agent the scene that trained perception sees, instead of raw frames.

    Parameters
    ----------
    env
        Its observations are RGB frames, ``(height, width, 3)`` uint8; `make_env` gives such
        environments with frame skip.
    encoder
        Folder of a trained run of a model that sees objects (``birch``, ``semantic``, ``semantic-map``, ``objects``,
        ``objects-map``; ``birch`` has no vectors), or its `Encoder`, which stays as it is.
    output
        ``"vector"``: the embedding of the scene, or the slots of tracked objects, and its difference to the
        previous one (§3.2.3), ``(2 d,)`` float32; `feature_names` says which number is what. ``"labels"``: every pixel
        in the grey level of its object's class, ``(84, 84, 1)`` uint8.

    Attributes
    ----------
    feature_names : tuple of str
        Of the numbers of a vector; those of labels have none.
    encoder : Encoder
        What it sees with.

    Raises
    ------
    UsageError
        When the frames are no RGB images, the run has not learned what the output needs, or was trained on another
        Atari game.

    Examples
    --------
    With the run of the page *Start*:

    >>> from semrl import make_env
    >>> env = SemanticObservation(make_env("semrl/Catch-v0"), encoder="runs/catch")
    >>> vector, info = env.reset(seed=0)
    >>> vector.shape == (len(env.feature_names),)
    True
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        encoder: str | Path | Encoder,
        output: Literal["vector", "labels"] = "vector",
    ) -> None:
        # Gymnasium makes a wrapped environment again from its recorded arguments.
        gym.utils.RecordConstructorArgs.__init__(self, encoder=encoder, output=output, _disable_deepcopy=True)
        gym.ObservationWrapper.__init__(self, env)
        _check_frames(env.observation_space)
        self.encoder = load_encoder(encoder) if isinstance(encoder, str | Path) else encoder
        self.output = output
        self._previous: NDArray[np.float32] | None = None
        self._over = False
        _check_learned(self.encoder, output)
        _check_game(self.encoder, rom_name(env))
        self._episode = self.encoder.begin()
        self.feature_names = _feature_names(self.encoder) if output == "vector" else ()
        if output == "labels":
            self.observation_space = gym.spaces.Box(0, 255, (IMAGE_SIZE_PX, IMAGE_SIZE_PX, 1), np.uint8)
        else:
            self.observation_space = _vector_space(self.encoder)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Reset; the first difference is zero."""
        self._begin()
        return super().reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[NDArray[Any], SupportsFloat, bool, bool, dict[str, Any]]:
        """Step; after the end of an episode what is below begins anew by itself (Gymnasium's ``Autoreset``)."""
        if self._over:
            self._begin()
        seen, reward, terminated, truncated, info = super().step(action)
        self._over = terminated or truncated
        return seen, reward, terminated, truncated, info

    def observation(self, observation: NDArray[np.uint8]) -> NDArray[Any]:
        """Elevate one frame."""
        seen = observation_of(self.env, observation)
        if self.output == "labels":
            perception = self.encoder.perception
            assert perception is not None, "checked at the beginning"
            return class_image(perception, perception.objects(seen))[:, :, None]
        current = self._episode.encode(seen).vector
        previous = current if self._previous is None else self._previous
        self._previous = current
        return np.concatenate([current, current - previous])

    def _begin(self) -> None:
        """Forget the episode before."""
        self._previous, self._over = None, False
        self._episode = self.encoder.begin()


class SemanticVectorObservation(gym.vector.VectorWrapper):
    """Show an agent the scenes of several environments at once, as `SemanticObservation` does with one.

    Each row is the embedding of an environment's scene and its difference to the one before, which is zero at
    the start of an episode. The bits are those of single environments, however many there are.

    Parameters
    ----------
    env
        A vector environment; its observations are RGB frames, ``(n, height, width, 3)`` uint8.
    encoder
        Folder of a trained run, or its `Encoder`, as of `SemanticObservation`.

    Attributes
    ----------
    feature_names, encoder
        As of `SemanticObservation`.

    Raises
    ------
    UsageError
        When the frames are no RGB images, the run has not learned to write scenes as vectors or was trained on another
        Atari game (which environments in other processes do not say), or environments do not begin anew by themselves
        (Gymnasium's autoreset modes at the next and in the same step; of the latter ``final_obs`` is elevated as well).

    Examples
    --------
    With the run of the page *Start*, two games at once:

    >>> from semrl import make_env
    >>> games = gym.vector.SyncVectorEnv([lambda: make_env("semrl/Catch-v0")] * 2)
    >>> env = SemanticVectorObservation(games, encoder="runs/catch")
    >>> vectors, info = env.reset(seed=0)
    >>> vectors.shape == (2, len(env.feature_names))
    True
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], encoder: str | Path | Encoder) -> None:
        mode = env.metadata.get("autoreset_mode", gym.vector.AutoresetMode.NEXT_STEP)
        if mode == gym.vector.AutoresetMode.DISABLED:
            raise UsageError("a semantic observation needs environments that begin anew by themselves, not DISABLED")
        self._in_same_step = mode == gym.vector.AutoresetMode.SAME_STEP
        super().__init__(env)
        _check_frames(env.single_observation_space)
        self.encoder = load_encoder(encoder) if isinstance(encoder, str | Path) else encoder
        _check_learned(self.encoder, "vector")
        for single in getattr(env.unwrapped, "envs", ()):  # those in other processes do not name their game
            _check_game(self.encoder, rom_name(single))
        self.feature_names = _feature_names(self.encoder)
        self.single_observation_space = _vector_space(self.encoder)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, env.num_envs)
        self._begins = np.ones(env.num_envs, np.bool_)
        self._previous = np.zeros((env.num_envs, self.encoder.space.shape[0]), np.float32)
        self._episodes = [self.encoder.begin() for _ in range(env.num_envs)]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Reset all environments; the first differences are zero."""
        frames, infos = self.env.reset(seed=seed, options=options)
        self._begins[:] = True
        return self.observations(frames), infos

    def step(self, actions: Any) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Step all environments; one whose episode is over begins anew, as its autoreset mode says."""
        frames, rewards, terminations, truncations, infos = self.env.step(actions)
        over = terminations | truncations
        if self._in_same_step:
            if over.any():
                infos = infos | {"final_obs": self._last(infos["final_obs"], over)}
            self._begins = over
        seen = self.observations(frames)
        if not self._in_same_step:
            self._begins = over
        return seen, rewards, terminations, truncations, infos

    def observations(self, observations: NDArray[np.uint8]) -> NDArray[Any]:
        """Elevate the frames of all environments."""
        for place in compress(range(len(self._episodes)), self._begins):
            self._episodes[place] = self.encoder.begin()
        current = np.stack([
            episode.encode(Observation(frame=frame)).vector
            for episode, frame in zip(self._episodes, observations, strict=True)
        ])  # fmt: skip
        change = np.where(self._begins[:, None], np.float32(0), current - self._previous)
        self._previous = current
        self._begins = np.zeros(len(current), np.bool_)
        return np.concatenate([current, change], axis=1)

    def _last(self, frames: NDArray[Any], over: NDArray[np.bool_]) -> NDArray[Any]:
        """Elevate the last frames of episodes that are over, ``(n,)`` of vectors, None where one goes on."""
        vectors = np.full(len(frames), None, object)
        for place in np.flatnonzero(over).tolist():
            current = self._episodes[place].encode(Observation(frame=frames[place])).vector
            vectors[place] = np.concatenate([current, current - self._previous[place]])
        return vectors


def _check_frames(space: gym.Space[Any]) -> None:
    shape = space.shape or ()
    if len(shape) != 3 or shape[2] != 3 or space.dtype != np.uint8:
        raise UsageError(f"a semantic observation needs RGB frames of uint8, got {space}")


def _vector_space(encoder: Encoder) -> gym.spaces.Box:
    return gym.spaces.Box(-np.inf, np.inf, (2 * encoder.space.shape[0],), np.float32)


def _feature_names(encoder: Encoder) -> tuple[str, ...]:
    """Name the numbers of a vector, then their differences; those of an embedding mean nothing by themselves."""
    space = encoder.space
    names = [f"embedding {i}" for i in range(space.shape[0])]
    if space.names:  # the facts stand at the end
        free = [f"free slot {i}" for i in range(space.n_facts - len(space.names))]
        names[space.shape[0] - space.n_facts :] = [*space.names, *free]
    return (*names, *(f"change of {name}" for name in names))


def _check_game(encoder: Encoder, rom: str | None) -> None:
    if encoder.rom and rom and encoder.rom != rom:
        raise UsageError(f"this perception has learned to see {encoder.rom}, not {rom}: train a run on {rom}")


def _check_learned(encoder: Encoder, output: str) -> None:
    """Complain of what cannot be shown, or was not learned."""
    if output not in ("vector", "labels"):
        raise UsageError(f"output must be 'vector' or 'labels', not '{output}'")
    has_vectors = len(encoder.space.shape) == 1
    if encoder.perception is None or (output == "vector" and not has_vectors):
        need = "a vector" if output == "vector" else "objects"
        raise UsageError(f"output '{output}' needs a run whose agent sees {need}; this one's does not")
    ready = encoder.is_fitted if output == "vector" else encoder.perception.clusterer.is_fitted
    if not ready:
        raise UsageError("this perception has not learned to tell objects apart yet: the run needs more decisions")
