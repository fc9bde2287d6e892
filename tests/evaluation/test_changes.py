"""What is different in an altered world is found, and nothing else is learned anew."""

import json
from pathlib import Path

import numpy as np
import pytest

from semrl.core.arrays import digest
from semrl.core.errors import UsageError
from semrl.evaluation.changes import RECOGNISING, REFLECTIONS, REWARD, Change, adapted, find_changes, turned
from semrl.evaluation.player import load_player
from semrl.training import train

ENOUGH = RECOGNISING * (len(REFLECTIONS) + 2)


@pytest.fixture(scope="module")
def catch_run(tmp_path_factory, tiny):
    """A run that knows Catch: where the ball falls, what the actions do, what is gained."""
    path = tmp_path_factory.mktemp("runs") / "catch"
    trees = {"planning.trees.members": 3, "planning.trees.first_decisions": 100}
    train(path, tiny("objects-map", decisions=900, **trees))
    return path


@pytest.mark.parametrize("variant", ["", "mirrored", "upside_down"])
def test_a_picture_that_is_turned_round_is_turned_back(catch_run, variant):
    player = load_player(catch_run)
    found = find_changes(player, variant, decisions=ENOUGH)
    assert found.reflection == variant, found.expected
    assert all(found.expected[variant] > 3 * found.expected[other] for other in REFLECTIONS if other != variant)
    assert not found.broken and not any(change.is_broken for change in found.facts + found.rules)
    assert found.facts[-1].about == REWARD and len(found.facts) > 3
    again = adapted(player, found)
    assert again.variant == turned(variant, variant)


def test_what_is_found_repeats(catch_run):
    assert find_changes(load_player(catch_run), "mirrored", decisions=ENOUGH) == find_changes(
        load_player(catch_run), "mirrored", decisions=ENOUGH
    )


@pytest.mark.parametrize("memory", [False, True])
def test_only_what_has_changed_is_learned_anew(catch_run, memory):
    player = load_player(catch_run, memory=memory)
    world = player.planning.world_model
    found = find_changes(player, "", decisions=ENOUGH)
    numbers, reward = world.features.varying_, len(world.features.varying_)
    before = [[tree.copy() for tree in world.forests._grown[1].tree(target)] for target in range(reward + 2)]
    world.learn_anew([one.trajectory for one in found.play], [int(numbers[0])], reward=True)
    for target in range(reward + 2):
        after = world.forests._grown[1].tree(target)
        same = all(np.array_equal(*pair) for pair in zip(before[target], after, strict=True))
        assert same is (target not in {0, reward})


def test_of_what_never_varied_there_is_nothing_to_learn_anew(catch_run):
    player = load_player(catch_run)
    world = player.planning.world_model
    steady = sorted(set(range(len(world.features.axes))) - set(world.features.varying_.tolist()))
    before = digest(world.inference_arrays())
    world.learn_anew([], steady[:1], reward=False)
    assert steady and digest(world.inference_arrays()) == before


def test_a_drop_must_be_large_and_no_chance():
    def change(*counts):
        before, times_before, now, times_now = counts
        return Change(
            about="x", right_before=before, times_before=times_before, right_now=now, times_now=times_now
        ).is_broken

    assert change(95, 100, 60, 100) and change(900, 1000, 800, 1000)
    assert not change(95, 100, 90, 100)  # by chance
    assert not change(99_900, 100_000, 99_000, 100_000)  # too small to matter
    assert not change(60, 100, 95, 100) and not change(95, 100, 0, 0) and not change(0, 0, 5, 9)


def test_too_few_decisions_are_refused(catch_run):
    with pytest.raises(UsageError, match="decisions must be 500 or more, not 400"):
        find_changes(load_player(catch_run), "mirrored", decisions=400)


def test_what_cannot_be_done_is_said_before_anything_is_played(catch_run, map_run, baseline_run, call):
    told = call("changes", map_run, "--env-variant", "mirrored", "--episodes", 1)
    assert (told.status, "'networks' cannot learn a part anew" in told.message) == (2, True)
    told = call("changes", baseline_run, "--env-variant", "mirrored")
    assert (told.status, "has no map" in told.message) == (2, True)
    told = call("changes", catch_run, "--env-variant", "mirored")
    assert (told.status, "mirrored" in told.message) == (2, True)


def test_the_command_prints_what_it_found_for_programs(catch_run, call):
    told = call("changes", catch_run, "--env-variant", "upside_down", "--decisions", ENOUGH, "--json")
    found = json.loads(told.out)
    keys = ", ".join(f"`{key}`" for key in found)
    assert f"| `changes` | {keys} |" in (Path(__file__).parents[2] / "docs" / "json.md").read_text()
    assert found["reflection"] == "upside_down" and not any(one["broken"] for one in found["facts"] + found["rules"])


def test_the_command_says_what_broke(catch_run, call):
    told = call("changes", catch_run, "--env-variant", "mirrored", "--decisions", ENOUGH, "--episodes", 1)
    assert told.status == 0 and "with left and right exchanged" in told.out, told.err
    assert "hold as before" in told.out and "planner, after" in told.out
