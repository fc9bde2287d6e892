"""What is drawn again is what was lived: against a plain list of decisions."""

from itertools import pairwise

import numpy as np
import pytest
from systems import copied, walk

from semrl.core import Trajectory
from semrl.core.arrays import digest
from semrl.world_model import EpisodeRecord, Experience
from semrl.world_model.experience import REWARD_LEAD


def serial(lengths, reward=0.0):
    """Episodes whose states are numbered through, so that each tells where it belongs."""
    begin = 0
    for length in lengths:
        numbers = np.arange(begin, begin + length + 1, dtype=np.float32)
        yield Trajectory(
            states=np.column_stack([numbers, -numbers]),
            actions=numbers[:-1].astype(np.int64) % 3,
            rewards=np.full(length, reward, np.float32),
        )
        begin += length + 1


def decisions_of(episodes):
    """State, previous, action and next state of each decision, by the state's number."""
    lived = {}
    for episode in episodes:
        numbers = episode.states[:, 0].astype(int).tolist()
        for t, (now, after) in enumerate(pairwise(numbers)):
            lived[now] = (numbers[max(t - 1, 0)], int(episode.actions[t]), after)
    return lived


def filled(lengths, capacity):
    experience, episodes = Experience(capacity, 2), list(serial(lengths))
    for episode in episodes:
        experience.add(episode)
    return experience, episodes


def drawn_from(experience, count=3000, seed=0):
    return experience.draw(np.random.default_rng(seed), count)


@pytest.mark.parametrize("lengths", [[1], [1, 1, 1], [5, 1, 7], [40]])
def test_draws_are_real_decisions_with_what_was_before_and_after(lengths):
    experience, episodes = filled(lengths, 1000)
    lived, drawn = decisions_of(episodes), drawn_from(experience)
    assert len(experience) == len(lived) == sum(lengths)
    assert {int(n) for n in drawn.states[:, 0]} == lived.keys()  # all of them, and no last state of an episode
    for i in range(len(drawn)):
        now = int(drawn.states[i, 0])
        assert (drawn.previous[i, 0], drawn.actions[i], drawn.next_states[i, 0]) == lived[now]
        assert drawn.states[i, 1] == -now and drawn.previous[i, 1] == -lived[now][0]


def test_draws_are_as_likely_as_each_other():
    experience, _ = filled([5, 1, 14], 1000)
    _, counts = np.unique(drawn_from(experience, 20_000).states[:, 0], return_counts=True)
    assert len(counts) == 20 and np.abs(counts - 1000).max() < 5 * np.sqrt(1000)


def test_an_episode_drawn_whole_is_the_episode_itself():
    episode, experience = walk(50), Experience(100, 3)
    experience.add(episode)
    drawn = experience._at(np.arange(50))
    for name in ("states", "previous", "actions", "rewards", "next_states"):
        np.testing.assert_array_equal(getattr(drawn, name), getattr(episode.transitions, name))


@pytest.mark.parametrize(
    ("lengths", "capacity", "kept"),
    [
        ([4, 4, 4], 15, [4, 4, 4]),  # five states each: just enough room
        ([4, 4, 4], 14, [4, 4]),
        ([4, 4, 4], 10, [4, 4]),
        ([4, 4, 4], 9, [4]),
        ([4, 4, 40], 20, [40]),  # larger than all room: the newest stays whole
        ([40, 4], 20, [4]),
        ([40], 20, [40]),
        ([1, 9, 2, 3], 7, [2, 3]),
        ([4, 4, 4], 0, [4]),
    ],
)
def test_whole_episodes_go_the_oldest_first_but_the_newest_stays(lengths, capacity, kept):
    experience, episodes = filled(lengths, capacity)
    left = decisions_of(episodes[len(lengths) - len(kept) :])
    assert len(experience) == sum(kept) == len(left)
    drawn = drawn_from(experience)
    assert {int(n) for n in drawn.states[:, 0]} == left.keys()
    for now, before in zip(drawn.states[:, 0], drawn.previous[:, 0], strict=True):
        assert before == left[int(now)][0]
    assert len(experience.to_arrays()["states"]) == sum(kept) + len(kept)


