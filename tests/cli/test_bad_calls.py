"""Every wrong call and every predicted failure: one line, an exit status, and nothing lost."""

import errno
import io
import json
import os
import pickle
import zipfile

import gymnasium as gym
import numpy as np
import pytest

from semrl.cli.arguments import _one_line
from semrl.training import RunFolder, train

CATCH = ("--env", "semrl/Catch-v0")


@pytest.fixture
def new_run(tmp_path, tiny):
    return RunFolder.create(tmp_path / "run", tiny("otsu"))


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ("trian", "unknown command 'trian'; did you mean 'train'?"),
        ("--run", "unknown command '--run'; there are train, eval"),
        ("train --decision 10", "--decision, 10; did you mean --decisions?; see semrl train --help"),
        ("train --dqn.batchsize 3", "Unrecognized options: --dqn.batchsize, 3; did you mean --dqn.batch-size?"),
        ("train --flag", "Unrecognized options: --flag; see semrl train --help"),
        ("train surplus", "surplus"),
        ("train --decisions", "Missing value for argument '--decisions'"),
        ("train --decisions many", "Error parsing --decisions: invalid literal"),
        ("train --seed 1.5", "--seed"),
        ("train --model", "--model"),
        ("train --model sematic", "unknown model 'sematic'; there are baseline, otsu"),
        ("train --preset best", "unknown preset 'best'; there are semrl, thesis"),
        ("train --perception.embedder bert", "there is no 'bert' among the embedders; there are doc2vec"),
        ("train --decisions 0", "decisions must be 1 or more"),
        ("train --decisions -400", "decisions must be 1 or more"),
        ("train --seed -1", "seed must lie between"),
        ("train --threads 0", "threads must lie between"),
        ("train --decisions 100 --milestones 101", "milestones are decisions, 1 to the budget's 100"),
        ("bench --seed -1", "seed must be 0 or more"),
        ("predict RUN --seed -1", "seed 0 or more"),
        ("train --checkpoint-seconds nan", "checkpoint_seconds must be 0 or more"),
        ("train --evaluation.episodes 0", "evaluation.episodes must be 1 or more"),
        ("train --environment.frame-skip 0", "frame_skip must be 1 or more"),
        ("train --perception.hashed.dimension 0", "dimension must be 1 or more"),
        ("train --env NoSuchGame-v0 --run RUN", "unknown environment 'NoSuchGame-v0'"),
        ("train --env PongNoFrameskip-v5 --run RUN", "did you mean PongNoFrameskip-v4?"),
        ("train --env os:Evil-v0 --run RUN", "unknown environment"),
        ("train --env semrl/FourRooms-v0 --model otsu --run RUN", "not RGB frames"),
        ("train --env semrl/FourRooms-v0 --model otsu --run RUN", "not RGB frames"),
        ("train --env semrl/Catch-v0 --model ram --run RUN", "has no mapped RAM"),
        ("train --env semrl/Catch-v0 --model otsu --environment.actions JUMP --run RUN", "has no action JUMP"),
        ("train --config RUN/none.toml", "cannot read"),
        ("train --resume", "--resume needs --run"),
        ("train --resume --run RUN", "there is no run at"),
        ("train --resume --run RUN --seed 3 --decisions=9", "keeps its settings; leave out --seed, --decisions"),
        ("eval", "Missing from semrl eval"),
        ("eval RUN", "there is no run at"),
        ("eval RUN --policy human", "invalid choice 'human'"),
        ("eval RUN --policy planner", "there is no run at"),
        ("eval RUN --decisions 3", "--decisions, 3"),
        ("doctor now", "now"),
        ("report", "report needs the folder"),
        ("report RUN", "there is no run at"),
    ],
)
def test_wrong_calls_cost_one_line(call, tmp_path, argv, said):
    run = tmp_path / "run"
    result = call(*argv.replace("RUN", str(run)).split())
    assert result.status == 2 and result.out == ""
    assert said in result.message
    assert result.err.count("\n") == 1
    assert not run.exists() and list(tmp_path.iterdir()) == []


def test_a_box_becomes_one_line():
    assert _one_line("") == "wrong arguments"
    plain = "  Value error\n -----\n  wrong value\n  of --x.\n -----\n help\n"
    assert _one_line(plain) == "wrong value of --x"
    box = "╭─ Value error ─╮\n│ \x1b[1mwrong\x1b[0m value │\n│ of x. │\n│ ───── │\n│ help │\n╰───────╯\n"
    assert _one_line(box) == "wrong value of x"


