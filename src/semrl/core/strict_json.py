"""JSON as others read it: without NaN and infinities, which it does not have."""

import json
import math
from collections.abc import Mapping
from typing import Any


def dumps(value: Any, *, indent: int | None = None, sort_keys: bool = False) -> str:
    """Write nested values as JSON; null stands for what is not a finite number.

    Parameters
    ----------
    value
        Mappings, lists, tuples, texts, numbers and None.
    indent
        Spaces for each level; one line when None.
    sort_keys
        Whether the order of keys makes no difference.
    """
    return json.dumps(_known(value), indent=indent, sort_keys=sort_keys, allow_nan=False)


def _known(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _known(part) for key, part in value.items()}
    return [_known(part) for part in value] if isinstance(value, list | tuple) else value
