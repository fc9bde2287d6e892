"""The words that describe a scene (§3.2.3): where each object is, and what it is surrounded by.

The thesis prints the words of one object, the left digit of the score. They settle what its text leaves
open. The digit lies at row 4, column 21 of the image, so the thesis's *x* is the row and its *y* the
column. Positions are cut down to integers and approximate ones are divided without remainder. Its first
hash, ``dab5edac…``, is the 128-bit BLAKE2b digest of ``811111``: an object of class 8 with five neighbours
of class 1, their labels sorted and written one after the other, which is how networkx hashes subgraphs.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semrl.core import SceneGraph
from semrl.core.errors import UsageError

Hashes = NDArray[np.uint64]

PIECES = ("", "pos_x", "pos_y", "apr_pos_x", "apr_pos_y")
"""What position words are put together from: class number, row, column and the cells of both, each after its name."""

_KIND, _X, _Y, _NEAR_X, _NEAR_Y = range(len(PIECES))
_PLAIN = ((_KIND,), (_X,), (_Y,), (_NEAR_X,), (_NEAR_Y,))
_BOUND = ((_KIND, _X), (_KIND, _Y), (_KIND, _NEAR_X), (_KIND, _NEAR_Y))
# The class stands once more before the exact column than before the approximate one: so it is printed.
_BOTH = ((_KIND, _NEAR_X, _NEAR_Y), (_KIND, _X, _KIND, _Y), (_NEAR_X, _NEAR_Y), (_X, _KIND, _Y))

POSITION_WORDS = {"pv-dbow": _PLAIN + _BOUND + _BOTH, "pv-dm": _PLAIN}
"""The words of each form, as places in `PIECES`. The text leaves out the column among the words of PV-DM; we take that
for a slip of the pen, since the approximate column is there and the printed example has both."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WordsConfig:
    """Settings of the words of a scene."""

    form: Literal["pv-dbow", "pv-dm"] = "pv-dbow"
    """Words of an object: `pv-dbow` adds words that bind class and position together, `pv-dm` does not."""
    wl_iterations: int = 2
    """How often labels are hashed with those of their neighbours; each time adds a word to an object."""
    coarse_px: int = 5
    """Width in pixels of the cells of an approximate position."""

    def __post_init__(self) -> None:
        if self.form not in ("pv-dbow", "pv-dm"):
            raise UsageError(f"form must be 'pv-dbow' or 'pv-dm', not {self.form!r}")
        if self.wl_iterations < 0:
            raise UsageError(f"wl_iterations must be 0 or more, not {self.wl_iterations}")
        if self.coarse_px < 1:
            raise UsageError(f"coarse_px must be 1 or more, not {self.coarse_px}")

    @property
    def words_per_object(self) -> int:
        """Number of words that every object has."""
        return len(POSITION_WORDS[self.form]) + self.wl_iterations


def document(graph: SceneGraph, config: WordsConfig) -> list[str]:
    """Write a scene as one list of words: its `sentences`, one after the other."""
    return [word for sentence in sentences(graph, config) for word in sentence]


def sentences(graph: SceneGraph, config: WordsConfig) -> list[tuple[str, ...]]:
    """Write a scene as words, object by object (§3.2.3).

    Parameters
    ----------
    graph
        The scene, ``n`` objects.
    config
        Which words to write.

    Returns
    -------
    list of tuple of str
        ``n`` sentences in the order of the objects, each of ``config.words_per_object`` words: first the
        `position_words`, then the `wl_hashes`.
    """
    places = graph.centres_px.astype(int).tolist()  # cuts off the fraction
    hashes = wl_hashes(graph, config.wl_iterations)
    return [
        position_words(number, row, column, config) + words
        for number, (row, column), words in zip(graph.classes.tolist(), places, hashes, strict=True)
    ]


@lru_cache(maxsize=1 << 15)
def position_words(number: int, row: int, column: int, config: WordsConfig) -> tuple[str, ...]:
    """Write what an object is and where: all its words but the hashes (§3.2.3).

    Parameters
    ----------
    number
        The object's class number.
    row, column
        Centre of the object, in whole pixels.
    config
        Which words to write.

    Returns
    -------
    tuple of str
        5 words for PV-DM; 13 for PV-DBOW, in the order of the thesis's example.
    """
    near = config.coarse_px
    numbers = (number, row, column, row // near, column // near)
    pieces = [f"{name}{value}" for name, value in zip(PIECES, numbers, strict=True)]
    return tuple("".join([pieces[piece] for piece in word]) for word in POSITION_WORDS[config.form])


def wl_hashes(graph: SceneGraph, iterations: int) -> list[tuple[str, ...]]:
    """Hash the surroundings of each object (Weisfeiler and Lehman; §3.2.3, Fig. 3.7).

    An object's label is its class number at first. Each iteration replaces it by the hash of itself and
    the sorted labels of the neighbours, so that after ``k`` iterations it describes what lies within ``k``
    edges. The hashes do not depend on the process, the order of objects or the lengths of edges.

    Parameters
    ----------
    graph
        The scene, ``n`` objects.
    iterations
        How many hashes each object gets.

    Returns
    -------
    list of tuple of str
        For each of ``n`` objects its hashes, one an iteration: 32 hexadecimal digits, the 128-bit BLAKE2b digests
        that networkx makes.
    """
    neighbours: list[list[int]] = [[] for _ in graph.classes]
    for a, b in graph.edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    labels = [str(number) for number in graph.classes.tolist()]
    found = []
    for _ in range(iterations):
        labels = [
            _digest(label + "".join(sorted([labels[j] for j in near])))
            for label, near in zip(labels, neighbours, strict=True)
        ]
        found.append(labels)
    return list(zip(*found, strict=True)) if found else [()] * len(labels)


@lru_cache(maxsize=1 << 16)
def word_hash(word: str, seed: int = 0) -> int:
    """Hash one word to 64 bits: BLAKE2b, alike in every process; the seed selects the function."""
    digest = hashlib.blake2b(word.encode(), digest_size=8, salt=seed.to_bytes(8, "little")).digest()
    return int.from_bytes(digest, "little")


def hash_words(sentences: list[tuple[str, ...]], seed: int) -> Hashes:
    """Hash ``n`` sentences of ``k`` words each, ``(n, k)`` uint64, each word as its `word_hash`."""
    hashes = [word_hash(word, seed) for sentence in sentences for word in sentence]
    return np.array(hashes, np.uint64).reshape(len(sentences), -1 if hashes else 0)


@lru_cache(maxsize=1 << 15)
def _digest(text: str) -> str:
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
