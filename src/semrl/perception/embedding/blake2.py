"""BLAKE2b for compiled code (RFC 7693): the hash of words, without a call into Python for each of them.

It gives what ``hashlib.blake2b`` gives, for messages without a key.
"""

import numpy as np
from numpy.typing import NDArray

from semrl.core.kernels import compiled

BLOCK_BYTES = 128
ROUNDS = 12

_START = np.array(
    [
        0x6A09E667F3BCC908, 0xBB67AE8584CAA73B, 0x3C6EF372FE94F82B, 0xA54FF53A5F1D36F1,
        0x510E527FADE682D1, 0x9B05688C2B3E6C1F, 0x1F83D9ABFB41BD6B, 0x5BE0CD19137E2179,
    ],
    dtype=np.uint64,
)  # fmt: skip
_ORDER = np.array(
    [
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
        [14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3],
        [11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4],
        [7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8],
        [9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13],
        [2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9],
        [12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11],
        [13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10],
        [6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5],
        [10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0],
    ]
)  # fmt: skip
# Columns and diagonals of the 4×4 state, each with its place in the message order.
_MIXED = np.array(
    [
        [0, 4, 8, 12], [1, 5, 9, 13], [2, 6, 10, 14], [3, 7, 11, 15],
        [0, 5, 10, 15], [1, 6, 11, 12], [2, 7, 8, 13], [3, 4, 9, 14],
    ]
)  # fmt: skip


@compiled
def _turned(word: np.uint64, bits: int) -> np.uint64:
    return (word >> np.uint64(bits)) | (word << np.uint64(64 - bits))


@compiled
def _compress(h: NDArray[np.uint64], m: NDArray[np.uint64], end: int, is_last: bool) -> None:
    """Take a block of 16 words into the state; `end` counts the bytes up to its end."""
    v = np.empty(16, np.uint64)
    v[:8] = h
    v[8:] = _START
    v[12] ^= np.uint64(end)
    if is_last:
        v[14] = ~v[14]
    for r in range(ROUNDS):
        order = _ORDER[r % len(_ORDER)]
        for k in range(8):
            a, b, c, d = _MIXED[k]
            v[a] += v[b] + m[order[2 * k]]
            v[d] = _turned(v[d] ^ v[a], 32)
            v[c] += v[d]
            v[b] = _turned(v[b] ^ v[c], 24)
            v[a] += v[b] + m[order[2 * k + 1]]
            v[d] = _turned(v[d] ^ v[a], 16)
            v[c] += v[d]
            v[b] = _turned(v[b] ^ v[c], 63)
    for i in range(8):
        h[i] ^= v[i] ^ v[i + 8]


@compiled
def blake2b(message: NDArray[np.uint8], digest_bytes: int, salt: np.uint64) -> NDArray[np.uint64]:
    """Hash a message.

    Parameters
    ----------
    message
        ``(n,)`` uint8.
    digest_bytes
        Length of the digest asked for; another length is another hash.
    salt
        Of 64 bits; selects the hash function.

    Returns
    -------
    ``(8,)`` uint64: the digest in little-endian words, of which the first ``digest_bytes`` bytes count.
    """
    h = _START.copy()
    h[0] ^= np.uint64(0x01010000 + digest_bytes)
    h[4] ^= salt
    m = np.empty(BLOCK_BYTES // 8, np.uint64)
    start = 0
    while True:
        end = min(start + BLOCK_BYTES, len(message))
        m[:] = 0
        for i in range(start, end):
            m[(i - start) >> 3] |= np.uint64(message[i]) << np.uint64(8 * ((i - start) & 7))
        _compress(h, m, end, end == len(message))
        if end == len(message):
            return h
        start = end
