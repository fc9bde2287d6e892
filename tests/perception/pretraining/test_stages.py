"""Perception learns one thing after the other (§3.2.3)."""

from dataclasses import replace

import numpy as np
import pytest
from seeing import BLACK, encoded, learn_all, play, schedule_of

from semrl.core.arrays import Arrays, digest
from semrl.perception.clustering import BirchConfig
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import ForegroundConfig
from semrl.perception.embedding import HashedEmbeddingConfig, OnlineEmbeddingConfig, SceneGraphConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.tracking import SlotAssignerConfig

HASHED = PerceptionConfig(
    embedder="hashed",
    hashed=HashedEmbeddingConfig(dimension=32),
    foreground=ForegroundConfig(background_frames=50),
    slot_assigner=SlotAssignerConfig(frames=30),
)
# With the thesis's wide threshold a ball may be of one kind with pieces of the wall.
SCENERY = replace(
    HASHED, birch=BirchConfig(threshold=0.25), scene=SceneGraphConfig(omit_scenery=True, scenery_frames=30)
)
QUICK = StabilityConfig(batches=20)
SHOWN = play(1200)


class Album:
    """An embedding that needs eight scenes and only counts them."""

    documents_needed = 8
    dimension = 1

    def __init__(self):
        self.fits_ = []

    def fit(self, graphs):
        self.fits_.append(list(graphs))
        return self

    def transform(self, graph):
        return np.array([len(graph)], np.float32)

    def to_arrays(self) -> Arrays:
        return {"scenes": np.array([len(fit) for fit in self.fits_], dtype=np.int64)}

    def from_arrays(self, arrays: Arrays) -> None:
        self.fits_ = [[None] * n for n in arrays["scenes"].tolist()]


def new(name, config=HASHED):
    return ENCODERS.load(name)(config)


def album_encoder(config=HASHED, name="scene"):
    encoder = new(name, config)
    encoder.perception._embedder = Album()
    return encoder


@pytest.mark.parametrize(
    ("name", "stages"),
    [
        ("grey", []),
        ("components", ["detection"]),
        ("classes", ["detection", "reduction", "clustering"]),
        ("scene", ["detection", "reduction", "clustering"]),
        ("objects", ["detection", "reduction", "clustering", "roles"]),
        ("tracked_scene", ["detection", "reduction", "clustering", "roles"]),
    ],
)
def test_an_encoder_learns_what_it_needs_in_order(name, stages):
    encoder = new(name)
    schedule = schedule_of(encoder, QUICK)
    assert [stage.name for stage in schedule.stages] == stages and not schedule.stores_play
    names = learn_all(schedule, SHOWN)
    assert schedule.current is None and encoder.is_fitted
    assert list(dict.fromkeys(names)) == stages and names == sorted(names, key=stages.index)
    assert not stages or names.count(stages[0]) == 50
    assert [stage.batches_ for stage in schedule.stages] == [names.count(name) for name in stages]


def test_ram_learns_nothing():
    assert schedule_of(ENCODERS.load("ram")(HASHED, rom="pong"), QUICK).current is None


def test_play_is_stored_only_where_there_is_something_to_learn():
    stored = replace(QUICK, decisions=30)
    schedule = schedule_of(new("classes"), stored)
    assert [stage.name for stage in schedule.stages] == ["play", "detection", "reduction", "clustering"]
    assert schedule.stores_play and not schedule.uses_stored_play and schedule.stages[0].target == 30
    assert learn_all(schedule, SHOWN[:30]) == ["play"] * 30 and schedule.uses_stored_play
    schedule = schedule_of(new("grey"), stored)
    assert not schedule.stores_play and schedule.current is None


def test_an_embedding_that_needs_scenes_gets_them_once_all_together():
    encoder = album_encoder()
    schedule = schedule_of(encoder, QUICK)
    names = learn_all(schedule, SHOWN)
    assert names[-8:] == ["embedding"] * 8 and names.count("embedding") == 8
    assert schedule.stages[-1].target == 8
    (scenes,) = encoder.perception.embedder.fits_
    shown = SHOWN[len(names) - 8 : len(names)]
    states = encoded(encoder, [observation for observation, _ in shown])
    assert [state.vector.tolist() for state in states] == [[len(scene)] for scene in scenes]


