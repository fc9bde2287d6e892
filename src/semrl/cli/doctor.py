"""``semrl doctor``: what is installed, what is missing and how to get it."""

import json as json_format
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Any

from packaging.requirements import Requirement
from rich.table import Table

from semrl.cli.arguments import parse
from semrl.cli.progress import console


@dataclass(frozen=True, kw_only=True)
class DoctorArguments:
    """Show the versions in use, and what is missing or too old and how to get it."""

    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, look, tell."""
    arguments = parse(DoctorArguments, argv, command="doctor")
    rows = [_look(Requirement(text)) for text in requires("semrl") or ()]
    machine = {"python": platform.python_version(), "system": platform.platform(), "cores": os.cpu_count()}
    if arguments.json:
        print(json_format.dumps({**machine, "packages": rows}))
        return
    table = Table("package", "installed", "needed", "for", box=None, padding=(0, 2, 0, 0))
    for row in rows:
        installed = row["installed"] or "missing"
        shown = installed if row["ok"] else f"[red]{installed}[/]"
        table.add_row(row["package"], shown, row["needed"], row["for"])
    console.print(
        f"Python {machine['python']} on {machine['system']}, {machine['cores']} cores; runs use one thread each"
    )
    console.print(table)
    lacking = [f"'{row['package']}{row['needed']}'" for row in rows if not row["ok"]]
    if lacking:
        console.print(f"To get what is missing: pip install {' '.join(lacking)}", soft_wrap=True)


def _look(requirement: Requirement) -> dict[str, Any]:
    try:
        installed: str | None = version(requirement.name)
    except PackageNotFoundError:
        installed = None
    marker = str(requirement.marker or "")
    extra = marker.split('"')[1] if "extra" in marker else "semrl"
    return {
        "package": requirement.name,
        "installed": installed,
        "ok": installed is not None and requirement.specifier.contains(installed, prereleases=True),
        "needed": str(requirement.specifier),
        "for": extra,
    }
