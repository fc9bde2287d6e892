"""Objects through time: which is which, where each goes, and which of them matter."""

from semrl.perception.tracking.following import TrackingConfig, follow, no_tracks
from semrl.perception.tracking.roles import AXES, SLOT_NUMBERS, Roles, RolesConfig

__all__ = ["AXES", "SLOT_NUMBERS", "Roles", "RolesConfig", "TrackingConfig", "follow", "no_tracks"]
