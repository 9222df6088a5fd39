"""Groups of rigid objects of EmbodiChain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import kinetoscope as ks
from kinetoscope.compat._layer import Layer
from kinetoscope.compat._poses import rows
from kinetoscope.compat._tensors import array, tensor
from .cfg import RigidObjectGroupCfg
from .objects import RigidObjectData, ids, poses

if TYPE_CHECKING:
    from .manager import SimulationManager


class RigidObjectGroupData(RigidObjectData):
    """State of the objects of a group, shape (n, objects, ...)."""

    @property
    def lin_vel(self) -> Any:
        return tensor(self._native.velocity[..., :3])

    @property
    def ang_vel(self) -> Any:
        return tensor(self._native.velocity[..., 3:])


class RigidObjectGroup(Layer):
    """Rigid objects under one uid. ``native`` is the group of this package."""

    def __init__(self, manager: SimulationManager, native: ks.RigidObjectGroup, cfg: RigidObjectGroupCfg) -> None:
        self.manager = manager
        self.native = native
        self.cfg = cfg
        self.body_data = RigidObjectGroupData(native)
        self._start = native.pose

    @property
    def uid(self) -> str:
        return self.native.uid

    @property
    def num_objects(self) -> int:
        return len(self.native)

    @property
    def is_non_dynamic(self) -> bool:
        return self.cfg.body_type != "dynamic"

    def get_local_pose(self, to_matrix: bool = False) -> Any:
        """Poses of the objects, shape (n, objects, 7), or (n, objects, 4, 4)."""
        return poses(self.native.pose, to_matrix)

    def set_local_pose(self, pose: Any, env_ids: Any = None, obj_ids: Any = None) -> None:
        """Writes poses of all objects, or of those in ``obj_ids``: shape (n, objects, 7) or (n, objects, 4, 4)."""
        given = np.asarray(array(pose), dtype=float)
        given = rows(given).reshape(*given.shape[:2], 7)
        chosen = slice(None) if env_ids is None else array(env_ids)
        new = self.native.pose[chosen]
        new[:, slice(None) if obj_ids is None else array(obj_ids)] = given
        self.native.write_pose(new, ids(env_ids))

    def clear_dynamics(self, env_ids: Any = None) -> None:
        """Sets velocities to 0."""
        if not self.is_non_dynamic:
            count = self.manager.num_envs if env_ids is None else len(array(env_ids))
            self.native.write_velocity(np.zeros((count, self.num_objects, 6)), ids(env_ids))

    def reset(self, env_ids: Any = None) -> None:
        """Returns to the initial poses; velocities become 0."""
        self.native.write_pose(self._start[slice(None) if env_ids is None else array(env_ids)], ids(env_ids))
        self.clear_dynamics(env_ids)
