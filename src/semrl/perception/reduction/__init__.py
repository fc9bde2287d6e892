"""Objects as few numbers (§3.2.2)."""

from semrl.perception.reduction.pca import ObjectPCA, PCAConfig

__all__ = ["ObjectPCA", "PCAConfig"]