def test_a_run_that_exists_is_not_overwritten(call, semantic_run):
    before = (semantic_run / "config.toml").read_bytes()
    result = call("train", *CATCH, "--model", "otsu", "--run", semantic_run)
    assert result.status == 2 and "exists: go on with it" in result.message and result.err.count("\n") == 1
    assert (semantic_run / "config.toml").read_bytes() == before


@pytest.mark.parametrize("command", ["train --resume --run", "eval", "report"])
@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("manifest.json", None, "only half of one"),
        ("config.toml", None, "only half of one"),
        ("manifest.json", '{"format": 1', "is damaged"),
        ("manifest.json", '{"format": 99, "status": "new"}', "has format 99; this semrl reads format 2"),
        ("config.toml", "decisions = ", "is not valid TOML"),
        ("config.toml", "decisoins = 3", "unknown setting 'decisoins'"),
        ("config.toml", 'decisions = "3"', "decisions"),
        ("config.toml", "decisions = -3", "decisions must be 1 or more"),
    ],
)
def test_damaged_runs_are_refused(call, new_run, command, name, content, said):  # noqa: PLR0917
    run = new_run
    (run.path / name).unlink()
    if content is not None:
        (run.path / name).write_text(content)
    result = call(*command.split(), run.path)
    assert result.status == 2 and said in result.message and result.err.count("\n") == 1


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[dqn", "is not valid TOML"),
        ("decision = 3", "unknown setting 'decision'; did you mean 'decisions'?"),
        ("[dqn]\ndouble = 3", "double"),
        ('model = "ramm"', "unknown model 'ramm'"),
        ("decisions = 0", "decisions must be 1 or more"),
    ],
)
def test_damaged_configurations_are_refused(call, tmp_path, content, said):
    path = tmp_path / "mine.toml"
    path.write_text(content)
    result = call("train", "--config", path, "--run", tmp_path / "run")
    assert result.status == 2 and said in result.message and str(path) in result.message
    assert not (tmp_path / "run").exists()


def spoil_flip(path):
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 1
    path.write_bytes(whole)


def spoil_cut(path):
    path.write_bytes(path.read_bytes()[:-1000])


def spoil_empty(path):
    path.write_bytes(b"")


def spoil_pickle(path):
    path.write_bytes(pickle.dumps(Mark(path)))


def spoil_objects(path):
    objects = np.array([Mark(path)], dtype=object)
    inside = io.BytesIO()
    np.lib.format.write_array(inside, objects, allow_pickle=True)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("decisions/more.npy", inside.getvalue())


class Mark:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path.with_name("unpickled")), "w"))


@pytest.fixture(scope="module")
def otsu_hashes(tmp_path_factory, tiny):
    path = tmp_path_factory.mktemp("runs") / "otsu"
    train(path, tiny("otsu", decisions=40))
    return RunFolder.open(path).manifest()["hashes"]


@pytest.mark.parametrize("spoil", [spoil_flip, spoil_cut, spoil_empty, spoil_pickle, spoil_objects])
def test_a_damaged_checkpoint_is_refused_and_the_one_before_goes_on(call, tmp_path, tiny, otsu_hashes, spoil):
    path = tmp_path / "run"
    stop_by_full_disk(path, tiny("otsu", decisions=40, checkpoint_seconds=0.0), after=50)
    before, last = RunFolder.open(path).checkpoints()
    spoil(last)
    playing = [] if spoil is spoil_flip else [["eval", path]]  # what is not needed to play is not read
    for command in (["train", "--resume", "--run", path], *playing):
        result = call(*command)
        assert result.status == 1 and result.err.count("\n") == 1
        assert f"{last.name} is damaged" in result.message and f"go on from {before.name}" in result.message
    assert not list(path.rglob("unpickled"))
    last.unlink()
    assert call("train", "--resume", "--run", path).status == 0
    assert RunFolder.open(path).manifest()["hashes"] == otsu_hashes


def stop_by_full_disk(path, config, after):
    """Train until the disk is full after so many syncs."""
    real, calls = os.fsync, []

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) > after:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(descriptor)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(Exception, match="No space left"):
            train(path, config)


def test_a_full_disk_is_one_line_and_keeps_the_checkpoint(call, tmp_path, tiny_toml, monkeypatch):
    calls = []

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) > 40:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    run = tmp_path / "run"
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        result = call("train", "--config", tiny_toml("otsu", checkpoint_seconds=0.0), "--run", run, "--json")
    assert result.status == 1 and "No space left on device" in result.message and result.out == ""
    assert RunFolder.open(run).load() is not None and not list(run.rglob("*.tmp"))


