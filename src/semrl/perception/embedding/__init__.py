"""Embedding (§3.2.3): a frame's objects become a graph, the graph words, the words a vector."""

from semrl.perception.embedding.doc2vec import Doc2VecConfig, Doc2VecEmbedding
from semrl.perception.embedding.fractional import FractionalEmbedding, FractionalEmbeddingConfig
from semrl.perception.embedding.hashing import HashedEmbedding, HashedEmbeddingConfig
from semrl.perception.embedding.online import OnlineEmbedding, OnlineEmbeddingConfig
from semrl.perception.embedding.scene_graph import SceneGraphConfig, build_scene_graph
from semrl.perception.embedding.scenery import Scenery
from semrl.perception.embedding.slots import SlotsEmbedding, SlotsEmbeddingConfig
from semrl.perception.embedding.words import (
    WordsConfig,
    document,
    hash_words,
    position_words,
    sentences,
    wl_hashes,
    word_hash,
)

__all__ = [
    "Doc2VecConfig",
    "Doc2VecEmbedding",
    "FractionalEmbedding",
    "FractionalEmbeddingConfig",
    "HashedEmbedding",
    "HashedEmbeddingConfig",
    "OnlineEmbedding",
    "OnlineEmbeddingConfig",
    "SceneGraphConfig",
    "Scenery",
    "SlotsEmbedding",
    "SlotsEmbeddingConfig",
    "WordsConfig",
    "build_scene_graph",
    "document",
    "hash_words",
    "position_words",
    "sentences",
    "wl_hashes",
    "word_hash",
]
