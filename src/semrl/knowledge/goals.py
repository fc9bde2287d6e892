"""Goals: what is sought, kept and shunned, over time (§2.5). Conditions on scenes are class expressions."""

import ast
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semrl.core.errors import UsageError
from semrl.knowledge.condition import expression_of, tree_of
from semrl.knowledge.consistency import require_possible
from semrl.knowledge.expressions import Bottom, Expression, Named, Not, Top, conjunction
from semrl.knowledge.manchester import is_manchester, read_manchester
from semrl.knowledge.ontology import Ontology

_TEMPORAL = {"always", "eventually", "before", "in_order"}


_ALWAYS = Top()


@dataclass(frozen=True, kw_only=True, slots=True)
class Stage:
    """One step of a task: something is reached while something else is kept."""

    reach: Expression
    """What ends the stage; ⊥ where it lasts to the end of the trial, and then has succeeded."""
    keep: Expression = _ALWAYS
    """What must hold at every decision before the end of it, from when it held first."""
    hold: int = 1
    """For how many decisions in a row `reach` must hold."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Goal:
    """Tasks that must all be done, each a sequence of stages."""

    tasks: tuple[tuple[Stage, ...], ...]

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """All conditions, each once."""
        every = [part for task in self.tasks for stage in task for part in (stage.reach, stage.keep)]
        return tuple(dict.fromkeys(every))


def read_goal(
    text: str,
    words: Ontology,
    *,
    hold: int = 1,
    until: str | None = None,
    avoid: str | None = None,
    forbidden: Sequence[str] = (),
) -> Goal:
    """Read a goal.

    It is a condition (see `read_condition`), or a class expression in Manchester syntax, that is to hold at some time.
    ``always(C)``, ``eventually(C)``, ``before(C, D)`` (C comes, and no D earlier) and ``in_order(C, D, …)`` say when;
    they may be joined by ``and``, and the first two follow ``not``.

    Parameters
    ----------
    text
        The goal.
    words
        The ontology that its words are of.
    hold
        For how many decisions in a row it must hold at last.
    until
        A condition up to which the goal must be kept, in place of reaching it.
    avoid
        A condition that must never hold meanwhile.
    forbidden
        Classes of scenes that must never be entered meanwhile.

    Raises
    ------
    UsageError
        When something is malformed or unknown, or does not go together.
    """
    if hold < 1:
        raise UsageError(f"a goal is held for 1 decision or more, not {hold}")
    tasks = _tasks(text, words)
    if until is not None:
        if hold > 1 or len(tasks) != 1 or len(tasks[0]) != 1 or tasks[0][0].keep != Top():
            raise UsageError("'until' goes with a plain condition, which is kept until another one holds")
        tasks = [(Stage(reach=read_expression(until, words), keep=tasks[0][0].reach),)]
    kept_out = [Named(name) for name in forbidden] + ([] if avoid is None else [read_expression(avoid, words)])
    shunned = conjunction(*map(Not, kept_out))
    finished = [(*task[:-1], replace(task[-1], hold=hold)) for task in tasks]
    return Goal(tasks=tuple(tuple(_without(stage, shunned) for stage in task) for task in finished))


def require_possible_goal(goal: Goal, words: Ontology) -> None:
    """Check that every stage of a goal can be had.

    Raises
    ------
    UsageError
        When one cannot; the message says why.
    """
    for stage in (stage for task in goal.tasks for stage in task):
        if stage.reach != Bottom():
            require_possible(stage.reach, words, "the goal")
        require_possible(stage.keep, words, "what is to be kept")


def read_expression(text: str, words: Ontology) -> Expression:
    """Read a condition on scenes in either syntax.

    Raises
    ------
    UsageError
        When it is malformed or uses unknown words.
    """
    return read_manchester(text, words) if is_manchester(text) else expression_of(tree_of(text), words)


def _without(stage: Stage, shunned: Expression) -> Stage:
    """Return a stage in which something is kept, at its end as well."""
    if shunned == _ALWAYS:
        return stage
    keep = shunned if stage.keep == _ALWAYS else conjunction(stage.keep, shunned)
    reach = stage.reach if stage.reach == Bottom() else conjunction(stage.reach, shunned)
    return replace(stage, reach=reach, keep=keep)


def _tasks(text: str, words: Ontology) -> list[tuple[Stage, ...]]:
    if is_manchester(text):
        return [(Stage(reach=read_manchester(text, words)),)]
    tree = tree_of(text)
    parts = tree.values if isinstance(tree, ast.BoolOp) and isinstance(tree.op, ast.And) else [tree]
    timeless = [part for part in parts if not _is_temporal(part)]
    tasks = [_task(part, words) for part in parts if _is_temporal(part)]
    if timeless:
        whole = timeless[0] if len(timeless) == 1 else ast.BoolOp(op=ast.And(), values=timeless)
        tasks.append((Stage(reach=expression_of(whole, words)),))
    return tasks


def _is_temporal(node: ast.expr) -> bool:
    return any(isinstance(part, ast.Name) and part.id in _TEMPORAL for part in ast.walk(node))


def _task(node: ast.expr, words: Ontology) -> tuple[Stage, ...]:
    match node:
        case ast.UnaryOp(op=ast.Not(), operand=ast.Call(func=ast.Name(id=("always" | "eventually") as name)) as inner):
            turned: ast.expr = ast.UnaryOp(op=ast.Not(), operand=inner.args[0]) if inner.args else inner
            other = "eventually" if name == "always" else "always"
            return _task(ast.Call(func=ast.Name(id=other), args=[turned], keywords=[]), words)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _TEMPORAL:
            conditions = [expression_of(argument, words) for argument in arguments]
            match name, conditions:
                case "always", [condition]:
                    return (Stage(reach=Bottom(), keep=condition),)
                case "eventually", [condition]:
                    return (Stage(reach=condition),)
                case "before", [first, then]:
                    return (Stage(reach=first, keep=Not(then)),)
                case "in_order", [_, *_]:
                    return tuple(Stage(reach=condition) for condition in conditions)
            raise UsageError(f"'{name}' does not take {len(conditions)} conditions")
    raise UsageError(
        "always, eventually, before and in_order stand at the front of a goal, joined by 'and'; "
        "within a condition they have no meaning"
    )


@dataclass(frozen=True, slots=True)
class _Conditions:
    reach: int
    keep: int
    hold: int
    lasting: bool


class Progress:
    """How far a goal has come in ``b`` courses of events at once.

    Parameters
    ----------
    goal
        What is followed.
    courses
        How many.

    Attributes
    ----------
    stages, held : ndarray
        ``(b, tasks)``: the stage that each task is in, and for how many decisions in a row its end has held.
    broken : ndarray
        ``(b,)``: whether something was not kept, so that the goal can no longer be had.
    """

    def __init__(self, goal: Goal, courses: int = 1) -> None:
        places = {expression: i for i, expression in enumerate(goal.expressions)}
        self.goal = goal
        self._tasks = [
            [_Conditions(places[s.reach], places[s.keep], s.hold, s.reach == Bottom()) for s in task]
            for task in goal.tasks
        ]
        shape = courses, len(goal.tasks)
        self.stages = np.zeros(shape, np.int64)
        self.held = np.zeros(shape, np.int64)
        self.settled = np.zeros(shape, np.bool_)
        self.broken = np.zeros(courses, np.bool_)

    def copies(self, courses: int) -> "Progress":
        """Return the same progress, so many times; this one has one course."""
        more = Progress(self.goal, courses)
        for name in ("stages", "held", "settled", "broken"):
            getattr(more, name)[:] = getattr(self, name)
        return more

    def follow(self, truths: NDArray[np.bool_]) -> None:
        """Go one decision on: ``(b, e)``, which of the goal's `expressions` hold now."""
        for k, task in enumerate(self._tasks):
            stage, moved = self.stages[:, k].copy(), np.zeros(len(truths), np.bool_)
            for i, now in enumerate(task):
                here = (stage == i) & ~self.broken
                kept, met = truths[:, now.keep], truths[:, now.reach]
                self.broken |= here & self.settled[:, k] & ~kept & ~met
                self.settled[:, k] |= here & kept
                reached = here & met & self.settled[:, k] & ~self.broken
                self.held[:, k] = np.where(here, np.where(reached, self.held[:, k] + 1, 0), self.held[:, k])
                moved |= here & (self.held[:, k] >= now.hold)
            self.stages[:, k] += moved
            self.held[moved, k] = 0
            self.settled[moved, k] = False

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether all tasks are done, ``(b,)``."""
        ends = [len(task) for task in self._tasks]
        return np.asarray((self.stages >= ends).all(axis=1) & ~self.broken)

    @property
    def reached_at_end(self) -> NDArray[np.bool_]:
        """Whether all tasks are done when a trial ends now, ``(b,)``: what was to be kept to the end was."""
        done = [
            (self.stages[:, k] >= len(task))
            | ((self.stages[:, k] == len(task) - 1) & task[-1].lasting & self.settled[:, k])
            for k, task in enumerate(self._tasks)
        ]
        return np.asarray(np.all(done, axis=0) & ~self.broken)

    @property
    def share(self) -> NDArray[np.float64]:
        """How much is done, ``(b,)``: stages, and of the present ones the share of the decisions they must hold."""
        within = np.zeros(len(self.broken))
        for k, task in enumerate(self._tasks):
            hold = np.array([now.hold for now in task] + [1])
            within += self.stages[:, k] + self.held[:, k] / hold[self.stages[:, k]]
        return within

    def wanted(self) -> list[Sequence[tuple[int, int]]]:
        """Return what each task of the first course asks for now.

        It is pairs of a condition's place and 1 for what is to be reached and 0 for what is to be kept.
        """
        asked: list[Sequence[tuple[int, int]]] = []
        for k, task in enumerate(self._tasks):
            if (stage := int(self.stages[0, k])) < len(task):
                now = task[stage]
                asked.append([(now.keep, 0), *([] if now.lasting else [(now.reach, 1)])])
        return asked
