"""Variants of what any game shows; what happens in it stays the same."""

from typing import Any

import gymnasium as gym
import numpy as np

from semrl.core import Frame


class AlteredFrames(gym.ObservationWrapper[Frame, Any, Frame]):
    """Show every frame altered by `alter`, also to those who film."""

    roms: tuple[str, ...] = ()

    def observation(self, observation: Frame) -> Frame:
        """Alter a frame, ``(h, w, 3)`` uint8."""
        return np.ascontiguousarray(self.alter(observation))

    def render(self) -> Any:
        """Alter what is rendered."""
        frame = self.env.render()
        return self.observation(frame) if isinstance(frame, np.ndarray) else frame

    def alter(self, frame: Frame) -> Frame:
        """Return the altered frame."""
        raise NotImplementedError


class Recoloured(AlteredFrames):
    """Red becomes green, green blue, blue red."""

    def alter(self, frame: Frame) -> Frame:
        """Exchange the channels."""
        return frame[:, :, [2, 0, 1]]


class Mirrored(AlteredFrames):
    """Left is right."""

    def alter(self, frame: Frame) -> Frame:
        """Exchange the sides."""
        return frame[:, ::-1]


class UpsideDown(AlteredFrames):
    """Up is down: what an action does looks turned round."""

    def alter(self, frame: Frame) -> Frame:
        """Exchange top and bottom."""
        return frame[::-1]
