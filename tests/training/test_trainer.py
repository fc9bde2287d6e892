"""The loop: perception, then the agent, under one budget; saved and resumed between any two decisions."""

import itertools

import numpy as np
import pytest

from semrl.agents import DQN, DQNConfig, NetworkConfig
from semrl.core.arrays import digest
from semrl.envs import Game, make_env
from semrl.perception.config import PerceptionConfig
from semrl.perception.detection import ForegroundConfig
from semrl.perception.embedding import HashedEmbeddingConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.perception.tracking import SlotAssignerConfig
from semrl.planning.config import PlanningConfig
from semrl.planning.module import PlanningModule
from semrl.planning.scenario_planner import ScenarioPlannerConfig
from semrl.training.loop import EpisodeView, play
from semrl.training.parts import Parts
from semrl.training.trainer import Trainer
from semrl.world_model import TreesConfig

CONFIG = PerceptionConfig(
    embedder="hashed",
    hashed=HashedEmbeddingConfig(dimension=16),
    foreground=ForegroundConfig(background_frames=30),
    slot_assigner=SlotAssignerConfig(frames=40),
)
PLANNING = PlanningConfig(
    world_model="trees",
    trees=TreesConfig(members=2, first_decisions=40, new_decisions=20),
    scenarios=ScenarioPlannerConfig(depth=4, scenarios=6),
    planner_every=2,
)
AGENT = DQNConfig(
    replay_capacity=600, learning_starts=40, train_freq=10, batch_size=8, exploration_decisions=200,
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


def new_trainer(encoder="scene", *, decisions=500, seed=0, game=Game, stored=0, planning=False):
    stability = StabilityConfig(batches=20, decisions=stored)
    shown = ENCODERS.load(encoder)(CONFIG, planning=planning)
    space = shown.space
    plans = PlanningModule(PLANNING, space.n_facts, 2, seed=seed, axes=space.axes) if planning else None
    agent = DQN(AGENT, space=space, n_actions=2, seed=seed, plan_size=plans.plan_size if plans else 0)
    return Trainer(
        game(make_env("semrl/Catch-v0"), seed),
        shown,
        PretrainingSchedule(shown.stages(stability), stability),
        agent,
        plans,
        decisions=decisions,
        seed=seed,
        observers=[Recorder()],
    )


def copied(trainer):
    return {name: array.copy() for name, array in trainer.to_arrays().items()}


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
    assert order == ["detection", "reduction", "clustering", "agent"]
    assert recorder.phases == sorted(recorder.phases, key=order.index)
    learned = sum(stage.batches_ for stage in trainer.schedule.stages)
    assert trainer.agent.decisions_ == 500 - learned > 100


def test_the_agent_begins_with_an_episode_of_its_own(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schedule.stages)
    assert learned % 45 != 0 and learned in trainer.game.begun
    starts = trainer.agent.to_arrays()["replay/starts"]
    assert starts[0] and starts.sum() == len([b for b in trainer.game.begun if b >= learned])


def test_the_agent_remembers_what_was_done_and_earned(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schedule.stages)
    replay = trainer.agent.to_arrays()
    decided = replay["replay/actions"] >= 0
    np.testing.assert_array_equal(replay["replay/actions"][decided], trainer.game.done[learned:])
    np.testing.assert_array_equal(replay["replay/rewards"][decided], trainer.game.rewards[learned:])
    assert replay["replay/terminated"].sum() == len(trainer.returns_) == (~decided).sum()


def test_perception_acts_at_random(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schedule.stages)
    assert abs(np.mean(trainer.game.done[:learned]) - 0.5) < 4 * 0.5 / np.sqrt(learned)


def test_rows_tell_of_batches_and_episodes(finished):
    trainer, recorder = finished
    perception = [row for row in recorder.rows if row["phase"] != "agent"]
    episodes = [row for row in recorder.rows if row["phase"] == "agent"]
    assert len(perception) == sum(stage.batches_ for stage in trainer.schedule.stages)
    assert list(dict.fromkeys(row["phase"] for row in perception)) == ["detection", "reduction", "clustering"]
    assert "clusters" in perception[-1] and perception[-1]["stability"] > 0.95
    assert [row["episode"] for row in episodes] == list(range(1, len(trainer.returns_) + 1))
    assert [row["return"] for row in episodes] == trainer.returns_
    assert {row["length"] for row in episodes} == {45}  # 36 frames a ball, 5 balls
    assert [row["decisions"] for row in recorder.rows] == sorted(row["decisions"] for row in recorder.rows)


def test_what_is_learned_from_stored_play_costs_no_decisions():
    trainer = new_trainer(decisions=150, stored=60)
    trainer.run()
    recorder = trainer.observers[0]
    assert recorder.decisions == list(range(1, 151))
    assert (
        recorder.phases == ["play"] * 59 + ["agent"] * 91
    )  # the last of its decisions ends with all that is learned from it
    assert trainer.agent.decisions_ == 90
    perception = [row for row in recorder.rows if row["phase"] != "agent"]
    assert list(dict.fromkeys(row["phase"] for row in perception)) == ["play", "detection", "reduction", "clustering"]
    assert {row["decisions"] for row in perception if row["phase"] != "play"} == {60}
    assert [row["decisions"] for row in perception[:60]] == list(range(1, 61))
    assert trainer.agent.replay.to_arrays()["starts"][0]


@pytest.mark.parametrize("decisions", [0, 30, 59, 60, 61, 120])
def test_resumed_around_stored_play_it_goes_on_bit_for_bit(decisions):
    straight, halting = new_trainer(decisions=150, stored=60), new_trainer(decisions=decisions, stored=60)
    halting.run()
    resumed = new_trainer(decisions=150, stored=60)
    resumed.from_arrays(copied(halting))
    straight.run()
    resumed.run()
    assert digest(straight.to_arrays()) == digest(resumed.to_arrays())


def test_returns_are_the_sums_of_rewards(finished):
    trainer, _ = finished
    learned = sum(stage.batches_ for stage in trainer.schedule.stages)
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
    trainer.agent.act = lambda shown, advised: seen.append(shown.vectors.copy()) or act(shown, advised)
    trainer.run()
    assert len(seen) == 60
    np.testing.assert_array_equal(seen[0][0], seen[0][1])
    for before, after in itertools.pairwise(seen[:45]):
        np.testing.assert_array_equal(after[1], before[0])
    np.testing.assert_array_equal(seen[45][0], seen[45][1])  # a new episode
    np.testing.assert_array_equal(seen, trainer.agent.replay.latest(62)[0][np.r_[0:45, 46:61]])


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


def test_the_plan_that_is_shown_is_remembered_beside_the_state():
    trainer = new_trainer("objects", decisions=320, planning=True, stored=60)
    shown, advice = [], []
    act = trainer.agent.act
    trainer.agent.act = lambda now, advised: shown.append(now) or advice.append(advised) or act(now, advised)
    trainer.run()
    replay = trainer.agent.replay.to_arrays()
    decided = replay["actions"] >= 0
    np.testing.assert_array_equal(replay["plans"][decided], [now.plan for now in shown])
    np.testing.assert_array_equal(replay["observations"][decided], [now.vectors[0] for now in shown])
    assert replay["plans"].shape[1] == trainer.planning.plan_size and replay["plans"].any()


def test_the_planner_controls_some_episodes_and_advises_in_all():
    """In its own its advice is given to the agent, which follows it; in the others it is only noted."""
    trainer = new_trainer("objects", decisions=400, planning=True, stored=60)
    given, acted = [], []
    act = trainer.agent.act
    trainer.agent.act = lambda now, advised: given.append(advised) or acted.append(act(now, advised)) or acted[-1]
    trainer.run()
    replay = trainer.agent.replay.to_arrays()
    noted, starts = (replay[name][replay["actions"] >= 0] for name in ("advised", "starts"))
    episode = np.cumsum(starts) - 1
    rows = [row for row in trainer.observers[0].rows if row["phase"] == "agent"]
    # What map and world model were warmed up with stands for an episode of the agent's.
    assert [row["policy"] for row in rows] == [("planner", "agent")[i % 2] for i in range(len(rows))]
    assert len(trainer.returns_) == [row["policy"] for row in rows].count("agent") and trainer.episodes_ == len(rows)
    told = np.array([-1 if advised is None else advised for advised in given])
    assert (noted[-90:] >= 0).all()  # by then there are plans at every decision
    np.testing.assert_array_equal(told[episode % 2 == 1], -1)
    np.testing.assert_array_equal(told[episode % 2 == 0], noted[episode % 2 == 0])
    planned = (told >= 0) & (np.arange(len(told)) > 60)
    followed = np.array(acted)[planned] == told[planned]
    assert followed.mean() > 0.7  # all but exploration's


def test_a_world_model_may_learn_from_a_reward_at_once():
    trainer, told = new_trainer("objects", decisions=200, planning=True, stored=60), []
    trainer.planning.update_online = lambda facts, _things: told.append((trainer.decisions_, facts.copy()))
    trainer.run()
    rewarded = np.flatnonzero(trainer.agent.replay.to_arrays()["rewards"])
    assert len(told) == len(rewarded) > 1


CASES = [
    *(("scene", False, 0, n) for n in (0, 20, 50, 71, 96, 150, 230)),
    *(("components", False, 0, n) for n in (50, 110)),
    *(("tracked_scene", False, 0, n) for n in (10, 45, 75, 100, 130, 180, 240)),
    *(("objects", True, 0, n) for n in (130, 180, 230, 262)),
    *(("objects", True, 60, n) for n in (30, 60, 61, 100, 125, 190)),
    *(("tracked_scene", True, 60, n) for n in (60, 100)),
]


@pytest.mark.parametrize(("encoder", "planning", "stored", "decisions"), CASES)
def test_resumed_it_goes_on_bit_for_bit(encoder, planning, stored, decisions):
    """At the start, in each stage, at the change to the agent, within its first and a later episode."""
    straight = new_trainer(encoder, decisions=decisions, planning=planning, stored=stored)
    straight.run()
    saved = copied(straight)
    resumed = new_trainer(encoder, seed=9, planning=planning, stored=stored)
    resumed.from_arrays(saved)
    resumed.observers[0].rows.clear()
    if planning:  # of what its seed decides, a world model of trees keeps the seed itself
        resumed.planning.world_model.seed = straight.planning.world_model.seed
    assert digest(resumed.to_arrays()) == digest(saved)
    for trainer in (straight, resumed):
        trainer.decisions = decisions + 90
        trainer.run()
    assert digest(resumed.to_arrays()) == digest(straight.to_arrays())
    tail = len(resumed.observers[0].rows)
    assert without_seconds(straight.observers[0].rows[-tail:]) == without_seconds(resumed.observers[0].rows)


def without_seconds(rows):
    return str([{name: value for name, value in row.items() if not name.startswith("seconds")} for row in rows])


def test_of_what_is_kept_for_play_a_player_plays_the_same():
    learned = new_trainer("tracked_scene", decisions=330, planning=True, stored=60)
    learned.run()
    kept, memory = learned.inference_arrays(), learned.memory_arrays()
    whole = learned.to_arrays()
    assert kept.keys() < whole.keys() and memory.keys() < whole.keys()
    assert not any("replay" in name or "experience" in name for name in kept)
    assert any("experience" in name for name in memory) and all(name.startswith("planning/") for name in memory)
    player = new_trainer("tracked_scene", seed=9, planning=True, stored=60)
    parts = Parts(encoder=player.encoder, agent=player.agent, planning=player.planning)
    parts.load_inference({name: array.copy() for name, array in kept.items()})
    games = [Game(make_env("semrl/Catch-v0"), 7) for _ in range(2)]
    episodes = []
    for trainer, game in zip((learned, player), games, strict=True):
        view = EpisodeView(trainer.encoder, trainer.planning)
        episodes.append(list(play(game, view, lambda step, own=trainer: own.agent.best_action(step.shown))))
    for one, two in zip(*episodes, strict=True):
        assert one.action == two.action
        np.testing.assert_array_equal(one.shown.vectors, two.shown.vectors)
        np.testing.assert_array_equal(one.shown.plan, two.shown.plan)
