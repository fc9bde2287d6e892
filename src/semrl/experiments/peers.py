"""The thesis's own libraries on the same frames (§3.2): scikit-learn, networkx and gensim."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semrl.clustering import BirchConfig
from semrl.embedding import (
    Doc2VecConfig,
    Doc2VecEmbedding,
    SceneGraphConfig,
    WordsConfig,
    build_scene_graph,
    position_words,
)
from semrl.errors import MissingExtraError
from semrl.reduction import PCAConfig
from semrl.types import Floats, Ints, Objects


class ThesisStack:
    """From objects to a vector with the thesis's libraries and parameters.

    scikit-learn reduces and classifies objects, networkx makes the graph and hashes surroundings, gensim infers the
    vector. Grey images and objects are ours, which makes the stack faster than the thesis's.

    Parameters
    ----------
    scenes
        Objects of some frames: what is learned here is learned from them.

    Raises
    ------
    MissingExtraError
        If gensim is not installed.
    """

    def __init__(self, scenes: Sequence[Objects]) -> None:
        if find_spec("gensim") is None:
            raise MissingExtraError("thesis", "the thesis's stack, which --peers compares with (gensim)")
        from sklearn.cluster import Birch
        from sklearn.decomposition import IncrementalPCA

        birch = BirchConfig()
        features = np.concatenate([objects.features for objects in scenes])
        self.proximity_px = SceneGraphConfig().proximity_px
        self.words = WordsConfig()
        self.pca = IncrementalPCA(n_components=PCAConfig().components).fit(features)
        self.birch = Birch(
            threshold=birch.threshold, branching_factor=birch.branching_factor, n_clusters=birch.max_classes
        ).fit(self.pca.transform(features))
        graphs = [build_scene_graph(self.classify(one), one.centres_px, self.proximity_px) for one in scenes]
        self.doc2vec = Doc2VecEmbedding(Doc2VecConfig(documents=len(scenes))).fit(graphs).model_

    def classify(self, objects: Objects) -> Ints:
        """Return the class of each object (§3.2.2)."""
        classes: Ints = self.birch.predict(self.pca.transform(objects.features))
        return classes

    def describe(self, classes: Ints, centres_px: Floats) -> list[str]:
        """Write the words of a scene (§3.2.3)."""
        import networkx as nx

        graph = nx.Graph()
        graph.add_nodes_from((i, {"kind": str(kind)}) for i, kind in enumerate(classes.tolist()))
        lengths = np.linalg.norm(centres_px[:, None] - centres_px[None], axis=2)  # (n, n)
        pairs = np.argwhere(np.triu(lengths <= self.proximity_px, k=1))
        graph.add_weighted_edges_from((i, j, float(lengths[i, j])) for i, j in pairs.tolist())
        hashes = nx.weisfeiler_lehman_subgraph_hashes(
            graph, node_attr="kind", iterations=self.words.wl_iterations, digest_size=16
        )
        places = centres_px.astype(int).tolist()
        return [
            word
            for i, (number, (row, column)) in enumerate(zip(classes.tolist(), places, strict=True))
            for word in (*position_words(number, row, column, self.words), *hashes[i])
        ]

    def infer(self, words: list[str]) -> NDArray[Any]:
        """Return the vector of a document (§3.2.3)."""
        vector: NDArray[Any] = self.doc2vec.infer_vector(words)
        return vector

    def elevate(self, objects: Objects) -> NDArray[Any]:
        """Do all of it."""
        return self.infer(self.describe(self.classify(objects), objects.centres_px))
