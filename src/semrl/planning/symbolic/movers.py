"""What the actions move: how it looks, which way it faces, and how it looks on something else."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from itertools import pairwise

from semrl.core import Ints
from semrl.core.errors import UsageError
from semrl.planning.symbolic.appearances import Appearances, Shape


def own_kinds(plays: Sequence[Ints], frames: Mapping[int, int], single: Set[int], looks: Appearances) -> dict[int, int]:
    """Find the kinds of the thing that moves most, and those that are only seen where none of these is.

    Parameters
    ----------
    plays
        ``(t + 1, rows, columns)`` of each episode: the kind of each cell.
    frames
        Kind → frames in which it is seen.
    single
        Kinds that are seen once at most in each frame.
    looks
        Of kinds.

    Returns
    -------
    dict
        Each kind → the one that it is on what lies beneath it in most frames. Such a kind is drawn over something
        else: it is taken for the one that it has most pixels of.

    Raises
    ------
    UsageError
        When nothing moves.
    """
    moves, turns = Counter[tuple[int, int]](), Counter[tuple[int, int]]()
    reveals: dict[int, Counter[Shape]] = {}
    for changed in changes(plays):
        pairs = [(a, b) for a, b in changed if not _lit(a, b, single, looks)]
        left = [(a, b) for a, b in pairs if a in single and b not in single]
        came = [b for _, b in pairs if b in single]
        if len(left) == 1:
            moves.update((left[0][0], b) for b in came)
        elif not left:
            turns.update((a, b) for a, b in pairs if a in single and b in single)
        for a, b in pairs:
            if a in single and came:
                reveals.setdefault(a, Counter())[looks.shape(b)] += 1
    own = _most_moved(moves, [pair for pair in turns if pair[::-1] in turns], single)
    own_shapes = {looks.shape(kind) for kind in own}
    beneath = {
        kind: max(
            (shape for shape in revealed if shape not in own_shapes), key=lambda shape: revealed[shape], default=None
        )
        for kind, revealed in reveals.items()
        if kind in own
    }
    usual = Counter[Shape | None]()
    for kind, shape in beneath.items():
        usual[shape] += frames[kind]
    ground = usual.most_common(1)[0][0]
    plain = {kind for kind, shape in beneath.items() if shape == ground}
    plain |= {b for a, b in turns if a in plain and b in own} | {a for a, b in turns if b in plain and a in own}
    others = own - plain | _seen_without(plays, own)
    return {kind: kind for kind in plain} | {kind: looks.most_alike(kind, plain) for kind in others}


def _lit(before: int, after: int, single: Set[int], looks: Appearances) -> bool:
    """Tell whether a cell still shows the same, in other light."""
    shape = looks.shape(before)
    return shape == looks.shape(after) and (bool(shape) or {before, after} <= single)


def changes(plays: Iterable[Ints]) -> Iterator[list[tuple[int, int]]]:
    """Yield of each decision the kinds of the cells that changed, before and after."""
    for grids in plays:
        flat = grids.reshape(len(grids), -1)
        for before, after in pairwise(flat):
            changed = before != after
            yield list(zip(before[changed].tolist(), after[changed].tolist(), strict=True))


def join(parent: dict[int, int], a: int, b: int) -> None:
    """Make two kinds of one group."""
    low, high = sorted((root(parent, a), root(parent, b)))
    parent[high] = low


def root(parent: Mapping[int, int], kind: int) -> int:
    """Return the first kind of a group."""
    while parent[kind] != kind:
        kind = parent[kind]
    return kind


def _most_moved(moves: Counter[tuple[int, int]], turns: Iterable[tuple[int, int]], single: Set[int]) -> set[int]:
    parent = {kind: kind for kind in single}
    for a, b in [*moves, *turns]:
        join(parent, a, b)
    moved = Counter[int]()
    for (_, b), count in moves.items():
        moved[root(parent, b)] += count
    if not moved:
        raise UsageError("nothing moved that the actions could have moved, so there is nothing to plan with")
    best = moved.most_common(1)[0][0]
    return {kind for kind in single if root(parent, kind) == best}


def _seen_without(plays: Iterable[Ints], own: Set[int]) -> set[int]:
    """Return the kinds that are only seen in frames without some."""
    with_it, without = set[int](), set[int]()
    for grids in plays:
        for grid in grids:
            kinds = set(grid.ravel().tolist())
            if kinds.isdisjoint(own):
                without |= kinds
            else:
                with_it |= kinds
    return without - with_it
