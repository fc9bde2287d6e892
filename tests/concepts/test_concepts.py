"""Kinds that switch into one another are one concept, those that are seen together are not; numbers stay."""

import numpy as np
import pytest
from rallies import BALL, CLIPPED, DIGIT, PADDLE, rally, table, thing

from semrl.concepts import Concepts, ConceptsConfig, SceneBuilder
from semrl.core.arrays import digest
from semrl.core.errors import UsageError


def kinds_of(concepts):
    return {kinds for kinds in concepts.table_.kinds if kinds}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_paddle_that_is_cut_off_is_one_concept(seed):
    tables, _, _ = rally(600, seed)
    known = Concepts().partial_fit(tables)
    told = known.table_
    assert kinds_of(known) == {(BALL,), (PADDLE, CLIPPED), (DIGIT,)}
    own = told.kinds.index((PADDLE, CLIPPED))
    assert told.controlled[own] and told.controlled.sum() == 1
    assert told.static[told.kinds.index((DIGIT,))] and told.static.sum() == 1
    assert len(set(told.names)) == len(told.names) and told.names[own].startswith("own")
    np.testing.assert_allclose(told.arena_px[[1, 3]], [10, 70], atol=1)


def test_a_concept_with_a_slot_of_its_own_is_called_as_facts_call_it():
    """Two balls of one concept share a name that no slot has; paddle and enemy have one each."""
    paddle, enemy = thing(0, PADDLE, (70, 30, 72, 40), own=True, slot=3), thing(1, CLIPPED, (5, 30, 7, 40), slot=0)
    balls = [thing(2 + i, BALL, (20 * i, 9, 20 * i + 2, 11), slot=1 + i) for i in range(2)]
    known = Concepts().partial_fit([table(paddle, enemy, balls[0])] * 30)
    assert set(known.table_.names) == {"own", "object0", "object1"}
    known.partial_fit([table(paddle, enemy, *balls)] * 30)
    names = dict(zip(known.table_.kinds, known.table_.names, strict=True))
    assert names == {(PADDLE,): "own", (CLIPPED,): "object0", (BALL,): f"concept{known.table_.kinds.index((BALL,))}"}
    odd = thing(9, DIGIT, (40, 30, 42, 40), own=True)  # steered as well, but without a slot
    known.partial_fit([table(paddle, enemy, *balls, odd)] * 30)
    assert known.table_.names[known.table_.kinds.index((PADDLE,))] == "own" and len(set(known.table_.names)) == 4
    again = Concepts()
    again.from_arrays(known.to_arrays())
    assert again.table_.names == known.table_.names
    older = Concepts()
    older.from_arrays({name: array for name, array in known.to_arrays().items() if name != "slots"})
    assert older.is_fitted and "object0" not in older.table_.names


def test_what_is_hidden_is_completed_and_velocities_are_those_of_whole_boxes():
    tables, _, _ = rally(600)
    known = Concepts().partial_fit(tables)
    builder = SceneBuilder(known)
    cut = [t for t in range(5, 600) if tables[t][0, 1] == CLIPPED]
    assert len(cut) > 5
    for t in cut:
        scene = builder.scene([tables[t - k] for k in range(5)])
        own = int(np.flatnonzero(scene.ids == 0)[0])
        np.testing.assert_allclose(scene.boxes_px[own], [60, tables[t][0, 6], 62, tables[t][0, 6] + 12], atol=1e-3)
        step = tables[t][0, 6] - tables[t - 1][0, 6]
        np.testing.assert_allclose(scene.velocities_px[own], [0, step], atol=1e-3)


def crowd(decisions, swapped):
    """Two things of two kinds, always both there; now and then their tracks are mixed up, so both switch."""
    tables = []
    for t in range(decisions):
        one, two = (1, 0) if swapped(t) else (0, 1)
        tables.append(table(thing(0, one, (t % 50, 5, t % 50 + 3, 9)), thing(1, two, (t % 40, 30, t % 40 + 3, 34))))
    return tables


@pytest.mark.parametrize("every", [2, 7])
def test_tracks_that_are_mixed_up_make_no_concept(every):
    assert kinds_of(Concepts().partial_fit(crowd(300, lambda t: t % every == 0))) == {(0,), (1,)}


def test_what_is_seen_together_is_kept_apart_though_it_switches():
    """A third thing changes its kind, of which there are others all the time."""
    tables = [
        table(
            thing(0, 0, (t % 50, 5, t % 50 + 3, 9)),
            thing(1, 1, (t % 40, 30, t % 40 + 3, 34)),
            thing(2, t // 3 % 2, (t % 45, 60, t % 45 + 3, 64)),
        )
        for t in range(300)
    ]
    assert kinds_of(Concepts().partial_fit(tables)) == {(0,), (1,)}
    lenient = ConceptsConfig(together_share=1.0)
    assert kinds_of(Concepts(lenient).partial_fit([t[2:] for t in tables])) == {(0, 1)}


def test_numbers_stay_while_more_is_learned():
    known, names = Concepts(), {}
    for seed in range(6):
        known.partial_fit(rally(200, seed)[0])
        for name, kinds in zip(known.table_.names, known.table_.kinds, strict=True):
            for kind in kinds:
                assert names.setdefault(kind, name) == name


def test_what_was_saved_goes_on_alike():
    known, again = Concepts().partial_fit(rally(300)[0]), Concepts()
    again.from_arrays(known.to_arrays())
    assert digest(again.to_arrays()) == digest(known.to_arrays())
    more = rally(300, 5)[0]
    assert digest(again.partial_fit(more).to_arrays()) == digest(known.partial_fit(more).to_arrays())


def test_nothing_seen_is_nothing_known():
    known = Concepts().partial_fit([table(), table()])
    assert not known.is_fitted and not len(known.table_)
    assert not len(SceneBuilder(known).scene([table()])) and not len(SceneBuilder(known).scene([]))


@pytest.mark.parametrize("wrong", [{"merge_share": 1.5}, {"least_switches": 0}, {"rare_share": -0.1}])
def test_settings_that_mean_nothing_are_refused(wrong):
    with pytest.raises(UsageError):
        ConceptsConfig(**wrong)
