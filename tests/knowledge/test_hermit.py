"""Edits that only a description logic reasoner finds impossible are refused with the reason."""

import pytest
from scenes import WORDS

from semrl.core.errors import SemrlWarning, UsageError
from semrl.knowledge import hermit
from semrl.knowledge.condition import read_condition
from semrl.knowledge.consistency import satisfiable
from semrl.knowledge.ontology import Definition

BACK_AND_FORTH = "some(contains, some(leftOf, only(rightOf, ball and not ball)))"
"""Impossible: what is on the right of something has that on its left. The tableau does not look through inverses."""


def having(text):
    definition = Definition(expression=read_condition(text, WORDS))
    return definition, WORDS.having(New=definition)


@pytest.mark.skipif(not hermit.has_hermit(), reason="needs the extra 'dl' and Java")
def test_what_contradicts_through_an_inverse_is_refused_with_the_reason():
    definition, after = having(BACK_AND_FORTH)
    assert satisfiable(definition.expression, after)
    with pytest.raises(UsageError, match=r"nothing could be of the class New.*leftOf is the inverse of rightOf"):
        hermit.require_possible_to_hermit(WORDS, after, "'New'")
    hermit.require_possible_to_hermit(after, after, "'New'")  # it was impossible before
    hermit.require_possible_to_hermit(WORDS, having("some(contains, ball and x < 30)")[1], "'New'")


def test_without_the_extra_nothing_more_is_asked(monkeypatch):
    asked = []
    monkeypatch.setattr(hermit.shutil, "which", lambda _: None)
    monkeypatch.setattr(hermit.subprocess, "run", lambda *command, **_: asked.append(command))
    hermit.require_possible_to_hermit(WORDS, having(BACK_AND_FORTH)[1], "'New'")
    assert not asked


def test_a_reasoner_that_fails_is_told_and_stops_nothing(monkeypatch):
    monkeypatch.setattr(hermit, "has_hermit", lambda: True)

    def fails(_):
        raise UsageError("HermiT gave no answer (TimeoutExpired)")

    monkeypatch.setattr(hermit, "impossible_classes", fails)
    with pytest.warns(SemrlWarning, match=r"no answer .*; 'New' was checked without it"):
        hermit.require_possible_to_hermit(WORDS, having(BACK_AND_FORTH)[1], "'New'")
