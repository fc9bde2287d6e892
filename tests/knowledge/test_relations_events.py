"""Relations and events against what plain Python makes of small steps in time."""

import itertools

import numpy as np
import pytest

from semrl.core import ConceptTable, Scene
from semrl.knowledge.events import BORDERS, Event, events_of
from semrl.knowledge.relations import TOUCH_PX, relations_of

TABLE = ConceptTable(
    names=("ball0", "own1", "still2"),
    controlled=np.array([False, True, False]),
    static=np.array([False, False, True]),
    kinds=((0,), (1,), (2,)),
    arena_px=np.array([0, 0, 84, 84], np.float32),
)


def scene(*things):
    """Make a scene of (id, concept, box, velocity)."""
    ids, concepts, boxes, velocities = zip(*things, strict=True) if things else ((), (), (), ())
    return Scene(
        ids=np.array(ids, np.int64),
        concepts=np.array(concepts, np.int64),
        kinds=np.array(concepts, np.int64),
        boxes_px=np.array(boxes, np.float32).reshape(-1, 4),
        velocities_px=np.array(velocities, np.float32).reshape(-1, 2),
    )


def drawn(seed, n=6):
    rng = np.random.default_rng(seed)
    corner, size = rng.integers(0, 60, (n, 2)), rng.integers(2, 20, (n, 2))
    boxes = np.concatenate([corner, corner + size], axis=1)
    velocities = rng.integers(-5, 6, (n, 2)) * (rng.random((n, 1)) < 0.8)
    return scene(*((i, 0, boxes[i], velocities[i]) for i in range(n)))


def apart(one, other):
    """The gap between two boxes, along x and y."""
    return max(other[0] - one[2], one[0] - other[2]), max(other[1] - one[3], one[1] - other[3])


def first_touch(one, v, other, w):
    """When two boxes touch, found by looking at many moments one after the other."""
    for time in np.linspace(0, 40, 4001):
        if max(apart(one + time * np.tile(v, 2), other + time * np.tile(w, 2))) <= 1e-6:
            return time
    return np.inf


@pytest.mark.parametrize("seed", range(4))
def test_relations_are_what_the_boxes_say(seed):
    shown = drawn(seed)
    told, boxes, velocities = relations_of(shown), shown.boxes_px, shown.velocities_px
    for i, j in itertools.permutations(range(len(shown)), 2):
        gaps = apart(boxes[i], boxes[j])
        np.testing.assert_allclose(told.gaps_px[i, j], gaps)
        assert told.touches[i, j] == told.touches[j, i] == (max(gaps) <= TOUCH_PX)
        assert told.overlaps[i, j] == told.overlaps[j, i] == (max(gaps) < 0)
        assert told.left_of[i, j] == (boxes[i, 2] <= boxes[j, 0]) and told.above[i, j] == (boxes[i, 3] <= boxes[j, 1])
        later = apart(boxes[i] + np.tile(velocities[i], 2), boxes[j] + np.tile(velocities[j], 2))
        assert told.approaches[i, j] == (max(*later, 0) < max(*gaps, 0))
        touch = first_touch(boxes[i], velocities[i], boxes[j], velocities[j])
        if touch < 39:
            assert abs(told.decisions_to_contact[i, j] - touch) < 0.03
        else:
            assert told.decisions_to_contact[i, j] > 38
    for flags in (told.touches, told.overlaps, told.left_of, told.above, told.approaches):
        assert not flags.diagonal().any()


def test_what_flies_through_another_thing_in_one_decision_touches_it():
    one = scene((0, 0, [0, 0, 2, 2], [20, 0]), (1, 1, [10, -5, 12, 10], [0, 0]))
    assert relations_of(one).decisions_to_contact[0, 1] == pytest.approx(0.4)
    beside = scene((0, 0, [0, 20, 2, 22], [20, 0]), (1, 1, [10, -5, 12, 10], [0, 0]))
    assert np.isinf(relations_of(beside).decisions_to_contact[0, 1])


def flight(places, velocity):
    return [(0, 0, [x, y, x + 2, y + 2], v) for (x, y), v in zip(places, velocity, strict=True)]


