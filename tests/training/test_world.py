"""What is noted of an environment: it is read where the environment is not; one that does not repeat is not resumed."""

import json

import gymnasium as gym
import pytest

from semrl.core.errors import NoEnvironmentError, SemrlError, SemrlWarning, UsageError
from semrl.envs import make_env
from semrl.envs.catch import Catch
from semrl.envs.repeating import repeats_itself
from semrl.evaluation import evaluate, load_encoder, load_map, load_player
from semrl.training import RunFolder, train


class Counted(Catch):
    """Catch that counts how many of it are open."""

    made = closed = 0

    def __init__(self, *arguments, **settings):
        super().__init__(*arguments, **settings)
        type(self).made += 1

    def close(self):
        type(self).closed += 1
        super().close()


class Whimsical(Counted):
    """It looks different each time, by a count: a draw would now and then come twice."""

    resets = 0

    def reset(self, **how):
        Whimsical.resets += 1
        self.lot = 1 + Whimsical.resets % 251
        return super().reset(**how)

    def step(self, action):
        frame, *rest = super().step(action)
        frame = frame.copy()
        frame[0, 0] = self.lot
        return frame, *rest


class Moody(Whimsical):
    """It pays differently each time."""

    def step(self, action):
        frame, reward, *rest = Catch.step(self, action)
        return frame, reward + float(self.lot), *rest


@pytest.fixture
def known():
    ids = {world: f"noted/{world.__name__}-v0" for world in (Counted, Whimsical, Moody)}
    for world, env_id in ids.items():
        world.made = world.closed = 0
        gym.register(env_id, world)
    yield ids
    for env_id in ids.values():
        gym.registry.pop(env_id, None)


def stopping(after):
    """Make an observer that ends a training."""

    class Stop:
        def on_row(self, row):
            pass

        def on_decision(self, trainer):
            if trainer.decisions_ == after:
                raise SemrlError("enough")

    return Stop()


@pytest.mark.parametrize("model", ["otsu", "objects"])
def test_one_environment_is_opened_and_closed(known, tiny, tmp_path, model):
    train(tmp_path / "run", tiny(model, env=known[Counted]))
    assert Counted.made == Counted.closed
    before = Counted.made
    evaluate(tmp_path / "run", episodes=3)
    assert Counted.made - before == Counted.closed - before == 1
    train(tmp_path / "run")  # a finished run needs none
    assert Counted.made - before == 1


def test_it_is_closed_when_training_fails(known, tiny, tmp_path):
    with pytest.raises(SemrlError, match="enough"):
        train(tmp_path / "run", tiny("otsu", env=known[Counted]), observers=[stopping(5)])
    assert Counted.made == Counted.closed


@pytest.mark.parametrize(("world", "repeats"), [(Counted, True), (Whimsical, False), (Moody, False)])
def test_whether_a_world_repeats_itself_is_tested(known, world, repeats):
    assert repeats_itself(make_env(known[world]), seed=0) is repeats
    assert repeats_itself(make_env(known[world]), seed=1, decisions=7) is repeats


@pytest.mark.parametrize("world", [Whimsical, Moody])
def test_what_does_not_repeat_is_told_and_not_resumed(known, tiny, tmp_path, world):
    run, config = tmp_path / "run", tiny("otsu", env=known[world], checkpoint_seconds=0)
    with pytest.raises(SemrlError, match="enough"), pytest.warns(SemrlWarning, match="does not repeat itself"):
        train(run, config, observers=[stopping(90)])
    made = world.made
    with pytest.raises(UsageError, match="cannot be resumed: its environment does not repeat itself"):
        train(run)
    assert world.made == made
    with pytest.raises(UsageError, match="exists") as raised, pytest.warns(SemrlWarning):
        train(run, config)
    assert "resume" not in str(raised.value)
    assert load_encoder(run)  # what was learned is there


def test_what_was_learned_is_read_without_the_game(known, tiny, tmp_path, call):
    run = tmp_path / "run"
    train(run, tiny("objects-map", env=known[Counted], decisions=300))
    names = load_player(run).action_names
    assert names == ("LEFT", "RIGHT")
    del gym.registry[known[Counted]]
    player = load_player(run)
    assert player.action_names == names
    assert load_map(run).action_names == names
    for argv in (["map", run], ["query", run, "ASK {?s ?p ?o}"], ["report", run]):
        told = call(*argv)
        assert told.status == 0, told.err
    with pytest.raises(NoEnvironmentError, match="unknown environment"):
        evaluate(run)


def test_without_a_note_a_run_cannot_be_read(tiny, tmp_path, objects_run):
    manifest = RunFolder.open(objects_run).manifest()
    run = RunFolder.create(tmp_path / "run", tiny("objects"))
    name = RunFolder.open(objects_run).checkpoints()[-1]
    (run.path / "checkpoints" / name.name).write_bytes(name.read_bytes())
    for damage in ({}, {"environment": None}, {"environment": manifest["environment"] | {"actions": 3}}):
        run.write_manifest({**{k: v for k, v in manifest.items() if k != "environment"}, **damage})
        with pytest.raises(UsageError, match="does not say which environment was played"):
            load_player(run.path)


@pytest.mark.parametrize(("trained", "asked", "played"), [(0.25, None, 0.25), (0.25, 0.0, 0.0), (None, 0.5, 0.5)])
def test_conditions_tell_what_was_played(tiny, tmp_path, trained, asked, played):
    run = tmp_path / "run"
    train(run, tiny("otsu", environment__sticky_actions=trained))
    assert RunFolder.open(run).manifest()["environment"]["sticky_actions"] == (trained or 0.0)
    told = evaluate(run, episodes=1, sticky_actions=asked).conditions
    assert told["sticky_actions"] == played
    assert (told["frame_skip"], told["max_frames"], told["pooling"]) == (4, 1, "brightest")
    assert json.loads(json.dumps(told)) == told


def test_an_id_means_what_it_says_in_training_and_evaluation(tiny, tmp_path):
    run = tmp_path / "run"
    train(run, tiny("ram", env="ALE/Pong-v5", decisions=100))
    assert RunFolder.open(run).manifest()["environment"]["sticky_actions"] == 0.25
    assert load_player(run).world.rom == "pong"