def test_scenery_is_learned_after_classes_and_before_the_embedding():
    encoder = album_encoder(SCENERY)
    schedule = schedule_of(encoder, QUICK)
    names = learn_all(schedule, SHOWN)
    assert list(dict.fromkeys(names)) == ["detection", "reduction", "clustering", "scenery", "embedding"]
    assert names.count("scenery") == schedule.stages[3].target == encoder.perception.scenery.frames_ == 30
    assert schedule.stages[3].measured() == {}
    plain = schedule_of(new("scene", replace(SCENERY, scene=SceneGraphConfig())), QUICK)
    assert learn_all(plain, SHOWN) == [name for name in names if name not in ("scenery", "embedding")]
    assert "scenery" not in [stage.name for stage in schedule_of(new("classes", SCENERY), QUICK).stages]


def test_scenes_leave_out_what_stood_still():
    """In Catch two walls do; the ball and the paddle, in two pieces, are left."""
    encoder = album_encoder(SCENERY)
    names = learn_all(schedule_of(encoder, QUICK), SHOWN)
    seen = encoder.perception
    (learned,) = seen.embedder.fits_
    for observation, _ in SHOWN[len(names) :][:30]:
        scene, objects = seen.scene(observation), seen.objects(observation)
        is_wall = (objects.boxes_px[:, 1] == 0) | (objects.boxes_px[:, 1] + objects.boxes_px[:, 3] == 84)
        assert is_wall.sum() > 10 and 1 < len(scene) < 5
        np.testing.assert_array_equal(scene.centres_px, objects.centres_px[~is_wall])
        np.testing.assert_array_equal(scene.classes, seen.classes(objects)[~is_wall])
        assert not np.isin(scene.classes, seen.scenery.still_).any()
    assert all(1 < len(scene) < 5 for scene in learned)  # the embedding learns from such scenes as well


def test_pca_and_birch_stop_at_the_first_stable_value():
    schedule = schedule_of(new("classes"), QUICK)
    learn_all(schedule, SHOWN)
    _, pca, birch = schedule.stages
    for stage in (pca, birch):
        # PCA waits for its first ten different objects, and a batch later there is something to compare.
        assert 0 < len(stage.test.values_) <= stage.batches_ - QUICK.batches
    assert len(birch.test.values_) == birch.batches_ - QUICK.batches
    assert all(value >= 0.05 for value in pca.test.values_[:-1]) and pca.test.values_[-1] < 0.05
    assert all(value <= 0.95 for value in birch.test.values_[:-1]) and birch.test.values_[-1] > 0.95


def test_each_stage_leaves_the_others_alone():
    encoder = album_encoder()
    schedule = schedule_of(encoder, QUICK)
    boxes = {
        "detection": encoder.perception.detector,
        "reduction": encoder.perception.reducer,
        "clustering": encoder.perception.clusterer,
        "embedding": encoder.perception.embedder,
    }
    for observation, action in SHOWN:
        if schedule.current is None:
            break
        before = {name: digest(box.to_arrays()) for name, box in boxes.items()}
        stage = schedule.learn(observation, action).name
        changed = {name for name, box in boxes.items() if digest(box.to_arrays()) != before[name]}
        assert changed <= {stage}


def test_instability_ends_at_the_limit():
    never = StabilityConfig(batches=5, max_difference=0.0, min_agreement=1.0, max_batches=12)
    schedule = schedule_of(new("classes"), never)
    names = learn_all(schedule, SHOWN[:500])
    assert (names.count("reduction"), names.count("clustering")) == (12, 12)


def test_frames_without_objects_do_no_harm():
    schedule = schedule_of(new("classes"), QUICK)
    shown = SHOWN[:600]
    for observation, action in shown[:50]:
        schedule.learn(observation, action)
    for observation, action in shown[50:]:
        for shown_now in (BLACK, observation):
            if schedule.current is not None:
                schedule.learn(shown_now, action)
    assert schedule.current is None
    for stage in schedule.stages[1:]:
        assert len(stage.test.values_) <= stage.batches_ // 2 - QUICK.batches + 1  # black frames were no batches


