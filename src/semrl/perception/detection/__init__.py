"""Which pixels are an object (§3.2.1)."""

from semrl.perception.detection.foreground import ForegroundConfig, ForegroundDetector
from semrl.perception.detection.ground import Ground
from semrl.perception.detection.labelled import LabelsConfig, LabelsDetector
from semrl.perception.detection.labels import label_image
from semrl.perception.detection.otsu import DetectionConfig, OtsuDetector
from semrl.perception.detection.segmentation import KMeansDetector, KMeansDetectorConfig

__all__ = [
    "DetectionConfig",
    "ForegroundConfig",
    "ForegroundDetector",
    "Ground",
    "KMeansDetector",
    "KMeansDetectorConfig",
    "LabelsConfig",
    "LabelsDetector",
    "OtsuDetector",
    "label_image",
]
