import dataclasses
import importlib.resources
import tomllib

import pytest

from semrl.core.errors import UsageError
from semrl.training import PRESETS, RunConfig, preset
from semrl.training.config import MODELS, from_dict, read_toml, to_dict, write_toml


def stored(name):
    return tomllib.loads(importlib.resources.files("semrl").joinpath("presets", f"{name}.toml").read_text())


def leaves(table, path=""):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", list(value) if isinstance(value, tuple) else value


@pytest.mark.parametrize("model", MODELS)
def test_the_thesis_is_what_the_defaults_say(model):
    assert preset("thesis") == RunConfig()
    assert preset("thesis", model) == RunConfig(model=model)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_the_defaults_and_what_its_file_names(name, model):
    file = stored(name)
    special = dict(leaves(file.pop("models", {}).get(model, {})))
    named = {**dict(leaves(file)), **special, "model": model}
    defaults = dict(leaves(to_dict(RunConfig())))
    assert dict(leaves(to_dict(preset(name, model)))) == {**defaults, **named}


def test_the_preset_has_no_dead_settings():
    file = stored("semrl")
    tables = file.pop("models", {})
    defaults = dict(leaves(to_dict(RunConfig())))
    assert [path for path, value in leaves(file) if value == defaults[path]] == []
    for model, table in tables.items():
        assert model in MODELS
        without = {**defaults, **dict(leaves(file))}
        assert [path for path, value in leaves(table) if value == without[path]] == []


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", PRESETS)
def test_toml_gives_back_the_same_configuration(name, model, tmp_path):
    config = preset(name, model, {"seed": 7, "environment": {"actions": ["LEFT", "RIGHT"]}, "checkpoint_seconds": 0.1})
    path = tmp_path / "config.toml"
    path.write_text(write_toml(config))
    assert from_dict(read_toml(path), source="file") == config
    assert dict(leaves(read_toml(path))) == {
        name: value for name, value in leaves(to_dict(config)) if value is not None
    }


UNSET = {"environment.sticky_actions", "evaluation.sticky_actions", "evaluation.variant"}


def test_every_setting_is_written_though_it_has_its_default():
    """A run must stay what it was when a default changes; for None TOML has no word, so it must stay the default."""
    written = tomllib.loads(write_toml(preset("semrl", "birch")))
    every = dict(leaves(to_dict(RunConfig())))
    assert every.keys() - dict(leaves(written)).keys() == UNSET
    assert all(every[name] is None for name in UNSET)


def test_overrides_win_over_the_table_of_the_model_and_the_preset():
    config = preset("semrl", "ram", {"dqn": {"n_steps": 9}})
    assert config.dqn == dataclasses.replace(preset("semrl", "ram").dqn, n_steps=9)


def test_a_file_may_hold_tables_of_models_too():
    tables = {"ram": {"dqn": {"n_steps": 7}}, "otsu": {"dqn": {"n_steps": 8}}}
    overrides = {"dqn": {"n_steps": 9}, "models": tables}
    assert [preset("semrl", model, overrides).dqn.n_steps for model in ("ram", "otsu", "birch")] == [7, 8, 9]
    with pytest.raises(UsageError, match=r"unknown setting 'models\.rma'; did you mean 'models\.ram'"):
        preset("semrl", "ram", {"models": {"rma": {}}})
    with pytest.raises(UsageError, match="holds a table for each model"):
        preset("semrl", "ram", {"models": 3})


