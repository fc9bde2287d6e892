"""The file of a sweep: what it trains, and what is wrong with it."""

import pytest

from semrl.core.errors import UsageError
from semrl.sweep.specification import read_sweep
from semrl.sweep.trials import Trial

WHOLE = """
models = ["ram", "ram-map"]
games = ["PongNoFrameskip-v4", "semrl/Catch-v0"]
seeds = [0, 5]
episodes = 3
policies = ["agent", "planner"]
settings = { decisions = 700, dqn = { discount = 0.5 }, models = { ram = { dqn = { batch_size = 9 } } } }
reference = { "semrl/Catch-v0" = { low = -3, high = 3 } }

[variants.short]
dqn.n_steps = 1
[variants.long]
dqn.n_steps = 4
decisions = 800
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "many.toml"
        path.write_text(text)
        return path

    return write


def test_a_file_is_every_model_in_every_game_with_every_variant_and_seed(write, tmp_path):
    sweep = read_sweep(write(WHOLE))
    cells = sweep.cells()
    tasks = [task for cell in cells for task in sweep.tasks(cell, tmp_path)]
    assert len(cells) == 2 * 2 * 2 and len({task.id for task in tasks}) == len(tasks) == 16
    assert tasks[0].id == "ram-pong-short-0" and tasks[0].run == tmp_path / "runs" / "ram-pong-short-0"
    for task in tasks:
        model, config = "ram-map" if task.id.startswith("ram-map-") else "ram", task.config
        is_long = "-long-" in task.id
        assert (config.model, config.decisions, config.dqn.n_steps) == (
            model,
            800 if is_long else 700,
            4 if is_long else 1,
        )
        assert config.env == ("PongNoFrameskip-v4" if "-pong-" in task.id else "semrl/Catch-v0")
        assert config.seed == int(task.id[-1]) and config.dqn.discount == 0.5
        assert (config.dqn.batch_size == 9) == (model == "ram")
        agent, planner = Trial(episodes=3), Trial(policy="planner", episodes=3)
        assert task.trials == ((agent, planner) if model == "ram-map" else (agent,))


def test_the_least_file(write, tmp_path):
    sweep = read_sweep(write('models = ["objects-map"]\nseeds = [0]\nepisodes = 0'))
    (cell,) = sweep.cells()
    (task,) = sweep.tasks(cell, tmp_path)
    assert (task.id, task.trials, cell.agent) == ("objects-map-pong-0", (), "objects-map")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seeds = [0]", "models"),
        ('models = ["ram"]', "seeds"),
        ('models = ["rem"]\nseeds = [0]', "rem"),
        ('models = ["ram"]\nseeds = [0, 0]', "each once"),
        ('models = ["ram"]\nseeds = []', "seeds must be named"),
        ('models = ["ram"]\nseeds = ["a"]', "seeds"),
        ('models = ["ram"]\nseeds = [0]\nsedes = 1', "sedes"),
        ('models = ["ram"]\nseeds = [0]\nepisodes = -1', "episodes"),
        ('models = ["ram"]\nseeds = [0]\npolicies = ["nobody"]', "nobody"),
        ('models = ["ram"]\nseeds = [0]\n[settings]\nseed = 3', "seeds = "),
        ('models = ["ram"]\nseeds = [0]\n[variants.a]\nenv = "x"', "games = "),
        ('models = ["ram"]\nseeds = [0]\n[variants."a b"]\n', "'a b' is no name"),
        ('models = ["ram"]\nseeds = [0]\n[settings]\nfoo = 3', "unknown setting 'foo'"),
        ('models = ["ram"]\nseeds = [0]\n[variants.a.dqn]\nbatch_sise = 3', "did you mean 'dqn.batch_size'"),
        ('models = ["ram"]\nseeds = [0]\ngames = ["a/b", "a-b"]', "called alike"),
        ('models = ["ram"]\nseeds = [0]\n[reference.x]\nlow = 2\nhigh = 1', "below"),
        ("models = [", "not valid TOML"),
    ],
)
def test_what_is_wrong_is_told_with_the_name_of_the_file(write, text, message):
    with pytest.raises(UsageError, match=r"many\.toml") as error:
        read_sweep(write(text))
    assert message in str(error.value) and "\n" not in str(error.value)
