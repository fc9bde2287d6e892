"""Boxes by name: those of this package, and those that other packages add by entry points."""

import difflib
import importlib
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from semrl.core.errors import UsageError

T = TypeVar("T")


class Registry(Generic[T]):
    """Names of the implementations of one box, loaded when they are asked for.

    Another package adds its own by an entry point in the group ``semrl.GROUP`` whose name is the box's name and whose
    value is ``module:Class``. The class has a dataclass ``Config`` of its parameters.

    Parameters
    ----------
    group
        What the boxes are, in the plural, such as ``"detectors"``.
    builtin
        Name → ``module:Class`` of this package's own.

    Examples
    --------
    >>> numbers: Registry[object] = Registry("numbers", {"fraction": "fractions:Fraction"})
    >>> numbers.load("fraction")(1, 2)
    Fraction(1, 2)
    """

    def __init__(self, group: str, builtin: Mapping[str, str]) -> None:
        self.group = group
        self._builtin = dict(builtin)
        self._what = group.replace("_", " ")  # as people say it

    def names(self) -> tuple[str, ...]:
        """Return all names, this package's own first."""
        return (*self._builtin, *(name for name in _added(f"semrl.{self.group}") if name not in self._builtin))

    def check(self, name: str) -> None:
        """Check that something has this name.

        Raises
        ------
        UsageError
            When nothing has; the message names what is close.
        """
        if name not in self.names():
            close = difflib.get_close_matches(name, self.names(), n=1)
            hint = f"; did you mean '{close[0]}'?" if close else f"; there are {', '.join(self.names())}"
            raise UsageError(f"there is no '{name}' among the {self._what}{hint}")

    def make(self, name: str, config: Any, **context: Any) -> T:
        """Make the box of a name with its part of the configuration; see `load` and `config`."""
        return self.load(name)(self.config(name, config), **context)

    def load(self, name: str) -> Callable[..., T]:
        """Return the class of a name.

        Raises
        ------
        UsageError
            When nothing has this name, or what has it cannot be imported.
        """
        self.check(name)
        if name in self._builtin:
            module, _, attribute = self._builtin[name].partition(":")
            found: Callable[..., T] = getattr(importlib.import_module(module), attribute)
            return found
        point = _added(f"semrl.{self.group}")[name]
        try:
            loaded: Callable[..., T] = point.load()
        except Exception as error:  # whatever somebody else's module does when it is imported
            why = " ".join(str(error).split()) or type(error).__name__
            raise UsageError(f"'{name}' of the {self._what} cannot be loaded from {point.value}: {why}") from error
        return loaded

    def config(self, name: str, config: Any) -> Any:
        """Return the parameters of a box: this package's own stand under its name, those of others in ``options``.

        Raises
        ------
        UsageError
            When an option is unknown or has a wrong value, or the box says nothing of its parameters.
        """
        if name in self._builtin:
            return getattr(config, name)
        kind: Any = self.load(name)
        if not hasattr(kind, "Config"):
            raise UsageError(f"'{name}' of the {self._what} has no dataclass 'Config' of its parameters")
        try:
            return kind.Config(**config.options.get(name, {}))
        except TypeError as error:
            raise UsageError(f"options.{name} does not fit: {error}") from None


@cache
def _added(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=group)}
