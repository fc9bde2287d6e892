"""What is told without a terminal, commands that can be pasted, and what a quick command does not import."""

import json
import re
import shlex
import shutil

import pytest
from outside import semrl

from semrl.cli import progress
from semrl.cli.progress import PlayProgress, show_summary, working
from semrl.core.errors import SemrlError, UsageError
from semrl.evaluation import load_player
from semrl.training import RunFolder, build_trainer, train
from semrl.training.session import _Session

NAMES = ["a run", "it's", "much/" + "deeper/" * 30 + "run", "$HOME;ls", "Ω→"]


@pytest.mark.parametrize("name", NAMES)
def test_what_comes_next_can_be_pasted(call, tmp_path, tiny_toml, name):
    run = tmp_path / name
    run.parent.mkdir(parents=True, exist_ok=True)
    result = call("train", "--config", tiny_toml("baseline", decisions=2), "--run", run)
    assert result.status == 0
    offered = [line.partition("semrl ")[2] for line in result.out.splitlines() if " semrl " in line]
    assert [shlex.split(line)[:2] for line in offered] == [["eval", str(run)], ["report", str(run)]]
    assert call(*shlex.split(offered[0])[:2], "--episodes", "1").status == 0


@pytest.mark.parametrize("name", NAMES)
def test_how_to_go_on_can_be_pasted(tmp_path, tiny, name):
    run = tmp_path / name
    run.parent.mkdir(parents=True, exist_ok=True)
    config = tiny("baseline", decisions=100)
    new = RunFolder.create(run, config)
    said = []
    with pytest.raises(UsageError) as refused:
        load_player(run)
    said.append(str(refused.value).partition("go on with: ")[2])
    with pytest.raises(UsageError) as refused:
        RunFolder.create(run, config)
    said.append(str(refused.value).partition("(")[2].rpartition(")")[0])
    session = _Session(new, config, build_trainer(config), [])
    session._stop(2, None)
    with pytest.raises(SemrlError) as stopped:
        session.run()
    said.append(str(stopped.value).partition("go on with: ")[2])
    assert [shlex.split(line) for line in said] == [["semrl", "train", "--run", str(run), "--resume"]] * 3


@pytest.mark.parametrize("width", [20, 80, 500])
def test_a_summary_is_never_wrapped(capsys, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    values = {"run": "x" * 300, "number": 3, "odd": "[red]word " * 40}
    show_summary(values)
    assert capsys.readouterr().out.splitlines() == [f"{name:<6}  {value}" for name, value in values.items()]


def test_training_tells_lines_where_there_is_no_terminal(call, tmp_path, tiny_toml):
    result = call("train", "--config", tiny_toml("otsu", decisions=100), "--run", tmp_path / "run")
    first, *lines = result.err.splitlines()
    assert first == f"otsu on semrl/Catch-v0, seed 0 → {tmp_path / 'run'}"
    assert [line.partition(": ")[0] for line in lines] == ["detection", "agent"]
    assert re.match(r"agent: 100 of 100 decisions, [\d.,]+/s; last returns ", lines[-1])
    logged = (tmp_path / "run" / "train.log").read_text().splitlines()
    assert [line[20:].partition(",")[0] for line in logged] == [line.partition(",")[0] for line in lines]


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["eval", "RUN", "--episodes", "2"], r"evaluate: 2 of 2 episodes, 90 decisions, [\d.,]+/s; mean return "),
        (["predict", "RUN", "--decisions", "50"], r"predict: 50 of 50 decisions, [\d.,]+/s$"),
    ],
)
def test_play_tells_lines_where_there_is_no_terminal(call, tmp_path, map_run, argv, said):
    run = str(shutil.copytree(map_run, tmp_path / "run"))
    result = call(*(word.replace("RUN", run) for word in argv))
    assert result.status == 0 and re.match(said, result.err.splitlines()[-1])


def test_nothing_is_told_where_nothing_was_done(capsys):
    with PlayProgress("evaluate", 3, "episodes"):
        pass
    assert capsys.readouterr().err == ""
    with working("learning to see") as tell:
        tell("stage 2")
    assert capsys.readouterr().err == "learning to see\nstage 2\n"


def test_progress_that_nobody_reads_ends_nothing(monkeypatch):
    def gone(*_, **__):
        raise BrokenPipeError

    monkeypatch.setattr(progress.error_console, "print", gone)
    with PlayProgress("evaluate", 2, "episodes") as shown:
        shown.update(0, 1)
        shown.update(2, 40)


@pytest.mark.parametrize(
    ("argv", "heavy"),
    [
        (["map", "RUN", "--json"], {"torch", "sklearn", "gymnasium", "ale_py", "cv2", "matplotlib", "networkx"}),
        (["--help"], {"torch", "sklearn", "numpy", "numba", "rich", "tyro", "scipy"}),
        (["--version"], {"torch", "numpy", "rich", "tyro"}),
        (["doctor", "--help"], {"torch", "numpy", "rich", "tyro"}),
        (["map", "--help"], {"torch", "sklearn", "gymnasium"}),
    ],
)
def test_quick_commands_do_not_import_what_is_slow(map_run, argv, heavy):
    tell = f"import atexit, sys; atexit.register(lambda: print(sorted({heavy!r} & set(sys.modules)), file=sys.stderr))"
    done = semrl(*(word.replace("RUN", str(map_run)) for word in argv), before=tell)
    assert done.returncode == 0 and done.stderr == b"[]\n"


@pytest.mark.parametrize("settings", ["training.config", "agents", "agents.config", "world_model", "planning.config"])
def test_settings_are_read_without_torch(settings):
    done = semrl("--version", before=f"import semrl.{settings}; assert 'torch' not in sys.modules")
    assert done.returncode == 0 and done.stderr == b""


def test_the_map_alone_is_the_map_of_the_whole_run(call, map_run, ram_map_run, tracked_run):
    from semrl.evaluation import load_map
    from semrl.knowledge.description import describe

    for run in (map_run, ram_map_run, tracked_run):
        told = json.loads(call("map", run, "--json").out)
        graph = describe(load_map(run).graph)
        assert (told["nodes"], told["edges"], told["states"]) == (graph.nodes, graph.edges, graph.states)
        assert (told["diameter"], told["positive"]) == (graph.diameter, graph.positive_share)


def test_a_run_without_a_map_or_with_an_empty_one_is_one_line(call, tmp_path, semantic_run, tiny):
    result = call("map", semantic_run)
    assert result.status == 2 and "has no map; train one with --model semantic-map or" in result.message
    train(tmp_path / "empty", tiny("semantic-map", decisions=60))
    result = call("map", tmp_path / "empty")
    assert result.status == 2 and "is still empty" in result.message
