"""The six steps of §2.6.1, each kept in a file, so that what was stopped goes on."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch

from semrl.core import Frame
from semrl.core.arrays import Arrays, arrays_to_ragged, nest, unnest
from semrl.core.errors import UsageError
from semrl.core.files import make_folder, read_arrays, write_arrays, write_text
from semrl.core.strict_json import dumps
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl.training.session import limited_threads
from semrl_thesis.world_models.controller import ControllerConfig, LinearController, evolve, parameter_count
from semrl_thesis.world_models.dream import Dream, DreamConfig, moments
from semrl_thesis.world_models.mdn_rnn import MDNRNN, LatentEpisode, MDNRNNConfig
from semrl_thesis.world_models.play import (
    Player,
    Rollout,
    arrays_to_rollouts,
    frames_of,
    game_returns,
    random_rollouts,
    rollouts_to_arrays,
    shrink,
)
from semrl_thesis.world_models.vae import SIDE_PX, VAE, VAEConfig, reconstruction_errors

TEST_SEED = 1_000_000
"""Added to a run's seed for the games of the test."""

CONFIG = "config.json"

STEPS = ("rollouts", "vae", "episodes", "mdn_rnn", "controller")
"""Attributes of `WorldModels`, in the order in which they are made."""


@dataclass(frozen=True, kw_only=True)
class WorldModelsConfig:
    """World Models on one environment."""

    env: str = "PongNoFrameskip-v4"
    """A registered Gymnasium environment whose observations are RGB frames."""
    environment: EnvironmentConfig = field(default_factory=EnvironmentConfig)
    """How it is played."""
    decisions: int = 100_000
    """Budget: decisions of real play at random, from which V and M learn. C learns from none."""
    vae_frames: int = 20_000
    """Frames that V learns from, drawn from all; 12 kB of memory each."""
    test_episodes: int = 30
    """Games of the test, once for C and once at random; not part of the budget."""
    vae: VAEConfig = field(default_factory=VAEConfig)
    """V."""
    mdn_rnn: MDNRNNConfig = field(default_factory=MDNRNNConfig)
    """M."""
    controller: ControllerConfig = field(default_factory=ControllerConfig)
    """C."""
    dream: DreamConfig = field(default_factory=DreamConfig)
    """Where C is tried."""
    seed: int = 0
    """Of everything."""

    def __post_init__(self) -> None:
        if min(self.decisions, self.vae_frames, self.test_episodes) < 1:
            raise UsageError("decisions, vae_frames and test_episodes of World Models must all be 1 or more")


