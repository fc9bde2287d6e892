"""How long it takes to classify a scene of ten things in thirty classes: reading it, what its roles entail, deciding.

python benchmarks/classes.py
"""

import json
import time
from collections.abc import Callable

import machine
import numpy as np

from semrl.knowledge.compiler import Classifier, entail, role_axioms
from semrl.knowledge.condition import read_condition
from semrl.knowledge.ontology import Definition
from semrl.knowledge.slots import SlotReader, kinds_of, slots_of, words_of

THINGS, CLASSES, SCENES, ROUNDS = 10, 30, 200, 5
CONDITIONS = (
    "some(contains, ball and some(touches, own))",
    "at_least(2, contains, autonomous and y > 40)",
    "only(contains, controlled or x <= 80)",
    "some(contains, some(leftOf, some(leftOf, ball)))",
    "approaches(ball, left_border) and not near(ball, own)",
)


def main() -> None:
    """Measure, and print microseconds a scene: of single scenes, and of as many at once."""
    slots = slots_of(
        [f"{name} {axis}" for name in ("own", *map(str, range(THINGS - 1))) for axis in ("x", "y", "seen")]
    )
    flying = np.arange(3 * THINGS) < 12
    kinds = [kinds_of(slot, flying) for slot in slots]
    words = words_of(slots, kinds)
    reader = SlotReader(slots, kinds, words)
    for i in range(CLASSES):
        text = f"{CONDITIONS[i % len(CONDITIONS)]} and own.x < {i}"
        words = words.having(**{f"C{i}": Definition(expression=read_condition(text, words))})
    classifier, axioms = Classifier(words), role_axioms(words)
    states = np.random.default_rng(0).random((SCENES, 3 * THINGS), np.float32)
    states[:, 2::3] = 1
    scene = reader.read(states[:1], states[1:2])

    def decide() -> None:
        for _ in range(SCENES):
            entail(scene, axioms)
            classifier(scene)

    def one_by_one() -> None:
        for i in range(SCENES):
            classifier(reader.read(states[i : i + 1], states[i : i + 1]))

    measured = {
        "decided": _microseconds(decide),
        "read and decided": _microseconds(one_by_one),
        "read and decided, all at once": _microseconds(lambda: classifier(reader.read(states, states))),
    }
    print(json.dumps({"things": THINGS, "classes": CLASSES, "microseconds": measured, "machine": machine.describe()}))


def _microseconds(work: Callable[[], object]) -> float:
    """Return the least time a scene, of some rounds."""
    work()
    times = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return round(1e6 * min(times) / SCENES, 1)


if __name__ == "__main__":
    main()
