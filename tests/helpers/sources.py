"""The files of both packages, for tests of what no file may contain."""

from pathlib import Path

import semrl
import semrl_thesis

SOURCES = sorted(path for package in (semrl, semrl_thesis) for path in Path(str(package.__file__)).parent.rglob("*.py"))
