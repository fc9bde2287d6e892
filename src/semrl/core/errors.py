"""Errors whose message is all a person needs: one line that says what is wrong and what to do."""

from importlib.metadata import PackageNotFoundError, requires


class SemrlError(Exception):
    """The run failed for a reason we can name; the command line prints it and exits with 1."""


class UsageError(SemrlError):
    """The call was wrong (unknown name, missing run, bad value); the command line exits with 2."""


class DataError(SemrlError, ValueError):
    """An array is not what a component can work with (shape, dtype, range, not finite)."""


class NoEnvironmentError(UsageError):
    """There is no such environment here; what a run learned in it can still be read."""


class SemrlWarning(UserWarning):
    """Something works but is not as a person may expect; the command line prints it as one line."""


class MissingExtraError(UsageError, ImportError):
    """An optional dependency is not installed.

    Parameters
    ----------
    extra : str
        Name of the extra, as in ``pyproject.toml``.
    purpose : str
        What it is needed for, to complete "... is needed for <purpose>".
    """

    def __init__(self, extra: str, purpose: str) -> None:
        self.extra = extra
        super().__init__(f"the extra '{extra}' is needed for {purpose}: {how_to_get(extra)}")


def how_to_get(extra: str) -> str:
    """Return the command that installs what an extra of semrl needs."""
    from packaging.requirements import Requirement  # late: errors are printed where packages are missing

    try:
        every = map(Requirement, requires("semrl") or ())
    except PackageNotFoundError:  # run from a folder
        return f"pip install '.[{extra}]'"
    wanted = [one for one in every if one.marker and one.marker.evaluate({"extra": extra})]
    return " ".join(["pip install", *(f"'{one.name}{one.specifier}'" for one in wanted)])
