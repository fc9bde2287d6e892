"""How well objects are found in several games, scored against what OCAtari reads from the emulator's RAM.

Perception is that of the preset ``semrl`` for the model ``objects``, learned from random play as in a run, and tested
on random play that it has not seen. A true object counts where it is part of the play (no score, no clock) and moves:
what stands in one place in more than half of the frames is scenery, which perception leaves out by design, and so is
what is of a category that never moves: bricks and pills that are gone in more than half of the frames. What the RAM has
and the picture does not show counts as little (its box and the pixels around look as they mostly do), nor does what it
has twice. What was found is matched one to one: its centre must lie in the true object's box, or two pixels beside it.
A kind stands for what it mostly matched in the first half of the play; the second half is scored. Kinds that one thing
has in turn are one concept, as it is learned from the same play; concepts are scored in the same way, and their purity
is the share of what they matched that is of the category that each matched most.

OCAtari asks for an old NumPy but runs with ours, so it is installed beside it:

    pip install termcolor pygame scikit-image && pip install --no-deps ocatari==2.2.1
    python benchmarks/objects.py [--games NAME...] [--decisions N] [--seed S] [--json]
"""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice, pairwise
from typing import Any

import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from ocatari.ram.extract_ram_info import detect_objects_ram, init_objects
from rich.console import Console
from rich.table import Table
from scipy.optimize import linear_sum_assignment
from scipy.stats import mode

from semrl.concepts import Concepts
from semrl.concepts.concepts import NO_CONCEPT
from semrl.concepts.counting import LABELS_A_KIND
from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Observation, Tracks
from semrl.core.things import ID, KIND, OWN, STILL
from semrl.perception.encoders.objects import ObjectsEncoder
from semrl.training import RunConfig, preset
from semrl.training.session import limited_threads
from semrl_thesis.perception import new_run, pretrain

GAMES = (
    "Pong", "Boxing", "Freeway", "Asterix", "Skiing", "Seaquest", "Tennis", "Kangaroo", "Breakout",
    "MsPacman", "DemonAttack", "SpaceInvaders", "Bowling", "Assault", "Riverraid", "Carnival",
)  # fmt: skip
LAG_PX = 2
"""The RAM may be a moment ahead of the picture."""

USUAL_EVERY = 10
"""One frame in so many is looked at for what is behind everything."""

LEAST_SHIFTS = 0.002
"""Share of the sightings of a category at which a thing of one size must be gone from one place and new in another."""

