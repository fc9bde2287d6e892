"""Small worlds of points, for the tests of tracking."""

import numpy as np

from semrl.core import Objects
from semrl.perception.tracking import TrackingConfig, follow, no_tracks

N_CLASSES = 4


def objects(places, colours=None):
    """Objects of 3×3 pixels at these centres, in these colours."""
    centres = np.array(places, np.float32).reshape(-1, 2)
    boxes = np.column_stack([centres.astype(np.int64) - 1, np.full((len(centres), 2), 3)])
    return Objects(
        crops=np.zeros((len(centres), 8, 8), np.float32),
        centres_px=centres,
        boxes_px=boxes,
        labels=np.zeros((84, 84), np.int32),
        colours=None if colours is None else np.array(colours, np.float32).reshape(-1, 3),
    )


def followed(frames, config=None, tracks=None, colours=None):
    """Follow frames of (class, row, column), in these colours at each; yield the tracks after each."""
    tracks = no_tracks(N_CLASSES) if tracks is None else tracks
    for t, frame in enumerate(frames):
        classes = np.array([number for number, *_ in frame], np.int64)
        seen = objects([place for _, *place in frame], None if colours is None else colours[t])
        features = 2 * np.eye(N_CLASSES, dtype=np.float32)[classes]
        tracks = follow(tracks, seen, classes, features, config or TrackingConfig())
        yield tracks
