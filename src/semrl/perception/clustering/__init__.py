"""When two objects are of one kind (§3.2.2), and how good such a grouping is (§2.3.2)."""

from typing import TYPE_CHECKING

from semrl.core.lazy import lazily

if TYPE_CHECKING:
    from semrl.perception.clustering.birch import Birch, BirchConfig
    from semrl.perception.clustering.cf_tree import CFTree, CFTreeConfig
    from semrl.perception.clustering.indices import (
        ClusterIndices,
        average_between_distance,
        average_centroid_distance,
        average_within_distance,
        centroid_distance,
        cluster_indices,
        davies_bouldin,
        diameter,
        dunn,
        nearest_distance,
        silhouette,
    )
    from semrl.perception.clustering.kmeans import KMeans, KMeansConfig
    from semrl.perception.clustering.protocol import Clusterer
    from semrl.perception.clustering.som import SelfOrganisingMap, SelfOrganisingMapConfig
    from semrl.perception.clustering.svm import SVMClassifier, SVMConfig

_HOME = {
    "Birch": "semrl.perception.clustering.birch",
    "BirchConfig": "semrl.perception.clustering.birch",
    "CFTree": "semrl.perception.clustering.cf_tree",
    "CFTreeConfig": "semrl.perception.clustering.cf_tree",
    "ClusterIndices": "semrl.perception.clustering.indices",
    "Clusterer": "semrl.perception.clustering.protocol",
    "KMeans": "semrl.perception.clustering.kmeans",
    "KMeansConfig": "semrl.perception.clustering.kmeans",
    "SVMClassifier": "semrl.perception.clustering.svm",
    "SVMConfig": "semrl.perception.clustering.svm",
    "SelfOrganisingMap": "semrl.perception.clustering.som",
    "SelfOrganisingMapConfig": "semrl.perception.clustering.som",
    "average_between_distance": "semrl.perception.clustering.indices",
    "average_centroid_distance": "semrl.perception.clustering.indices",
    "average_within_distance": "semrl.perception.clustering.indices",
    "centroid_distance": "semrl.perception.clustering.indices",
    "cluster_indices": "semrl.perception.clustering.indices",
    "davies_bouldin": "semrl.perception.clustering.indices",
    "diameter": "semrl.perception.clustering.indices",
    "dunn": "semrl.perception.clustering.indices",
    "nearest_distance": "semrl.perception.clustering.indices",
    "silhouette": "semrl.perception.clustering.indices",
}

__all__ = [
    "Birch",
    "BirchConfig",
    "CFTree",
    "CFTreeConfig",
    "ClusterIndices",
    "Clusterer",
    "KMeans",
    "KMeansConfig",
    "SVMClassifier",
    "SVMConfig",
    "SelfOrganisingMap",
    "SelfOrganisingMapConfig",
    "average_between_distance",
    "average_centroid_distance",
    "average_within_distance",
    "centroid_distance",
    "cluster_indices",
    "davies_bouldin",
    "diameter",
    "dunn",
    "nearest_distance",
    "silhouette",
]

__getattr__, __dir__ = lazily(__name__, _HOME)
