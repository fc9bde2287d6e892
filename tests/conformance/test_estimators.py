"""One list of checks for every public estimator; a new one is found and checked without a word here.

Those of the lower line are made for states of so many numbers and so many actions, and learn from decisions.
"""

import ast
import dataclasses
import importlib
import inspect
import io
import pkgutil
import re
from importlib.util import find_spec

import numpy as np
import pytest
import torch

import semrl.perception.clustering
import semrl.perception.detection
import semrl.perception.embedding
import semrl.perception.reduction
import semrl.perception.tracking
import semrl.planning
import semrl.world_model
from semrl.core import Objects, Trajectory
from semrl.core.arrays import digest
from semrl.core.errors import DataError, SemrlError
from semrl.core.protocols import Persistent
from semrl.perception.embedding import build_scene_graph
from semrl.perception.tracking import TrackingConfig, follow, no_tracks

PACKAGES = [
    semrl.perception.detection,
    semrl.perception.reduction,
    semrl.perception.clustering,
    semrl.perception.tracking,
    semrl.perception.embedding,
    semrl.world_model,
    semrl.planning,
]
ANSWERS = ("detect", "predict", "transform", "locate")
DIMENSION, N_ACTIONS = 4, 3


def discover():
    """Every public class with something to learn, something to tell and a state."""
    found = {}
    for package in PACKAGES:
        for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
            classes = inspect.getmembers(importlib.import_module(module.name), inspect.isclass)
            found |= {name: cls for name, cls in classes if cls.__module__ == module.name and is_estimator(cls)}
    return found


def is_estimator(cls):
    can_learn = hasattr(cls, "partial_fit") or hasattr(cls, "fit")
    is_public = not cls.__name__.startswith("_") and not getattr(cls, "_is_protocol", False)
    reads_labels = hasattr(cls, "detect") and hasattr(cls, "read")  # and finds nothing in a frame alone
    return is_public and can_learn and not reads_labels and any(hasattr(cls, name) for name in ANSWERS)


def follows(cls):
    """Whether it learns from tracks."""
    return cls.__module__.startswith("semrl.perception.tracking")


def knows_actions(cls):
    """Whether it belongs to the lower line."""
    return "n_actions" in inspect.signature(cls).parameters


def is_embedder(cls):
    """Whether it learns from scenes."""
    return hasattr(cls, "documents_needed")


ESTIMATORS = discover()
EXTRAS = {"Doc2VecEmbedding": "gensim"}


def checked(names):
    """One test for each name, left out where its extra is not installed."""
    missing = {name for name in names if name in EXTRAS and find_spec(EXTRAS[name]) is None}
    skip = pytest.mark.skip(reason="its extra is not installed")
    params = [pytest.param(ESTIMATORS[n], id=n, marks=[skip] if n in missing else []) for n in names]
    return pytest.mark.parametrize("cls", params)


each_estimator = checked(ESTIMATORS)
each_that_takes_rows = checked(
    [
        name
        for name, cls in ESTIMATORS.items()
        if hasattr(cls, "partial_fit")
        and not (hasattr(cls, "detect") or knows_actions(cls) or follows(cls) or is_embedder(cls))
    ]
)


def new(cls, config=None):
    """Make one with its defaults."""
    if not knows_actions(cls):
        return cls(config) if config else cls()
    return cls(config or inspect.signature(cls).parameters["config"].annotation(), DIMENSION, N_ACTIONS)


def images(seed):
    rng = np.random.default_rng(seed)
    shown = rng.integers(0, 60, size=(60, 84, 84)).astype(np.uint8)
    for image in shown:
        for row, column in rng.integers(4, 70, size=(6, 2)):
            image[row : row + rng.integers(1, 12), column : column + rng.integers(1, 12)] = 200
    return list(np.repeat(shown[..., None], 3, axis=3))  # RGB


def rows(seed):
    rng = np.random.default_rng(seed)
    centres = 3 * np.eye(16)[:6]
    return [(centres[rng.integers(6, size=20)] + 0.1 * rng.normal(size=(20, 16))).astype(np.float32) for _ in range(12)]


def scenes(seed):
    rng = np.random.default_rng(seed)
    return [
        build_scene_graph(rng.integers(4, size=6), rng.integers(84, size=(6, 2)).astype(np.float32), 20.0)
        for _ in range(30)
    ]


def episodes(seed):
    rng = np.random.default_rng(seed)
    for _ in range(6):
        actions, states = rng.integers(N_ACTIONS, size=40), rng.normal(size=(41, DIMENSION))
        states[1:] += actions[:, None]
        rewards = np.sign(states[1:, 0]) * (np.abs(states[1:, 0]) > 1)
        yield Trajectory(states=states.astype(np.float32), actions=actions, rewards=rewards.astype(np.float32))


