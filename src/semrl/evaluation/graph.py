"""The map of a run alone, without the agent, the game and the libraries that these need."""

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semrl.core import MapGraph
from semrl.core.arrays import unnest
from semrl.core.errors import DataError, SemrlError, UsageError
from semrl.planning.state_map import StateMap, StateMapConfig
from semrl.training.folder import RunFolder

MAP = "planning/state_map"
"""What the names of a checkpoint's arrays begin with that hold the map."""


def load_graph(run: str | Path) -> MapGraph:
    """Read the map of a run, as of its newest checkpoint.

    Raises
    ------
    UsageError
        When there is no such run, or it has no map yet.
    SemrlError
        When it is damaged.
    """
    folder = RunFolder.open(Path(run))
    arrays = unnest(folder.newest(prefix=f"{MAP}/").arrays, MAP)
    if not arrays:
        raise UsageError(no_map(run, str(folder.manifest().get("model"))))
    try:
        nodes, edges = arrays["nodes/leaves_means"], arrays["edges/leaves_means"]  # (n, d), (m, 2 d + actions + 1)
        if not len(nodes):
            raise UsageError(empty_map(run))
        dimension = nodes.shape[1]
        state_map = StateMap(_settings(folder), dimension, max(1, edges.shape[1] - 2 * dimension - 1))
        state_map.from_arrays(arrays)
    except (KeyError, IndexError, DataError) as error:
        raise SemrlError(f"the checkpoint of {run} does not fit its configuration ({error})") from error
    return state_map.graph_


def node_states(graph: MapGraph, weight: float, dimension: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the facts that each node of a map stands for, and those before them, ``(n, d)`` each."""
    states = graph.node_means[:, :dimension].astype(np.float32)
    if weight <= 0:
        return states, states
    return states, (states - graph.node_means[:, dimension:] / weight).astype(np.float32)


def _settings(folder: RunFolder) -> StateMapConfig:
    """Read what the configuration says of the map; all of it is checked only where that cannot be used."""
    try:
        with (folder.path / "config.toml").open("rb") as file:
            return StateMapConfig(**tomllib.load(file)["planning"]["state_map"])
    except (OSError, ValueError, KeyError, TypeError, UsageError):
        return folder.config().planning.state_map


def no_map(run: str | Path, model: str) -> str:
    """Say that the model of a run has no map."""
    from semrl.training.config import MODELS  # late: it knows every part of a run

    models = " or ".join(f"--model {name}" for name, model_ in MODELS.items() if model_.plans)
    return f"{run} is of model '{model}', which has no map; train one with {models}"


def empty_map(run: str | Path) -> str:
    """Say that a run has a map with nothing on it."""
    return f"the map of {run} is still empty: it is drawn after the agent's first episode"
