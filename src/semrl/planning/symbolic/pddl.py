"""Operators and a state as a domain and a problem of PDDL (McDermott et al. 1998): STRIPS, with types and ADL's ¬∃."""

import re
from collections.abc import Mapping, Sequence

from semrl.planning.symbolic.cells import OUTSIDE, GridState
from semrl.planning.symbolic.operators import Operator, Operators
from semrl.planning.symbolic.search import SymbolicGoal
from semrl.planning.symbolic.turning import Offset

_NO_PLACE = "nowhere"


def write_domain(operators: Operators, name: str, actions: Sequence[str], concepts: Mapping[int, str]) -> str:
    """Write operators as a domain.

    Parameters
    ----------
    operators
        See `Operators`; those that change nothing are left out.
    name
        Of the domain.
    actions
        Names of the actions, by number.
    concepts
        Names of the concepts of cells.
    """
    useful = [one for one in operators.operators if _is_useful(one)]
    offsets = sorted({offset for one in useful for offset in _offsets(one)})
    kinds = sorted({kind for one in useful for kind in (one.kind, one.effect.kind)})
    predicates = [
        "(own-at ?c - cell)",
        *(f"(own-looks-{kind})" for kind in kinds),
        *(f"({concepts[concept]} ?c - cell)" for concept in sorted(concepts)),
        *(f"({_relation(offset)} ?a ?b - cell)" for offset in offsets),
        "(gained)",
        "(ended)",
    ]
    lines = [
        f"(define (domain {_word(name)})",
        "  (:requirements :strips :typing :negative-preconditions :existential-preconditions)",
        "  (:types cell)",
        "  (:predicates",
        *(f"    {predicate}" for predicate in predicates),
        "  )",
    ]
    for number, operator in enumerate(useful):
        lines += _action(operator, f"{_word(actions[operator.action])}-{number}", concepts)
    return "\n".join([*lines, ")", ""])


def write_problem(
    operators: Operators, state: GridState, goal: SymbolicGoal, name: str, concepts: Mapping[int, str]
) -> str:
    """Write a state and a goal as a problem of the domain of these operators."""
    useful = [one for one in operators.operators if _is_useful(one)]
    offsets = sorted({offset for one in useful for offset in _offsets(one)})
    rows, columns = len(state.cells) // state.columns, state.columns
    cells = [(row, column) for row in range(rows) for column in range(columns)]
    facts = [f"(own-at {_cell((state.row, state.column))})", f"(own-looks-{state.kind})"]
    for row, column in cells:
        concept = state.concept((row - state.row, column - state.column))
        facts += [f"({concepts[concept]} {_cell((row, column))})"] if concept in concepts else []
    for offset in offsets:
        for row, column in cells:
            there = row + offset[0], column + offset[1]
            facts.append(
                f"({_relation(offset)} {_cell((row, column))} {_cell(there) if there in cells else _NO_PLACE})"
            )
    objects = [_cell(cell) for cell in cells]
    return "\n".join(
        [
            f"(define (problem {_word(name)}-1)",
            f"  (:domain {_word(name)})",
            f"  (:objects {' '.join([*objects, _NO_PLACE])} - cell)",
            "  (:init",
            *(f"    {fact}" for fact in [*facts, f"({concepts[OUTSIDE]} {_NO_PLACE})"]),
            "  )",
            f"  (:goal {_goal(goal, concepts)})",
            ")",
            "",
        ]
    )


def operator_of(operators: Operators, name: str) -> Operator:
    """Return the operator that an action of the domain stands for: its number follows its name."""
    useful = [one for one in operators.operators if _is_useful(one)]
    return useful[int(name.rsplit("-", 1)[1])]


def _is_useful(operator: Operator) -> bool:
    effect = operator.effect
    return bool(effect.move != (0, 0) or effect.kind != operator.kind or effect.changes or effect.gain or effect.ends)


def _offsets(operator: Operator) -> list[Offset]:
    """Return the offsets that an operator speaks of."""
    asked = [ask for ask, _ in operator.when if isinstance(ask, tuple) and ask != (0, 0)]
    moved = [operator.effect.move] if operator.effect.move != (0, 0) else []
    changed = [offset for offset, _ in operator.effect.changes if offset != (0, 0)]
    return sorted({*asked, *moved, *changed})


def _action(operator: Operator, name: str, concepts: Mapping[int, str]) -> list[str]:
    effect, offsets = operator.effect, _offsets(operator)
    names = {(0, 0): "?here", **{offset: f"?c{i}" for i, offset in enumerate(offsets)}}
    asked = dict(operator.when)
    conditions = ["(own-at ?here)", f"(own-looks-{operator.kind})", "(not (ended))"]
    conditions += [f"({_relation(offset)} ?here {names[offset]})" for offset in offsets]
    for ask, answer in operator.when:
        if isinstance(ask, tuple):
            conditions.append(f"({concepts[answer]} {names[ask]})")
        elif ask in concepts:
            some = f"(exists (?x - cell) ({concepts[ask]} ?x))"
            conditions.append(some if answer else f"(not {some})")
    effects = []
    if effect.move != (0, 0):
        effects += ["(not (own-at ?here))", f"(own-at {names[effect.move]})"]
    if effect.kind != operator.kind:
        effects += [f"(not (own-looks-{operator.kind}))", f"(own-looks-{effect.kind})"]
    for offset, concept in effect.changes:
        before = asked.get(offset)
        effects += [f"(not ({word} {names[offset]}))" for known, word in concepts.items() if before in {known, None}]
        effects.append(f"({concepts[concept]} {names[offset]})")
    effects += ["(gained)"] if effect.gain > 0 else []
    effects += ["(ended)"] if effect.ends else []
    return [
        f"  (:action {name}",
        f"    :parameters ({' '.join(names.values())} - cell)",
        f"    :precondition (and {' '.join(conditions)})",
        f"    :effect (and {' '.join(effects)})",
        "  )",
    ]


def _goal(goal: SymbolicGoal, concepts: Mapping[int, str]) -> str:
    if goal.event:
        return "(gained)" if goal.event == "gain" else "(ended)"
    if goal.place is not None:
        return f"(own-at {_cell(goal.place)})"
    assert goal.concept is not None
    return f"(exists (?x - cell) (and (own-at ?x) ({concepts[goal.concept]} ?x)))"


def _relation(offset: Offset) -> str:
    down, right = offset
    return "to" + "".join(
        f"-{'up' if n < 0 and axis == 'row' else 'left' if n < 0 else 'down' if axis == 'row' else 'right'}{abs(n)}"
        for n, axis in ((down, "row"), (right, "column"))
        if n
    )


def _cell(place: Offset) -> str:
    return f"r{place[0]}c{place[1]}"


def _word(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "world"