def tracks(seed):
    """Five objects in 60 frames: some stand still, some walk."""
    rng = np.random.default_rng(seed)
    places, steps = rng.uniform(10, 70, size=(5, 2)), rng.normal(size=(5, 2)) * [[0], [0], [1], [2], [3]]
    features, followed = np.eye(5, dtype=np.float32), no_tracks(5)
    for _ in range(60):
        places = np.abs(places + steps) % 84
        boxes = np.column_stack([places.astype(np.int64), np.full((5, 2), 3)])
        crops, labels = np.zeros((5, 8, 8), np.float32), np.zeros((84, 84), np.int32)
        seen = Objects(crops=crops, centres_px=places.astype(np.float32), boxes_px=boxes, labels=labels)
        followed = follow(followed, seen, np.arange(5), features, TrackingConfig())
        yield followed


def batches(cls, seed=0):
    """What one call of learning takes, several times."""
    if follows(cls):
        return list(tracks(seed))
    if knows_actions(cls):
        return [e if hasattr(cls, "locate") else e.transitions for e in episodes(seed)]
    if hasattr(cls, "detect"):
        return images(seed)
    return scenes(seed) if is_embedder(cls) else rows(seed)


def learn(estimator, data):
    if hasattr(estimator, "partial_fit"):
        for batch in data:
            assert estimator.partial_fit(batch) is estimator
    else:
        assert estimator.fit(data) is estimator
    return estimator


def answer(estimator, batch):
    """The answer as arrays."""
    ask = next(getattr(estimator, name) for name in ANSWERS if hasattr(estimator, name))
    if not knows_actions(type(estimator)):
        told = ask(batch)
    elif hasattr(estimator, "locate"):
        told = ask(batch.states)
    else:
        told = ask(batch.states, batch.previous, batch.actions)
    return parts(told) if dataclasses.is_dataclass(told) else {"": told}


def parts(value):
    """The arrays of an input or an answer."""
    if dataclasses.is_dataclass(value):
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        return {name: part for name, part in fields.items() if isinstance(part, np.ndarray)}
    return {"": value}


def learned(cls, seed=0):
    return learn(new(cls), batches(cls, seed))


def shown(value):
    """What an attribute looks like, wherever in memory it is."""
    return re.sub(r" at 0x\w+", "", repr(value))


def copied(estimator):
    return {name: array.copy() for name, array in estimator.to_arrays().items()}


def learns(cls):
    """Whether it learns at all: an embedding by hashing does not."""
    return bool(learned(cls).to_arrays())


def documented_fields(config_class):
    """Fields with a docstring below them, or an entry in the class's list of attributes."""
    tree = ast.parse(inspect.getsource(config_class)).body[0]
    documented = set()
    for field, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        if isinstance(field, ast.AnnAssign) and is_text:
            documented.add(field.target.id)
    lines = inspect.getdoc(config_class).splitlines()
    listed = {name.strip() for line in lines if not line.startswith(" ") for name in line.split(",")}
    return documented | (listed if "Attributes" in lines else set())


def test_all_estimators_are_found():
    assert {"OtsuDetector", "ObjectPCA", "Birch", "CFTree", "Doc2VecEmbedding", "HashedEmbedding"} <= set(ESTIMATORS)
    assert {"ForegroundDetector", "KMeansDetector", "SlotAssigner"} <= set(ESTIMATORS)
    assert {"KMeans", "SelfOrganisingMap", "SVMClassifier"} <= set(ESTIMATORS)
    assert {"StateMap", "NextStateNetwork", "RewardSVM", "RewardNetwork"} <= set(ESTIMATORS)


@each_estimator
def test_it_can_be_saved(cls):
    assert isinstance(new(cls), Persistent)


@each_estimator
def test_its_configuration_is_frozen_named_and_documented(cls):
    config = new(cls).config
    kind = type(config)
    assert kind.__name__.endswith("Config") and dataclasses.is_dataclass(kind)
    folder = cls.__module__.rpartition(".")[0]  # settings that are read without torch stand in a file of their own
    assert kind.__module__ in (cls.__module__, f"{folder}.config")
    assert kind.__dataclass_params__.frozen
    fields = dataclasses.fields(kind)
    assert all(f.kw_only for f in fields)
    assert kind() == config  # there are defaults, and they are what is used
    assert {f.name for f in fields} <= documented_fields(kind)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(config, fields[0].name, getattr(config, fields[0].name))


@each_estimator
def test_making_one_only_stores(cls):
    needed = ["config", "dimension", "n_actions"] if knows_actions(cls) else ["config"]
    optional = ("seed", "teacher", "changes")
    assert [name for name in inspect.signature(cls).parameters if name not in optional] == needed
    numpy_state, torch_state = np.random.get_state()[1].copy(), torch.random.get_rng_state()  # noqa: NPY002
    config = type(new(cls).config)()
    estimator = new(cls, config)
    assert estimator.config is config
    assert digest(estimator.to_arrays()) == digest(new(cls).to_arrays())
    np.testing.assert_array_equal(np.random.get_state()[1], numpy_state)  # noqa: NPY002
    assert torch.equal(torch.random.get_rng_state(), torch_state)


