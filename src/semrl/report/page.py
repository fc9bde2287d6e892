"""Putting the page together: one HTML file that needs nothing else."""

import base64
import dataclasses
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from semrl.core.errors import UsageError
from semrl.core.files import require_writable, write_text
from semrl.report import scenes, wording
from semrl.report.charts import RUN_COLOURS, learning_curve, prediction_path, stability_path
from semrl.report.record import RunRecord, read_run
from semrl.report.templates import render_page


def write_report(runs: Sequence[Path], out: Path, *, defaults: Mapping[str, Any] | None = None) -> Path:
    """Write one page about one or more runs.

    Parameters
    ----------
    runs
        Their folders.
    out
        The HTML file; an older one is replaced.
    defaults
        Nested settings: those of a run that differ from them come first. None: none do.

    Raises
    ------
    UsageError
        When there is no run, a folder is none, or the file may not be written there.
    SemrlError
        When a file of a run is damaged, or the page cannot be written.
    """
    if not runs:
        raise UsageError("a report needs at least one run")
    require_writable(out)
    records = [read_run(run) for run in runs]
    if len({record.name for record in records}) < len(records):
        records = [dataclasses.replace(record, name=record.path) for record in records]
    write_text(out, render(records, defaults or {}))
    return out


def render(records: Sequence[RunRecord], defaults: Mapping[str, Any]) -> str:
    """Return the page as HTML text."""
    runs = [_run(record, RUN_COLOURS[i % len(RUN_COLOURS)], defaults) for i, record in enumerate(records)]
    planned = any(len(record.returns("planner")) for record in records)
    return render_page("page.html", runs=runs, curves=_curves(records), planned=planned, title=_title(records))


def _title(records: Sequence[RunRecord]) -> str:
    if len(records) > 1:
        return f"{len(records)} runs compared"
    return f"{records[0].manifest.get('model', '?')} on {wording.game(records[0])}"


def _curves(records: Sequence[RunRecord]) -> list[tuple[str, Markup]]:
    """Draw the learning curves for both widths of a page; nothing before the first episode."""
    played = [(record.name, record.returns(), record.returns("planner")) for record in records]
    if not any(len(agent) + len(planner) for _, agent, planner in played):
        return []
    return [("wide", learning_curve(played, wide=True)), ("narrow", learning_curve(played, wide=False))]


def _run(record: RunRecord, colour: str, defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Gather everything that the template says about one run."""
    changed, rest = wording.settings(record, defaults)
    notes = scenes.meta(record.gallery)
    returns = record.returns().y
    return {
        "name": record.name,
        "path": shlex.quote(record.path),
        "colour": colour,
        "model": record.manifest.get("model", "?"),
        "game": wording.game(record),
        "seed": record.manifest.get("seed", "?"),
        "evaluation": record.evaluation,
        "trained": wording.trained(record),
        "tested": wording.tested(record),
        "decisions": record.decisions if record.began else 0,
        "last": float(returns[-10:].mean()) if len(returns) else None,
        "paths": _paths(record),
        "gallery": notes,
        "sees": wording.SEES.get(notes.get("encoder", ""), ""),
        "samples": scenes.samples(record.gallery),
        "kinds": scenes.kinds(record.gallery),
        "concepts": scenes.concepts(record.gallery),
        "learned": _learned(record),
        "predictions": _predictions(record),
        "has_map": any(row.get("map_nodes") for row in record.rows),
        "video": base64.b64encode(record.video).decode() if record.video else None,
        "has_video": record.has_video,
        "changed": changed,
        "settings": rest,
        "provenance": wording.provenance(record),
    }


def _paths(record: RunRecord) -> list[dict[str, Any]]:
    """Draw the path to stability of every stage that has one."""
    limits = record.config.get("stability", {})
    batches = limits.get("batches", 250)
    stages = (
        ("reduction", "Reduction", limits.get("max_difference", 0.05), "mean absolute difference",
         "its outputs moved by less than the goal on average"),
        ("clustering", "Clustering", limits.get("min_agreement", 0.95), "balanced accuracy",
         "more of its labels than the goal stayed what they were"),
    )  # fmt: skip
    drawn = []
    for phase, name, goal, unit, stable in stages:
        values = record.column(phase, "stability")
        if not any(row["phase"] == phase for row in record.rows):
            continue
        title = f"{name} of {record.name}: {unit} after {batches} more batches, at every batch"
        drawn.append({
            "name": name,
            "chart": stability_path(values, goal=goal, ylabel=unit, title=title) if len(values) else None,
            "batches": batches,
            "unit": unit,
            "stable": stable,
            "last": float(values.y[-1]) if len(values) else None,
            "after": int(values.x[-1]) if len(values) else None,
        })  # fmt: skip
    return drawn


def _predictions(record: RunRecord) -> dict[str, Any] | None:
    """Draw how far a run sees ahead, and count what it predicted of gains and losses."""
    if record.predictions is None:
        return None
    explained = {int(ahead): float(share) for ahead, share in record.predictions["explained"].items()}
    counts = record.predictions["confusion"]  # rows: what came, a loss, nothing, a gain
    title = f"Share of the variance of the states that {record.name} predicted, by decisions ahead"
    return {
        "chart": prediction_path(explained, title=title) if explained else None,
        "decisions": record.predictions["decisions"],
        "losses": (counts[0][0], sum(counts[0])),
        "gains": (counts[2][2], sum(counts[2])),
        "false_alarms": counts[1][0] + counts[1][2],
    }


def _learned(record: RunRecord) -> list[tuple[str, str]]:
    """Return the few numbers that sum up perception."""
    gallery = record.gallery
    facts = []
    if "threshold" in gallery:
        facts.append((wording.number(float(gallery["threshold"])), "grey level above which a pixel is foreground"))
    if "explained_variance_ratio" in gallery:
        ratios = gallery["explained_variance_ratio"]
        facts.append((
            f"{wording.number(100 * float(ratios.sum()))} %",
            f"of the objects' variance is kept by {len(ratios)} principal components",
        ))  # fmt: skip
    if "n_clusters" in gallery:
        facts.append((str(int(gallery["n_clusters"])), "clusters found before merging"))
        facts.append((str(len(gallery["class_numbers"])), "kinds of objects after merging"))
    return facts
