"""The six steps together: they repeat themselves, go on where they stopped, and beat random play on Catch."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from semrl.core.arrays import digest
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import read_arrays
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl_thesis.world_models import (
    ControllerConfig,
    DreamConfig,
    MDNRNNConfig,
    VAEConfig,
    WorldModels,
    WorldModelsConfig,
)
from semrl_thesis.world_models.play import arrays_to_rollouts, frames_of, random_rollouts, rollouts_to_arrays

pytest.importorskip("cma")

TINY = WorldModelsConfig(
    env="semrl/Catch-v0",
    decisions=60,
    vae_frames=20,
    test_episodes=2,
    vae=VAEConfig(latent_size=3, channels=(2, 2, 4, 4), updates=3, batch_size=4),
    mdn_rnn=MDNRNNConfig(hidden_size=4, mixtures=2, updates=3, batch_size=4),
    controller=ControllerConfig(population=4, generations=2, dreams=2),
    dream=DreamConfig(horizon_decisions=5, starts=10),
)
FILES = ("rollouts", "vae", "latents", "mdn_rnn", "controller", "test")


def contents(folder):
    """The digest of each file, but for the times."""
    told = {}
    for name in FILES:
        arrays = read_arrays(folder / f"{name}.npz")
        assert arrays.pop("seconds") >= 0
        told[name] = digest(arrays)
    return told


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    return folder, WorldModels(TINY, folder).run()


def test_all_steps_are_done_within_the_budget(finished):
    folder, told = finished
    assert told["decisions"] == 60 == sum(len(one.actions) for one in WorldModels(TINY, folder).rollouts)
    assert set(told["seconds"]) == set(FILES)
    for name in ("returns", "random_returns"):
        assert len(told[name]) == 2
        assert all(abs(one) <= 5 and one == int(one) for one in told[name])
    assert json.loads(json.dumps(told)) == told


def test_same_seed_same_files_and_another_seed_others(finished, tmp_path):
    folder, told = finished
    again = WorldModels(TINY, tmp_path / "again").run()
    assert contents(tmp_path / "again") == contents(folder)
    assert again["returns"] == told["returns"]
    WorldModels(replace(TINY, seed=1), tmp_path / "other").run()
    other, first = contents(tmp_path / "other"), contents(folder)
    assert all(other[name] != first[name] for name in FILES)


@pytest.mark.parametrize("kept", range(len(FILES)))
def test_what_was_stopped_goes_on(finished, tmp_path, kept):
    folder, _ = finished
    said = []
    for name in FILES[:kept]:
        (tmp_path / f"{name}.npz").write_bytes((folder / f"{name}.npz").read_bytes())
    WorldModels(TINY, tmp_path, said.append).run()
    assert said == [f"{name} …" for name in FILES[kept:]]
    assert contents(tmp_path) == contents(folder)


def test_a_folder_belongs_to_one_configuration(finished):
    folder, _ = finished
    with pytest.raises(UsageError, match="another configuration"):
        WorldModels(replace(TINY, decisions=61), folder)
    assert json.loads((folder / "config.json").read_text()) == json.loads(json.dumps(asdict(TINY)))


def test_a_damaged_file_is_named(finished, tmp_path):
    folder, _ = finished
    for name in FILES:
        (tmp_path / f"{name}.npz").write_bytes((folder / f"{name}.npz").read_bytes())
    (tmp_path / "vae.npz").write_bytes(b"PK nothing")
    with pytest.raises(SemrlError, match=r"vae\.npz is damaged"):
        WorldModels(TINY, tmp_path).run()


@pytest.mark.parametrize("decisions", [1, 44, 45, 100])
def test_rollouts_play_the_budget_and_can_be_played_again(decisions):
    def new_game():
        return Game(make_env("semrl/Catch-v0", EnvironmentConfig()), 3)

    seen = {}
    rollouts = random_rollouts(new_game(), decisions, 5, lambda i, frame: seen.update({i: frame}))
    assert list(seen) == list(range(decisions))
    assert [len(one.actions) for one in rollouts] == [45] * (decisions // 45) + [decisions % 45] * (decisions % 45 > 0)
    assert [one.terminated for one in rollouts] == [len(one.actions) == 45 for one in rollouts]
    again = arrays_to_rollouts(rollouts_to_arrays(rollouts))
    last = frames_of(new_game(), again[-1])
    assert last.shape == (len(rollouts[-1].actions) + 1, 64, 64, 3)
    # A frame of Catch is twice the 84 px image: its mean brightness outlasts scaling by area.
    assert last[-1].mean() == pytest.approx(seen[decisions - 1].mean(), abs=0.5)
    for one, other in zip(rollouts, again, strict=True):
        np.testing.assert_array_equal(one.rewards, other.rewards)


@pytest.mark.parametrize("wrong", [{"decisions": 0}, {"vae_frames": 0}, {"test_episodes": 0}])
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(UsageError):
        WorldModelsConfig(**wrong)


@pytest.mark.slow
def test_catch_is_learned_in_a_dream(tmp_path):
    sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
    from world_models import configure

    told = WorldModels(configure("catch", decisions=5000, seed=0, episodes=30), tmp_path).run()
    assert told["vae_error"] < 0.6 * told["mean_image_error"]
    assert told["dreamt"][1] > told["dreamt"][0]
    assert np.mean(told["returns"]) > np.mean(told["random_returns"]) + 1.5
