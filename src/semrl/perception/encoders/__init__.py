"""What an agent may be shown of a frame: how far it is elevated, one file each (§4.3)."""

from semrl.core.registry import Registry
from semrl.perception.encoders.protocol import Encoder, EpisodeEncoder

ENCODERS: Registry[Encoder] = Registry(
    "encoders",
    {
        "grey": "semrl.perception.encoders.grey:GreyEncoder",
        "components": "semrl.perception.encoders.components:ComponentsEncoder",
        "classes": "semrl.perception.encoders.classes:ClassesEncoder",
        "scene": "semrl.perception.encoders.scene:SceneEncoder",
        "tracked_scene": "semrl.perception.encoders.tracked_scene:TrackedSceneEncoder",
        "objects": "semrl.perception.encoders.objects:ObjectsEncoder",
        "ram": "semrl.perception.encoders.ram:RamEncoder",
    },
)

__all__ = ["ENCODERS", "Encoder", "EpisodeEncoder"]
