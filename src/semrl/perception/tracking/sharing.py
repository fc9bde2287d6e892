"""More things of a kind than ever were seen at once: each of them counts, though there is a slot for one."""

import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Ints, Tracks
from semrl.core.protocols import Saved
from semrl.core.things import LEAST_MOVING_SHARE
from semrl.perception.tracking.slot_statistics import NEVER
from semrl.perception.tracking.slots import SlotAssigner, sizes_px

REMEMBERED = 16
"""Decisions back, as far as a plan looks."""

LEAST_DECISIONS = 3
"""For which a thing must have been followed: before, it may be a piece of another one, or have no speed yet."""

MOST_MORE = 2
"""Things without a slot of their own that count; the ones that fit worse do not."""


class SharedSlots(Saved):
    """The lists of an episode in which a slot is had by one thing after the other.

    Where more things of a kind are seen than while slots were learned, one has the slot, and the others none. What
    has been learned of the slot holds for each of them. So each has it once: with its own past, in a list that
    is otherwise the same. Where more things move than there are slots, as in a crowd, no slot is shared.

    Parameters
    ----------
    assigner
        Says which slots there are, and which of them are shared.
    on
        Whether slots are shared at all.
    """

    SAVED = ("_ids", "_trails", "_lists", "_left")

    def __init__(self, assigner: SlotAssigner, *, on: bool = True) -> None:
        self._assigner = assigner
        self._slots = np.flatnonzero(assigner.shared_) if on else np.zeros(0, np.int64)
        self._ids: Ints = np.zeros(0, np.int64)
        self._width = len(assigner.config.numbers)
        self._trails: Floats = np.zeros((0, REMEMBERED, self._width), np.float32)  # of each track, NaN before it began
        self._lists: Floats = np.zeros((0, assigner.dimension), np.float32)
        self._left: Ints = np.zeros(len(assigner.slots_), np.int64)  # decisions for which each slot is shared still

    def lists(self, tracks: Tracks, facts: Floats) -> tuple[Floats, ...]:
        """Return the newest lists, ``(h, k)`` each, the newest first, once for each thing that counts.

        Parameters
        ----------
        tracks
            Of the next decision, with their roles.
        facts
            ``(k,)``, the list as it is; see `SlotAssigner.transform`.

        Returns
        -------
        tuple
            Empty where no slot is shared. The first is that of the things that have the slots.
        """
        if not len(self._slots):
            return ()
        self._remember(tracks, facts)
        more = self._more(tracks)
        self._left = np.maximum(self._left - 1, 0)
        self._left[[slot for _, slot in more]] = REMEMBERED
        if not self._left.any():
            return ()
        main = self._lists
        for slot in np.flatnonzero(self._left).tolist():
            for holder in np.flatnonzero(tracks.roles == self._assigner.slots_[slot]).tolist():
                main = self._with(main, slot, holder)
        return main, *(self._with(main, slot, track) for track, slot in more)

    def _remember(self, tracks: Tracks, facts: Floats) -> None:
        now = np.empty((len(tracks), 1, self._width), np.float32)
        now[:, 0, :2] = tracks.centres_px[:, ::-1] / np.float32(IMAGE_SIZE_PX - 1)
        if self._assigner.config.sizes:
            now[:, 0, 2:4] = sizes_px(tracks) / np.float32(IMAGE_SIZE_PX - 1)
        now[:, 0, -1] = tracks.visible
        past = np.full((len(tracks), REMEMBERED - 1, self._width), np.nan, np.float32)
        places = {track: place for place, track in enumerate(self._ids.tolist())}
        for place, track in enumerate(tracks.ids.tolist()):
            if track in places:
                past[place] = self._trails[places[track], :-1]
        self._ids, self._trails = tracks.ids, np.concatenate([now, past], axis=1)
        self._lists = np.concatenate([facts[None], self._lists])[:REMEMBERED]

    def _more(self, tracks: Tracks) -> list[tuple[int, int]]:
        """Return which tracks would have a slot if it were free, and which, those first that fit best."""
        steady = (tracks.ages >= LEAST_DECISIONS) & (tracks.moves >= LEAST_MOVING_SHARE * tracks.ages)
        without = np.flatnonzero(tracks.visible & steady & (tracks.roles < 0))
        if not len(without):
            return []
        roles = set(tracks.roles[tracks.visible].tolist())
        held = self._slots[[role in roles for role in self._assigner.slots_[self._slots].tolist()]]
        if not len(held):
            return []
        costs: NDArray[np.float64] = self._assigner.costs(tracks)[np.ix_(without, held)]
        best = costs.argmin(axis=1)
        order = np.argsort(costs.min(axis=1), kind="stable")[:MOST_MORE]
        return [(int(without[i]), int(held[best[i]])) for i in order if costs[i, best[i]] < NEVER]

    def _with(self, lists: Floats, slot: int, track: int) -> Floats:
        """Return the lists with a track in a slot; before it began, the slot is as it is when nothing is there."""
        trail, changed = self._trails[track, : len(lists)], lists.copy()
        place = slice(slot * self._width, (slot + 1) * self._width)
        changed[:, place] = np.where(np.isnan(trail), self._assigner.at_rest_[place], trail)
        return changed
