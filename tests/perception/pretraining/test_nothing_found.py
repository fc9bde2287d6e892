"""Where perception finds nothing, it says in which stage, as soon as that is known, and what to try."""

from dataclasses import replace

import numpy as np
import pytest
from seeing import CONFIG, learn_all, play, schedule_of

from semrl.core import Observation
from semrl.core.errors import UsageError
from semrl.perception.embedding import SceneGraphConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining import stages

SCENERY = replace(CONFIG, scene=SceneGraphConfig(omit_scenery=True, scenery_frames=30))
DARK = np.zeros((84, 84, 3), np.uint8)
GREY = np.full((84, 84, 3), 90, np.uint8)
PICTURE = np.random.default_rng(0).integers(0, 255, (84, 84, 3), np.uint8)
TRACKED, SINGLE = ("objects", "tracked_scene"), ("components", "classes", "scene")


def shown(*frames, n=2500):
    """The same frames again and again; an episode has 200."""
    return [(Observation(frame=frames[t % len(frames)]), None if t % 200 == 0 else 0) for t in range(n)]


def with_square(row, column, frame=DARK, side=6):
    """A frame with a bright square."""
    frame = frame.copy()
    frame[row : row + side, column : column + side] = 255
    return frame


BLINKING_IN_PLACE = [DARK, DARK, with_square(30, 40)]
MOVING = [DARK, DARK, *(with_square(10 + 3 * t, 8 + 2 * t) for t in range(20))]


@pytest.mark.parametrize(
    ("name", "frame"),
    [*((name, DARK) for name in SINGLE), *((name, frame) for name in TRACKED for frame in (DARK, GREY))],
)
def test_frames_of_one_colour_have_no_object(name, frame):
    schedule = schedule_of(ENCODERS.load(name)(CONFIG))
    target = schedule.current.target
    with pytest.raises(UsageError, match=r"the stage 'detection' of perception found no object in .* try ") as told:
        learn_all(schedule, shown(frame))
    assert target + 100 <= schedule.current.batches_ <= 2 * target + 100 and "--model baseline" in str(told.value)


@pytest.mark.parametrize("name", TRACKED)
def test_a_picture_that_stands_still_is_all_background(name):
    with pytest.raises(UsageError, match="the stage 'detection' of perception found no object"):
        learn_all(schedule_of(ENCODERS.load(name)(CONFIG)), shown(PICTURE))


@pytest.mark.parametrize("name", TRACKED)
def test_what_only_blinks_in_its_place_is_background(name):
    schedule = schedule_of(ENCODERS.load(name)(CONFIG))
    with pytest.raises(UsageError, match="the stage 'detection' of perception found no object in 150 frames"):
        learn_all(schedule, shown(*BLINKING_IN_PLACE))


@pytest.mark.parametrize("frames", [[with_square(30, 40)], [with_square(3, 8, with_square(60, 40))]])
def test_scenes_without_scenery_need_something_that_moves(frames):
    schedule = schedule_of(ENCODERS.load("scene")(SCENERY))
    with pytest.raises(UsageError, match="'scenery' of perception found no kind of object that moves in 30 frames"):
        learn_all(schedule, shown(*frames))


@pytest.mark.parametrize("name", [*TRACKED, *SINGLE])
def test_what_moves_is_found_all_the_same(name):
    encoder = ENCODERS.load(name)(SCENERY if name == "scene" else CONFIG)
    schedule = schedule_of(encoder)
    learn_all(schedule, shown(*MOVING))
    assert schedule.current is None and encoder.is_fitted


def test_detection_waits_for_the_first_object():
    schedule = schedule_of(ENCODERS.load("classes")(CONFIG))
    detection = schedule.current
    names = learn_all(schedule, [*shown(DARK, n=detection.target + 60), *shown(*MOVING[2:], n=1)])
    assert names == ["detection"] * (detection.target + 61) and schedule.current is not detection


@pytest.mark.parametrize("stage", ["reduction", "clustering"])
def test_objects_that_never_come_again_are_not_waited_for(stage, monkeypatch):
    monkeypatch.setattr(stages, "MOST_EMPTY_FRAMES", 150)
    schedule, steps = schedule_of(ENCODERS.load("objects")(CONFIG)), iter(shown(*MOVING))
    while schedule.current.name != stage:
        learn_all(schedule, [next(steps)])
    with pytest.raises(UsageError, match=f"the stage '{stage}' of perception found no object in 150 frames"):
        learn_all(schedule, shown(DARK))


def test_a_clusterer_without_a_class_is_told(monkeypatch):
    encoder = ENCODERS.load("classes")(CONFIG)
    monkeypatch.setattr(type(encoder.perception.clusterer), "n_clusters_", 0)
    with pytest.raises(UsageError, match="the stage 'clustering' of perception found no class of objects"):
        learn_all(schedule_of(encoder), play(600))


@pytest.mark.parametrize("decisions", [20, 40, 200])
@pytest.mark.parametrize("model", ["objects", "objects-map", "otsu", "semantic"])
def test_a_run_that_sees_nothing_is_refused_at_the_end_of_its_budget_at_the_latest(
    model, decisions, call, tiny_toml, tmp_path
):
    dark = tiny_toml(model, env="semrl-tests/Dark-v0", decisions=decisions)
    told = call("train", "--run", tmp_path / "run", "--config", dark)
    assert told.status == 2 and "the stage 'detection' of perception found no object in" in told.message
    assert '"failed"' in (tmp_path / "run" / "manifest.json").read_text()


@pytest.mark.parametrize("decisions", [5, 20])
def test_a_budget_too_small_to_see_is_said_and_no_evaluation_is_proposed(decisions, call, tiny_toml, tmp_path):
    told = call("train", "--run", tmp_path / "run", "--config", tiny_toml("objects", decisions=decisions))
    assert told.status == 0 and "ended in the stage" in told.err and "semrl eval" not in told.out + told.err
    whole = call("train", "--run", tmp_path / "whole", "--config", tiny_toml("objects"))
    assert whole.status == 0 and "ended in the stage" not in whole.err and "semrl eval" in whole.out + whole.err


def test_stored_play_that_shows_nothing_is_refused_as_well(call, tiny_toml, tmp_path):
    dark = tiny_toml("objects", env="semrl-tests/Dark-v0", stability__decisions=30)
    told = call("train", "--run", tmp_path / "run", "--config", dark)
    assert told.status == 2 and "the stage 'detection' of perception found no object in" in told.message
