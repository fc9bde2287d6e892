import shutil
from dataclasses import replace
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pytest

from semrl.cli.report import main as report
from semrl.core import AgentObservation, Observation, State
from semrl.core.arrays import array_to_json, arrays_to_ragged, unnest
from semrl.core.errors import UsageError
from semrl.core.files import read_arrays
from semrl.evaluation import gallery, sight
from semrl.evaluation import video as filming
from semrl.evaluation.player import load_player
from semrl.evaluation.sight import CLASS_COLOURS
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import DetectionConfig
from semrl.perception.detection.grey import to_grey
from semrl.perception.encoders import ENCODERS
from semrl.report import write_report
from semrl.training import train
from semrl.training.config import from_dict
from semrl.training.loop import Step


def frame_with_ball(row, column):
    frame = np.zeros((168, 168, 3), np.uint8)
    frame[row : row + 6, column : column + 6] = 255
    frame[160:] = 200
    return frame


def step(i=0, ram=None):
    return Step(
        observation=Observation(frame=frame_with_ball(20 + i, 30), ram=ram),
        number=i,
        total=float(-i),
        state=State(vector=np.zeros(4, np.float32), facts=np.zeros(4, np.float32)),
        shown=AgentObservation(vectors=np.zeros((2, 4), np.float32)),
    )


@pytest.fixture
def otsu():
    encoder = ENCODERS.load("components")(PerceptionConfig(otsu=DetectionConfig(threshold_frames=1)))
    encoder.perception.detector.partial_fit(frame_with_ball(20, 30))
    return encoder


@pytest.fixture
def player(otsu, monkeypatch):
    monkeypatch.setattr(filming, "load_player", lambda run: SimpleNamespace(encoder=otsu))


def test_a_film_reads_back_with_its_frames(tmp_path, player):
    video = tmp_path / "film.mp4"
    with filming.recorder(tmp_path, video) as on_step:
        for i in range(12):
            on_step(0, step(i))
        on_step(1, step())
    frames = iio.imread(video, plugin="pyav")
    # 168 px enlarged three times, a gap, and 84 px enlarged five times; a line of text below
    assert frames.shape == (12, 504 + 32, 504 + 24 + 420, 3)
    assert frames[0][:504, :504].max() > 200
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]


