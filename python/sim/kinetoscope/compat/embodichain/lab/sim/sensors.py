"""Cameras of EmbodiChain. A camera changes only in ``update``."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinetoscope.compat._poses import rows, to_matrix
from kinetoscope.compat._tensors import array, tensor
from kinetoscope.compat.configclass import configclass


@configclass
class ExtrinsicsCfg:
    """Pose of a camera. ``quat`` is w x y z. As in EmbodiChain, the axes are those of ROS (z forward) without a parent,
    and those of OpenGL (looking along -z) with a parent link. ``eye``, ``target`` and ``up`` replace the pose."""

    pos: Any = (0.0, 0.0, 0.0)
    quat: Any = (1.0, 0.0, 0.0, 0.0)
    parent: str | None = None
    eye: Any = None
    target: Any = None
    up: Any = None


@configclass
class CameraCfg:
    """A camera: ``intrinsics`` are fx fy cx cy [pixels]."""

    ExtrinsicsCfg = ExtrinsicsCfg

    uid: str | None = None
    width: int = 640
    height: int = 480
    near: float = 0.005
    far: float = 100.0
    intrinsics: Any = (600.0, 600.0, 320.0, 240.0)
    extrinsics: ExtrinsicsCfg = ExtrinsicsCfg()
    enable_color: bool = True
    enable_depth: bool = False
    enable_mask: bool = False
    enable_normal: bool = False
    enable_position: bool = False


def channels(cfg: CameraCfg) -> list[str]:
    names = ("color", "depth", "mask", "normal", "position")
    return [name for name in names if getattr(cfg, f"enable_{name}")]


def camera_cfg(cfg: CameraCfg) -> dict[str, Any]:
    """Fields of this package's camera."""
    extrinsics = cfg.extrinsics
    if extrinsics.eye is not None:
        placement = {"look_at": {"eye": vector(extrinsics.eye), "target": vector(extrinsics.target)}}
        if extrinsics.up is not None:
            placement["look_at"]["up"] = vector(extrinsics.up)
    else:
        placement = {"pose": {"pos": vector(extrinsics.pos), "rotation": vector(extrinsics.quat)}}
    fx, fy, cx, cy = vector(cfg.intrinsics)
    return {
        "type": "camera",
        "width": cfg.width,
        "height": cfg.height,
        "near": float(cfg.near),
        "far": float(cfg.far),
        "intrinsics": {"pixels": {"fx": fx, "fy": fy, "cx": cx, "cy": cy}},
        "extrinsics": {
            "parent": extrinsics.parent,
            "placement": placement,
            "convention": "ros" if extrinsics.parent is None else "open_gl",
        },
        "channels": channels(cfg),
        # EmbodiChain's consumers treat a depth of 0 as invalid.
        "depth_miss": "zero",
    }


def vector(values: Any) -> list[float]:
    return [float(x) for x in array(values)]


class Camera:
    """A camera. ``native`` is the sensor of this package."""

    def __init__(self, manager: Any, native: Any, cfg: CameraCfg) -> None:
        self.manager = manager
        self.native = native
        self.cfg = cfg
        self._data: dict[str, Any] = {}

    @property
    def uid(self) -> str:
        return self.native.uid

    @property
    def is_attached(self) -> bool:
        return self.cfg.extrinsics.parent is not None

    def update(self, fetch_only: bool = False) -> None:  # noqa: ARG002
        """Renders the current state."""
        self._data = {name: tensor(self.native[name]) for name in channels(self.cfg)}

    def get_data(self) -> dict[str, Any]:
        """Images of the last ``update``: color (n, h, w, 4), depth and mask (n, h, w), normal (n, h, w, 3)."""
        if not self._data:
            self.update()
        return self._data

    def get_intrinsics(self) -> Any:
        return tensor(self.native.intrinsic_matrices)

    def set_intrinsics(self, intrinsics: Any, env_ids: Any = None) -> None:
        values = np.asarray(array(intrinsics), dtype=float)
        if values.shape[-2:] == (3, 3):
            values = np.stack([values[..., 0, 0], values[..., 1, 1], values[..., 0, 2], values[..., 1, 2]], axis=-1)
        self.native.set_intrinsics(values, None if env_ids is None else array(env_ids))

    def get_local_pose(self, to_matrix_form: bool = False) -> Any:
        values = self.native.local_pose("opengl")
        return tensor(to_matrix(values) if to_matrix_form else values)

    def set_local_pose(self, pose: Any, env_ids: Any = None) -> None:
        self.native.set_local_pose(rows(array(pose)), None if env_ids is None else array(env_ids), "opengl")

    def get_arena_pose(self, to_matrix_form: bool = False) -> Any:
        values = self.native.pose_w("opengl")
        return tensor(to_matrix(values) if to_matrix_form else values)

    def look_at(self, eye: Any, target: Any, up: Any = None, env_ids: Any = None) -> None:
        up = None if up is None else array(up)
        self.native.look_at(array(eye), array(target), up, None if env_ids is None else array(env_ids))