def test_balanced_draws_hold_equally_many_of_each_sign_that_was_met():
    experience, rng = Experience(10_000, 3), np.random.default_rng(0)
    experience.add(walk(2000, rare=0.02))
    plain = np.sign(experience.draw(rng, 300).rewards)
    assert (plain == 0).mean() > 0.9
    for count in (300, 301, 302):
        rewards = experience.draw_balanced(rng, count).rewards
        shares = [(np.sign(rewards) == sign).sum() for sign in (-1, 0, 1)]
        assert sum(shares) == count and max(shares) - min(shares) <= 1


@pytest.mark.parametrize("met", [[0], [1], [0, 1], [-1, 0], [-1, 1]])
def test_balanced_draws_do_without_what_was_never_met(met):
    experience = Experience(1000, 2)
    for reward in met:
        experience.add(next(serial([5], float(3 * reward))))
    rewards = np.sign(experience.draw_balanced(np.random.default_rng(0), 60).rewards)
    assert {int(sign): int((rewards == sign).sum()) for sign in np.unique(rewards)} == dict.fromkeys(met, 60 / len(met))


def test_balanced_draws_are_real_decisions_too():
    experience, episodes = filled([5, 1, 7], 1000)
    experience.add(Trajectory(states=np.array([[90, -90], [91, -91]], np.float32), actions=np.array([2]),
                              rewards=np.array([1], np.float32)))  # fmt: skip
    lived = decisions_of(episodes) | {90: (90, 2, 91)}
    drawn = experience.draw_balanced(np.random.default_rng(0), 500)
    assert {int(n) for n in drawn.states[:, 0]} == lived.keys() and (drawn.states[:, 0] == 90).sum() == 250
    for i in range(500):
        now = int(drawn.states[i, 0])
        assert (drawn.previous[i, 0], drawn.actions[i], drawn.next_states[i, 0]) == lived[now]


def lengthy(rewarded, length=300):
    """One episode with rewards at the given decisions."""
    (episode,) = serial([length])
    episode.rewards[list(rewarded)] = [(-1.0) ** i for i in range(len(rewarded))]
    return episode


def test_a_share_is_drawn_from_shortly_before_rewards():
    experience = Experience(1000, 2)
    experience.add(lengthy([100, 200]))
    drawn = experience.draw(np.random.default_rng(0), 4000, 0.25).states[:, 0]
    before = [(reward - drawn[:1000]).astype(int) for reward in (100, 200)]
    soon = [gap[(gap >= 0) & (gap < REWARD_LEAD)] for gap in before]
    assert sum(map(len, soon)) == 1000  # all of the share, and as many for either reward, of every distance
    for gaps in soon:
        assert len(gaps) == pytest.approx(500, abs=80)
        assert (np.bincount(gaps, minlength=REWARD_LEAD) > 10).all()
    assert np.ptp(drawn[1000:]) > 290 and drawn[1000:].mean() == pytest.approx(150, abs=10)


def test_without_rewards_or_a_share_draws_are_uniform():
    for episode, share in ((lengthy([]), 1.0), (lengthy([150]), 0.0)):
        experience, plain = Experience(1000, 2), Experience(1000, 2)
        experience.add(episode)
        plain.add(lengthy([]))
        np.testing.assert_array_equal(
            experience.draw(np.random.default_rng(0), 500, share).states, drawn_from(plain, 500).states
        )


def test_a_reward_at_the_start_of_an_episode_leads_to_real_decisions_only():
    experience, (first, second) = Experience(1000, 2), serial([3, 5])
    first.rewards[0] = second.rewards[1] = 1
    experience.add(first)
    experience.add(second)
    lived = decisions_of([first, second])
    drawn = experience.draw(np.random.default_rng(0), 2000, 1.0)
    assert {int(n) for n in drawn.states[:, 0]} <= lived.keys()
    for now, before, after in zip(drawn.states[:, 0], drawn.previous[:, 0], drawn.next_states[:, 0], strict=True):
        assert (before, after) == (lived[int(now)][0], lived[int(now)][2])


@pytest.mark.parametrize("capacity", [1000, 60])
def test_restored_it_draws_the_same(capacity):
    experience, restored = Experience(capacity, 3), Experience(capacity, 3)
    for seed in range(4):
        experience.add(walk(20, seed))
    restored.add(walk(33, 9))  # used before
    restored.from_arrays(copied(experience))
    for seed in (5, 6):
        assert digest(restored.to_arrays()) == digest(experience.to_arrays())
        for name in ("draw", "draw_balanced"):
            one, two = (getattr(e, name)(np.random.default_rng(1), 50) for e in (experience, restored))
            for field in ("states", "previous", "actions", "rewards", "next_states"):
                np.testing.assert_array_equal(getattr(one, field), getattr(two, field))
        for one in (experience, restored):
            one.add(walk(20, seed))


