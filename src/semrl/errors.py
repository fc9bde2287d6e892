"""Errors whose message is all a person needs: one line that says what is wrong and what to do."""


class SemrlError(Exception):
    """The run failed for a reason we can name; the command line prints it and exits with 1."""


class UsageError(SemrlError):
    """The call was wrong (unknown name, missing run, bad value); the command line exits with 2."""


class DataError(SemrlError, ValueError):
    """An array is not what a component can work with (shape, dtype, range, not finite)."""


class MissingExtraError(UsageError, ImportError):
    """An optional dependency is not installed.

    Parameters
    ----------
    extra : str
        Name of the extra in ``pip install 'semrl[extra]'``.
    purpose : str
        What it is needed for, to complete "... is needed for <purpose>".
    """

    def __init__(self, extra: str, purpose: str) -> None:
        self.extra = extra
        super().__init__(f"the extra '{extra}' is needed for {purpose}: pip install 'semrl[{extra}]'")
