import json

import numpy as np
import pytest

from semrl.core.arrays import digest, json_to_array
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import write_arrays
from semrl.training import RunConfig, RunFolder, folder
from semrl.training.checkpoint import FORMAT, Checkpoint


def checkpoint(decisions):
    arrays = {
        "decisions": np.array(decisions),
        "agent/x": np.full(3, decisions),
        "agent/replay": np.zeros(9),
        "planning/trees": np.ones(2),
        "planning/experience": np.ones(5),
    }
    playable = frozenset({"decisions", "agent/x", "planning/trees"})
    return Checkpoint(arrays=arrays, metrics_rows=decisions + 1, seconds=0.5, playable=playable)


@pytest.fixture
def run(tmp_path):
    return RunFolder.create(tmp_path / "run", RunConfig(seed=3))


def test_a_new_folder_tells_where_it_comes_from(run, tmp_path):
    assert RunFolder.open(run.path).config() == RunConfig(seed=3)
    manifest = run.manifest()
    assert manifest["status"] == "new" and manifest["format"] == FORMAT and manifest["seed"] == 3
    assert {"python", "semrl", "torch", "numpy", "gymnasium"} <= manifest["versions"].keys()
    assert "unknown" not in manifest["versions"].values()
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_an_existing_path_is_never_touched(run, tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "empty").mkdir()
    for path in (run.path, tmp_path / "file", tmp_path / "empty"):
        with pytest.raises(UsageError, match="exists: go on with it"):
            RunFolder.create(path, RunConfig())
    assert (tmp_path / "file").read_text() == "mine" and run.config().seed == 3


def test_folders_that_cannot_be_made_leave_nothing(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(UsageError, match="cannot make"):
        RunFolder.create(tmp_path / "file" / "run", RunConfig())

    def fail(*_):
        raise SemrlError("cannot write: no space left")

    monkeypatch.setattr(folder, "write_text", fail)
    with pytest.raises(SemrlError, match="no space left"):
        RunFolder.create(tmp_path / "run", RunConfig())
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_is_no_run_is_refused(run, tmp_path):
    with pytest.raises(UsageError, match="there is no run at"):
        RunFolder.open(tmp_path / "none")
    with pytest.raises(UsageError, match="there is no run at"):
        RunFolder.open(run.path / "config.toml")
    with pytest.raises(UsageError, match="only half of one"):
        RunFolder.open(tmp_path)
    for name in ("manifest.json", "config.toml"):
        (run.path / name).rename(tmp_path / name)
        with pytest.raises(UsageError, match="only half of one"):
            RunFolder.open(run.path)


@pytest.mark.parametrize("content", ["", "{", "[]", "\0", '{"format": 1}', '{"status": "new"}'])
def test_a_damaged_manifest_is_refused(run, content):
    run.manifest_path.write_text(content)
    with pytest.raises(UsageError, match=r"manifest\.json is damaged") as caught:
        RunFolder.open(run.path)
    assert "\n" not in str(caught.value)


def test_another_version_is_refused(run):
    run.manifest_path.write_text(json.dumps(run.manifest() | {"format": FORMAT + 1}))
    with pytest.raises(UsageError, match=f"has format {FORMAT + 1}; this semrl reads format {FORMAT}"):
        RunFolder.open(run.path)


def test_the_manifest_is_changed_entry_by_entry(run):
    before = run.manifest()
    run.update_manifest(status="running", hashes={"state": "x"})
    assert run.manifest() == before | {"status": "running", "hashes": {"state": "x"}}


def test_the_newest_checkpoints_are_kept(run):
    assert run.load() is None
    for decisions in (5, 50, 1_000_000):
        run.save(checkpoint(decisions))
    assert [path.name for path in run.checkpoints()] == ["0000000050.npz", "0001000000.npz"]
    loaded = run.load()
    assert digest(loaded.arrays) == digest(checkpoint(1_000_000).arrays)
    assert loaded.metrics_rows == 1_000_001 and loaded.seconds == 0.5
    assert loaded.playable == checkpoint(5).playable


def test_of_a_checkpoint_only_what_play_needs_is_read(run):
    run.save(checkpoint(5))
    assert run.load(play_only=True).arrays.keys() == {"decisions", "agent/x", "planning/trees"}
    both = run.load(play_only=True, memory=True)
    assert both.arrays.keys() == {"decisions", "agent/x", "planning/trees", "planning/experience"}
    np.testing.assert_array_equal(both.arrays["planning/experience"], np.ones(5))


def test_milestones_stay_while_checkpoints_go(run):
    for decisions in (5, 6, 7, 8):
        run.save(checkpoint(decisions))
        if decisions < 7:
            run.save_milestone(checkpoint(decisions))
    assert list(run.milestones()) == [5, 6] and len(run.checkpoints()) == 2
    assert run.load(5, play_only=True).arrays["agent/x"].tolist() == [5, 5, 5]
    with pytest.raises(UsageError, match="has no milestone of decision 7, there are those of decisions 5, 6"):
        run.load(7)


def test_a_damaged_checkpoint_names_the_one_before(run):
    run.save(checkpoint(5))
    last = run.save(checkpoint(50))
    last.write_bytes(last.read_bytes()[:-30])
    with pytest.raises(SemrlError, match=r"0000000050\.npz is damaged.*delete this file to go on from 0000000005\.npz"):
        run.load()
    last.unlink()
    assert run.load().metrics_rows == 6
    only = run.checkpoints()[0]
    only.write_bytes(b"")
    with pytest.raises(SemrlError, match="delete this file to start again"):
        run.load()


@pytest.mark.parametrize("meta", [None, [], {"format": FORMAT}, "text"])
def test_a_checkpoint_without_its_meta_is_refused(run, meta):
    arrays = checkpoint(5).arrays | ({} if meta is None else {"meta": json_to_array(meta)})
    write_arrays(run.path / "checkpoints" / "0000000005.npz", arrays)
    with pytest.raises(SemrlError, match="is no checkpoint"):
        run.load()


def test_a_checkpoint_of_another_version_is_refused(run):
    meta = json_to_array({"format": FORMAT + 1, "metrics_rows": 1, "seconds": 0.0, "playable": []})
    write_arrays(run.path / "checkpoints" / "0000000005.npz", checkpoint(5).arrays | {"meta": meta})
    with pytest.raises(UsageError, match="has format"):
        run.load()


def test_cleaning_removes_what_was_left_half_written(run):
    run.save(checkpoint(5))
    for name in ("manifest.json.tmp", "checkpoints/0000000009.npz.tmp"):
        (run.path / name).write_bytes(b"half")
    before = run.load().metrics_rows
    run.clean()
    assert not list(run.path.rglob("*.tmp")) and run.load().metrics_rows == before
