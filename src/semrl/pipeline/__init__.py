"""Elevation: the boxes of the upper line, wired (Fig. 1.1)."""

from semrl.pipeline.config import MODELS, PipelineConfig, View, make_embedder
from semrl.pipeline.pipeline import Pipeline

__all__ = ["MODELS", "Pipeline", "PipelineConfig", "View", "make_embedder"]
