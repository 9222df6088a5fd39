"""The transform of a scene (`scene.enabletransform`), from its model to the room of its cameras."""

from __future__ import annotations

from typing import Any, Optional

import mujoco
import numpy as np

# Largest deviation of the length of a quaternion from 1.
_ROUNDING = 1e-3


class RoomTransform:
    """Rotation, translation and scale: `room = translation + scale * rotation @ model`.

    An image of the transformed scene is that of the model, seen by a camera that is moved by the inverse. Lengths in the
    room are `scale` times as large: depths, the distances on which fog and the attenuation of lights depend, and the
    sizes of a view.
    """

    def __init__(self, scene: "mujoco.MjvScene"):
        """Reads the transform of a scene.

        Raises:
            ValueError: The scale is not positive, `rotate` is not a unit quaternion, or a number is not finite.
        """
        quaternion = np.array(scene.rotate, np.float64)
        self.translation = np.array(scene.translate, np.float64)
        self.scale = float(scene.scale)
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise ValueError(f"scene.scale must be positive and finite, not {self.scale:g}")
        if not np.isfinite(self.translation).all():
            raise ValueError(f"scene.translate must be finite, not {self.translation}")
        length = float(np.linalg.norm(quaternion))
        if not abs(length - 1) < _ROUNDING:
            raise ValueError(f"scene.rotate must be a quaternion of length 1, not of length {length:g}")
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, quaternion / length)
        self.rotation = rotation.reshape(3, 3)

    @classmethod
    def of(cls, scene: "mujoco.MjvScene") -> Optional["RoomTransform"]:
        """The transform of a scene; `None` if it is off."""
        return cls(scene) if scene.enabletransform else None

    def position_in_model(self, position: Any) -> np.ndarray:
        """A position of the room, in the model."""
        return (np.asarray(position) - self.translation) @ self.rotation / self.scale

    def direction_in_model(self, direction: Any) -> np.ndarray:
        """A direction in the room, in the model."""
        return np.asarray(direction) @ self.rotation
