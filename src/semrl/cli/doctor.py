"""``semrl doctor``: what is installed, what is missing and how to get it."""

import json as json_format
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version

from packaging.requirements import Requirement
from rich.table import Table

from semrl.cli.arguments import parse
from semrl.cli.progress import console


@dataclass(frozen=True, kw_only=True)
class DoctorArguments:
    """Show the versions in use, the processor threads, and which extras are missing."""

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
        table.add_row(*(str(row[key] or "[red]missing[/]") for key in ("package", "installed", "needed", "for")))
    console.print(
        f"Python {machine['python']} on {machine['system']}, {machine['cores']} cores; runs use one thread each"
    )
    console.print(table)
    extras = sorted({str(row["for"]) for row in rows if row["installed"] is None} - {"semrl"})
    if extras:
        console.print(f"To get what is missing: pip install 'semrl[{','.join(extras)}]'")


def _look(requirement: Requirement) -> dict[str, str | None]:
    try:
        installed: str | None = version(requirement.name)
    except PackageNotFoundError:
        installed = None
    marker = str(requirement.marker or "")
    extra = marker.split('"')[1] if "extra" in marker else "semrl"
    return {
        "package": requirement.name,
        "installed": installed,
        "needed": str(requirement.specifier),
        "for": extra,
    }
