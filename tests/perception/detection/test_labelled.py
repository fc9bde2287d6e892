"""Objects that an environment labels: places, classes, and what there is to say where it labels none."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from semrl.core import Labels, Observation
from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig, Game, make_env
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import LabelsConfig, LabelsDetector
from semrl.perception.perception import Perception
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.pretraining.stages import ClustererStage, DetectorStage, ReducerStage

CLASSES = {60: "Medikit", 120: "Imp", 200: "Medikit"}


class Labelled(gym.Env):
    """Three things that drift over a screen of noise, in which nothing but the labels tells them apart.

    With ``named``, values are things, whose classes stand in ``state.labels``, as in ViZDoom; else they are classes.
    """

    observation_space = spaces.Dict(
        {
            "labels": spaces.Box(0, 255, (168, 168, 1), np.uint8),
            "screen": spaces.Box(0, 255, (168, 168, 3), np.uint8),
        }
    )
    action_space = spaces.Discrete(2)

    def __init__(self, *, named=True):
        self.named = named

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self.seen(), {}

    def step(self, action):
        self.t += 1 + int(action)
        return self.seen(), 0.0, self.t >= 100, False, {}

    def seen(self):
        values = np.zeros((168, 168, 1), np.uint8)
        values[:4] = 1  # a floor, which is no object
        boxes = self.boxes()
        for value, (top, left, height, width) in boxes.items():
            values[top : top + height, left : left + width] = value
        if self.named:
            self.state = SimpleNamespace(labels=[SimpleNamespace(value=v, object_name=CLASSES[v]) for v in boxes])
        return {"labels": values, "screen": self.np_random.integers(256, size=(168, 168, 3), dtype=np.uint8)}

    def boxes(self):
        return {60: (10, 4 + self.t, 8, 12), 120: (40 + self.t, 20, 16, 6), 200: (100, 150 - self.t, 8, 12)}


def play(decisions=30, **kwargs):
    game = Game(make_env(Labelled(**kwargs), EnvironmentConfig(frame_skip=1)), 0)
    rng = np.random.default_rng(0)
    return [game.reset()] + [game.step(int(rng.integers(2))).observation for _ in range(decisions)]


def test_objects_are_where_the_environment_says():
    env = Labelled()
    game = Game(make_env(env, EnvironmentConfig(frame_skip=1)), 0)
    game.reset()
    for _ in range(5):
        observation = game.step(1).observation
        objects = LabelsDetector().read(observation)
        exact = np.array([[left, top, left + width, top + height] for top, left, height, width in env.boxes().values()])
        np.testing.assert_array_equal(objects.edges_px, exact / 2)
        for i, (left, top, right, bottom) in enumerate(exact):
            colour = observation.frame[top:bottom, left:right].reshape(-1, 3).mean(0)
            np.testing.assert_allclose(objects.colours[i], colour, rtol=1e-5)
            assert (objects.labels[(top + 1) // 2 : bottom // 2, (left + 1) // 2 : right // 2] == i + 1).all()


def test_the_clusterer_finds_the_classes_of_the_environment_again():
    perception = Perception(PerceptionConfig(detector="labels"))
    shown, config = play(90), StabilityConfig(batches=5)
    for stage in (DetectorStage(perception), ReducerStage(perception, config), ClustererStage(perception, config)):
        assert any(stage.learn(observation, None) for observation in shown)
    medikit, imp, other = perception.classes(perception.objects(shown[20])).tolist()
    assert medikit == other != imp


def test_each_value_is_a_class_where_none_is_named():
    objects = LabelsDetector().read(play(named=False)[3])
    assert len(objects) == 4 and objects.boxes_px[0].tolist() == [0, 0, 2, 84]  # the floor is one
    assert len(np.unique(objects.features, axis=0)) == 4


def test_classes_are_omitted():
    shown = play()[-1]
    assert [
        len(LabelsDetector(LabelsConfig(omit=omit)).read(shown)) for omit in ((), ("Imp",), ("Imp", "Medikit"))
    ] == [
        3,
        1 + 1,
        0,
    ]


def test_no_label_is_no_object():
    frame = np.zeros((50, 60, 3), np.uint8)
    labels = Labels(values=np.full((50, 60), 7, np.uint8), classes={})
    objects = LabelsDetector().read(Observation(frame=frame, labels=labels))
    assert len(objects) == 0 and objects.features.shape == (0, 64) and not objects.labels.any()


@pytest.mark.parametrize(
    ("observation", "complaint"),
    [
        (Observation(frame=np.zeros((50, 60, 3), np.uint8)), "needs labels, and the environment offers none"),
        (
            Observation(frame=np.zeros((50, 60, 3), np.uint8), labels=Labels(values=np.zeros((25, 30), np.uint8))),
            r"labels are of \(25, 30\) pixels, frames of \(50, 60\)",
        ),
    ],
)
def test_what_has_no_labels_is_refused(observation, complaint):
    with pytest.raises(UsageError, match=complaint):
        Perception(PerceptionConfig(detector="labels")).objects(observation)


def test_an_environment_that_labels_nothing_is_refused():
    with pytest.raises(UsageError, match="semrl/Catch-v0 offers no labels"):
        make_env("semrl/Catch-v0", EnvironmentConfig(labels=True))


def test_vizdoom_labels_its_things():
    pytest.importorskip("vizdoom", reason="its extra is not installed")
    env = make_env("VizdoomBasic-v1", EnvironmentConfig(labels=True))
    game = Game(env, 0)
    observation = game.reset()
    assert set(observation.labels.classes.values()) == {"Cacodemon", "DoomPlayer"}
    (monster,) = (thing for thing in env.unwrapped.state.labels if thing.object_name == "Cacodemon")
    objects = LabelsDetector(LabelsConfig(omit=("DoomPlayer",))).read(observation)
    left, top, right, bottom = objects.edges_px[0] * np.array([320, 240, 320, 240]) / 84
    np.testing.assert_allclose(
        [left, top, right - left, bottom - top], [monster.x, monster.y, monster.width, monster.height], atol=1.01
    )
    while not (outcome := game.step(0)).done:
        assert outcome.observation.labels.values.shape == (240, 320)
    assert not len(LabelsDetector().read(outcome.observation))  # no state is left
    env.close()
