"""Class expressions on arrays, compiled: one small interpreter serves every ontology, so nothing is compiled anew."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Ints
from semrl.core.kernels import compiled

CLASS, EVERY, BOTH, EITHER, WITHOUT, BELOW, UP_TO, BEYOND, FROM, COUNT, VALUE, ITSELF, SCENE_ITSELF = range(13)
"""Operations. Each writes one row: who is of an expression."""

INVERSE, SYMMETRIC, TRANSITIVE, CHAIN = range(4)
"""Axioms on roles."""


@compiled
def run_program(  # noqa: PLR0912, PLR0917 - no keywords where compiled; in parts it takes 1.6 times as long
    program: Ints,
    bounds: NDArray[np.float64],
    present: NDArray[np.bool_],
    classes: NDArray[np.bool_],
    roles: NDArray[np.bool_],
    numbers: NDArray[np.float64],
    wanted: Ints,
) -> NDArray[np.bool_]:
    """Decide who is of which class in ``b`` scenes.

    Parameters
    ----------
    program
        ``(k, 5)``: operation and four operands; row i of it writes row i of who is of what.
    bounds
        ``(k,)``: what numbers are compared with.
    present, classes, roles, numbers
        As in `Interpretation`.
    wanted
        ``(m,)``: rows to be returned.

    Returns
    -------
    ndarray
        ``(b, m, n)`` bool.
    """
    scenes, n = present.shape
    rows = np.zeros((len(program), n), np.bool_)
    found = np.empty((scenes, len(wanted), n), np.bool_)
    for s in range(scenes):
        for k in range(len(program)):
            op, a, b, low, high = program[k]
            for i in range(n):
                holds = False
                if not present[s, i]:
                    pass
                elif op == CLASS:
                    holds = classes[s, a, i]
                elif op == EVERY:
                    holds = True
                elif op == SCENE_ITSELF:
                    holds = i == 0
                elif op == BOTH:
                    holds = rows[a, i] and rows[b, i]
                elif op == EITHER:
                    holds = rows[a, i] or rows[b, i]
                elif op == WITHOUT:
                    holds = not rows[a, i]
                elif op == BELOW:
                    holds = numbers[s, a, i] < bounds[k]
                elif op == UP_TO:
                    holds = numbers[s, a, i] <= bounds[k]
                elif op == BEYOND:
                    holds = numbers[s, a, i] > bounds[k]
                elif op == FROM:
                    holds = numbers[s, a, i] >= bounds[k]
                elif op == COUNT:
                    count = 0
                    for j in range(n):
                        count += roles[s, a, i, j] and rows[b, j]
                    holds = low <= count <= high
                elif op == VALUE:
                    holds = b >= 0 and present[s, b] and roles[s, a, i, b]
                else:
                    holds = roles[s, a, i, i]
                rows[k, i] = holds
        for m in range(len(wanted)):
            found[s, m] = rows[wanted[m]]
    return found


@compiled
def materialise(roles: NDArray[np.bool_], axioms: Ints) -> None:
    """Add to ``(b, r, n, n)`` roles all that ``(a, 4)`` axioms entail: kind, and up to three roles."""
    scenes, _, n, _ = roles.shape
    for s in range(scenes):
        grows = len(axioms) > 0
        while grows:
            grows = False
            for k in range(len(axioms)):
                kind, a, b, c = axioms[k]
                for i in range(n):
                    for j in range(n):
                        if kind in (INVERSE, SYMMETRIC):
                            if roles[s, a, i, j] and not roles[s, b, j, i]:
                                roles[s, b, j, i] = grows = True
                            if roles[s, b, i, j] and not roles[s, a, j, i]:
                                roles[s, a, j, i] = grows = True
                        elif roles[s, b, i, j]:
                            for m in range(n):
                                if roles[s, c, j, m] and not roles[s, a, i, m]:
                                    roles[s, a, i, m] = grows = True


def axiom_rows(axioms: list[tuple[int, int, int, int]]) -> Ints:
    """Return axioms as `materialise` takes them: a symmetric role as its own inverse, a transitive one as a chain."""
    own = {SYMMETRIC, TRANSITIVE}
    return np.array([(kind, a, a, a) if kind in own else (kind, a, b, c) for kind, a, b, c in axioms]).reshape(-1, 4)
