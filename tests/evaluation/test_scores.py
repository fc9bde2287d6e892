import dataclasses
import json
import shutil

import numpy as np
import pytest
import torch
from stopping import stopped

from semrl.core.arrays import unnest
from semrl.core.errors import SemrlError, UsageError
from semrl.envs import Game, make_env
from semrl.evaluation import evaluate, load_encoder, load_player
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.training import RunFolder, train
from semrl.training.config import write_toml
from semrl.training.parts import build_trainer


def test_the_same_seed_gives_the_same_returns(semantic_run):
    first = evaluate(semantic_run, episodes=3, seed=5)
    assert evaluate(semantic_run, episodes=3, seed=5) == first
    many = [evaluate(semantic_run, episodes=3, seed=seed).returns for seed in range(6, 10)]
    assert any(returns != first.returns for returns in many)


def test_what_is_told_is_what_is_written(semantic_run):
    result = evaluate(semantic_run)
    written = json.loads((semantic_run / "evaluation.json").read_text())
    assert written == json.loads(json.dumps(dataclasses.asdict(result)))
    provenance = result.conditions
    for total, length, rewards in zip(result.returns, result.lengths, result.rewards, strict=True):
        assert total == sum(reward for _, reward in rewards) and all(0 <= at < length for at, _ in rewards)
    config = RunFolder.open(semantic_run).config()
    assert result.episodes == len(result.returns) == config.evaluation.episodes == provenance["episodes"]
    assert provenance["seed"] == config.seed + EVALUATION_SEED and provenance["decisions"] == 150
    assert result.mean == pytest.approx(np.mean(result.returns))
    assert result.std == pytest.approx(np.std(result.returns, ddof=1))
    assert (result.min, result.max) == (min(result.returns), max(result.returns))


def test_returns_are_the_sums_of_the_rewards_of_greedy_play(semantic_run):
    """Played again without the code under test: own loop, own network input, weights from the file."""
    config = RunFolder.open(semantic_run).config()
    trainer = build_trainer(config)
    saved = RunFolder.open(semantic_run).load().arrays
    trainer.encoder.from_arrays(unnest(saved, "encoder"))
    weights = unnest(saved, "agent/network")
    trainer.agent.network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
    episode_of = trainer.encoder.begin  # single frames
    returns = []
    for episode in range(3):
        seed = int(np.random.default_rng([9, episode]).integers(2**31))
        game = Game(make_env(config.env, config.environment), seed)
        now = before = episode_of().encode(game.reset()).vector
        rewards, done = [], False
        while not done:
            with torch.no_grad():
                values = trainer.agent.network(torch.from_numpy(np.stack([now, before])[None]), torch.zeros(1, 0))
            values = values.reshape(config.dqn.heads, game.n_actions).mean(axis=0)
            outcome = game.step(int(values.argmax()))
            now, before = episode_of().encode(outcome.observation).vector, now
            rewards.append(outcome.reward)
            done = outcome.done
        returns.append(sum(rewards))
    assert evaluate(semantic_run, episodes=3, seed=9).returns == returns


def test_observers_see_every_step_and_episode(semantic_run):
    steps, totals = [], []
    result = evaluate(
        semantic_run,
        episodes=2,
        on_episode=lambda total, decisions: totals.append((total, decisions)),
        on_step=lambda episode, step: steps.append((episode, step.total)),
    )
    assert totals == list(zip(result.returns, result.lengths, strict=True))
    assert [dict(steps)[episode] for episode in (0, 1)] == result.returns  # the last step of each
    assert len(steps) == 2 * (45 + 1)  # five balls of nine decisions, and the first observation


def test_playing_changes_nothing_that_was_learned(semantic_run):
    before = [path.read_bytes() for path in sorted((semantic_run / "checkpoints").iterdir())]
    evaluate(semantic_run, episodes=1)
    assert [path.read_bytes() for path in sorted((semantic_run / "checkpoints").iterdir())] == before


def test_a_player_loads_what_play_needs_and_no_more(semantic_run, tracked_run, tmp_path, tiny):
    for run in (semantic_run, tracked_run, stopped(tmp_path / "half", tiny("semantic-map"), 100)):
        folder, player = RunFolder.open(run), load_player(run)
        whole, loaded = folder.load(), folder.load(play_only=True)
        assert loaded.arrays.keys() == whole.playable <= whole.arrays.keys()
        assert not any("replay" in name or "experience" in name or "optimiser" in name for name in loaded.arrays)
        assert not len(player.agent.replay) and player.agent.replay.capacity == player.config.dqn.n_steps + 1
        assert player.decisions == int(whole.arrays["decisions"]) and not player.perceiving


