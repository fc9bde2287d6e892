"""Whether actions move an object: a correlation ratio, counted as the play goes on."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import Floats, Ints
from semrl.core.protocols import Saved

LAGS = 3
"""An action may show after so many decisions: what has inertia answers late."""

LEAST_STEPS = 5
"""For each action, on average; before, the largest of several ratios is a matter of chance."""


class Controllability(Saved):
    """For each role, how much of the variance of its steps the actions explain.

    The correlation ratio η² is the variance between the mean steps of the actions, as a share of the whole
    variance. It needs no order of actions and no line through them, and is 0 where they do not matter, once what chance
    alone would explain is taken off: much of few steps by many actions (the adjusted ratio, ε², Kelley 1935). It is
    counted for rows and columns, and for the last action and the ones before it; the largest counts.
    """

    SAVED = ("_counts", "_sums", "_squares", "_actions")

    def __init__(self) -> None:
        self._counts = np.zeros((0, LAGS, 2, 0))  # (roles, lags, axes, actions): steps
        self._sums = np.zeros((0, LAGS, 2, 0))  # of these, in pixels
        self._squares = np.zeros((0, LAGS, 2))
        self._actions: list[int] = []  # the last ones of the episode, the newest first

    def learn(self, action: int | None, roles: Ints, steps_px: Floats) -> None:
        """Learn from one decision.

        Parameters
        ----------
        action
            The one that led here; None at the beginning of an episode.
        roles
            ``(n,)``, each at most once.
        steps_px
            ``(n, 2)``, what each of them moved by.
        """
        self._actions = [] if action is None else [action, *self._actions[: LAGS - 1]]
        self._grow(int(roles.max(initial=-1)) + 1, max(self._actions, default=-1) + 1)
        for lag, cause in enumerate(self._actions):
            self._counts[roles, lag, :, cause] += 1
            self._sums[roles, lag, :, cause] += steps_px
            self._squares[roles, lag] += np.square(steps_px)

    def merge(self, role: int, other: int) -> None:
        """Let one role have all that was counted of another, which is left with nothing."""
        self._grow(max(role, other) + 1, 0)
        for counted in (self._counts, self._sums, self._squares):
            counted[role] += counted[other]
            counted[other] = 0

    def shares(self, n_roles: int) -> NDArray[np.float64]:
        """Return the explained share of each role, ``(n_roles,)`` in 0 … 1; 0 where nothing is known."""
        shares = np.zeros(n_roles)
        counts, sums = self._counts.sum(axis=3), self._sums.sum(axis=3)  # (r, lags, 2)
        whole = self._squares - np.square(sums) / np.maximum(counts, 1)
        between = (np.square(self._sums) / np.maximum(self._counts, 1)).sum(axis=3)
        between -= np.square(sums) / np.maximum(counts, 1)
        moved = whole > 1e-9 * np.maximum(counts, 1)
        ratios = np.where(moved, between / np.where(moved, whole, 1), 0.0)
        causes = (self._counts > 0).sum(axis=3)
        enough = counts >= np.maximum(LEAST_STEPS * causes, causes + 1)
        adjusted = 1 - (1 - ratios) * (counts - 1) / np.maximum(counts - causes, 1)
        ratios = np.where(enough, adjusted, 0.0)
        shares[: len(ratios)] = ratios.max(axis=(1, 2), initial=0.0)
        return np.asarray(np.clip(shares, 0, 1))

    def _grow(self, n_roles: int, n_actions: int) -> None:
        """Make room for more roles and actions."""
        roles = max(n_roles - len(self._counts), 0)
        actions = max(n_actions - self._counts.shape[3], 0)
        if roles or actions:
            wider = ((0, roles), (0, 0), (0, 0), (0, actions))
            self._counts, self._sums = np.pad(self._counts, wider), np.pad(self._sums, wider)
            self._squares = np.pad(self._squares, wider[:3])
