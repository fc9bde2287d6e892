"""What `online.OnlineEmbedding` does for each document, compiled: counting, drawing, one step down the gradient."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.kernels import compiled

NOISE_POWER = 0.75
"""Words are drawn as noise by their frequency to this power (Mikolov et al. 2013)."""

NOISE_WORDS = 1 << 16
"""Length of the table that noise is drawn from."""

ONE = 1 << 30
"""What a component of 1 counts: sums are of integers, so that their order does not matter to the last bit."""

_STEEPEST = 8.0  # scores beyond it are as sure as this


class Memory(NamedTuple):
    """What is known of the words: of each of ``b`` buckets, and of all together."""

    vectors: Floats
    """``(b, dimension)`` float32: what a word adds to its document's vector."""
    contexts: Floats
    """``(b, dimension)`` float32: the inner product with a document's vector scores how likely the word is in it."""
    counts: Ints
    """``(b,)`` int64: how often a word of this bucket was met."""
    noise: Ints
    """``(NOISE_WORDS,)`` int64: buckets, each about as often as it is to be drawn as noise."""
    totals: NDArray[np.float64]
    """``(3,)`` float64: words met, sum of the counts' powers, places of the table that are filled."""
    chance: NDArray[np.uint64]
    """``(1,)`` uint64: state of the random generator."""


class Rates(NamedTuple):
    """How one document is learned: `OnlineEmbeddingConfig`, and what the vector of each word counts in it."""

    learning_rate: float
    anchor: float
    down_sampling: float
    negative: int
    corruption: float
    word_weight: float


def new_memory(buckets: int, dimension: int, start: float, seed: int) -> Memory:
    """Return what is known before the first document: nothing, with vectors drawn from −start … start."""
    vectors = np.random.default_rng(seed).uniform(-start, start, (buckets, dimension))
    return Memory(
        vectors=vectors.astype(np.float32),
        contexts=np.zeros((buckets, dimension), np.float32),
        counts=np.zeros(buckets, np.int64),
        noise=np.zeros(NOISE_WORDS, np.int64),
        totals=np.zeros(3),
        chance=np.array([seed], np.uint64),
    )


@compiled
def learn(objects: Ints, priors: Floats, memory: Memory, rates: Rates) -> None:
    """Learn a document of ``(n, k)`` buckets, ``k`` words an object, whose objects' vectors begin as `priors`.

    Objects are left out of the document's vector at random, so that their words must be told from the others
    (Chen 2017). The vector moves by the sum of all steps, but by 1 at most, so that no document overthrows
    what is known.
    """
    shown = np.zeros(len(objects), np.float32)
    for i in range(len(objects)):
        for word in objects[i]:
            _count(word, memory)
        shown[i] = (_uniform(memory.chance) >= rates.corruption) / (1 - rates.corruption)
    vector = np.zeros(memory.vectors.shape[1], np.float32)
    for i in range(len(objects)):
        if shown[i]:
            vector += shown[i] * priors[i]
            for word in objects[i]:
                vector += shown[i] * np.float32(rates.word_weight) * memory.vectors[word]
    change = _predict(objects.ravel(), vector, memory, rates)
    length = np.sqrt(np.sum(change * change))
    change *= np.float32(rates.word_weight / max(length, 1.0))
    stay = np.float32(1 - min(rates.learning_rate * rates.anchor, 1.0))
    for i in range(len(objects)):
        if shown[i]:
            for word in objects[i]:
                memory.vectors[word] = stay * memory.vectors[word] + shown[i] * change


@compiled
def _predict(words: Ints, vector: Floats, memory: Memory, rates: Rates) -> Floats:
    """Learn to tell a document's words from noise by its vector; return by how much that should change for it."""
    change = np.zeros_like(vector)
    for word in words:
        share = memory.counts[word] / memory.totals[0]
        kept = np.sqrt(rates.down_sampling / share) + rates.down_sampling / share
        if _uniform(memory.chance) < kept:
            _step(vector, memory.contexts[word], (1.0, rates.learning_rate), change)
            for _ in range(rates.negative):
                noise = memory.noise[_below(memory.totals[2], memory.chance)]
                if noise != word:
                    _step(vector, memory.contexts[noise], (0.0, rates.learning_rate), change)
    return change


@compiled
def add_vectors(words: Ints, vectors: Floats) -> Floats:
    """Sum the vectors of ``(n, k)`` buckets, whatever their order to the last bit."""
    total = np.zeros(vectors.shape[1], np.int64)
    for word in words.ravel():
        for k in range(len(total)):
            total[k] += np.int64(np.rint(vectors[word, k] * ONE))
    return (total / ONE).astype(np.float32)


@compiled
def _step(vector: Floats, context: Floats, sample: tuple[float, float], change: Floats) -> None:
    """Move a word's context towards the truth about a document, and note how the document should move.

    The sample: whether the word is in the document (1 or 0), and the learning rate.
    """
    truth, rate = sample
    score = np.float32(0)
    for k in range(len(vector)):
        score += vector[k] * context[k]
    logit = min(max(float(score), -_STEEPEST), _STEEPEST)
    error = np.float32(rate * (truth - 1 / (1 + np.exp(-logit))))
    for k in range(len(vector)):
        change[k] += error * context[k]
        context[k] += error * vector[k]


@compiled
def _count(word: int, memory: Memory) -> None:
    """Count a word and let it take its share of the noise table (Kaji and Kobayashi 2017, algorithm 3)."""
    totals = memory.totals
    before = memory.counts[word]
    memory.counts[word] = before + 1
    gained = (before + 1.0) ** NOISE_POWER - np.float64(before) ** NOISE_POWER
    totals[0] += 1
    totals[1] += gained
    is_full = totals[2] == len(memory.noise)
    expected = gained * len(memory.noise) / totals[1] if is_full else gained
    places = int(expected) + int(_uniform(memory.chance) < expected - int(expected))
    for _ in range(places):
        memory.noise[_below(totals[2], memory.chance) if is_full else int(totals[2])] = word
        totals[2] += not is_full


@compiled
def _below(count: float, chance: NDArray[np.uint64]) -> int:
    return int(_uniform(chance) * count)


@compiled
def _uniform(chance: NDArray[np.uint64]) -> float:
    """Draw from 0 … 1 (SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014)."""
    chance[0] += np.uint64(0x9E3779B97F4A7C15)
    z = chance[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return float(z >> np.uint64(11)) / (1 << 53)
