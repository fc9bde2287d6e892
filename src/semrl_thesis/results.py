"""What an experiment yields, numbers beside the thesis's and figures, and how it is kept in files."""

import csv
import dataclasses
import hashlib
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from semrl.core.arrays import Arrays, array_to_json, json_to_array
from semrl.core.errors import SemrlError
from semrl.core.files import read_arrays, write_arrays, write_text
from semrl_thesis import figures as figure_kinds
from semrl_thesis.figures import Figure

Better = Literal["higher", "lower", "near"]
"""Which side of the thesis's number is better; ``"near"``: neither, the nearer the more alike."""

COLUMNS = ("id", "thesis", "ours", "unit", "better")
KINDS = {name: kind for name, kind in vars(figure_kinds).items() if dataclasses.is_dataclass(kind)}


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number of the thesis; None where it gives none but ours is worth telling."""

    id: str
    thesis: float | None
    unit: str = ""
    better: Better = "higher"


@dataclass(frozen=True, kw_only=True)
class Row:
    """Ours beside the thesis's; None where there is no number (yet)."""

    id: str
    thesis: float | None
    ours: float | None
    unit: str
    better: Better


@dataclass(frozen=True, kw_only=True)
class Result:
    """What one experiment has measured.

    Attributes
    ----------
    values
        By id of the number; ``ID@semrl`` is the same in the preset `semrl`.
    figures
        In the order of the thesis.
    notes
        What somebody must know who reads them.
    lacks
        Extras that were not installed, so that something was left out.
    whole
        Whether nothing else was left out that may be there another time.
    """

    values: Mapping[str, float | None]
    figures: tuple[Figure, ...] = ()
    notes: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()
    whole: bool = True


@dataclass(frozen=True, kw_only=True)
class Section:
    """An experiment as a page tells it.

    Attributes
    ----------
    name, title, place
        Of the experiment, and where the thesis has it.
    command
        What made it.
    rows, figures, notes
        See `Result`.
    """

    name: str
    title: str
    place: str
    command: str
    rows: tuple[Row, ...]
    figures: tuple[Figure, ...]
    notes: tuple[str, ...]


def rows_of(numbers: Sequence[Number], values: Mapping[str, float | None]) -> list[Row]:
    """Put every number beside what was measured, each preset's on a row of its own."""
    rows = []
    for number in numbers:
        for id_ in (number.id, *sorted(id_ for id_ in values if id_.startswith(f"{number.id}@"))):
            value = values.get(id_)
            ours = None if value is None or not math.isfinite(value) else float(value)
            rows.append(Row(id=id_, thesis=number.thesis, ours=ours, unit=number.unit, better=number.better))
    return rows


def joined(parts: Sequence[Result]) -> Result:
    """Put results of one experiment together: of equal figures all panels stand side by side."""
    figures: dict[str, Figure] = {}
    for figure in (figure for part in parts for figure in part.figures):
        before = figures[figure.number].panels if figure.number in figures else ()
        figures[figure.number] = dataclasses.replace(figure, panels=(*before, *figure.panels))
    return Result(
        values={id_: value for part in parts for id_, value in part.values.items()},
        figures=tuple(figures[number] for number in sorted(figures)),
        notes=tuple(note for part in parts for note in part.notes),
        lacks=tuple(sorted({extra for part in parts for extra in part.lacks})),
        whole=all(part.whole for part in parts),
    )


def digest(*settings: object) -> str:
    """Tell settings apart in a few characters."""
    return hashlib.sha256(repr(settings).encode()).hexdigest()[:16]


def write_result(path: Path, result: Result, settings: str) -> None:
    """Keep a result as named arrays, with a digest of the settings it was measured with."""
    arrays: Arrays = {}
    content = _packed(result, arrays)
    write_arrays(path, {"result": json_to_array({"settings": settings, "content": content}), **arrays})


def read_result(path: Path, settings: str | None = None) -> Result | None:
    """Read a result; None when it was measured with other settings than these.

    Raises
    ------
    SemrlError
        When the file is damaged.
    """
    arrays = read_arrays(path)
    try:
        kept = array_to_json(arrays["result"])
        if settings is not None and kept["settings"] != settings:
            return None
        result = _unpacked(kept["content"], arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise SemrlError(f"{path} is damaged: {error}; delete it to measure again") from None
    if not isinstance(result, Result):
        raise SemrlError(f"{path} is damaged: it holds no result; delete it to measure again")
    return result


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV; what is not known stays empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(dataclasses.asdict(row) for row in rows)
    write_text(path, text.getvalue())


def _packed(value: Any, arrays: Arrays) -> Any:
    """Write nested dataclasses as JSON; their arrays go to `arrays`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _packed(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **fields}
    if isinstance(value, np.ndarray):
        name = f"array{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, Mapping):
        return {"mapping": {key: _packed(part, arrays) for key, part in value.items()}}
    if isinstance(value, tuple | list):
        return [_packed(part, arrays) for part in value]
    return value.item() if isinstance(value, np.generic) else value


def _unpacked(value: Any, arrays: Arrays) -> Any:
    if isinstance(value, list):
        return tuple(_unpacked(part, arrays) for part in value)
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    if "mapping" in value:
        return {key: _unpacked(part, arrays) for key, part in value["mapping"].items()}
    kinds: Mapping[str, Any] = {**KINDS, "Result": Result}
    return kinds[value["kind"]](**{key: _unpacked(part, arrays) for key, part in value.items() if key != "kind"})
