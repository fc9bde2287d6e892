"""Which pixels are an object (§3.2.1)."""

from semrl.detection.foreground import ForegroundConfig, ForegroundDetector
from semrl.detection.labels import label_image
from semrl.detection.otsu import DetectionConfig, OtsuDetector

__all__ = ["DetectionConfig", "ForegroundConfig", "ForegroundDetector", "OtsuDetector", "label_image"]
