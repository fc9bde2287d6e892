"""Actions of every discrete kind: the environment receives its own, names are strings and differ."""

import enum

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, action_meanings, make_env

EVERY_FRAME = EnvironmentConfig(frame_skip=1)
FRAME = np.zeros((4, 4, 3), np.uint8)


class Listening(gym.Env):
    """Keeps what it is told to do, which must lie in its space."""

    observation_space = spaces.Box(0, 255, (4, 4, 3), np.uint8)

    def __init__(self, space, names=None):
        self.action_space, self.told = space, []
        if names is not None:
            self.get_action_meanings = lambda: names

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return FRAME, {}

    def step(self, action):
        assert self.action_space.contains(action), action
        self.told.append(action)
        return FRAME, 0.0, False, False, {}


class Compass(enum.Enum):
    NORTH = "n"
    SOUTH = "s"


class Keys(enum.IntEnum):
    LEFT = 0
    RIGHT = 1


def told_by(space, config=EVERY_FRAME, names=None):
    """Take every action of an environment; return what it was told to do."""
    env = make_env(Listening(space, names), config)
    env.reset(seed=0)
    for action in range(env.action_space.n):
        env.step(action)
    return env.unwrapped.told


@pytest.mark.parametrize("start", [-1, 0, 1, 7])
@pytest.mark.parametrize("n", [1, 3])
def test_the_environment_receives_its_own_numbers(start, n):
    space = spaces.Discrete(n, start=start)
    assert told_by(space) == list(range(start, start + n))
    assert action_meanings(make_env(Listening(space))) == [str(start + i) for i in range(n)]


def test_an_environment_of_other_numbers_waits_as_it_does():
    env = make_env(
        Listening(spaces.Discrete(3, start=5), ["UP", "NOOP", "DOWN"]), EnvironmentConfig(frame_skip=1, max_noops=9)
    )
    for seed in range(20):
        env.reset(seed=seed)
    assert set(env.unwrapped.told) == {6}


def test_chosen_actions_of_other_numbers():
    config = EnvironmentConfig(frame_skip=1, actions=("C", "A"))
    env = make_env(Listening(spaces.Discrete(3, start=-1), ["A", "B", "C"]), config)
    assert action_meanings(env) == ["C", "A"]
    assert told_by(spaces.Discrete(3, start=-1), config, ["A", "B", "C"]) == [1, -1]


@pytest.mark.parametrize(
    "space",
    [
        spaces.MultiDiscrete([3, 2]),
        spaces.MultiDiscrete([2, 2, 3]),
        spaces.MultiDiscrete([[2, 3], [1, 2]]),
        spaces.MultiDiscrete([3, 2], start=[-1, 4]),
        spaces.MultiBinary(2),
        spaces.MultiBinary((2, 2)),
        spaces.MultiBinary(1),
    ],
)
def test_every_combination_of_choices_is_one_action(space):
    told = told_by(space)
    different = {action.tobytes() for action in told}
    sizes = space.nvec if isinstance(space, spaces.MultiDiscrete) else np.full(space.shape, 2)
    assert len(told) == len(different) == np.prod(sizes)
    assert len(set(action_meanings(make_env(Listening(space))))) == len(told)


def test_names_of_combinations_are_the_choices():
    assert action_meanings(make_env(Listening(spaces.MultiDiscrete([2, 2])))) == ["0,0", "0,1", "1,0", "1,1"]


def test_an_action_cannot_be_changed_by_the_environment():
    class Rough(Listening):
        def step(self, action):
            result = super().step(action.copy())
            action[:] = 9
            return result

    env = make_env(Rough(spaces.MultiBinary(2)), EVERY_FRAME)
    env.reset(seed=0)
    for _ in range(2):
        env.step(3)
    assert [told.tolist() for told in env.unwrapped.told] == [[1, 1], [1, 1]]


@pytest.mark.parametrize("space", [spaces.MultiBinary(11), spaces.MultiDiscrete([100] * 30)])
def test_too_many_combinations_are_refused(space):
    with pytest.raises(UsageError, match=r"Listening has [\d,]+ combinations of actions, more than 1,024"):
        make_env(Listening(space))


@pytest.mark.parametrize(
    "space", [spaces.Box(-1, 1, (2,), np.float32), spaces.Dict(a=spaces.Discrete(2)), spaces.Tuple([])]
)
def test_what_is_not_discrete_is_refused(space):
    with pytest.raises(UsageError, match=r"Listening has actions .*; only discrete ones can be learned"):
        make_env(Listening(space))


@pytest.mark.parametrize(
    ("given", "names"),
    [
        (["A", "B"], ["A", "B"]),
        ([10, 20], ["10", "20"]),
        ({0: "L", 1: "R"}, ["L", "R"]),
        (list(Compass), ["NORTH", "SOUTH"]),
        (list(Keys), ["LEFT", "RIGHT"]),
        (("A", "A"), ["A (0)", "A (1)"]),
        (["", "日 <&\n"], [" (0)", "日 <&\n"]),
        (["only one"], ["0", "1"]),
        (None, ["0", "1"]),
    ],
)
def test_names_of_any_kind_are_strings_that_differ(given, names):
    assert action_meanings(make_env(Listening(spaces.Discrete(2), given))) == names


class Button:
    """Has a name, as a member of an enumeration that was made in C++."""

    def __init__(self, name):
        self.name = name


class Console:
    """Tells its buttons, as ViZDoom's games do."""

    def get_available_buttons(self):
        return [Button("LEFT"), Button("FIRE")]


@pytest.mark.parametrize(
    ("space", "names"),
    [
        (spaces.MultiBinary(2), ["NOOP", "FIRE", "LEFT", "LEFT+FIRE"]),
        (spaces.MultiDiscrete([2, 2]), ["NOOP", "FIRE", "LEFT", "LEFT+FIRE"]),
        (spaces.MultiBinary(1), ["0", "1"]),
        (spaces.Discrete(3), ["NOOP", "FIRE", "LEFT"]),
    ],
)
def test_combinations_of_buttons_have_their_names(space, names):
    env = Listening(space)
    env.game = Console()
    if isinstance(space, spaces.Discrete):
        env.button_map = [(0, 0), (0, 1), (1, 0)]
    assert action_meanings(make_env(env)) == names


def test_an_enumeration_of_actions_gives_names():
    env = Listening(spaces.Discrete(2))
    env.actions = Keys
    assert action_meanings(make_env(env)) == ["LEFT", "RIGHT"]
