"""What every experiment is made of: a name, its numbers, its settings at each scale, and how it measures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from semrl_thesis.ledger import Ledger
from semrl_thesis.results import Number, Result
from semrl_thesis.sweep import RunSpec

Scale = Literal["tiny", "quick", "full"]
"""``full`` is the thesis's budget, ``quick`` some minutes, ``tiny`` some seconds, to see that everything works."""


@dataclass(frozen=True, kw_only=True)
class Context:
    """Where an experiment measures.

    Attributes
    ----------
    scale
        Budget.
    folder
        Its ``runs`` folder holds the trained runs.
    ledger
        What finished runs have scored.
    shipped
        Other folders with results.
    say
        Is told what is being done.
    """

    scale: Scale
    folder: Path
    ledger: Ledger
    shipped: Sequence[Path] = ()
    say: Callable[[str], None] = lambda _: None

    @property
    def folders(self) -> tuple[Path, ...]:
        """Where results may lie."""
        return (self.folder, *self.shipped)

    def kept(self, name: str) -> Path:
        """Return the file of this name, where there is one; else where it is to be written."""
        paths = [folder / name for folder in self.folders]
        return next((path for path in paths if path.exists()), paths[0])

    def run_folder(self, spec: RunSpec) -> Path:
        """Return where a run is, or would be."""
        return self.folder / "runs" / spec.id


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A test, table or group of figures of the thesis.

    Attributes
    ----------
    name
        As it is called on the command line.
    place
        Among the others: experiments come in this order.
    title, section
        As a page says it.
    numbers
        Of the thesis, in its order.
    settings
        At each scale; data that `measure` is given.
    measure
        Does it.
    runs
        The training runs it needs, at each scale.
    """

    name: str
    place: int
    title: str
    section: str
    numbers: tuple[Number, ...]
    settings: Mapping[Scale, Any]
    measure: Callable[[Any, Context], Result]
    runs: Mapping[Scale, tuple[RunSpec, ...]] = field(default_factory=dict)
