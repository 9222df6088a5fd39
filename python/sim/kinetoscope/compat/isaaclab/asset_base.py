"""Common parts of the assets of Isaac."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from .._layer import Layer
from .._poses import to_matrix
from .._tensors import array, tensor
from ..configclass import configclass


@configclass
class AssetBaseCfg:
    """An asset without state: the ground, or a light."""

    prim_path: str = ""
    spawn: Any = None
    init_state: Any = None
    collision_group: int = 0
    debug_vis: bool = False


def ids_of(values: Any, count: int) -> Any:
    """Indices as an array; None for all of ``count``."""
    if isinstance(values, slice):
        return None if values == slice(None) else np.arange(count)[values]
    return None if values is None else array(values)


class RootData(Layer, ABC):
    """State of an asset with a root, as tensors in the world frame: position, rotation w x y z, linear and angular velocity."""

    @property
    @abstractmethod
    def root_state_w(self) -> Any:
        """State of the root, shape (N, 13)."""

    @property
    @abstractmethod
    def body_state_w(self) -> Any:
        """States of the bodies, shape (N, bodies, 13)."""

    @property
    def root_pos_w(self) -> Any:
        return self.root_state_w[:, :3]

    @property
    def root_quat_w(self) -> Any:
        return self.root_state_w[:, 3:7]

    @property
    def root_vel_w(self) -> Any:
        return self.root_state_w[:, 7:13]

    @property
    def root_lin_vel_w(self) -> Any:
        return self.root_state_w[:, 7:10]

    @property
    def root_ang_vel_w(self) -> Any:
        return self.root_state_w[:, 10:13]

    @property
    def body_pos_w(self) -> Any:
        return self.body_state_w[..., :3]

    @property
    def body_quat_w(self) -> Any:
        return self.body_state_w[..., 3:7]

    @property
    def body_vel_w(self) -> Any:
        return self.body_state_w[..., 7:13]

    @property
    def body_lin_vel_w(self) -> Any:
        return self.body_state_w[..., 7:10]

    @property
    def body_ang_vel_w(self) -> Any:
        return self.body_state_w[..., 10:13]

    @property
    def root_lin_vel_b(self) -> Any:
        return self._in_root_axes(self.root_lin_vel_w)

    @property
    def root_ang_vel_b(self) -> Any:
        return self._in_root_axes(self.root_ang_vel_w)

    def _in_root_axes(self, vectors: Any) -> Any:
        """Vectors in world axes, shape (N, 3), in the axes of the root."""
        axes = to_matrix(array(self.root_state_w)[:, :7])[:, :3, :3]
        return tensor(np.einsum("nij,ni->nj", axes, np.broadcast_to(array(vectors), (len(axes), 3))))


class RootAsset(Layer, ABC):
    """An asset with a root, in environments with these origins."""

    def __init__(self, origins: Any) -> None:
        self._origins = origins

    @abstractmethod
    def _write_root_pose(self, poses: Any, env_ids: Any) -> None:
        """Writes poses in the frames of the environments."""

    @abstractmethod
    def _write_root_velocity(self, velocities: Any, env_ids: Any) -> None:
        """Writes velocities in world axes."""

    @property
    def num_instances(self) -> int:
        return len(self._origins)

    def write_root_state_to_sim(self, root_state: Any, env_ids: Any = None) -> None:
        """Writes poses (world frame) and velocities of the root, shape (n, 13)."""
        states = np.asarray(array(root_state), dtype=float)
        self.write_root_pose_to_sim(states[:, :7], env_ids)
        self.write_root_velocity_to_sim(states[:, 7:], env_ids)

    def write_root_pose_to_sim(self, root_pose: Any, env_ids: Any = None) -> None:
        """Writes poses of the root (world frame), shape (n, 7)."""
        poses = np.array(array(root_pose), dtype=float)
        chosen = ids_of(env_ids, self.num_instances)
        poses[:, :3] -= self._origins if chosen is None else self._origins[chosen]
        self._write_root_pose(poses, chosen)

    def write_root_velocity_to_sim(self, root_velocity: Any, env_ids: Any = None) -> None:
        """Writes velocities of the root, world axes, shape (n, 6); those of an articulation are of its center of mass."""
        self._write_root_velocity(array(root_velocity), ids_of(env_ids, self.num_instances))

    def update(self, dt: float) -> None:
        """Does nothing: data is read from the simulation."""