def test_a_bounce_names_what_was_hit_and_along_which_axis():
    wall = (7, 2, [30, 0, 34, 60], [0, 0])
    there = [(20, 20), (24, 22), (27, 24), (23, 26)]
    velocities = [(4, 2), (4, 2), (3, 2), (-4, 2)]
    scenes = [scene(one, wall) for one in flight(there, velocities)]
    told = events_of(scenes, TABLE)
    bounces = [event for event in told if event.kind == "bounce"]
    assert [(e.decision, e.things, e.concepts, e.axis) for e in bounces] == [(3, (0, 7), ("ball0", "still2"), "x")]
    assert "bounces off still2" in bounces[0].sentence
    contacts = [event for event in told if event.kind == "contact"]
    assert not contacts or contacts[0].things == (0, 7)


def test_what_is_steered_turns_and_does_not_bounce():
    scenes = [scene((0, 1, [20, y, 22, y + 9], (0, v))) for y, v in ((20, 4), (24, 4), (20, -4))]
    assert events_of(scenes, TABLE) == []


@pytest.mark.parametrize("border", range(4))
def test_a_bounce_off_a_border_names_it(border):
    axis, far = border % 2, border >= 2
    place = np.array([40.0, 40.0])
    place[axis] = 80.0 if far else 2.0
    velocity = np.zeros(2)
    velocity[axis], velocity[1 - axis] = 3 if far else -3, 1
    turned = velocity.copy()
    turned[axis] *= -1
    scenes = [scene(*flight([p], [v])) for p, v in ((place, velocity), (place + turned, turned))]
    (event,) = events_of(scenes, TABLE)
    assert (event.kind, event.axis, event.concepts) == ("bounce", "xy"[axis], ("ball0", BORDERS[border]))


def test_coming_going_rewards_and_lives_are_told_in_the_order_of_time():
    ball, own = (0, 0, [5, 5, 7, 7], [0, 0]), (3, 1, [50, 5, 52, 15], [0, 0])
    scenes = [scene(ball), scene(ball, own), scene(own), scene(own)]
    told = events_of(scenes, TABLE, rewards=[0, 0, -1], lives=[3, 3, 3, 2])
    assert [(e.decision, e.kind, e.things, e.amount) for e in told] == [
        (1, "appears", (3,), 0),
        (2, "vanishes", (0,), 0),
        (3, "loss", (), -1),
        (3, "life lost", (), 1),
    ]
    assert told[0].concepts == ("own1",) and events_of([scene()], TABLE) == []


def plain_contacts(before, after, static):
    """Contacts between two scenes, by looking at many moments between them."""
    found = set()
    for i, j in itertools.combinations(range(len(before)), 2):
        if static[i] and static[j]:
            continue
        ways = [
            [before.boxes_px[k] + s * (after.boxes_px[k] - before.boxes_px[k]) for s in np.linspace(0, 1, 401)]
            for k in (i, j)
        ]
        gaps = [max(apart(a, b)) for a, b in zip(*ways, strict=True)]
        if gaps[0] > TOUCH_PX and (gaps[-1] <= TOUCH_PX or min(gaps) <= 0):
            found.add((i, j))
    return found


@pytest.mark.parametrize("seed", range(12))
def test_contacts_are_those_of_many_small_steps(seed):
    rng = np.random.default_rng(seed)
    before = drawn(seed, 8)
    steps = rng.integers(-15, 16, (8, 2))
    steps[:2] = 0
    concepts = [2, 2, 0, 0, 0, 0, 0, 0]
    moved = [
        scene(*((i, concepts[i], before.boxes_px[i] + k * np.tile(steps[i], 2), (0, 0)) for i in range(8)))
        for k in (0, 1)
    ]
    told = {event.things for event in events_of(moved, TABLE) if event.kind == "contact"}
    assert told == plain_contacts(*moved, np.array(concepts) == 2)


def test_an_event_says_what_happened():
    assert Event(decision=1, kind="gain", amount=1.0).sentence == "reward +1"
    assert Event(decision=1, kind="vanishes", things=(0,), concepts=("ball0",)).sentence == "ball0 vanishes"
