"""``semrl doctor``: what is installed, what is missing and how to get it.

It is called where packages are missing, so it needs none of them: no tyro, no rich.
"""

import argparse
import contextlib
import importlib
import json as json_format
import logging
import os
import platform
import re
import warnings
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Any, NoReturn

from semrl.core.errors import SemrlError, UsageError

MODULES = {"opencv-python-headless": "cv2", "pillow": "PIL", "scikit-learn": "sklearn"}
"""Package → what it is imported as, where that is another name."""

COLUMNS = ("package", "installed", "needed", "for")


def main(argv: Sequence[str]) -> None:
    """Parse, look, print.

    Raises
    ------
    SemrlError
        When something is missing, too old or cannot be used; what was found has been printed then.
    """
    arguments = _parse(argv)
    rows = [_look(text) for text in _requirements()]
    machine = {"python": platform.python_version(), "system": platform.platform(), "cores": os.cpu_count()}
    lacking = [row for row in rows if not row["ok"]]
    if arguments.json:
        print(json_format.dumps({**machine, "packages": rows}, allow_nan=False))
    else:
        print(f"Python {machine['python']} on {machine['system']}, {machine['cores']} cores; runs use one thread each")
        print(_table(rows))
        if lacking:
            print(f"To get what is missing: {_command(lacking)}")
    wanted = [row for row in lacking if row["for"] == "semrl"]
    if wanted:
        problems = ", ".join(f"{row['package']} ({row['problem']})" for row in wanted)
        raise SemrlError(f"semrl cannot work without {problems}; to get what it needs: {_command(wanted)}")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see semrl doctor --help")

    def print_help(self, file: Any = None) -> None:
        print(self.format_help(), end="", file=file)  # argparse would not say that it cannot be written


def _parse(argv: Sequence[str]) -> argparse.Namespace:
    parser = _Parser(
        prog="semrl doctor", description="Show the versions in use, and what is missing or too old and how to get it."
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object as the only line of standard output")
    return parser.parse_args(argv)


def _requirements() -> list[str]:
    """Return what semrl says it needs.

    Raises
    ------
    SemrlError
        When it was not installed, but is run from a folder.
    """
    try:
        return list(requires("semrl") or ())
    except PackageNotFoundError:
        raise SemrlError(
            "semrl is not installed, so what it needs is not known: pip install -e . where its pyproject.toml is"
        ) from None


def _look(text: str) -> dict[str, Any]:
    """Look at one package that is needed, such as ``numpy>=2.0`` or ``gensim>=4.3; extra == "thesis"``."""
    requirement, _, marker = (part.strip() for part in text.partition(";"))
    name = requirement.split(" ")[0]
    for sign in "<>=!~[":
        name = name.partition(sign)[0]
    quoted = marker.replace("'", '"').split('"')
    extra = quoted[1] if "extra" in marker else "semrl"
    needed = re.sub(r"^\[.*?\]", "", requirement.removeprefix(name).strip()).strip()
    try:
        installed: str | None = version(name)
    except PackageNotFoundError:
        installed = None
    problem = _problem(name, installed, needed, used=extra not in ("dev", "docs"))
    return {
        "package": name,
        "installed": installed,
        "ok": problem is None,
        "problem": problem,
        "needed": needed,
        "for": extra,
    }


def _problem(name: str, installed: str | None, needed: str, *, used: bool) -> str | None:
    """Say what is wrong with a package; those that are `used` are imported as well, since files may be missing."""
    if installed is None:
        return "missing"
    if used:
        try:
            with warnings.catch_warnings(action="ignore"), _no_logging():
                importlib.import_module(MODULES.get(name, name.replace("-", "_")))
        except ModuleNotFoundError as error:
            return f"cannot be imported: {error.name} is missing"
        except Exception as error:  # a package that is broken may raise anything
            return f"cannot be imported: {' '.join(str(error).split())}"
    try:
        from packaging.specifiers import SpecifierSet
    except ImportError:
        return None  # the package that compares versions is missing itself, and reported
    return None if SpecifierSet(needed).contains(installed, prereleases=True) else f"{installed} is not {needed}"


@contextlib.contextmanager
def _no_logging() -> Iterator[None]:
    """Keep packages from printing what they make of this machine while they are imported."""
    before = logging.root.manager.disable
    logging.disable()
    try:
        yield
    finally:
        logging.disable(before)


def _command(rows: Sequence[dict[str, Any]]) -> str:
    """Return the command that installs packages, anew where what is installed cannot be used."""
    broken = any(row["installed"] and str(row["problem"]).startswith("cannot") for row in rows)
    wanted = [f"'{row['package']}{row['needed']}'" for row in rows]
    return " ".join(["pip install", *(["--force-reinstall"] if broken else []), *wanted])


def _table(rows: Sequence[dict[str, Any]]) -> str:
    shown = [COLUMNS]
    for row in rows:
        installed = str(row["installed"] or "missing")
        problem = "" if row["ok"] or not row["installed"] else f" ({row['problem']})"
        shown.append((row["package"], f"{installed}{problem}", row["needed"], row["for"]))
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    lines = ("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)) for row in shown)
    return "\n".join(line.rstrip() for line in lines)