def test_an_animated_picture_has_every_few_frames_at_half_the_size(tmp_path, player):
    with filming.recorder(tmp_path, tmp_path / "film.gif") as on_step:
        for i in range(13):
            on_step(0, step(i))
    frames = iio.imread(tmp_path / "film.gif", plugin="pillow")
    every = filming.VIDEO_RATE // filming.GIF_RATE
    assert every > 1 and frames.shape == (-(-13 // every), (504 + 32) // 2, (504 + 24 + 420) // 2, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]


def test_films_end_after_a_minute(tmp_path, player, monkeypatch):
    monkeypatch.setattr(filming, "MAX_VIDEO_FRAMES", 5)
    with filming.recorder(tmp_path, tmp_path / "film.mp4") as on_step:
        for i in range(9):
            on_step(0, step(i))
    assert len(iio.imread(tmp_path / "film.mp4", plugin="pyav")) == 5


def test_no_video_costs_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(filming, "load_player", None)
    with filming.recorder(tmp_path, None) as on_step:
        on_step(0, step())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
@pytest.mark.parametrize("frames", [0, 3])
def test_an_interrupted_film_leaves_the_old_one(tmp_path, player, error, frames):
    video = tmp_path / "film.mp4"
    video.write_bytes(b"old")
    with pytest.raises(error), filming.recorder(tmp_path, video) as on_step:
        for i in range(frames):
            on_step(0, step(i))
        raise error
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]
    assert video.read_bytes() == b"old"


@pytest.mark.parametrize("name", ["film.avi", "film", "nowhere/film.mp4", "folder.mp4"])
def test_places_that_cannot_be_written_are_told_first(tmp_path, name, monkeypatch):
    monkeypatch.setattr(filming, "load_player", None)
    (tmp_path / "folder.mp4").mkdir()
    with pytest.raises(UsageError, match="mp4"), filming.recorder(tmp_path, tmp_path / name):
        raise AssertionError("nothing may be played")


def test_boxes_surround_what_they_mark(otsu):
    _, looked = sight.look(otsu.begin(), step().observation)
    assert [10, 15, 3, 3] in looked.boxes_px.tolist()
    assert looked.labels[11, 16] == 1 and looked.labels[5, 5] == 0
    picture = filming.compose(otsu.space, step(), looked)
    bright = frame_with_ball(20, 30).max(axis=2).repeat(3, 0).repeat(3, 1) > 0
    blue = (picture[:504, :504] == CLASS_COLOURS[0]).all(axis=2)
    assert blue[57:60, 90:108].any() and not blue[100:400].any()  # just above the ball, and nowhere else
    assert (picture[:504, :504][bright & ~blue].max(axis=1) > 0).all()


def filmed(encoder, shown):
    state, seen = sight.look(encoder.begin(), shown.observation)
    return filming.compose(encoder.space, replace(shown, state=state), seen)


def test_other_encoders_can_be_filmed():
    grey = filmed(ENCODERS.load("grey")(PerceptionConfig()), step())
    ram = filmed(ENCODERS.load("ram")(PerceptionConfig(), rom="pong"), step(ram=np.arange(128, dtype=np.uint8)))
    blind = filmed(ENCODERS.load("classes")(PerceptionConfig()), step())  # nothing learned yet
    assert grey.shape == ram.shape == blind.shape
    assert all(side % 2 == 0 for side in grey.shape[:2])
    assert ram[:100, 528:].any()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A real run of a few seconds, perception and all."""
    config = {
        "model": "semantic",
        "env": "semrl/Catch-v0",
        "decisions": 300,
        "perception": {"embedder": "hashed", "otsu": {"threshold_frames": 3}},
        "stability": {"batches": 5, "max_batches": 30},
    }
    path = tmp_path_factory.mktemp("runs") / "catch"
    train(path, from_dict(config, source="test"))
    return path


@pytest.fixture(autouse=True)
def few_decisions(monkeypatch):
    monkeypatch.setattr(gallery, "GALLERY_DECISIONS", 200)


def test_a_gallery_holds_what_perception_saw(run):
    arrays = read_arrays(gallery.save_gallery(run, seed=3))
    n = gallery.GALLERY_SAMPLES
    assert arrays["frames"].shape == (n, 168, 168, 3) and arrays["greys"].shape == (n, 84, 84)
    assert all(np.array_equal(to_grey(f), g) for f, g in zip(arrays["frames"], arrays["greys"], strict=True))
    boxes, classes, edges = (arrays_to_ragged(unnest(arrays, name)) for name in ("boxes", "classes", "edges"))
    for box, kind, edge in zip(boxes, classes, edges, strict=True):
        assert len(box) == len(kind) > 0
        assert edge.max(initial=-1) < len(box)
        assert np.isin(kind, arrays["class_numbers"]).all()
    # walls, ball and paddle are there in every frame
    assert arrays["class_counts"].sum() >= 3 * array_to_json(arrays["meta"])["played"]
    assert arrays["centres"].shape == (len(arrays["class_numbers"]), 8, 8)
    assert arrays["n_clusters"] >= len(arrays["class_numbers"])
    assert arrays["vectors"].shape[0] == n and array_to_json(arrays["meta"])["encoder"] == "scene"
    assert 0 < arrays["explained_variance_ratio"].sum() <= 1 + 1e-9
    assert 0 <= arrays["threshold"] < 255


def test_a_gallery_repeats(run):
    first = read_arrays(gallery.save_gallery(run, seed=3))
    second = read_arrays(gallery.save_gallery(run, seed=3))
    assert all(np.array_equal(first[name], second[name]) for name in first)


def test_the_command_makes_gallery_and_page(run, capsys):
    (run / "gallery.npz").unlink(missing_ok=True)
    report([str(run), "--json"])
    assert '"report"' in capsys.readouterr().out
    assert (run / "gallery.npz").exists()
    assert "Kinds of objects" in (run / "report.html").read_text()


def test_a_gallery_of_images_holds_what_is_shown(baseline_run, tmp_path):
    run = shutil.copytree(baseline_run, tmp_path / "run")
    arrays = read_arrays(gallery.save_gallery(run, seed=3))
    np.testing.assert_array_equal(arrays["shown"], arrays["greys"])
    assert "vectors" not in arrays and "centres" not in arrays and array_to_json(arrays["meta"])["encoder"] == "grey"


@pytest.mark.parametrize("name", ["objects_run", "tracked_run", "plain_tracked_run"])
def test_a_gallery_of_tracked_objects_holds_their_numbers_and_makes_a_page(request, tmp_path, name):
    """Slots in use have names; without a planner a scene has none, and its vector is shown."""
    run = shutil.copytree(request.getfixturevalue(name), tmp_path / "run")
    space = load_player(run).encoder.space
    arrays = read_arrays(gallery.save_gallery(run, seed=3))
    assert arrays["vectors"].shape == (gallery.GALLERY_SAMPLES, len(space.names) or space.shape[0])
    assert bool(space.names) == (name != "plain_tracked_run") and arrays["vectors"].any()
    learned, pictures = array_to_json(arrays["meta"])["learned"], unnest(arrays, "pictures")
    assert bool(learned) == bool(pictures) == (load_player(run).planning is not None)
    assert all(picture.ndim == 3 and picture.size for picture in pictures.values())
    page = write_report([run], tmp_path / "page.html").read_text()
    assert all(f"{told} " in page for told in space.names)


@pytest.fixture(scope="module")
def plain_tracked_run(tmp_path_factory, tiny):
    path = tmp_path_factory.mktemp("runs") / "plain"
    train(path, tiny(encoder="tracked_scene"))
    return path


def test_slots_are_drawn_with_their_identities(objects_run):
    player = load_player(objects_run)
    encoder, episode = player.encoder, player.encoder.begin()
    for i, step in enumerate(player.episode(0, 0)):
        state, seen = sight.look(episode, step.observation)
        np.testing.assert_array_equal(state.facts, step.state.facts)
        assert (
            len(seen.names) == len(seen.boxes_px) == len(seen.classes) <= len(encoder.perception.slot_assigner.slots_)
        )
        if i > 8:
            break
    assert seen.names and all(name.startswith(("own", "object ")) for name in seen.names)
    picture = filming.compose(encoder.space, step, seen)
    assert picture.dtype == np.uint8 and picture.shape[0] % 2 == picture.shape[1] % 2 == 0
