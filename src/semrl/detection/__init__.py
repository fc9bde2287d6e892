"""Which pixels are an object (§3.2.1)."""

from semrl.detection.labels import label_image
from semrl.detection.otsu import DetectionConfig, OtsuDetector

__all__ = ["DetectionConfig", "OtsuDetector", "label_image"]