class WorldModels:
    """V, M and C for one environment, trained step by step.

    Parameters
    ----------
    config
        What is done.
    folder
        Where the result of each step is kept, and taken from where it is there already.
    say
        Is told what is being done.

    Raises
    ------
    UsageError
        When the folder belongs to another configuration.
    """

    def __init__(
        self, config: WorldModelsConfig, folder: Path, say: Callable[[str], None] = lambda _text: None
    ) -> None:
        self.config = config
        self.folder = folder
        self.say = say
        self.seconds: dict[str, float] = {}
        """Wall-clock time of each step, whenever it was done."""
        self._claim()

    def run(self) -> dict[str, Any]:
        """Do all steps; return the returns of both tests and what is known of the parts, as JSON can hold it."""
        with limited_threads(1):
            for part in STEPS:  # in this order, so that no step's time holds another's
                getattr(self, part)
            tested = self._step("test", self._test)
        history, vae = read_arrays(self.folder / "controller.npz")["history"], read_arrays(self.folder / "vae.npz")
        return {
            "decisions": self.config.decisions,
            "returns": tested["returns"].tolist(),
            "random_returns": tested["random_returns"].tolist(),
            "dreamt": [float(history[0]), float(history[-1])],
            "vae_error": float(vae["error/vae"]),
            "mean_image_error": float(vae["error/mean_image"]),
            "seconds": self.seconds,
        }

    @cached_property
    def rollouts(self) -> list[Rollout]:
        """Step 1: play at random."""
        return arrays_to_rollouts(self._step("rollouts", self._play_at_random))

    @cached_property
    def vae(self) -> VAE:
        """Step 2: V."""
        vae = VAE(self.config.vae, seed=self.config.seed)
        vae.from_arrays(unnest(self._step("vae", self._train_vae), "weights"))
        return vae

    @cached_property
    def episodes(self) -> list[LatentEpisode]:
        """Step 2, second half: the rollouts as V sees them."""
        arrays = self._step("latents", self._encode)
        parts = [arrays_to_ragged({"values": arrays[name], "lengths": arrays["lengths"]}) for name in ("means", "stds")]
        return [
            LatentEpisode(means=m, stds=s, actions=one.actions, rewards=one.rewards, terminated=one.terminated)
            for m, s, one in zip(*parts, self.rollouts, strict=True)
        ]

    @cached_property
    def mdn_rnn(self) -> MDNRNN:
        """Step 3: M."""
        model = self._new_mdn_rnn()
        model.from_arrays(self._step("mdn_rnn", lambda: self._new_mdn_rnn().fit(self.episodes).to_arrays()))
        return model

    @cached_property
    def controller(self) -> LinearController:
        """Steps 4 and 5: C."""
        controller = LinearController(self._n_features, self._game(0).n_actions)
        controller.from_arrays(self._step("controller", self._evolve))
        return controller

    def player(self) -> Player:
        """Return what plays one real game: it sees a full frame and chooses an action."""
        vae, model, controller = self.vae, self.mdn_rnn, self.controller
        state = model.begin(1)

        def act(frame: Frame) -> int:
            nonlocal state
            mean, _ = vae.encode(shrink(frame)[None])
            action = controller.act(np.concatenate([mean, state[0].numpy()], axis=1))
            _, state = model.step(state, torch.from_numpy(mean), torch.from_numpy(action))
            return int(action[0])

        return act

    def _play_at_random(self) -> Arrays:
        c, rng = self.config, np.random.default_rng(self.config.seed)
        wanted = np.sort(rng.choice(c.decisions, min(c.vae_frames, c.decisions), replace=False))
        rows = dict(zip(wanted.tolist(), range(len(wanted)), strict=True))
        frames = np.empty((len(wanted), SIDE_PX, SIDE_PX, 3), np.uint8)

        def keep(decision: int, frame: Frame) -> None:
            if decision in rows:
                frames[rows[decision]] = shrink(frame)

        rollouts = random_rollouts(self._game(c.seed), c.decisions, c.seed, keep)
        return rollouts_to_arrays(rollouts) | {"frames": frames}

    def _train_vae(self) -> Arrays:
        frames = self._step("rollouts", self._play_at_random)["frames"]
        vae = VAE(self.config.vae, seed=self.config.seed).fit(frames)
        error, mean_image_error = reconstruction_errors(vae, frames)
        return nest(weights=vae.to_arrays(), error={"vae": np.array(error), "mean_image": np.array(mean_image_error)})

    def _encode(self) -> Arrays:
        game = self._game(self.config.seed)
        encoded = [self.vae.encode(frames_of(game, one)) for one in self.rollouts]
        means, stds = zip(*encoded, strict=True)
        lengths = np.array([len(one) for one in means])
        return {"means": np.concatenate(means), "stds": np.concatenate(stds), "lengths": lengths}

    def _evolve(self) -> Arrays:
        c = self.config
        z, state = moments(self.mdn_rnn, self.episodes, c.dream.starts, seed=c.seed)
        dream = Dream(self.mdn_rnn, z, state, c.dream)
        rng = np.random.default_rng(c.seed)
        seeds = rng.integers(2**31, size=c.controller.generations).tolist()  # new dreams for each generation
        n = parameter_count(self._n_features, self.mdn_rnn.n_actions)
        found, history = evolve(
            lambda candidates, i: dream.returns(candidates, c.controller.dreams, seed=seeds[i]),
            n,
            c.controller,
            seed=c.seed,
        )
        return {"parameters": found, "history": history}

    def _test(self) -> Arrays:
        seed, episodes = self.config.seed + TEST_SEED, self.config.test_episodes
        rng = np.random.default_rng(seed)
        game = self._game(seed)
        blind = game_returns(self._game(seed), episodes, lambda: lambda _frame: int(rng.integers(game.n_actions)))
        return {
            "returns": np.array(list(game_returns(game, episodes, self.player))),
            "random_returns": np.array(list(blind)),
        }

    def _step(self, name: str, make: Callable[[], Arrays]) -> Arrays:
        """Return what a step made, from its file where there is one."""
        path = self.folder / f"{name}.npz"
        if not path.exists():
            self.say(f"{name} …")
            began = time.perf_counter()
            made = make()
            write_arrays(path, made | {"seconds": np.array(time.perf_counter() - began)})
        arrays = read_arrays(path)
        self.seconds[name] = float(arrays.pop("seconds"))
        return arrays

    @property
    def _n_features(self) -> int:
        return self.config.vae.latent_size + self.config.mdn_rnn.hidden_size

    def _new_mdn_rnn(self) -> MDNRNN:
        c = self.config
        return MDNRNN(c.mdn_rnn, c.vae.latent_size, self._game(0).n_actions, seed=c.seed)

    def _game(self, seed: int) -> Game:
        return Game(make_env(self.config.env, self.config.environment), seed)

    def _claim(self) -> None:
        """Write the configuration into the folder, or compare it with the one that is there."""
        make_folder(self.folder)
        path, mine = self.folder / CONFIG, dumps(asdict(self.config), indent=2) + "\n"
        if not path.exists():
            write_text(path, mine)
        elif path.read_text(encoding="utf-8") != mine:
            raise UsageError(f"{self.folder} holds World Models of another configuration; choose another folder")
