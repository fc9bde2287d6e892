"""State as named arrays: how every component is saved and restored, without pickle.

Each stateful component offers ``to_arrays() -> Arrays`` and ``from_arrays(arrays)``. Components nest
by prefix (``"pca/mean"``), so a whole run is one flat dictionary.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.core.strict_json import dumps

Arrays = dict[str, NDArray[Any]]


def nest(**parts: Arrays) -> Arrays:
    """Join the arrays of several components, each under its keyword as prefix."""
    return {f"{name}/{key}": value for name, part in parts.items() for key, value in part.items()}


def unnest(arrays: Mapping[str, NDArray[Any]], name: str) -> Arrays:
    """Give back one component's arrays as they were before `nest`."""
    start = name + "/"
    return {key.removeprefix(start): value for key, value in arrays.items() if key.startswith(start)}


def json_to_array(value: object) -> NDArray[np.uint8]:
    """Write a JSON-able value as bytes, so that it can stand among arrays."""
    return np.frombuffer(dumps(value, sort_keys=True).encode(), dtype=np.uint8)


def array_to_json(array: NDArray[np.uint8]) -> Any:
    """Read what `json_to_array` wrote."""
    return json.loads(array.tobytes().decode())


def rng_to_array(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Write the state of a random generator."""
    return json_to_array(rng.bit_generator.state)


def array_to_rng(array: NDArray[np.uint8]) -> np.random.Generator:
    """Make a generator that goes on where the written one stood."""
    rng = np.random.default_rng()
    rng.bit_generator.state = array_to_json(array)
    return rng


def ragged_to_arrays(rows: Iterable[NDArray[Any]], *, like: NDArray[Any]) -> Arrays:
    """Write a list of arrays of different lengths as one array and their lengths.

    Parameters
    ----------
    rows
        Arrays of shape ``(n_i, ...)``.
    like
        An array of shape ``(0, ...)`` that gives trailing shape and dtype when there are no rows.
    """
    rows = list(rows)
    return {
        "values": np.concatenate([like, *rows]),
        "lengths": np.array([len(row) for row in rows], dtype=np.int64),
    }


def arrays_to_ragged(arrays: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
    """Read what `ragged_to_arrays` wrote."""
    ends = np.cumsum(arrays["lengths"])
    return np.split(arrays["values"], ends[:-1]) if len(ends) else []


def digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Hash names, shapes, types and contents: equal digests mean bit-for-bit equal state."""
    hasher = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        hasher.update(f"{name}:{array.dtype.str}:{array.shape}".encode())
        hasher.update(array.data)
    return hasher.hexdigest()
