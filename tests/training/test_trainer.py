"""The loop: perception, then the agent, under one budget; saved and resumed between any two decisions."""

import itertools

import numpy as np
import pytest

from semrl.agents import DQN, DQNConfig, NetworkConfig
from semrl.core.arrays import digest
from semrl.envs import Game, make_env
from semrl.perception.config import PipelineConfig
from semrl.perception.embedding import HashedEmbeddingConfig
from semrl.perception.pipeline import Pipeline
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.training.trainer import Trainer

CONFIG = PipelineConfig(embedding="hashed", hashed=HashedEmbeddingConfig(dimension=16))
AGENT = DQNConfig(
    replay_capacity=600, initial_buffer=40, decisions_per_update=10, batch_size=8, exploration_decisions=43,
    n_steps=2, network=NetworkConfig(hidden_units=(16,)),
)  # fmt: skip


class Recorder:
    """Remembers what observers are told."""

    def __init__(self):
        self.decisions, self.phases, self.rows = [], [], []

    def on_decision(self, trainer):
        self.decisions.append(trainer.decisions_)
        self.phases.append(trainer.phase)

    def on_row(self, row):
        self.rows.append(row)


class Diary(Game):
    """Remembers when episodes began, and what was done."""

    def __init__(self, env, seed):
        super().__init__(env, seed)
        self.begun, self.done, self.rewards = [], [], []

    def reset(self):
        self.begun.append(len(self.done))
        return super().reset()

    def step(self, action):
        self.done.append(action)
        outcome = super().step(action)
        self.rewards.append(outcome.reward)
        return outcome


def new_trainer(view="embedding", *, decisions=500, seed=0, game=Game, studied=0):
    pipeline = Pipeline(CONFIG, view)
    agent = DQN(AGENT, pipeline.shape, pipeline.dtype, 2, seed=seed)
    return Trainer(
        game(make_env("semrl/Catch-v0"), seed),
        pipeline,
        Schooling(pipeline, StabilityConfig(batches=20, decisions=studied)),
        agent,
        decisions=decisions,
        seed=seed,
        observers=[Recorder()],
    )


@pytest.fixture(scope="module")
def finished():
    trainer = new_trainer(game=Diary)
    trainer.run()
    return trainer, trainer.observers[0]


def test_perception_comes_first_and_counts(finished):
    trainer, recorder = finished
    assert len(trainer.game.done) == trainer.decisions_ == 500
    assert recorder.decisions == list(range(1, 501))
    order = list(dict.fromkeys(recorder.phases))
    assert order == ["threshold", "pca", "birch", "agent"]
    assert recorder.phases == sorted(recorder.phases, key=order.index)
    learned = sum(stage.batches_ for stage in trainer.schooling.stages)
    assert trainer.agent.decisions_ == 500 - learned > 100


def test_the_agent_begins_with_an_episode_of_its_own(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schooling.stages)
    assert learned % 45 != 0 and learned in trainer.game.begun
    starts = trainer.agent.to_arrays()["replay/starts"]
    assert starts[0] and starts.sum() == len([b for b in trainer.game.begun if b >= learned])


def test_the_agent_remembers_what_was_done_and_earned(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schooling.stages)
    replay = trainer.agent.to_arrays()
    decided = replay["replay/actions"] >= 0
    np.testing.assert_array_equal(replay["replay/actions"][decided], trainer.game.done[learned:])
    np.testing.assert_array_equal(replay["replay/rewards"][decided], trainer.game.rewards[learned:])
    assert replay["replay/terminated"].sum() == len(trainer.returns_) == (~decided).sum()


def test_perception_acts_at_random(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schooling.stages)
    assert abs(np.mean(trainer.game.done[:learned]) - 0.5) < 4 * 0.5 / np.sqrt(learned)


def test_rows_tell_of_batches_and_episodes(finished):
    trainer, recorder = finished
    perception = [row for row in recorder.rows if row["phase"] != "agent"]
    episodes = [row for row in recorder.rows if row["phase"] == "agent"]
    assert len(perception) == sum(stage.batches_ for stage in trainer.schooling.stages)
    assert list(dict.fromkeys(row["phase"] for row in perception)) == ["threshold", "pca", "birch"]
    assert "leaves" in perception[-1] and perception[-1]["stability"] > 0.95
    assert [row["episode"] for row in episodes] == list(range(1, len(trainer.returns_) + 1))
    assert [row["return"] for row in episodes] == trainer.returns_
    assert {row["length"] for row in episodes} == {45}  # 36 frames a ball, 5 balls
    assert [row["decisions"] for row in recorder.rows] == sorted(row["decisions"] for row in recorder.rows)