@each_estimator
def test_it_says_so_when_it_has_not_learned_yet(cls):
    if not learns(cls):
        return
    if knows_actions(cls) and not hasattr(cls, "locate"):  # what comes next can always be guessed
        assert all(np.isfinite(array).all() for array in answer(new(cls), batches(cls)[0]).values())
        return
    with pytest.raises(SemrlError, match="first"):
        answer(new(cls), batches(cls)[0])


@each_estimator
def test_what_it_learns_ends_in_an_underscore(cls):
    fresh, estimator = new(cls), learned(cls)
    for name, value in vars(estimator).items():
        changed = name not in vars(fresh) or shown(vars(fresh)[name]) != shown(value)
        assert name.startswith(("_", "is_")) or name.endswith("_") or not changed, name
    for name, member in inspect.getmembers(cls, lambda m: isinstance(m, property)):
        if name.startswith(("_", "is_")) or name.endswith("_"):
            continue
        assert repr(getattr(fresh, name)) == repr(getattr(estimator, name)), member


@each_estimator
def test_answering_never_learns(cls):
    estimator = learned(cls)
    before = digest(estimator.to_arrays())
    first = [answer(estimator, batch) for batch in batches(cls, seed=1)]
    again = [answer(estimator, batch) for batch in reversed(batches(cls, seed=1))]
    assert digest(estimator.to_arrays()) == before
    for one, two in zip(first, reversed(again), strict=True):
        assert digest(one) == digest(two)


@each_estimator
def test_inputs_are_left_alone(cls):
    data = batches(cls)
    before = [digest(parts(batch)) for batch in data]
    for batch in data:
        for array in parts(batch).values():
            array.flags.writeable = False
    estimator = learn(new(cls), data)
    for batch in data:
        answer(estimator, batch)
    assert [digest(parts(batch)) for batch in data] == before


@each_estimator
def test_answers_are_not_its_own_memory(cls):
    estimator = learned(cls)
    before, batch = digest(estimator.to_arrays()), batches(cls)[0]
    first = answer(estimator, batch)
    expected = digest(first)
    for array in first.values():
        array[...] = 1
    assert digest(estimator.to_arrays()) == before
    assert digest(answer(estimator, batch)) == expected


@each_estimator
def test_the_same_data_gives_the_same_state(cls):
    np.random.seed(1)  # noqa: NPY002 - whatever the global generators do
    one = learned(cls)
    np.random.seed(2)  # noqa: NPY002
    torch.rand(1)
    two = learned(cls)
    assert digest(one.to_arrays()) == digest(two.to_arrays())
    if learns(cls):
        assert digest(learned(cls, seed=3).to_arrays()) != digest(one.to_arrays())


@each_estimator
def test_a_restored_one_behaves_the_same(cls):
    estimator = learned(cls)
    saved = copied(estimator)
    for restored in (new(cls), learned(cls, seed=3)):
        restored.from_arrays(copied(estimator))
        assert digest(restored.to_arrays()) == digest(saved)
        for batch in batches(cls, seed=1):
            assert digest(answer(restored, batch)) == digest(answer(estimator, batch))


@each_estimator
def test_a_restored_one_learns_on_the_same(cls):
    data = batches(cls)
    straight = learn(new(cls), data[: len(data) // 2])
    restored = new(cls)
    restored.from_arrays(copied(straight))
    for estimator in (straight, restored):
        learn(estimator, data[len(data) // 2 :])
    assert digest(restored.to_arrays()) == digest(straight.to_arrays())


@each_estimator
def test_nothing_fresh_is_lost_either(cls):
    restored = learned(cls)
    restored.from_arrays(new(cls).to_arrays())
    assert digest(restored.to_arrays()) == digest(new(cls).to_arrays())


@each_estimator
def test_its_state_is_plain_arrays(cls):
    for estimator in (new(cls), learned(cls)):
        arrays = estimator.to_arrays()
        assert all(isinstance(a, np.ndarray) and a.dtype.kind in "biuf" for a in arrays.values())
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, **arrays)
        file.seek(0)
        with np.load(file, allow_pickle=False) as loaded:
            assert digest(dict(loaded)) == digest(arrays)


@each_that_takes_rows
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_and_not_learned(cls, bad):
    estimator = learned(cls)
    before = digest(estimator.to_arrays())
    batch = batches(cls)[0].copy()
    batch[3, 2] = bad
    for method in (estimator.partial_fit, lambda X: answer(estimator, X)):
        with pytest.raises(DataError):
            method(batch)
    assert digest(estimator.to_arrays()) == before


@each_estimator
def test_it_is_described(cls):
    assert inspect.getdoc(cls)
    for name in ("partial_fit", "fit", *ANSWERS, "to_arrays", "from_arrays"):
        if method := getattr(cls, name, None):
            assert method.__doc__, name
