"""Keys for the actions of any game, by the words in their names."""

import re
from collections.abc import Collection, Sequence

KEYS = {
    "UP": "ArrowUp",
    "DOWN": "ArrowDown",
    "LEFT": "ArrowLeft",
    "RIGHT": "ArrowRight",
    "FORWARD": "ArrowUp",
    "FIRE": " ",
    "ATTACK": " ",
    "TOGGLE": " ",
    "PICK": "p",
    "DROP": "d",
    "USE": "u",
    "DONE": "Enter",
}
"""Words in names of actions, and the keys that stand for them, as browsers call keys."""

SPARE = "123456789qwertyasfgh"
"""Keys for actions whose names say nothing, by their numbers; later ones have none."""

WAITING = ("NOOP", "STAY", "WAIT")
"""Names of actions that need no key."""

_WORDS = re.compile("|".join(["PICKUP", *KEYS]))  # the UP of PICKUP is no direction


def keys_of(actions: Sequence[str]) -> list[frozenset[str]]:
    """Return the keys that must be held for each action; none for one that waits.

    >>> [sorted(keys) for keys in keys_of(["NOOP", "UPFIRE", "jump"])]
    [[], [' ', 'ArrowUp'], ['3']]
    """
    found: list[frozenset[str]] = []
    for i, name in enumerate(actions):
        words = _WORDS.findall(name.upper())
        keys = frozenset(KEYS[word.replace("PICKUP", "PICK")] for word in words)
        if keys in found or not (keys or name.upper() in WAITING):
            keys = frozenset([SPARE[i] if i < len(SPARE) else ""])  # no key is called ""
        found.append(keys)
    return found


def action_for(held: Collection[str], keys: Sequence[frozenset[str]]) -> int | None:
    """Return the action of which most keys are held and none is missing; None where there is no such action.

    While nothing is held that is the action that waits, if there is one.
    """
    fitting = [i for i, wanted in enumerate(keys) if wanted.issubset(held)]
    return max(fitting, key=lambda i: len(keys[i]), default=None)
