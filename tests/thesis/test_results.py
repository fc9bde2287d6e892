import dataclasses

import numpy as np
import pytest

from semrl.core.errors import SemrlError
from semrl_thesis import figures
from semrl_thesis.figures import (
    Bars,
    Curve,
    Curves,
    Figure,
    Layers,
    Matrix,
    Network,
    Picture,
    Pictures,
    Scatter,
    Scene,
)
from semrl_thesis.results import Number, Result, Row, read_result, rows_of, write_result

NUMBERS = (Number(id="a/b", thesis=1.5, unit="%"), Number(id="c", thesis=None, better="lower"))
TWO = np.array([0, 1])

PANELS = (
    Curves(xlabel="x", ylabel="y", curves=(Curve(label="p", x=TWO, y=TWO), Curve(label="q", x=TWO, y=-TWO)), goal=1),
    Bars(xlabel="x", ylabel="y", labels=("p", "q"), heights=np.array([3, 400]), logarithmic=True),
    Scatter(xlabel="x", ylabel="y", x=TWO, y=TWO, groups=TWO, weights=np.array([1, 9]), line=(2.0, 1.0)),
    Matrix(labels=("-1", "+1"), values=np.array([[0.25, 0.75], [0, 1]])),
    Pictures(pictures=(Picture(caption="<b>", image=np.zeros((8, 8), np.uint8)),)),
    Scene(
        frame=np.zeros((210, 160, 3), np.uint8),
        boxes_px=np.array([[1, 2, 3, 4], [20, 2, 3, 4]]),
        classes=TWO,
        edges=np.array([[0, 1]]),
        palette=((1, 2, 3), (4, 5, 6)),
    ),
    Network(xlabel="x", ylabel="y", positions=np.eye(2), sources=TWO, targets=TWO[::-1], signs=np.array([0, -1])),
    Layers(layers=(("input", "2 × 2"), ("output", "2 values"))),
)  # fmt: skip
RESULT = Result(
    values={"a/b": 2.0, "a/b@semrl": np.float64(3), "c": None},
    figures=(Figure(number="4.1", title="t", says="s", panels=tuple((f"panel {i}", p) for i, p in enumerate(PANELS))),),
    notes=("mind this",),
)


def flat(value):
    """Write nested dataclasses and arrays as plain values, to compare them."""
    if dataclasses.is_dataclass(value):
        return {field.name: flat(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return value.dtype.name, value.tolist()
    return [flat(part) for part in value] if isinstance(value, tuple) else value


def test_every_number_has_its_rows():
    assert rows_of(NUMBERS, {"a/b": 2, "a/b@semrl": float("nan")}) == [
        Row(id="a/b", thesis=1.5, ours=2.0, unit="%", better="higher"),
        Row(id="a/b@semrl", thesis=1.5, ours=None, unit="%", better="higher"),
        Row(id="c", thesis=None, ours=None, unit="", better="lower"),
    ]


def test_a_result_comes_back_from_its_file_as_it_was(tmp_path):
    write_result(tmp_path / "r.npz", RESULT, "settings")
    assert flat(read_result(tmp_path / "r.npz", "settings")) == flat(RESULT)
    assert read_result(tmp_path / "r.npz", "other settings") is None


def test_every_kind_of_panel_was_tried():
    kinds = {kind for kind in vars(figures).values() if dataclasses.is_dataclass(kind)}
    assert {type(panel) for panel in PANELS} == kinds - {Figure, Curve, Picture}


def test_damage_is_told(tmp_path):
    path = tmp_path / "r.npz"
    write_result(path, RESULT, "settings")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(SemrlError, match=r"r\.npz is damaged"):
        read_result(path)
