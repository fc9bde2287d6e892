"""Named arrays: whatever is written is read back, and a digest tells every change."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semrl.core.arrays import (
    array_to_json,
    array_to_rng,
    arrays_to_ragged,
    digest,
    json_to_array,
    nest,
    ragged_to_arrays,
    rng_to_array,
    unnest,
)

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


def test_nesting_and_back():
    inner = nest(pca={"mean": np.ones(3)}, pca2={"mean": np.zeros(2)})
    outer = nest(encoder=inner, pipe={"mean": np.full(1, 7)})
    assert set(outer) == {"encoder/pca/mean", "encoder/pca2/mean", "pipe/mean"}
    assert unnest(unnest(outer, "encoder"), "pca")["mean"].tolist() == [1, 1, 1]
    assert digest(unnest(outer, "encoder")) == digest(inner)
    assert unnest(outer, "pip") == {}


@given(json_values)
def test_json(value):
    array = json_to_array(value)
    assert array.dtype == np.uint8
    assert array_to_json(array) == value


def test_a_written_generator_goes_on_where_it_stood():
    rng = np.random.default_rng(3)
    rng.integers(10, size=7, dtype=np.uint8)  # leaves half of a drawn word in the generator
    written = rng_to_array(rng)
    expected = rng.random(5), rng.integers(10, size=5, dtype=np.uint8)
    again = array_to_rng(written)
    np.testing.assert_array_equal(again.random(5), expected[0])
    np.testing.assert_array_equal(again.integers(10, size=5, dtype=np.uint8), expected[1])


@given(st.lists(st.integers(0, 4), max_size=8))
def test_ragged_rows(lengths):
    rng = np.random.default_rng(0)
    rows = [rng.normal(size=(n, 3)).astype(np.float32) for n in lengths]
    arrays = ragged_to_arrays(iter(rows), like=np.empty((0, 3), np.float32))
    assert arrays["values"].dtype == np.float32 and arrays["values"].shape == (sum(lengths), 3)
    again = arrays_to_ragged(arrays)
    assert len(again) == len(rows)
    for a, b in zip(again, rows, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    "other",
    [
        {"a": np.array([1, 2, 4])},
        {"b": np.array([1, 2, 3])},
        {"a": np.array([1, 2, 3], dtype=np.int32)},
        {"a": np.array([[1, 2, 3]])},
        {"a": np.array([1, 2, 3]), "b": np.array(0)},
        {},
    ],
)
def test_a_digest_tells_names_types_shapes_and_contents(other):
    assert digest(other) != digest({"a": np.array([1, 2, 3])})


def test_a_digest_overlooks_order_and_layout():
    a, b = np.arange(12).reshape(3, 4), np.arange(3.0)
    assert digest({"a": a, "b": b}) == digest({"b": b[::-1][::-1], "a": np.asfortranarray(a)})
    assert digest({"a": np.array(0.0)}) != digest({"a": np.array(-0.0)})


def test_everything_goes_to_disk_without_pickle():
    arrays = nest(
        a={"json": json_to_array({"x": [1, None]}), "rng": rng_to_array(np.random.default_rng(0))},
        b=ragged_to_arrays([], like=np.empty((0, 2))),
    )
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    file.seek(0)
    with np.load(file, allow_pickle=False) as loaded:
        assert digest(dict(loaded)) == digest(arrays)
