"""The extent is that of what was seen."""

import numpy as np

from semrl.core import Trajectory
from semrl.planning.config import PlanningConfig
from semrl.planning.extent import Extent
from semrl.planning.module import PlanningModule

SEEN = np.array([1, 1, 3, 3])


def test_what_is_not_seen_does_not_count():
    extent = Extent(4, SEEN).partial_fit(np.array([[0.5, 1, 9, 0], [0.2, 1, 8, 0], [7, 0, 7, 0]], np.float32))
    np.testing.assert_array_equal(extent.bounds_[:, 0], np.float32([0.2, 0.5]))
    assert np.isnan(extent.bounds_[:, 2]).all()
    extent.partial_fit(np.array([[0.9, 1, 3, 1]], np.float32))
    np.testing.assert_array_equal(extent.bounds_[:, [0, 2]], np.float32([[0.2, 3], [0.9, 3]]))


def test_it_is_learned_episode_by_episode_and_saved_and_older_maps_have_their_nodes():
    module, restored, older = (PlanningModule(PlanningConfig(), 4, 2, seed=0) for _ in range(3))
    for seed in range(2):
        states = np.random.default_rng(seed).normal(size=(6, 4)).astype(np.float32)
        module.learn(Trajectory(states=states, actions=np.zeros(5, np.int64), rewards=np.zeros(5, np.float32)))
    met = np.concatenate([np.random.default_rng(seed).normal(size=(6, 4)) for seed in range(2)]).astype(np.float32)
    np.testing.assert_array_equal(module.extent.bounds_, [met.min(axis=0), met.max(axis=0)])
    saved = module.inference_arrays()
    restored.from_arrays(saved)
    np.testing.assert_array_equal(restored.extent.bounds_, module.extent.bounds_)
    older.from_arrays({name: array for name, array in saved.items() if not name.startswith("extent/")})
    nodes = module.state_map.graph_.node_means
    np.testing.assert_array_equal(older.extent.bounds_, [nodes.min(axis=0), nodes.max(axis=0)])
