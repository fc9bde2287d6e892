"""What an agent is shown of one observation."""

import dataclasses

import numpy as np
import pytest

from semrl.core import AgentObservation, State, StateSpace


def test_images_have_no_facts_and_no_plan() -> None:
    image = np.zeros((84, 84), np.uint8)
    state, shown = State(vector=image), AgentObservation(vectors=np.stack([image, image]))
    for numbers in (state.facts, shown.plan):
        assert numbers.shape == (0,) and numbers.dtype == np.float32


def test_each_has_facts_of_its_own() -> None:
    one, two = State(vector=np.zeros(3)), State(vector=np.zeros(3))
    assert one.facts is not two.facts


@pytest.mark.parametrize(
    "value", [State(vector=np.zeros(3)), StateSpace(shape=(3,)), AgentObservation(vectors=np.zeros((2, 3)))]
)
def test_they_are_frozen(value: object) -> None:
    for field in dataclasses.fields(value):  # type: ignore[arg-type]
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(value, field.name, None)
    with pytest.raises((AttributeError, TypeError)):
        value.other = 1  # type: ignore[attr-defined]


def test_a_space_is_of_numbers_without_names_unless_it_says_so() -> None:
    space = StateSpace(shape=(3,))
    assert (np.dtype(space.dtype), space.n_facts, space.names, space.axes, space.unit) == (
        np.float32,
        0,
        (),
        None,
        None,
    )
