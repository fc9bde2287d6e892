"""The words of a run go with the play that it has learned from."""

import pytest

from semrl.evaluation.player import load_player
from semrl.evaluation.words import words_of_run


@pytest.mark.parametrize("name", ["tracked_run", "ram_map_run"])
def test_no_scene_of_the_play_lies_beyond_the_bounds_that_it_taught(name, request):
    run = request.getfixturevalue(name)
    player = load_player(run, memory=True)
    known = words_of_run(player, run)
    episodes = player.planning.world_model.experience.episodes()
    scenes = [known.reader.read(one.states, one.states) for one in episodes]
    assert known.words.ranges and sum(map(len, scenes)) > 100
    concepts, numbers = list(known.words.concepts), list(known.words.numbers)
    for (concept, number), (low, high) in known.words.ranges.items():
        for scene in scenes:
            there = scene.present & scene.classes[:, concepts.index(concept)]
            values = scene.numbers[:, numbers.index(number)][there]
            assert not ((values < low) | (values > high)).any(), (concept, number)