def test_what_was_trained_on_a_device_plays_where_there_is_none(semantic_run, tmp_path):
    run = shutil.copytree(semantic_run, tmp_path / "run")
    expected = evaluate(run, episodes=2).returns
    config = RunFolder.open(run).config()
    missing = "mps" if torch.cuda.is_available() else "cuda"
    (run / "config.toml").write_text(write_toml(dataclasses.replace(config, device=missing)))
    assert evaluate(run, episodes=2).returns == expected


def test_exploring_play_is_another_play(semantic_run, monkeypatch):
    player = load_player(semantic_run)
    config = player.config
    wild = dataclasses.replace(
        player,
        config=dataclasses.replace(config, evaluation=dataclasses.replace(config.evaluation, exploration=1.0)),
    )

    def frames(player):
        return np.stack([s.observation.frame for s in player.play(player.new_game(3), np.random.default_rng(0))])

    assert not np.array_equal(frames(player), frames(wild))
    assert np.array_equal(frames(wild), frames(wild))


def test_games_with_an_action_for_waiting_begin_at_random(tmp_path, tiny):
    train(tmp_path / "run", tiny("ram", decisions=2))
    player = load_player(tmp_path / "run")
    game = player.new_game(0)
    rams = [game.reset().ram.tobytes() for _ in range(4)]
    assert len(set(rams)) > 1
    again = player.new_game(0)
    assert [again.reset().ram.tobytes() for _ in range(4)] == rams


@pytest.mark.parametrize("wrong", [{"episodes": 0}, {"episodes": -1}, {"seed": -1}])
def test_nothing_to_play_is_refused(semantic_run, wrong):
    with pytest.raises(UsageError, match="1 or more"):
        evaluate(semantic_run, **wrong)


def test_runs_that_cannot_play_are_told_apart(tmp_path, tiny):
    new = RunFolder.create(tmp_path / "new", tiny())
    with pytest.raises(UsageError, match=r"has no checkpoint yet; go on with: semrl train --run .* --resume"):
        evaluate(new.path)
    blind = stopped(tmp_path / "blind", tiny(), 8)
    with pytest.raises(UsageError, match="has not learned to see yet"):
        evaluate(blind)
    train(tmp_path / "short", tiny(decisions=10))
    with pytest.raises(UsageError, match="has not learned to see yet"):
        evaluate(tmp_path / "short")
    half = stopped(tmp_path / "half", tiny(), 90)
    assert evaluate(half, episodes=1).episodes == 1
    assert json.loads((half / "evaluation.json").read_text())["conditions"]["decisions"] == 91


def test_checkpoints_that_do_not_fit_are_told(tmp_path, tiny, baseline_run):
    run = RunFolder.create(tmp_path / "run", tiny("semantic"))
    run.update_manifest(environment=RunFolder.open(baseline_run).manifest()["environment"])
    (run.path / "checkpoints" / "0000000010.npz").write_bytes(
        RunFolder.open(baseline_run).checkpoints()[-1].read_bytes()
    )
    with pytest.raises(SemrlError, match="does not fit its configuration"):
        load_encoder(run.path)


def test_a_milestone_plays_as_the_run_did_then(tmp_path, tiny):
    config = dataclasses.replace(tiny(), milestones=(91, 120))
    train(tmp_path / "whole", config)
    half = stopped(tmp_path / "half", tiny(), 90)
    assert load_player(half).decisions == load_player(tmp_path / "whole", at=91).decisions == 91
    then, now = evaluate(tmp_path / "whole", episodes=2, at=91), evaluate(half, episodes=2)
    assert then == dataclasses.replace(now, run=then.run)
    assert (tmp_path / "whole" / "evaluation-at-91.json").exists()
    with pytest.raises(UsageError, match="has no milestone of decision 92, there are those of decisions 91, 120"):
        evaluate(tmp_path / "whole", at=92)
    with pytest.raises(UsageError, match="there are none"):
        evaluate(half, at=91)


def test_milestones_change_nothing_else(tmp_path, tiny):
    config = tiny()
    train(tmp_path / "plain", config)
    train(tmp_path / "kept", dataclasses.replace(config, milestones=(100,)))
    plain, kept = (RunFolder.open(tmp_path / name).manifest()["hashes"] for name in ("plain", "kept"))
    assert plain == kept
