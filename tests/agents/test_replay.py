"""The ring against the plain definition: a list of episodes and the formula of the n-step return."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semrl.agents.replay import REWARD_WINDOW, ReplayBuffer
from semrl.core.arrays import digest

DISCOUNT = 0.9
NO_PLAN = np.zeros(0, np.float32)


class Naive:
    """Entries ``(episode, step, action, reward)``; an observation is its serial number, its plan that with a minus."""

    def __init__(self, episodes, capacity):
        self.entries = []  # (serial, action, reward, terminated, first, last)
        serial = 0
        for length, ending in episodes:
            for step in range(length):
                terminated = ending == "terminated" and step == length - 1
                reward = float((serial * 7919) % 13 - 6)
                self.entries.append((serial, serial % 3, reward, terminated, step == 0))
                serial += 1
            if ending != "running":
                self.entries.append((serial, -1, 0.0, False, False))
                serial += 1
        self.count = len(self.entries)
        self.oldest = max(0, self.count - capacity)

    def fill(self, buffer):
        for serial, action, reward, terminated, first in self.entries:
            if action < 0:
                buffer.end_episode(np.array([serial]), np.array([-serial]))
            else:
                buffer.add(np.array([serial]), np.array([-serial]), action, reward, terminated=terminated, start=first)

    def drawable(self):
        return {e[0] for e in self.entries[self.oldest : self.count - 1] if e[1] >= 0}

    def state(self, serial):
        first = self.entries[serial][4] or serial == self.oldest
        return [serial, serial if first else serial - 1]

    def transition(self, serial, n_steps):
        """State, action, return, next state (None when it does not matter) and discount."""
        total, factor, i = 0.0, 1.0, serial
        for _ in range(n_steps):
            _, action, reward, terminated, _ = self.entries[i]
            if action < 0 or i == self.count - 1:
                break
            total += factor * reward
            factor *= DISCOUNT
            if terminated:
                return self.state(serial), self.entries[serial][1], total, None, 0.0
            i += 1
        return self.state(serial), self.entries[serial][1], total, self.state(i), factor


def filled(episodes, capacity):
    naive, buffer = Naive(episodes, capacity), ReplayBuffer(capacity, (1,), np.int64, plan_size=1)
    naive.fill(buffer)
    return naive, buffer


def check_batch(naive, batch, n_steps):
    for i, (serial, _) in enumerate(batch.states[:, :, 0]):
        state, action, total, next_state, discount = naive.transition(serial, n_steps)
        assert batch.states[i, :, 0].tolist() == state
        assert batch.plans[i].tolist() == [-serial]
        assert batch.actions[i] == action
        assert batch.returns[i] == pytest.approx(total, abs=1e-4)
        assert batch.discounts[i] == pytest.approx(discount, abs=1e-6)
        if next_state is not None:
            assert batch.next_states[i, :, 0].tolist() == next_state
            assert batch.next_plans[i].tolist() == [-next_state[0]]


endings = st.sampled_from(["terminated", "truncated"])
histories = st.tuples(
    st.lists(st.tuples(st.integers(1, 12), endings), max_size=6), st.tuples(st.integers(2, 9), st.just("running"))
).map(lambda parts: [*parts[0], parts[1]])


@settings(deadline=None, max_examples=150)
@given(histories, st.integers(3, 40), st.integers(1, 6), st.sampled_from([0.0, 0.5, 1.0]))
def test_transitions_are_those_of_a_list_of_episodes(episodes, capacity, n_steps, share):
    naive, buffer = filled(episodes, capacity)
    rng = np.random.default_rng(0)
    batch = buffer.sample(rng, 64, n_steps=n_steps, discount=DISCOUNT, reward_share=share)
    assert len(buffer) == min(naive.count, capacity)
    assert {*batch.states[:, 0, 0].tolist()} <= naive.drawable()
    check_batch(naive, batch, n_steps)


def test_everything_that_can_be_drawn_is_drawn_alike():
    naive, buffer = filled([(5, "terminated"), (7, "truncated"), (9, "running")], 15)
    batch = buffer.sample(np.random.default_rng(0), 20_000, n_steps=3, discount=DISCOUNT)
    serials, counts = np.unique(batch.states[:, 0, 0], return_counts=True)
    assert {*serials.tolist()} == naive.drawable()
    expected = 20_000 / len(serials)
    assert np.abs(counts - expected).max() < 5 * np.sqrt(expected)


def test_a_terminated_episode_counts_nothing_after_it_and_a_truncated_one_bootstraps():
    for ending, discount in (("terminated", 0.0), ("truncated", DISCOUNT)):
        naive, buffer = filled([(4, ending), (2, "running")], 10)
        batch = buffer.sample(np.random.default_rng(0), 200, n_steps=1, discount=DISCOUNT)
        last = batch.states[:, 0, 0] == 3
        assert last.any() and np.allclose(batch.discounts[last], discount)
        if ending == "truncated":
            assert (batch.next_states[last, :, 0] == [4, 3]).all()
        check_batch(naive, batch, 1)


def test_the_first_state_of_an_episode_has_no_difference():
    _, buffer = filled([(3, "truncated"), (4, "running")], 20)
    states = buffer.latest(100)[0][:, :, 0].tolist()
    assert states == [[0, 0], [1, 0], [2, 1], [3, 2], [4, 4], [5, 4], [6, 5], [7, 6]]
    assert buffer.latest(3)[0][:, :, 0].tolist() == states[-3:]


def test_the_latest_after_the_ring_went_round():
    _, buffer = filled([(30, "running")], 8)
    assert buffer.latest(100)[0][:, 0, 0].tolist() == list(range(22, 30))
    assert buffer.latest(100)[0][0, :, 0].tolist() == [22, 22]  # what was before it is overwritten


def rewarded_buffer(capacity=2000, rewards=(500, 1200), length=1500):
    buffer = ReplayBuffer(capacity, (1,), np.int64)
    for i in range(length):
        buffer.add(np.array([i]), NO_PLAN, 0, float(i in rewards), terminated=False, start=i == 0)
    return buffer


@pytest.mark.parametrize("capacity", [2000, 1100])
def test_a_share_is_drawn_from_shortly_before_rewards(capacity):
    buffer = rewarded_buffer(capacity)
    batch = buffer.sample(np.random.default_rng(0), 4000, n_steps=1, discount=DISCOUNT, reward_share=0.25)
    drawn = batch.states[:, 0, 0]
    near = np.zeros(len(drawn), bool)
    for reward in (500, 1200):
        near |= (drawn > reward - REWARD_WINDOW) & (drawn <= reward)
    assert near[:1000].all()
    assert near[1000:].mean() < 0.2
    for reward in (500, 1200):  # each reward, and each decision before it, as likely as the others
        counts = np.bincount(reward - drawn[:1000][np.abs(drawn[:1000] - reward) <= REWARD_WINDOW])
        assert len(counts) == REWARD_WINDOW
        assert counts.sum() == pytest.approx(500, abs=90)


def test_without_rewards_every_draw_is_uniform():
    buffer = rewarded_buffer(rewards=())
    drawn = [
        buffer.sample(np.random.default_rng(0), 500, n_steps=1, discount=DISCOUNT, reward_share=share).states
        for share in (0.0, 1.0)
    ]
    np.testing.assert_array_equal(*drawn)


def test_every_frame_is_stored_once():
    capacity, shape = 500, (84, 84)
    buffer = ReplayBuffer(capacity, shape, np.uint8)
    stored = sum(v.nbytes for v in vars(buffer).values() if isinstance(v, np.ndarray))
    assert stored <= capacity * (84 * 84 + 16)
    frame = np.random.default_rng(0).integers(256, size=shape, dtype=np.uint8)
    buffer.add(frame, NO_PLAN, 1, 0.0, terminated=False, start=True)
    kept = frame.copy()
    frame[:] = 0  # what is stored is a copy
    np.testing.assert_array_equal(buffer.latest(1)[0][0, 0], kept)


@pytest.mark.parametrize("length", [3, 25, 90])
def test_restored_it_draws_the_same(length):
    _, buffer = filled([(10, "terminated"), (length, "running")], 40)
    saved = {name: array.copy() for name, array in buffer.to_arrays().items()}
    assert len(saved["observations"]) == len(buffer)
    restored = ReplayBuffer(40, (1,), np.int64, plan_size=1)
    Naive([(80, "running")], 40).fill(restored)  # used before
    restored.from_arrays(saved)
    assert digest(restored.to_arrays()) == digest(saved)
    for _ in range(2):
        one, two = (
            b.sample(np.random.default_rng(1), 50, n_steps=3, discount=DISCOUNT, reward_share=0.5)
            for b in (buffer, restored)
        )
        for name in ("states", "plans", "actions", "returns", "next_states", "next_plans", "discounts"):
            np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
        for b in (buffer, restored):
            b.add(np.array([1000]), np.array([7]), 1, 1.0, terminated=False, start=False)
