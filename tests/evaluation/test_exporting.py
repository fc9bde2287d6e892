"""Play that is exported can be loaded with Minari, and is what an evaluation plays."""

import json
import sys

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl.evaluation import evaluate
from semrl.evaluation.exporting import export_play
from semrl.evaluation.player import load_player

minari = pytest.importorskip("minari", reason="the extra 'minari' is not installed")
pytest.importorskip("h5py", reason="the extra 'minari' is not installed")


@pytest.fixture(scope="module")
def exported(tracked_run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("datasets")
    return folder, export_play(tracked_run, folder, episodes=2, policy="planner", frames=True)


def load(exported, monkeypatch):
    folder, told = exported
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    return minari.load_dataset(told.dataset)


def test_it_is_the_play_of_an_evaluation(exported, tracked_run, monkeypatch):
    dataset, told = load(exported, monkeypatch), exported[1]
    wanted = evaluate(tracked_run, episodes=2, policy="planner")
    episodes = list(dataset.iterate_episodes())
    assert [float(episode.rewards.sum()) for episode in episodes] == wanted.returns
    assert [len(episode.actions) for episode in episodes] == wanted.lengths
    assert (dataset.total_episodes, dataset.total_steps, told.decisions) == (
        2,
        sum(wanted.lengths),
        sum(wanted.lengths),
    )
    for episode in episodes:
        assert episode.terminations[-1] or episode.truncations[-1]
        assert not (episode.terminations[:-1] | episode.truncations[:-1]).any()
        assert len(episode.observations["facts"]) == len(episode.actions) + 1


def test_observations_are_facts_concepts_and_frames(exported, tracked_run, monkeypatch):
    dataset, told = load(exported, monkeypatch), exported[1]
    metadata = dataset.storage.metadata
    player = load_player(tracked_run)
    assert metadata["semrl_facts"] == list(player.encoder.space.names) == told.facts
    assert metadata["semrl_actions"] == list(player.action_names)
    assert metadata["semrl_concepts"] == list(player.planning.concepts.table_.names) == told.concepts
    episode = dataset[0]
    seen = {name: episode.observations["facts"][:, i] for i, name in enumerate(told.facts)}
    concepts = episode.observations["concepts"]
    assert concepts.shape == (len(episode.actions) + 1, len(told.slots)) and (concepts >= 0).any()
    for place, slot in enumerate(told.slots):
        unseen = seen[f"{slot} seen"] < 0.5
        assert (concepts[unseen, place] == -1).all() and concepts[:, place].max() < len(told.concepts)
    with player.new_env() as env:
        assert episode.observations["frame"].shape[1:] == env.observation_space.shape
    assert len(np.unique(episode.observations["frame"].reshape(len(concepts), -1), axis=0)) > 3
    assert dataset.observation_space.contains({key: value[0] for key, value in episode.observations.items()})


def test_a_run_without_concepts_has_facts_alone(objects_run, tmp_path, monkeypatch):
    told = export_play(objects_run, tmp_path / "new", episodes=1)
    assert told.concepts == told.slots == []
    episode = load((tmp_path / "new", told), monkeypatch)[0]
    assert set(episode.observations) == {"facts"}


def test_the_command_tells_what_it_wrote(call, tracked_run, tmp_path):
    done = call("export", tracked_run, "--to", tmp_path, "--episodes", 1, "--json")
    assert done.status == 0, done.err
    found = json.loads(done.out)
    assert list(found) == ["dataset", "folder", "episodes", "decisions", "facts", "slots", "concepts"]
    assert found["episodes"] == 1 and (tmp_path / found["dataset"] / "data" / "main_data.hdf5").exists()
    again = call("export", tracked_run, "--to", tmp_path, "--episodes", 1)
    assert again.status == 2 and "there already" in again.message
    assert [path.name for path in tmp_path.iterdir()] == ["semrl"], "nothing half made is left"


@pytest.mark.parametrize(("options", "said"), [({"episodes": 0}, "1 or more"), ({"seed": -1}, "0 or more")])
def test_wrong_numbers_are_refused(tracked_run, tmp_path, options, said):
    with pytest.raises(UsageError, match=said):
        export_play(tracked_run, tmp_path, **options)


def test_states_without_names_are_refused(semantic_run, tmp_path):
    with pytest.raises(UsageError, match="have no names"):
        export_play(semantic_run, tmp_path)


def test_a_missing_extra_is_one_line(call, tracked_run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "minari", None)
    told = call("export", tracked_run, "--to", tmp_path)
    assert told.status == 2 and "extra 'minari'" in told.message
