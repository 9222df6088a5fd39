"""Rigid objects of Isaac. Poses of data and writers are in the world frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._sim import RigidObject as NativeRigidObject
from .._poses import to_matrix, to_world
from .._tensors import array, tensor
from ..configclass import configclass
from .asset_base import AssetBaseCfg, RootAsset, RootData, ids_of
from .names import resolve
from .sim import SimulationContext
from .spawners import shape


@configclass
class RigidObjectInitialStateCfg:
    """Initial state: position [m], rotation w x y z, velocities in world axes."""

    pos: Any = (0.0, 0.0, 0.0)
    rot: Any = (1.0, 0.0, 0.0, 0.0)
    lin_vel: Any = (0.0, 0.0, 0.0)
    ang_vel: Any = (0.0, 0.0, 0.0)


@configclass
class RigidObjectCfg(AssetBaseCfg):
    """A rigid object: ``spawn`` is its shape."""

    InitialStateCfg = RigidObjectInitialStateCfg

    init_state: Any = RigidObjectInitialStateCfg()


def object_fields(uid: str, cfg: RigidObjectCfg) -> dict[str, Any]:
    """Fields of this package's rigid object."""
    start = cfg.init_state
    return {"uid": uid, "init_pose": [float(x) for x in (*start.pos, *start.rot)], **shape(cfg.spawn, uid)}


class RigidObjectData(RootData):
    """State of a rigid object as tensors."""

    def __init__(self, native: NativeRigidObject, origins: Any, cfg: RigidObjectCfg) -> None:
        self._native = native
        self._origins = origins
        start = cfg.init_state
        row = np.array([*start.pos, *start.rot, *start.lin_vel, *start.ang_vel], dtype=float)
        self.default_root_state = tensor(np.tile(row, (len(origins), 1)))
        context = SimulationContext.instance()
        gravity = np.array((0.0, 0.0, -9.81) if context is None else context.cfg.gravity, dtype=float)
        self._down = gravity / max(float(np.linalg.norm(gravity)), 1e-12)

    @property
    def root_state_w(self) -> Any:
        states = np.concatenate([self._native.pose, self._native.velocity], axis=1)
        return tensor(to_world(states, self._origins))

    @property
    def body_state_w(self) -> Any:
        return self.root_state_w[:, None]

    @property
    def projected_gravity_b(self) -> Any:
        """Direction of gravity in the axes of the object, shape (N, 3)."""
        return self._in_root_axes(self._down)

    @property
    def heading_w(self) -> Any:
        """Yaw of the x axis of the object [rad], shape (N,)."""
        axes = to_matrix(self._native.pose)
        return tensor(np.arctan2(axes[:, 1, 0], axes[:, 0, 0]))


class RigidObject(RootAsset):
    """A rigid object. ``native`` is the object of this package."""

    def __init__(self, native: NativeRigidObject, origins: Any, cfg: RigidObjectCfg) -> None:
        super().__init__(origins)
        self.native = native
        self.cfg = cfg
        self.data = RigidObjectData(native, origins, cfg)

    @property
    def num_bodies(self) -> int:
        return 1

    @property
    def body_names(self) -> list[str]:
        """The last part of the path."""
        return [self.cfg.prim_path.rsplit("/", 1)[-1]]

    def find_bodies(self, name_keys: Any, preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Index and name of the body, which each pattern must match."""
        return resolve(name_keys, self.body_names, preserve_order, "body")

    def _write_root_pose(self, poses: Any, env_ids: Any) -> None:
        self.native.write_pose(poses, env_ids)

    def _write_root_velocity(self, velocities: Any, env_ids: Any) -> None:
        self.native.write_velocity(velocities, env_ids)

    def set_external_force_and_torque(self, forces: Any, torques: Any, body_ids: Any = None, env_ids: Any = None) -> None:
        """A force and a torque in the axes of the object, shape (n, 1, 3), until they are set again."""
        if body_ids is not None and not isinstance(body_ids, slice) and list(array(body_ids).ravel()) != [0]:
            raise IndexError(f"body_ids is {body_ids}; there is one body")
        force, torque = (np.asarray(array(values), dtype=float).reshape(-1, 3) for values in (forces, torques))
        self.native.set_external_wrench(force, torque, "link", ids_of(env_ids, self.num_instances))

    def write_data_to_sim(self) -> None:
        """Does nothing: forces and torques act at once."""

    def reset(self, env_ids: Any = None) -> None:
        """Removes the external force and torque."""
        chosen = ids_of(env_ids, self.num_instances)
        none = np.zeros((self.num_instances if chosen is None else np.atleast_1d(chosen).size, 3))
        if len(none):
            self.native.set_external_wrench(none, none, "link", chosen)

    def write_start(self) -> None:
        """Writes the initial velocity, if there is one."""
        velocity = np.asarray(self.data.default_root_state)[:, 7:]
        if velocity.any():
            self.native.write_velocity(velocity)
