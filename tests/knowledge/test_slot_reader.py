"""What is read of facts is what the axioms of roles say already: closing it adds nothing."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semrl.knowledge.compiler import entail, role_axioms
from semrl.knowledge.ontology import Role
from semrl.knowledge.slots import SlotReader, kinds_of, slots_of, words_of

NAMES = [f"{thing} {what}" for thing in ("own", "ball", "enemy", "far") for what in ("x", "y", "seen")]


def reader_of(words, slots, kinds):
    return SlotReader(slots, kinds, words, arena=(5.0, 5.0, 95.0, 95.0))


@settings(deadline=None)  # compiled at first
@given(st.integers(0, 10_000))
def test_roles_that_are_read_are_closed_under_their_axioms(seed):
    slots = slots_of(NAMES)
    kinds = [kinds_of(slot, np.zeros(len(NAMES), np.bool_)) for slot in slots]
    words = words_of(slots, kinds)
    bare = replace(words, roles=tuple(Role(name=role.name) for role in words.roles))
    rng = np.random.default_rng(seed)
    states, previous = rng.random((2, 8, len(NAMES))).round(2)  # things often stand on one line
    read, scenes = (reader_of(some, slots, kinds).read(states, previous) for some in (bare, words))
    np.testing.assert_array_equal(read.roles, scenes.roles)
    assert scenes.roles.any()
    less = scenes.roles.copy()
    less[:, words.role_names.index("rightOf")] = False
    entail(again := replace(scenes, roles=less), role_axioms(words))
    np.testing.assert_array_equal(again.roles, scenes.roles)