def test_drawing_changes_nothing():
    experience, episodes = filled([5, 7], 1000)
    before = digest(experience.to_arrays())
    drawn = drawn_from(experience, 50)
    for name in ("states", "previous", "next_states"):
        getattr(drawn, name)[:] = 99
    assert digest(experience.to_arrays()) == before
    assert episodes[0].states[0].tolist() == [0, 0]


def record(trajectory, until=None, into=None):
    noted = into or EpisodeRecord(3)
    for t in range(len(trajectory) if until is None else until):
        noted.add(trajectory.states[t], int(trajectory.actions[t]), float(trajectory.rewards[t]))
    return noted


def assert_same(one, two):
    for name in ("states", "actions", "rewards"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), strict=True)


def test_an_episode_is_told_whole_and_another_begins():
    first, second = walk(30, 0), walk(1, 1)
    noted = record(first)
    assert_same(noted.so_far(first.states[-1]), first)
    noted.clear()
    assert digest(noted.to_arrays()) == digest(EpisodeRecord(3).to_arrays())
    assert_same(record(second, into=noted).so_far(second.states[-1]), second)


@pytest.mark.parametrize("until", [0, 1, 17, 30])
def test_an_episode_saved_midway_ends_the_same(until):
    episode, restored = walk(30), record(walk(5, 4))
    restored.from_arrays(copied(record(episode, until)))
    assert digest(restored.to_arrays()) == digest(record(episode, until).to_arrays())
    for t in range(until, 30):
        restored.add(episode.states[t], int(episode.actions[t]), float(episode.rewards[t]))
    assert_same(restored.so_far(episode.states[-1]), episode)


@pytest.mark.parametrize("count", [1, 3, 8])
def test_what_was_before_is_told_alike_while_playing_and_afterwards(count):
    episodes = [walk(6, 0), walk(1, 1), walk(5, 2)]
    experience, told = Experience(100, 3), []
    for episode in episodes:
        noted = EpisodeRecord(3)
        for t in range(len(episode)):
            history = noted.history(episode.states[t], 4, np.zeros(0, np.int64))
            assert history.number == t and len(history.states) == min(t + 1, 4) and len(history.actions) == min(t, 4)
            told.append((history.window(count).tolist(), history.recent(count).tolist()))
            noted.add(episode.states[t], int(episode.actions[t]), float(episode.rewards[t]))
        experience.add(episode)
    states, before, actions, rewards, following = experience.windows(count, count)
    depth = min(count, 4)  # as far as the moment reaches back
    assert [(s[:depth].tolist(), a[:depth].tolist()) for s, a in zip(states, before, strict=True)] == [
        (s[:depth], a[:depth]) for s, a in told
    ]
    np.testing.assert_array_equal(actions, np.concatenate([episode.actions for episode in episodes]))
    np.testing.assert_array_equal(rewards, np.concatenate([episode.rewards for episode in episodes]))
    np.testing.assert_array_equal(following, np.concatenate([episode.states[1:] for episode in episodes]))


def test_what_goes_on_is_joined_to_what_is_over_without_being_kept():
    experience = Experience(100, 3)
    experience.add(walk(6, 0))
    before = digest(experience.to_arrays())
    assert len(experience.joined(walk(4, 1))) == 10 and len(experience) == 6
    assert digest(experience.to_arrays()) == before


@pytest.mark.parametrize(
    ("rewards", "ends"),
    [
        ([0, 1, 0, 1, 0, 0, -1, 0], (True, False)),  # gains follow each other
        ([1, 0, 0, 0, 0, 0, 1, 0], (True, True)),  # too late
        ([-1, 1, 0, 0, 0, 0, -1, 1], (False, True)),
        ([0, 0, 0, 0, 0, 0, 0, 1], (True, True)),
        ([0] * 8, (True, True)),
    ],
)
def test_a_reward_that_is_mostly_followed_by_another_ends_nothing(rewards, ends):
    memory = Experience(100, 1)
    for _ in range(2):  # what comes in another episode does not follow
        states = np.zeros((9, 1), np.float32)
        memory.add(Trajectory(states=states, actions=np.zeros(8, np.int64), rewards=np.array(rewards, np.float32)))
    assert tuple(memory.ending(3)) == ends
    assert memory.ending(0).all()
