"""Goals over time mean what linear temporal logic says, once what must be kept has held."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import WORDS

from semrl.knowledge.expressions import And, Bottom, Named, Not, Some, Top
from semrl.knowledge.goals import Progress, read_goal

COURSES = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=8)


def follow(text, course, **options):
    """Play a course of (ball, own); return after which decision it is reached, whether it is broken, how it ends."""
    goal = read_goal(text, WORDS, **options)
    progress = Progress(goal)
    reached = None
    for i, (ball, own) in enumerate(course, 1):
        truths = [truth(expression, ball, own) for expression in goal.expressions]
        progress.follow(np.array([truths]))
        if reached is None and progress.reached[0]:
            reached = i
    return reached, bool(progress.broken[0]), bool(progress.reached_at_end[0])


def truth(expression, ball, own):
    match expression:
        case Top() | Bottom():
            return isinstance(expression, Top)
        case Not(part):
            return not truth(part, ball, own)
        case And(parts):
            return all(truth(part, ball, own) for part in parts)
        case Some("contains", Named(name)):
            return {"ball": ball, "own": own}[name]
    raise AssertionError(expression)


@settings(max_examples=60, deadline=None)
@given(COURSES)
def test_reaching_is_eventually(course):
    first = next((i for i, (ball, _) in enumerate(course, 1) if ball), None)
    assert follow("ball", course)[0] == follow("eventually(ball)", course)[0] == first
    assert follow("not always(not ball)", course)[0] == first


@settings(max_examples=60, deadline=None)
@given(COURSES, st.integers(1, 4))
def test_holding_is_so_many_in_a_row(course, hold):
    runs = [i for i in range(hold, len(course) + 1) if all(ball for ball, _ in course[i - hold : i])]
    assert follow("ball", course, hold=hold)[0] == (runs[0] if runs else None)


@settings(max_examples=60, deadline=None)
@given(COURSES)
def test_in_order_takes_a_decision_each(course):
    first = next((i for i, (ball, _) in enumerate(course) if ball), len(course))
    then = next((i for i, (_, own) in enumerate(course) if own and i > first), None)
    assert follow("in_order(ball, own)", course)[0] == (None if then is None else then + 1)


@settings(max_examples=60, deadline=None)
@given(COURSES)
def test_what_is_kept_counts_from_when_it_held(course):
    start = next((i for i, (ball, _) in enumerate(course) if ball), None)
    kept = start is not None and all(ball for ball, _ in course[start:])
    assert follow("always(ball)", course)[2] == kept
    assert follow("not eventually(not ball)", course)[2] == kept


@settings(max_examples=60, deadline=None)
@given(COURSES)
def test_until_keeps_up_to_the_end(course):
    start = next((i for i, (ball, _) in enumerate(course) if ball), None)
    reached = None
    for i, (ball, own) in enumerate(course):
        if start is None or i < start:
            continue
        if own:
            reached = i + 1
            break
        if not ball:
            break
    assert follow("ball", course, until="own")[0] == reached


@settings(max_examples=60, deadline=None)
@given(COURSES)
def test_what_is_avoided_breaks_the_goal(course):
    found, broken, _ = follow("ball", course, avoid="own")
    free = next((i for i, (_, own) in enumerate(course) if not own), len(course))
    after = course[free:]
    good = next((i for i, (ball, own) in enumerate(after) if ball and not own), len(after))
    bad = next((i for i, (_, own) in enumerate(after) if own), len(after))
    assert (found is not None) == (good < bad)
    assert broken == (bad < good)


@pytest.mark.parametrize("text", ["eventually(ball) and eventually(own)", "eventually(ball) and own"])
def test_all_tasks_must_be_done_in_any_order(text):
    assert follow(text, [(True, False), (False, False), (False, True)])[0] == 3
    assert follow(text, [(False, True), (True, False)])[0] == 2
    assert follow(text, [(False, True), (False, True)])[0] is None
