"""A state has room for as many things as move at once, as far as random play shows."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from stopping import stopped

from semrl import SemanticEnv, preset
from semrl.envs import make_env
from semrl.evaluation import load_player
from semrl.perception.tracking import SlotAssigner, SlotAssignerConfig
from semrl.training import RunFolder, train
from semrl.training.crowd import needed_slots, with_room

SIDE, PERIOD = 84, 78
QUICK = {
    "decisions": 130,
    "stability": {"decisions": 100},
    "perception": {"foreground": {"background_frames": 60}, "slot_assigner": {"frames": 60}},
}


class Crowd(gym.Env):
    """So many squares drive in rows of their own, each at its speed; one of them is steered."""

    cars = 10

    def __init__(self):
        self.observation_space = gym.spaces.Box(0, 255, (SIDE, SIDE, 3), np.uint8)
        self.action_space = gym.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.begins = self.np_random.integers(PERIOD, size=self.cars + 1)
        self.time, self.steered = 0, 0
        return self._frame(), {}

    def step(self, action):
        self.time += 1
        self.steered += action - 1
        return self._frame(), 0.0, self.time >= 200, False, {}

    def _frame(self):
        frame = np.zeros((SIDE, SIDE, 3), np.uint8)
        gone = self.time * (1 + np.arange(self.cars + 1) % 2) // 4  # one or two pixels a decision
        gone[0] = self.steered
        for row, column in enumerate(((self.begins + gone) % PERIOD).tolist()):
            frame[2 + 7 * row : 6 + 7 * row, column : column + 5] = 90 + 15 * row
        return frame


class Few(Crowd):
    """Three of them."""

    cars = 2


class Many(Crowd):
    """Twelve of them, which fill the frame."""

    cars = 11


@pytest.fixture(scope="module", autouse=True)
def known():
    ids = {world: f"crowd/{world.__name__}-v0" for world in (Crowd, Few, Many)}
    for world, env_id in ids.items():
        gym.register(env_id, world)
    yield ids
    for env_id in ids.values():
        del gym.registry[env_id]


def wanted(name, **settings):
    return preset("semrl", "objects-map", {"env": f"crowd/{name}-v0", **QUICK, **settings})


def counted(config):
    env = make_env(config.env, config.environment)
    slots = needed_slots(config, env, game_seed=1, seed=2)
    env.close()
    return slots


def test_slots_are_one_more_than_things_that_mostly_move_at_once():
    few, crowd, many = (counted(wanted(name)) for name in ("Few", "Crowd", "Many"))
    assert few == 8 and crowd in (11, 12) and many == 12  # who has come in just now is not counted yet


def test_what_is_asked_for_is_given_and_nothing_is_counted_elsewhere():
    config = wanted("Crowd")
    assert needed_slots(preset("semrl", "ram-map"), None, game_seed=0, seed=0) == 8
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semrl.training.crowd.learn_from_random_play", None)  # not called
        for perception, slots in ((with_room(config.perception, 3), 3), (with_room(config.perception, 30), 30)):
            assert needed_slots(replace(config, perception=perception), None, game_seed=0, seed=0) == slots


def test_where_nobody_counts_there_are_eight():
    assert SlotAssigner(SlotAssignerConfig(slots=0)).dimension == 3 * 8 == SlotAssigner().dimension


def test_a_run_notes_its_slots_and_is_resumed_and_played_with_them(tmp_path):
    looked = []
    stopped(tmp_path / "run", wanted("Many"), 115)
    assert RunFolder.open(tmp_path / "run").manifest()["environment"]["slots"] == 12
    train(tmp_path / "run", looking=lambda: looked.append("again"))
    train(tmp_path / "whole", wanted("Many"), looking=lambda: looked.append("at first"))
    assert looked == ["at first"]
    hashes = [RunFolder.open(tmp_path / name).manifest()["hashes"]["state"] for name in ("run", "whole")]
    assert hashes[0] == hashes[1]
    player = load_player(tmp_path / "run")
    assert player.encoder.space.n_facts == 36 == player.planning.dimension
    assert len(player.encoder.perception.slot_assigner.slots_) == 12


def test_trees_learn_from_as_many_things_with_their_sizes(tmp_path):
    config = wanted("Many")
    slots = replace(config.perception.slot_assigner, sizes=True)
    train(tmp_path / "run", replace(config, perception=replace(config.perception, slot_assigner=slots)))
    assert load_player(tmp_path / "run").encoder.space.n_facts == 5 * 12


def test_an_environment_of_symbols_has_room_as_well():
    config = wanted("Many")
    env = SemanticEnv(make_env(config.env, config.environment), config)
    assert env.observation_space["state"].shape == (2 * 36,)
    env.close()