Truth = tuple[str, int, int, int, int]
"""An object as the RAM has it: its category, left, top, width and height in pixels of the frame."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Score what is found in several games."""

    games: tuple[str, ...] = GAMES
    """Their names, as Gymnasium's environments have them."""
    decisions: int = 4_000
    """Decisions of new random play in each: half to name the kinds, half to be scored."""
    seed: int = 0
    """Of the random play."""
    json: bool = False
    """Print one JSON object and nothing else."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """What was found in one frame.

    Attributes
    ----------
    kinds
        ``(n,)``: the kind of what is followed, or its role.
    centres
        ``(n, 2)``: x and y in pixels of the frame.
    """

    kinds: NDArray[np.int64]
    centres: NDArray[np.float64]


def main(arguments: Arguments) -> None:
    """Learn to see each game, play it, compare."""
    with limited_threads(1):
        rows = {game: score_game(game, arguments) for game in arguments.games}
        told = {"games": rows, "seed": arguments.seed, "decisions": arguments.decisions, "machine": machine.describe()}
    if arguments.json:
        print(json.dumps(told))
    else:
        show(told)


def score_game(game: str, arguments: Arguments) -> dict[str, Any]:
    """Score one game: all that is followed and moves, by kind and by concept, and that of it which has a slot."""
    config = preset("semrl", "objects", {"env": f"{game}NoFrameskip-v4", "seed": arguments.seed})
    encoder = pretrain(config, "objects").encoder
    assert isinstance(encoder, ObjectsEncoder)
    roles = encoder.perception.slot_assigner
    truths: list[list[Truth]] = []
    frames: list[Frame] = []
    followed: list[Found] = []
    told: list[Found] = []
    things: list[list[Floats]] = []
    labels: list[NDArray[np.int64]] = []
    objects = init_objects(game, hud=False)
    for observation, tracks in islice(play(encoder, config), arguments.decisions):
        if not things or int(tracks.ages.max(initial=0)) == 0:
            things.append([])
        things[-1].append(roles.things(tracks))
        assert observation.ram is not None
        detect_objects_ram(objects, observation.ram.astype(int), game, hud=False)
        truths.append([(each.category, *map(int, each.xywh)) for each in objects if each and each.visible])
        frames.append(observation.frame.copy())
        shape = observation.frame.shape
        moving = tracks.visible & ~roles.stays(tracks)
        followed.append(found(tracks, moving, roles.kinds(tracks), shape))
        labels.append(labels_of(things[-1][-1], tracks.ids[moving]))
        slotted = (tracks.time_since_update == 0) & np.isin(tracks.roles, roles.slots_)
        told.append(found(tracks, slotted, tracks.roles, shape))
    moved = drawn(without_scenery(truths), frames)
    number_of = concepts_of(things)
    named = [replace(each, kinds=number_of[label]) for each, label in zip(followed, labels, strict=True)]
    return {
        "objects": sum(map(len, moved)) / len(moved),
        "slots": len(roles.slots_),
        "followed": score(moved, followed),
        "concepts": score(moved, named) | {"purity": purity(moved, named), "number": int(number_of.max() + 1)},
        "told": score(moved, told),
    }


def play(encoder: ObjectsEncoder, config: RunConfig) -> Iterator[tuple[Observation, Tracks]]:
    """Act at random and follow the objects, episode after episode."""
    for number in count():
        episode = encoder.begin()
        for observation in new_run(replace(config, seed=config.seed + number), None):
            episode.encode(observation)
            yield observation, episode.tracks


def drawn(truths: list[list[Truth]], frames: list[Frame]) -> list[list[Truth]]:
    """Leave out what the picture does not show, or the RAM has twice.

    Something is shown if the box, or a pixel around it, is not what is seen there in more than half of the frames.
    """
    some = colours(np.array(frames[::USUAL_EVERY]))
    commonest = mode(some, axis=0)
    usual = np.where(commonest.count > len(some) / 2, commonest.mode, -1)
    kept: list[list[Truth]] = []
    for true, frame in zip(truths, frames, strict=True):
        unusual = colours(frame) != usual
        kept.append([each for each in dict.fromkeys(true) if around(each, unusual).any()])
    return kept


def colours(frames: Frame) -> NDArray[np.int64]:
    """Return one number for each colour of frames, ``(…, channels)``."""
    return np.asarray(frames.astype(np.int64) @ [1 << 16, 1 << 8, 1])


def around(true: Truth, picture: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the part of a picture in an object's box and one pixel around it."""
    _, left, top, width, height = true
    return picture[max(top - 1, 0) : top + height + 1, max(left - 1, 0) : left + width + 1]


def found(tracks: Tracks, chosen: NDArray[np.bool_], kinds: NDArray[np.int64], shape: Sequence[int]) -> Found:
    """Return some of the tracks, in pixels of the frame."""
    scale = np.array(shape[:2]) / IMAGE_SIZE_PX
    return Found(kinds=kinds[chosen], centres=((tracks.centres_px[chosen] + 0.5) * scale - 0.5)[:, ::-1])


