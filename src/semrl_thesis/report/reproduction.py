"""The page about the thesis's evaluation done again: Table 4.1 first, if it is known, then every test."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from semrl.core.files import require_writable, write_text
from semrl.report.templates import render_page
from semrl.report.wording import number
from semrl_thesis.figures import Figure
from semrl_thesis.report import panels
from semrl_thesis.results import Row, Section

Numbers = Mapping[str, Row]


def write_reproduction(sections: Sequence[Section], out: Path, *, scale: str) -> Path:
    """Write the page.

    Parameters
    ----------
    sections
        What is known of every experiment.
    out
        The HTML file; an older one is replaced.
    scale
        ``"full"``, or a smaller budget, which the page then warns of.

    Raises
    ------
    UsageError
        When the file may not be written there.
    SemrlError
        When it cannot be written.
    """
    require_writable(out)
    rows = {row.id: row for section in sections for row in section.rows}
    page = render_page(
        "reproduction.html",
        package="semrl_thesis.report",
        title="The thesis's evaluation, done again",
        scale=scale,
        table=[_model(rows, model) for model in _models(rows)],
        planners=[row for id_, row in rows.items() if id_.startswith("planner-alone/") and row.ours is not None],
        sections=[_section(section) for section in sections],
    )
    write_text(out, page)
    return out


def _models(rows: Numbers) -> list[str]:
    """Return the models of Table 4.1, in its order."""
    return list(dict.fromkeys(id_.split("/")[1] for id_ in rows if id_.startswith("table4.1/")))


def _model(rows: Numbers, model: str) -> dict[str, Any]:
    """Return one row of Table 4.1: the thesis's cell and ours of both presets."""
    ours = {preset: _cell(rows, model, suffix) for preset, suffix in (("thesis", ""), ("semrl", "@semrl"))}
    return {"model": model, "thesis": _thesis_cell(rows, model), "ours": ours}


def _thesis_cell(rows: Numbers, model: str) -> dict[str, str] | None:
    values = [rows[f"table4.1/{model}/{name}"].thesis for name in ("mean", "std", "min", "max")
              if f"table4.1/{model}/{name}" in rows]  # fmt: skip
    return _written([value for value in values if value is not None])


def _cell(rows: Numbers, model: str, suffix: str) -> dict[str, Any] | None:
    found = [rows.get(f"table4.1/{model}/{name}{suffix}") for name in ("mean", "std", "min", "max")]
    cell = _written([row.ours for row in found if row and row.ours is not None])
    mean = found[0]
    if cell is None or mean is None:
        return None
    return cell | {"better": _is_better(mean)}


def _written(values: Sequence[float]) -> dict[str, str] | None:
    if len(values) < 4:
        return None
    mean, std, least, most = values
    return {"mean": number(mean), "std": number(std, 2), "range": f"{number(least)} … {number(most)}"}


def _is_better(row: Row) -> bool:
    """Whether ours is better than the thesis's."""
    if row.ours is None or row.thesis is None or row.better == "near":
        return False
    return row.ours > row.thesis if row.better == "higher" else row.ours < row.thesis


def _section(section: Section) -> dict[str, Any]:
    return {
        "name": section.name,
        "title": section.title,
        "place": section.place,
        "command": section.command,
        "rows": _side_by_side(section.rows),
        "presets": any("@" in row.id for row in section.rows),
        "figures": [_figure(figure) for figure in section.figures],
        "notes": section.notes,
    }


def _side_by_side(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Put both presets' numbers on one row; leave out what the thesis does not say and we did not measure."""
    lines: dict[str, dict[str, Any]] = {}
    for row in rows:
        base, _, preset = row.id.partition("@")
        line = lines.setdefault(base, {"id": base, "thesis": row.thesis, "unit": row.unit, "ours": {}})
        line["ours"][preset or "thesis"] = {"value": row.ours, "better": _is_better(row)}
    return [
        line for line in lines.values()
        if line["thesis"] is not None or any(cell["value"] is not None for cell in line["ours"].values())
    ]  # fmt: skip


def _figure(figure: Figure) -> dict[str, Any]:
    title = f"Fig. {figure.number}, {figure.title}"
    return {
        "number": figure.number,
        "title": figure.title,
        "says": figure.says,
        "panels": [
            {
                "caption": caption,
                "legend": panels.legend(panel),
                "drawing": panels.draw(panel, f"{title}, {caption}" if caption else title),
            }
            for caption, panel in figure.panels
        ],
    }
