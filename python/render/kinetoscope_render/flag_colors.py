"""Colors that show segmentation ids or depth, for flags of a scene."""

from __future__ import annotations

from typing import Any, Optional

import mujoco
import numpy as np

# Random colors are between these shares of white, with these bases of Halton sequences, as in MuJoCo's renderer.
_DARKEST, _RANGE, _FIRST, _BASES = 0.1, 0.8, 10, (2, 3, 5)


def _flag(scene: "mujoco.MjvScene", name: str) -> bool:
    """True if the scene has this flag, which some versions of MuJoCo lack."""
    flag = mujoco.mjtRndFlag.__members__.get(name)
    return flag is not None and bool(scene.flags[int(flag)])


class FlagColors:
    """Colors of a captured scene that replace its image of color."""

    def __init__(self, scene: "mujoco.MjvScene") -> None:
        """Reads the flags of the scene."""
        camera = scene.camera[0]
        self.is_depth = _flag(scene, "mjRND_DEPTH")
        self.is_segments = _flag(scene, "mjRND_SEGMENT")
        self._are_ids = _flag(scene, "mjRND_IDCOLOR")
        self._range = float(camera.frustum_near), float(camera.frustum_far)
        self._is_orthographic = bool(getattr(camera, "orthographic", False))

    @property
    def source(self) -> Optional[tuple[str, Any]]:
        """Channel that the colors show, and its type; `None` for the image of color."""
        if self.is_depth:
            return "depth", np.float32
        return ("segments", np.int32) if self.is_segments else None

    def of(self, image: np.ndarray) -> np.ndarray:
        """Colors of the image of the channel, (..., 3)."""
        if self.is_depth:
            gray = np.rint(255 * self.nearness(image)).astype(np.uint8)
            return np.repeat(gray[..., None], 3, -1)
        return id_colors(image) if self._are_ids else random_colors(image)

    def nearness(self, depth: np.ndarray) -> np.ndarray:
        """Depth in units of OpenGL: 1 at the near plane, 0 at the far plane."""
        near, far = self._range
        metric = depth.astype(np.float64)
        return (1.0 if self._is_orthographic else near / metric) * (far - metric) / (far - near)


def id_colors(segments: np.ndarray) -> np.ndarray:
    """Bytes of segmentation ids plus 1; the background, -1, is black."""
    ids = segments + 1
    return np.stack([ids & 255, ids >> 8 & 255, ids >> 16 & 255], axis=-1).astype(np.uint8)


def random_colors(segments: np.ndarray) -> np.ndarray:
    """A color for each segmentation id; the background, -1, is black."""
    used, where = np.unique(segments, return_inverse=True)
    table = np.zeros((len(used), 3), np.uint8)
    for row, segment in zip(table, used.tolist()):
        if segment >= 0:
            shares = (_DARKEST + _RANGE * mujoco.mju_Halton(segment + _FIRST, base) for base in _BASES)
            row[:] = [round(255 * share) for share in shares]
    return table[where].reshape(*segments.shape, 3)