def test_the_limit_ends_no_stage_that_has_seen_too_little_to_go_on_with():
    schedule = schedule_of(new("classes"), replace(QUICK, max_batches=5))
    shown = SHOWN[:100]
    learn_all(schedule, shown[: schedule.stages[0].target])
    for _ in range(8):
        assert schedule.learn(BLACK, 0).name == "reduction"
    learn_all(schedule, shown)
    assert schedule.current is None


def test_what_there_is_to_tell():
    schedule = schedule_of(new("classes"), QUICK)
    threshold, pca, birch = schedule.stages
    assert pca.measured() == {} and threshold.measured() == {}
    learn_all(schedule, SHOWN)
    assert pca.measured() == {"stability": pca.test.values_[-1]}
    assert birch.measured() == {
        "stability": birch.test.values_[-1],
        "clusters": schedule.stages[2].perception.clusterer.n_clusters_,
    }


@pytest.mark.parametrize(
    ("name", "stage"),
    [
        *(("scene", stage) for stage in ("detection", "reduction", "clustering", "scenery", "embedding", "end")),
        *(("tracked_scene", stage) for stage in ("detection", "reduction", "roles", "embedding", "end")),
    ],
)
def test_the_schedule_goes_on_where_it_was(name, stage):
    """Where objects are tracked, in the middle of an episode, whose tracks are saved."""
    shown = SHOWN
    config = SCENERY if stage == "scenery" else HASHED
    straight = album_encoder(config, name)
    schedule = schedule_of(straight, QUICK)
    learned = in_stage = 0
    while schedule.current is not None and in_stage < 5:
        schedule.learn(*shown[learned])
        learned += 1
        in_stage += schedule.current is not None and schedule.current.name == stage

    other = album_encoder(config, name)
    restored = schedule_of(other, QUICK)
    other.from_arrays(straight.to_arrays())
    restored.from_arrays(schedule.to_arrays())
    assert digest(restored.to_arrays()) == digest(schedule.to_arrays())
    assert stage == "end" or (restored.current.name == stage and 0 < restored.current.batches_ <= 5)
    assert learn_all(schedule, shown[learned:]) == learn_all(restored, shown[learned:])
    assert schedule.current is restored.current is None
    assert digest(straight.to_arrays()) == digest(other.to_arrays())
    assert digest(schedule.to_arrays()) == digest(restored.to_arrays())


def test_an_online_embedding_learns_from_scenes_as_they_come():
    online = OnlineEmbeddingConfig(dimension=8, documents=6, buckets=64)
    config = PerceptionConfig(embedder="online", online=online)
    encoder = new("scene", config)
    schedule = schedule_of(encoder, QUICK)
    shown = iter(SHOWN[:900])
    names = learn_all(schedule, shown)
    assert names.count("embedding") == encoder.perception.embedder.documents_ == 6
    assert schedule.current is None
    before = digest(encoder.to_arrays())
    assert encoded(encoder, [next(shown)[0]])[0].vector.shape == (8,)
    assert digest(encoder.to_arrays()) == before


def test_online_learning_goes_on_where_it_was():
    online = OnlineEmbeddingConfig(dimension=8, documents=6, buckets=64)
    config = PerceptionConfig(embedder="online", online=online)
    learned, shown = new("scene", config), SHOWN[:900]
    straight = schedule_of(learned, QUICK)
    used = 0
    while straight.current is None or straight.current.name != "embedding" or straight.current.batches_ < 3:
        straight.learn(*shown[used])
        used += 1
    encoder = new("scene", config)
    encoder.from_arrays(learned.to_arrays())
    resumed = schedule_of(encoder, QUICK)
    resumed.from_arrays(straight.to_arrays())
    for schedule in (straight, resumed):
        learn_all(schedule, shown[used:])
    assert digest(encoder.to_arrays()) == digest(learned.to_arrays())