def test_the_model_of_an_override_chooses_the_table():
    assert preset("semrl", None, {"model": "birch"}) == preset("semrl", "birch")
    assert preset("semrl", "otsu", {"model": "birch"}) == preset("semrl", "otsu")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"decision": 3}, "unknown setting 'decision'; did you mean 'decisions'"),
        ({"dqn": {"batchsize": 3}}, "unknown setting 'dqn.batchsize'; did you mean 'dqn.batch_size'"),
        ({"dqn": 3}, "dqn"),
        ({"agent": "dnq"}, "there is no 'dnq' among the agents; did you mean 'dqn'"),
        ({"encoder": "gray"}, "there is no 'gray' among the encoders; did you mean 'grey'"),
        ({"perception": {"embedder": "word2vec"}}, "there is no 'word2vec' among the embedders"),
        ({"planning": {"world_model": "tree"}}, "there is no 'tree' among the world models; did you mean 'trees'"),
        ({"device": "gpu"}, "device"),
        ({"decisions": "many"}, "decisions"),
        ({"decisions": 1.5}, "decisions"),
        ({"dqn": {"double": 1}}, "double"),
        ({"dqn": {"network": {"hidden_units": ["a"]}}}, "hidden_units"),
        ({"model": "ramm"}, "model"),
        ({"perception": {"hashed": {"dimension": 0}}}, "dimension must be 1 or more"),
    ],
)
def test_wrong_values_are_named_with_their_source(values, said):
    with pytest.raises(UsageError) as caught:
        from_dict(values, source="here.toml")
    assert str(caught.value).startswith("here.toml: ") and said in str(caught.value)


NOT_A_NUMBER = float("nan")


@pytest.mark.parametrize(
    "wrong",
    [
        {"decisions": 0},
        {"decisions": -400},
        {"seed": -1},
        {"seed": 1 << 63},
        {"threads": 0},
        {"threads": 1_000_000},
        {"checkpoint_seconds": -0.1},
        {"checkpoint_seconds": NOT_A_NUMBER},
        {"evaluation": {"episodes": 0}},
        {"evaluation": {"max_noops": -1}},
        {"evaluation": {"exploration": 1.01}},
        {"evaluation": {"exploration": NOT_A_NUMBER}},
        {"environment": {"frame_skip": 0}},
        {"environment": {"sticky_actions": 1.5}},
        {"environment": {"max_noops": -1}},
        {"perception": {"otsu": {"threshold_frames": 0}}},
        {"perception": {"pca": {"components": 0}}},
        {"perception": {"birch": {"max_classes": 0}}},
        {"perception": {"scene": {"proximity_px": NOT_A_NUMBER}}},
    ],
)
def test_impossible_values_are_refused(wrong):
    with pytest.raises(UsageError):
        from_dict(wrong, source="here.toml")


def test_the_smallest_budget_is_one_decision():
    assert from_dict({"decisions": 1}, source="test").decisions == 1


@pytest.mark.parametrize("content", [b"frames = ", b"[dqn\n", b"\xff\xfe", b"frames = 1\nframes = 2"])
def test_files_that_are_no_toml_are_named(tmp_path, content):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=r"bad\.toml is not valid TOML"):
        read_toml(path)


def test_files_that_cannot_be_read_are_named(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(UsageError, match=f"cannot read {path}"):
            read_toml(path)


def test_a_models_encoder_can_be_another():
    thesis, ours = preset("thesis", "semantic"), preset("semrl", "semantic")
    assert (thesis.encoder, thesis.encoder_name) == ("auto", "scene")
    assert (ours.encoder, ours.encoder_name) == ("tracked_scene", "tracked_scene")
    assert preset("semrl", "baseline", {"encoder": "classes"}).encoder_name == "classes"
    assert [preset("thesis", model).plans for model in ("semantic", "semantic-map", "ram-map")] == [False, True, True]


def test_parameters_of_boxes_that_others_add_are_not_checked_here():
    options = {"mine": {"depth": 3, "names": ["a"]}}
    config = from_dict({"options": options, "perception": {"options": options}}, source="test")
    assert config.options == config.perception.options == options
    with pytest.raises(UsageError, match=r"unknown setting 'perception\.option'; did you mean 'perception\.options'"):
        from_dict({"perception": {"option": options}}, source="test")


def test_unknown_presets_and_models_are_named():
    with pytest.raises(UsageError, match="there are semrl, thesis"):
        preset("thesiss")
    with pytest.raises(UsageError, match="there are baseline, otsu"):
        preset("thesis", "sematic")