def labels_of(things: Floats, ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the label of some of the things, see `semrl.concepts`, given their identities."""
    chosen = things[np.searchsorted(things[:, ID], ids)]
    kind, still, own = (chosen[:, column].astype(np.int64) for column in (KIND, STILL, OWN))
    return np.asarray(kind * LABELS_A_KIND + 2 * still + own)


def concepts_of(episodes: list[list[Floats]]) -> NDArray[np.int64]:
    """Return the concept of each label, as it is learned from the things of some episodes."""
    concepts = Concepts()
    for things in episodes:
        concepts.partial_fit(things)
    return concepts.number_of_


def purity(truths: list[list[Truth]], seen: list[Found]) -> float:
    """Return the share of what concepts matched that is of the category that each of them matched most."""
    pairs = Counter(pair for true, found in zip(truths, seen, strict=True) for pair in matches(true, found))
    most: dict[int, int] = {}
    for (_, concept), n in pairs.items():
        if concept != NO_CONCEPT:
            most[concept] = max(most.get(concept, 0), n)
    return sum(most.values()) / max(sum(n for (_, concept), n in pairs.items() if concept != NO_CONCEPT), 1)


def without_scenery(truths: list[list[Truth]]) -> list[list[Truth]]:
    """Leave out what stands in one place in more than half of the frames, and categories that never move."""
    places = Counter(each[:3] for frame in truths for each in set(frame))
    moving = moving_categories(truths)
    return [[each for each in frame if places[each[:3]] <= len(truths) / 2 and each[0] in moving] for frame in truths]


def moving_categories(truths: list[list[Truth]]) -> set[str]:
    """Return the categories of which things of one size leave a place and come to another at the same decision."""
    seen, shifts = Counter[str](), Counter[str]()
    for before, now in pairwise(truths):
        seen.update(each[0] for each in now)
        gone = Counter((each[0], *each[3:]) for each in set(before) - set(now))
        new = Counter((each[0], *each[3:]) for each in set(now) - set(before))
        for (category, *_), n in (gone & new).items():
            shifts[category] += n
    return {category for category in seen if shifts[category] >= LEAST_SHIFTS * seen[category]}


def score(truths: list[list[Truth]], seen: list[Found]) -> dict[str, float]:
    """Return precision, recall and F1, and F1 where a match of the wrong kind counts as none."""
    half = len(truths) // 2
    pairs = [matches(true, found) for true, found in zip(truths, seen, strict=True)]
    votes = Counter(pair for frame in pairs[:half] for pair in frame)
    names: dict[int, str] = {}
    for (category, kind), _ in votes.most_common():
        names.setdefault(kind, category)
    scored = [pair for frame in pairs[half:] for pair in frame]
    n_true = sum(map(len, truths[half:]))
    n_found = sum(len(found.kinds) for found in seen[half:])
    right = sum(names.get(kind) == category for category, kind in scored)
    return {
        "precision": len(scored) / max(n_found, 1),
        "recall": len(scored) / max(n_true, 1),
        "f1": 2 * len(scored) / max(n_found + n_true, 1),
        "f1_with_kind": 2 * right / max(n_found + n_true, 1),
    }


def matches(true: list[Truth], found: Found) -> list[tuple[str, int]]:
    """Match one frame so that distances are least; return the category and kind of each match."""
    if not true or not len(found.kinds):
        return []
    boxes = np.array([each[1:] for each in true], np.float64)
    away = np.abs(found.centres[None] - (boxes[:, None, :2] + (boxes[:, None, 2:] - 1) / 2))  # (true, found, 2)
    inside = (away <= boxes[:, None, 2:] / 2 + LAG_PX).all(axis=2)
    distances = np.where(inside, np.hypot(*np.moveaxis(away, 2, 0)), 1e6)
    return [
        (true[i][0], int(found.kinds[j]))
        for i, j in zip(*linear_sum_assignment(distances), strict=True)
        if inside[i, j]
    ]


def show(told: dict[str, Any]) -> None:
    """Print a table."""
    names = ("precision", "recall", "f1", "f1_with_kind", "purity")
    table = Table("game", "true", "found", *names, box=None, padding=(0, 1, 0, 0))
    for game, row in told["games"].items():
        for what in ("followed", "concepts", "told"):
            of = {"told": f"told, {row['slots']} slots", "concepts": f"{row['concepts']['number']} concepts"}
            shown = [f"{row[what][name]:.3f}" if name in row[what] else "" for name in names]
            table.add_row(game, f"{row['objects']:.1f}", of.get(what, what), *shown)
    console = Console()
    console.print(table)
    console.print(f"{told['decisions']:,} decisions a game, seed {told['seed']}", highlight=False)
    console.print(machine.sentence(told["machine"]), highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
