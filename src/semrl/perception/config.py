"""What the boxes between frame and state are set to, and which boxes there are."""

from dataclasses import dataclass, field
from typing import Any

from semrl.core.registry import Registry
from semrl.perception.clustering import BirchConfig, KMeansConfig, SelfOrganisingMapConfig, SVMConfig
from semrl.perception.clustering.protocol import Clusterer
from semrl.perception.detection import DetectionConfig, ForegroundConfig, KMeansDetectorConfig, LabelsConfig
from semrl.perception.detection.protocol import Detector
from semrl.perception.embedding import (
    Doc2VecConfig,
    FractionalEmbeddingConfig,
    HashedEmbeddingConfig,
    OnlineEmbeddingConfig,
    SceneGraphConfig,
    SlotsEmbeddingConfig,
)
from semrl.perception.embedding.protocol import Embedder
from semrl.perception.reduction import PCAConfig
from semrl.perception.reduction.protocol import Reducer
from semrl.perception.tracking import InheritanceConfig, SlotAssignerConfig, TrackingConfig

DETECTORS: Registry[Detector] = Registry(
    "detectors",
    {
        "otsu": "semrl.perception.detection:OtsuDetector",
        "foreground": "semrl.perception.detection:ForegroundDetector",
        "segmentation": "semrl.perception.detection:KMeansDetector",
        "labels": "semrl.perception.detection:LabelsDetector",
    },
)
REDUCERS: Registry[Reducer] = Registry("reducers", {"pca": "semrl.perception.reduction:ObjectPCA"})
CLUSTERERS: Registry[Clusterer] = Registry(
    "clusterers",
    {
        "birch": "semrl.perception.clustering:Birch",
        "kmeans": "semrl.perception.clustering:KMeans",
        "som": "semrl.perception.clustering:SelfOrganisingMap",
        "svm": "semrl.perception.clustering:SVMClassifier",
    },
)
EMBEDDERS: Registry[Embedder] = Registry(
    "embedders",
    {
        "doc2vec": "semrl.perception.embedding:Doc2VecEmbedding",
        "hashed": "semrl.perception.embedding:HashedEmbedding",
        "fractional": "semrl.perception.embedding:FractionalEmbedding",
        "online": "semrl.perception.embedding:OnlineEmbedding",
        "slots": "semrl.perception.embedding:SlotsEmbedding",
    },
)


@dataclass(frozen=True, kw_only=True)
class PerceptionConfig:
    """Which boxes stand between frame and state, and the parameters of each, under its name."""

    detector: str = "auto"
    """How objects are found: otsu, foreground, segmentation (k-means) or labels (the environment's own, see
    environment.labels); auto: otsu in single frames, foreground where objects are tracked."""
    reducer: str = "pca"
    """How objects are described by fewer numbers."""
    clusterer: str = "birch"
    """How objects are grouped into classes: birch, kmeans, som (self-organising map), svm (learns from Birch)."""
    embedder: str = "doc2vec"
    """How a scene becomes a vector: the thesis's way (needs the extra 'thesis'), hashed words, places as phases
    (fractional), those and words learned as they come (online), or a plain list of objects (slots)."""
    otsu: DetectionConfig = field(default_factory=DetectionConfig)
    """What counts as an object in the small grey image."""
    foreground: ForegroundConfig = field(default_factory=ForegroundConfig)
    """What counts as an object at full resolution."""
    segmentation: KMeansDetectorConfig = field(default_factory=KMeansDetectorConfig)
    """How the small grey image is segmented."""
    labels: LabelsConfig = field(default_factory=LabelsConfig)
    """Which of the objects that the environment labels are seen."""
    pca: PCAConfig = field(default_factory=PCAConfig)
    """How objects are reduced."""
    birch: BirchConfig = field(default_factory=BirchConfig)
    """When objects are of one class."""
    kmeans: KMeansConfig = field(default_factory=KMeansConfig)
    """Mini-batch k-means in place of Birch."""
    som: SelfOrganisingMapConfig = field(default_factory=SelfOrganisingMapConfig)
    """A self-organising map in place of Birch."""
    svm: SVMConfig = field(default_factory=SVMConfig)
    """A support vector machine that learns Birch's classes."""
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    """Which object is which from decision to decision."""
    slot_assigner: SlotAssignerConfig = field(default_factory=SlotAssignerConfig)
    """Which of the tracked objects have a place in the state."""
    inheritance: InheritanceConfig = field(default_factory=InheritanceConfig)
    """When something that looks new is taken for something known."""
    scene: SceneGraphConfig = field(default_factory=SceneGraphConfig)
    """Which objects a scene has, and which of them are joined."""
    doc2vec: Doc2VecConfig = field(default_factory=Doc2VecConfig)
    """Parameters of the thesis's embedding."""
    hashed: HashedEmbeddingConfig = field(default_factory=HashedEmbeddingConfig)
    """Parameters of the hashed embedding."""
    fractional: FractionalEmbeddingConfig = field(default_factory=FractionalEmbeddingConfig)
    """Parameters of the fractional embedding."""
    online: OnlineEmbeddingConfig = field(default_factory=OnlineEmbeddingConfig)
    """Parameters of the online embedding."""
    slots: SlotsEmbeddingConfig = field(default_factory=SlotsEmbeddingConfig)
    """Parameters of the plain list."""
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Parameters of boxes that other packages add: name of the box → parameter → value."""

    def __post_init__(self) -> None:
        if self.detector != "auto":
            DETECTORS.check(self.detector)
        REDUCERS.check(self.reducer)
        CLUSTERERS.check(self.clusterer)
        EMBEDDERS.check(self.embedder)


def make_detector(config: PerceptionConfig, *, tracked: bool) -> Detector:
    """Make the detector that the configuration names."""
    name = config.detector if config.detector != "auto" else "foreground" if tracked else "otsu"
    return DETECTORS.make(name, config)
