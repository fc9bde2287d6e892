"""What a grounder must offer."""

from collections.abc import Mapping
from typing import Protocol

from semrl.core import Floats, Plan


class Grounder(Protocol):
    """Writes a plan as numbers that an agent is shown beside the state (§3.4.4).

    It is made with its configuration and, by keyword, ``dimension`` (length of the facts), ``depth`` (actions of a
    plan) and ``n_actions``.
    """

    @property
    def size(self) -> int:
        """How many numbers it writes."""
        ...

    def ground(self, plan: Plan) -> Floats:
        """Write a plan, ``(size,)`` float32."""
        ...

    def parts(self, features: Floats) -> Mapping[str, Floats]:
        """Take what was written apart: name of each part → its numbers, for those who explain it."""
        ...
