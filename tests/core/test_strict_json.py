"""JSON has no NaN and no infinities, wherever they stand."""

import json
import math

import numpy as np
import pytest
from sources import SOURCES

from semrl.core.arrays import array_to_json, json_to_array
from semrl.core.strict_json import dumps


def strict(text):
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf, np.float64("nan")])
def test_what_is_not_a_number_is_null(odd):
    value = {"a": odd, "b": [1.5, (odd, "text")], "c": {"d": {"e": odd}}, "f": True, "g": 1 << 80}
    told = {"a": None, "b": [1.5, [None, "text"]], "c": {"d": {"e": None}}, "f": True, "g": 1 << 80}
    assert strict(dumps(value)) == strict(dumps(value, indent=2)) == told
    assert array_to_json(json_to_array(value)) == told
    assert dumps(odd) == "null"


@pytest.mark.parametrize("value", [None, [], {}, "NaN", 1e308, {"b": 1, "a": [0.1, -0.0]}])
def test_everything_else_is_as_ever(value):
    assert dumps(value) == json.dumps(value) and dumps(value, sort_keys=True) == json.dumps(value, sort_keys=True)


def test_nothing_else_writes_json():
    """The process that answers queries imports nothing of ours, and writes texts only."""
    for path in SOURCES:
        for line in path.read_text(encoding="utf-8").splitlines():
            if "json.dump" in line or "json_format.dump" in line:
                shown = "ensure_ascii=False" in line and path.name == "wording.py"
                assert "allow_nan=False" in line or shown, f"{path}: {line}"