def test_what_is_studied_again_costs_no_decisions():
    trainer = new_trainer(decisions=150, studied=60)
    trainer.run()
    recorder = trainer.observers[0]
    assert recorder.decisions == list(range(1, 151))
    assert recorder.phases == ["play"] * 59 + ["agent"] * 91  # the last of its decisions ends with all that is studied
    assert trainer.agent.decisions_ == 90
    perception = [row for row in recorder.rows if row["phase"] != "agent"]
    assert list(dict.fromkeys(row["phase"] for row in perception)) == ["play", "threshold", "pca", "birch"]
    assert {row["decisions"] for row in perception if row["phase"] != "play"} == {60}
    assert [row["decisions"] for row in perception[:60]] == list(range(1, 61))
    assert trainer.agent.replay.to_arrays()["starts"][0]


@pytest.mark.parametrize("decisions", [0, 30, 59, 60, 61, 120])
def test_resumed_after_play_that_is_studied_it_goes_on_bit_for_bit(decisions):
    straight, halting = new_trainer(decisions=150, studied=60), new_trainer(decisions=decisions, studied=60)
    halting.run()
    resumed = new_trainer(decisions=150, studied=60)
    resumed.from_arrays({name: array.copy() for name, array in halting.to_arrays().items()})
    straight.run()
    resumed.run()
    assert digest(straight.to_arrays()) == digest(resumed.to_arrays())


def test_returns_are_the_sums_of_rewards(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schooling.stages)
    rewards = np.array(trainer.game.rewards[learned:])
    whole = rewards[: 45 * len(trainer.returns_)].reshape(-1, 45).sum(axis=1)
    assert whole.tolist() == trainer.returns_


def test_without_perception_the_agent_begins_at_once():
    trainer = new_trainer("grey", decisions=30)
    trainer.run()
    assert set(trainer.observers[0].phases) == {"agent"} and trainer.agent.decisions_ == 30


def test_the_agent_sees_the_current_and_the_previous_observation():
    trainer = new_trainer("components", decisions=110)
    seen = []
    act = trainer.agent.act
    trainer.agent.act = lambda state, advised: seen.append(state.copy()) or act(state, advised)
    trainer.run()
    assert len(seen) == 60
    np.testing.assert_array_equal(seen[0][0], seen[0][1])
    for before, after in itertools.pairwise(seen[:45]):
        np.testing.assert_array_equal(after[1], before[0])
    np.testing.assert_array_equal(seen[45][0], seen[45][1])  # a new episode
    np.testing.assert_array_equal(seen, trainer.agent.replay.latest(62)[np.r_[0:45, 46:61]])


def test_a_budget_can_be_raised():
    straight, halting = new_trainer(decisions=300), new_trainer(decisions=0)
    straight.run()
    for budget in (17, 140, 300):
        halting.decisions = budget
        halting.run()
        assert halting.decisions_ == budget
    assert digest(straight.to_arrays()) == digest(halting.to_arrays())


def test_the_same_seed_gives_the_same_run():
    runs = [new_trainer(decisions=250, seed=s) for s in (0, 0, 1)]
    for run in runs:
        run.run()
    digests = [digest(run.to_arrays()) for run in runs]
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize(
    ("view", "decisions"),
    [*(("embedding", n) for n in (0, 20, 50, 71, 96, 150, 230)), *(("components", n) for n in (50, 110))],
)
def test_resumed_it_goes_on_bit_for_bit(view, decisions):
    """At the start, in each stage, at the change to the agent, within its first and a later episode."""
    straight = new_trainer(view, decisions=decisions)
    straight.run()
    saved = {name: array.copy() for name, array in straight.to_arrays().items()}
    resumed = new_trainer(view, seed=9)
    resumed.from_arrays(saved)
    assert digest(resumed.to_arrays()) == digest(saved)
    for trainer in (straight, resumed):
        trainer.decisions = decisions + 90
        trainer.run()
    assert digest(resumed.to_arrays()) == digest(straight.to_arrays())
    tail = len(resumed.observers[0].rows)
    shown = [straight.observers[0].rows[-tail:], resumed.observers[0].rows]
    assert str(shown[0]) == str(shown[1])
