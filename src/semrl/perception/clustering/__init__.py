"""When two objects are of one kind (§3.2.2)."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

if TYPE_CHECKING:
    from semrl.perception.clustering.birch import Birch, BirchConfig
    from semrl.perception.clustering.cf_tree import CFTree, CFTreeConfig
    from semrl.perception.clustering.kmeans import KMeans, KMeansConfig
    from semrl.perception.clustering.protocol import Clusterer
    from semrl.perception.clustering.som import SelfOrganisingMap, SelfOrganisingMapConfig
    from semrl.perception.clustering.svm import SVMClassifier, SVMConfig

_HOME = {
    "Birch": "semrl.perception.clustering.birch",
    "BirchConfig": "semrl.perception.clustering.birch",
    "CFTree": "semrl.perception.clustering.cf_tree",
    "CFTreeConfig": "semrl.perception.clustering.cf_tree",
    "Clusterer": "semrl.perception.clustering.protocol",
    "KMeans": "semrl.perception.clustering.kmeans",
    "KMeansConfig": "semrl.perception.clustering.kmeans",
    "SVMClassifier": "semrl.perception.clustering.svm",
    "SVMConfig": "semrl.perception.clustering.svm",
    "SelfOrganisingMap": "semrl.perception.clustering.som",
    "SelfOrganisingMapConfig": "semrl.perception.clustering.som",
}

__all__ = [
    "Birch",
    "BirchConfig",
    "CFTree",
    "CFTreeConfig",
    "Clusterer",
    "KMeans",
    "KMeansConfig",
    "SVMClassifier",
    "SVMConfig",
    "SelfOrganisingMap",
    "SelfOrganisingMapConfig",
]

__getattr__, __dir__ = lazily(__name__, _HOME)
