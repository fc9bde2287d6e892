"""The thesis's own libraries on the same frames (§3.2): scikit-learn, networkx and gensim."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from semrl.core import IMAGE_SIZE_PX, Floats, Frame, Ints
from semrl.core.errors import MissingExtraError
from semrl.perception.clustering import BirchConfig
from semrl.perception.detection.cutting import n_parts
from semrl.perception.embedding import (
    Doc2VecConfig,
    Doc2VecEmbedding,
    SceneGraphConfig,
    WordsConfig,
    build_scene_graph,
    position_words,
)
from semrl.perception.reduction import PCAConfig


def require_peers() -> None:
    """Raise MissingExtraError if gensim is not installed."""
    if find_spec("gensim") is None:
        raise MissingExtraError("thesis", "the thesis's stack, which --peers compares with (gensim)")


class ThesisStack:
    """From a frame to a vector with the thesis's libraries and parameters.

    OpenCV finds components, which Python cuts one by one; scikit-learn reduces and classifies objects, networkx makes
    the graph and hashes surroundings, gensim infers the vector.

    Parameters
    ----------
    frames
        What is learned here is learned from them.
    threshold, limit_px
        Of the detector: the grey level above which a pixel is foreground, and the largest edge of an object.

    Raises
    ------
    MissingExtraError
        If gensim is not installed.
    """

    def __init__(self, frames: Sequence[Frame], threshold: float, limit_px: int) -> None:
        require_peers()
        from sklearn.cluster import Birch
        from sklearn.decomposition import IncrementalPCA

        birch = BirchConfig()
        self.threshold, self.limit_px = threshold, limit_px
        scenes = [self.detect(frame) for frame in frames]
        features = np.concatenate([crops for crops, _ in scenes])
        self.proximity_px = SceneGraphConfig().proximity_px
        self.words = WordsConfig()
        self.pca = IncrementalPCA(n_components=PCAConfig().components).fit(features)
        self.birch = Birch(
            threshold=birch.threshold, branching_factor=birch.branching_factor, n_clusters=birch.max_classes
        ).fit(self.pca.transform(features))
        graphs = [build_scene_graph(self.classify(crops), places, self.proximity_px) for crops, places in scenes]
        self.embedding = Doc2VecEmbedding(Doc2VecConfig(documents=len(scenes))).fit(graphs)

    def detect(self, frame: Frame) -> tuple[Floats, Floats]:
        """Return the crops of the objects as rows, and their centres (§3.2.1)."""
        small = cv2.resize(frame, (IMAGE_SIZE_PX, IMAGE_SIZE_PX), interpolation=cv2.INTER_AREA)
        image = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)
        foreground = (image > self.threshold).astype(np.uint8)
        count, labels, _, _ = cv2.connectedComponentsWithStats(foreground, connectivity=8)
        crops, centres = [], []
        for number in range(1, count):
            strips = self._cut(np.argwhere(labels == number), axis=1)
            for pixels in [piece for strip in strips for piece in self._cut(strip, axis=0)]:
                top_left = pixels.min(axis=0)
                size = pixels.max(axis=0) - top_left + 1
                crop = np.zeros((self.limit_px, self.limit_px), np.float32)
                inside = pixels - top_left + (self.limit_px - size) // 2
                crop[tuple(inside.T)] = image[tuple(pixels.T)] / np.float32(255)
                crops.append(crop.ravel())
                centres.append(top_left + (size - 1) / 2)
        return np.array(crops), np.array(centres, np.float32)

    def _cut(self, pixels: Ints, axis: int) -> list[Ints]:
        """Cut the ``(p, 2)`` pixels of an object along one axis, where it is too long."""
        offsets = pixels[:, axis] - pixels[:, axis].min()
        length = int(offsets.max()) + 1
        parts = n_parts(length, self.limit_px)
        pieces = (pixels[offsets * parts // length == part] for part in range(parts))
        return [piece for piece in pieces if len(piece)]

    def classify(self, crops: Floats) -> Ints:
        """Return the class of each object (§3.2.2)."""
        classes: Ints = self.birch.predict(self.pca.transform(crops))
        return classes

    def describe(self, classes: Ints, centres_px: Floats) -> list[str]:
        """Write the words of a scene (§3.2.3)."""
        import networkx as nx  # type: ignore[import-untyped]

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
        vector: NDArray[Any] = self.embedding.model_.infer_vector(words)
        return vector

    def elevate(self, frame: Frame) -> NDArray[Any]:
        """Do all of it."""
        crops, centres_px = self.detect(frame)
        return self.infer(self.describe(self.classify(crops), centres_px))
