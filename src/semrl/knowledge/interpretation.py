"""Scenes as a description logic sees them (ABoxes): who is of which class, in which role to whom, which numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, slots=True)
class Interpretation:
    """Any number of scenes with room for n individuals each, of which the first is the scene itself."""

    present: NDArray[np.bool_]
    """``(b, n)``: who is there."""
    classes: NDArray[np.bool_]
    """``(b, c, n)``: who is of which atomic class, in the order of the ontology's `concepts`."""
    roles: NDArray[np.bool_]
    """``(b, r, n, n)``: from whom to whom, in the order of the ontology's `role_names`."""
    numbers: NDArray[np.float64]
    """``(b, d, n)``: in the order of the ontology's `numbers`; NaN where there is none."""
    names: tuple[str, ...] = ()
    """``n`` names of individuals; empty for those without one."""

    def __len__(self) -> int:
        return len(self.present)
