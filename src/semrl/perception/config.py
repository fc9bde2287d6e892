"""What the boxes between frame and state are told, and how far up each model looks."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from semrl.perception.clustering import BirchConfig
from semrl.perception.detection import DetectionConfig, ForegroundConfig
from semrl.perception.embedding import (
    Doc2VecConfig,
    Doc2VecEmbedding,
    FractionalEmbedding,
    FractionalEmbeddingConfig,
    HashedEmbedding,
    HashedEmbeddingConfig,
    OnlineEmbedding,
    OnlineEmbeddingConfig,
    SceneGraphConfig,
    SlotsEmbedding,
    SlotsEmbeddingConfig,
)
from semrl.perception.embedding.protocol import Embedder
from semrl.perception.reduction import PCAConfig
from semrl.perception.tracking import RolesConfig, TrackingConfig

View = Literal["grey", "components", "classes", "embedding", "objects", "ram"]
"""What is shown to the agent: how far up a frame is elevated."""

MODELS: dict[str, View] = {
    "baseline": "grey",
    "otsu": "components",
    "birch": "classes",
    "semantic": "embedding",
    "semantic-map": "embedding",
    "objects": "objects",
    "objects-map": "objects",
    "ram": "ram",
    "ram-map": "ram",
}
"""The models of Table 4.1, and `objects`, and what their agents see; those with a map are told its plans as well."""


@dataclass(frozen=True, kw_only=True)
class PipelineConfig:
    """Parameters of every box between frame and state."""

    detection: DetectionConfig = field(default_factory=DetectionConfig)
    """What counts as an object."""
    pca: PCAConfig = field(default_factory=PCAConfig)
    """How objects are reduced."""
    birch: BirchConfig = field(default_factory=BirchConfig)
    """When objects are of one kind."""
    scene: SceneGraphConfig = field(default_factory=SceneGraphConfig)
    """Which objects a scene has, and which of them are joined."""
    embedding: Literal["doc2vec", "hashed", "fractional", "online", "slots"] = "doc2vec"
    """How a scene becomes a vector: the thesis's way (needs the extra 'thesis'), hashed words, places as phases,
    those and words learned as they come, or a plain list of objects."""
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
    foreground: ForegroundConfig = field(default_factory=ForegroundConfig)
    """What counts as an object where objects are tracked."""
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    """Which object is which from decision to decision."""
    roles: RolesConfig = field(default_factory=RolesConfig)
    """Which of them are told of."""


def make_embedder(config: PipelineConfig) -> Embedder:
    """Make the embedding that the configuration names."""
    makers: dict[str, Callable[[], Embedder]] = {
        "doc2vec": lambda: Doc2VecEmbedding(config.doc2vec),
        "hashed": lambda: HashedEmbedding(config.hashed),
        "fractional": lambda: FractionalEmbedding(config.fractional),
        "online": lambda: OnlineEmbedding(config.online),
        "slots": lambda: SlotsEmbedding(config.slots),
    }
    return makers[config.embedding]()