def test_a_loss_that_is_no_number_is_one_line(call, tmp_path, tiny_toml):
    run = tmp_path / "run"
    settings = tiny_toml("baseline", dqn__learning_rate=1e30)
    result = call("train", "--config", settings, "--run", run, "--json")
    assert result.status == 1 and result.out == ""
    assert "try a smaller --dqn.learning-rate" in result.message
    assert RunFolder.open(run).manifest()["status"] == "failed"


class Liar(gym.Env):
    """Promises images and shows something else after a while."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 20
        return np.zeros((84, 84, 3), np.uint8), {}

    def step(self, action):
        self.left -= 1
        return np.zeros((84, 84, 3), np.uint8 if self.left else np.float64), 0.0, False, False, {}


@pytest.mark.parametrize("model", ["baseline", "otsu", "semantic"])
def test_frames_that_are_no_images_are_one_line(call, tmp_path, tiny_toml, model):
    if "test/Liar-v0" not in gym.registry:
        gym.register("test/Liar-v0", Liar)
    result = call("train", "--config", tiny_toml(model, env="test/Liar-v0"), "--run", tmp_path / "run")
    assert result.status == 2 and "announces frames of uint8" in result.message


def test_too_little_memory_is_one_line(call, tmp_path, tiny_toml):
    run = tmp_path / "run"
    result = call("train", "--config", tiny_toml("baseline", dqn__replay_capacity=1 << 45), "--run", run)
    assert result.status == 1 and "not enough memory" in result.message and result.err.count("\n") == 1
    assert not run.exists()


def test_a_planner_without_a_map_is_one_line(call, tmp_path, semantic_run, tiny):
    result = call("eval", semantic_run, "--policy", "planner", "--json")
    assert result.status == 2 and result.out == "" and result.err.count("\n") == 1
    assert "has no map; train one with --model semantic-map or --model objects-map or" in result.message
    empty = tmp_path / "empty"
    train(empty, tiny("semantic-map", decisions=60))
    result = call("eval", empty, "--policy", "planner")
    assert result.status == 2 and "is still empty" in result.message and result.err.count("\n") == 1
    assert not [*semantic_run.glob("*planner*"), *empty.glob("*planner*")]


def test_ctrl_c_and_sigterm_end_any_command(call, semantic_run, monkeypatch):
    import signal

    import semrl.cli.evaluate as command

    for number in (signal.SIGINT, signal.SIGTERM):
        before = signal.getsignal(number)
        monkeypatch.setattr(command, "evaluate", lambda *_, number=number, **__: signal.raise_signal(number))
        result = call("eval", semantic_run)
        assert result.status == 1 and result.message == "stopped"
        assert signal.getsignal(number) is before


def test_compiled_code_that_is_stopped_says_no_more_than_other_code(call, semantic_run, monkeypatch):
    import semrl.cli.evaluate as command

    def compiled(*_, cause, **__):
        raise SystemError("returned a result with an exception set") from cause

    monkeypatch.setattr(command, "evaluate", lambda *_, **__: compiled(cause=KeyboardInterrupt()))
    result = call("eval", semantic_run)
    assert result.status == 1 and result.message == "stopped"
    monkeypatch.setattr(command, "evaluate", lambda *_, **__: compiled(cause=ValueError()))
    with pytest.raises(SystemError):
        call("eval", semantic_run)


def test_a_missing_extra_is_named(call, tmp_path, tiny_toml, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    result = call("train", "--config", tiny_toml("otsu"), "--run", tmp_path / "run", "--tensorboard")
    assert result.status == 2 and "pip install 'tensorboard>=" in result.message
    assert not (tmp_path / "run").exists()


def test_errors_of_evaluation_leave_no_result(call, tmp_path, tiny):
    run = RunFolder.create(tmp_path / "run", tiny())
    result = call("eval", run.path, "--json")
    assert result.status == 2 and "has no checkpoint yet" in result.message and result.err.count("\n") == 1
    for flags in (["--episodes", "0"], ["--seed", "-1"]):
        result = call("eval", run.path, *flags)
        assert result.status == 2 and "episodes must be 1 or more and seed 0 or more" in result.message
    assert not (run.path / "evaluation.json").exists()
    assert json.loads(run.manifest_path.read_text())["status"] == "new"
