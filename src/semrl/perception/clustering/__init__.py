"""When two objects are of one kind (§3.2.2), and how good such a grouping is (§2.3.2)."""

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
