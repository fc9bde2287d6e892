"""Objects through time: which is which, where each goes, and which of them matter."""

from semrl.perception.tracking.following import TrackingConfig, follow, no_tracks, restored_tracks
from semrl.perception.tracking.inheritance import Inheritance, InheritanceConfig
from semrl.perception.tracking.jumps import Jumps
from semrl.perception.tracking.sharing import SharedSlots
from semrl.perception.tracking.slots import AXES, SLOT_NUMBERS, SlotAssigner, SlotAssignerConfig

__all__ = [
    "AXES",
    "SLOT_NUMBERS",
    "Inheritance",
    "InheritanceConfig",
    "Jumps",
    "SharedSlots",
    "SlotAssigner",
    "SlotAssignerConfig",
    "TrackingConfig",
    "follow",
    "no_tracks",
    "restored_tracks",
]
