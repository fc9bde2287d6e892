"""The encoder that reads the emulator's memory."""

import numpy as np
import pytest
from seeing import CONFIG, bits, encoded, episodes, schedule_of

from semrl.core.errors import UsageError
from semrl.envs import ram_feature_names, ram_features
from semrl.perception.encoders import ENCODERS


def test_it_shows_coordinates_and_learns_nothing():
    encoder = ENCODERS.load("ram")(CONFIG, rom="pong", planning=True)
    assert encoder.space.shape == (4,) and encoder.space.n_facts == 4 and encoder.space.dtype == np.float32
    assert encoder.space.names == ram_feature_names("pong")
    assert schedule_of(encoder).current is None and encoder.is_fitted and encoder.to_arrays() == {}
    (shown,) = episodes(4, env="PongNoFrameskip-v4")
    states = encoded(encoder, [observation for observation, _ in shown])
    for (observation, _), state in zip(shown, states, strict=True):
        np.testing.assert_array_equal(state.vector, ram_features("pong", observation.ram))
        np.testing.assert_array_equal(state.facts, state.vector)
    assert [bits(s) for s in encoded(encoder, [observation for observation, _ in shown])] == [bits(s) for s in states]


@pytest.mark.parametrize("rom", [None, "breakout"])
def test_it_needs_a_game_that_is_mapped(rom):
    with pytest.raises(UsageError, match=r"not mapped|no mapped RAM"):
        ENCODERS.load("ram")(CONFIG, rom=rom)
