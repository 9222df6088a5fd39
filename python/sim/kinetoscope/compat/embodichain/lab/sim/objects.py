"""Robots, articulations and rigid objects of EmbodiChain. Numbers have single precision, poses are x y z qw qx qy qz."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import kinetoscope as ks
from kinetoscope.cfg import DriveType
from kinetoscope.compat._layer import Layer
from kinetoscope.compat._poses import rows, to_matrix
from kinetoscope.compat._tensors import array, tensor
from .cfg import ArticulationCfg, RigidObjectCfg

if TYPE_CHECKING:
    from .manager import SimulationManager


def poses(values: Any, to_matrix_form: bool) -> Any:
    return tensor(to_matrix(values) if to_matrix_form else values)


def ids(values: Any) -> Any:
    return None if values is None else array(values)


class ArticulationData(Layer):
    """State of an articulation as tensors with the environments on the first axis."""

    def __init__(self, native: ks.Robot) -> None:
        self._native = native

    @property
    def qpos(self) -> Any:
        return tensor(self._native.qpos)

    @property
    def target_qpos(self) -> Any:
        return tensor(self._native.qpos_target)

    @property
    def qvel(self) -> Any:
        return tensor(self._native.qvel)

    @property
    def target_qvel(self) -> Any:
        return tensor(self._native.qvel_target)

    @property
    def qacc(self) -> Any:
        return tensor(self._native.qacc)

    @property
    def qf(self) -> Any:
        return tensor(self._native.qf)

    @property
    def qpos_limits(self) -> Any:
        return tensor(self._native.qpos_limits)

    @property
    def qvel_limits(self) -> Any:
        return tensor(self._native.qvel_limits)

    @property
    def qf_limits(self) -> Any:
        return tensor(self._native.qf_limits)

    @property
    def joint_stiffness(self) -> Any:
        return tensor(self._native.stiffness)

    @property
    def joint_damping(self) -> Any:
        return tensor(self._native.damping)

    @property
    def joint_friction(self) -> Any:
        return tensor(self._native.friction)

    @property
    def joint_armature(self) -> Any:
        return tensor(self._native.armature)

    @property
    def root_pose(self) -> Any:
        return tensor(self._native.root_pose)

    @property
    def root_vel(self) -> Any:
        return tensor(self._native.root_velocity)

    @property
    def root_lin_vel(self) -> Any:
        return tensor(self._native.root_velocity[:, :3])

    @property
    def root_ang_vel(self) -> Any:
        return tensor(self._native.root_velocity[:, 3:])

    @property
    def root_state(self) -> Any:
        return tensor(self._native.root_state)

    @property
    def body_state(self) -> Any:
        """Poses and velocities of the links, shape (N, links, 13)."""
        return tensor(np.concatenate([self._native.link_poses, self._native.link_velocities], axis=-1))

    @property
    def body_link_pose(self) -> Any:
        return tensor(self._native.link_poses)

    @property
    def body_link_vel(self) -> Any:
        return tensor(self._native.link_velocities)


class Articulation(Layer):
    """An articulation. ``native`` is the object of this package."""

    def __init__(self, manager: SimulationManager, native: ks.Robot, cfg: ArticulationCfg) -> None:
        self.manager = manager
        self.native = native
        self.cfg = cfg
        self.body_data = ArticulationData(native)

    @property
    def uid(self) -> str:
        return self.native.uid

    @property
    def dof(self) -> int:
        return self.native.dof

    @property
    def joint_names(self) -> list[str]:
        return self.native.joint_names

    @property
    def active_joint_names(self) -> list[str]:
        return self.native.active_joint_names

    @property
    def link_names(self) -> list[str]:
        return self.native.link_names

    @property
    def num_links(self) -> int:
        return len(self.native.link_names)

    @property
    def root_link_name(self) -> str:
        return self.native.link_names[0]

    @property
    def active_dof(self) -> int:
        return self.native.active_dof

    @property
    def active_joint_ids(self) -> list[int]:
        return self.native.active_joint_ids()

    @property
    def mimic_ids(self) -> list[int]:
        return self.native.mimic_joint_ids

    def _drivers(self) -> list[tuple[int, float, float]]:
        """Driving joint, multiplier and offset of each joint in ``mimic_ids``."""
        drivers = self.native.mimic_drivers
        return [drivers[joint] for joint in self.native.mimic_joint_ids]

    @property
    def mimic_parents(self) -> list[int]:
        return [parent for parent, _, _ in self._drivers()]

    @property
    def mimic_multipliers(self) -> list[float]:
        return [multiplier for _, multiplier, _ in self._drivers()]

    @property
    def mimic_offsets(self) -> list[float]:
        return [offset for _, _, offset in self._drivers()]

    def _rows(self, values: Any, env_ids: Any) -> Any:
        """Rows for the selected environments. As in EmbodiChain, one row does not stand for several environments."""
        values = np.atleast_2d(np.asarray(array(values), dtype=float))
        count = self.manager.num_envs if env_ids is None else len(array(env_ids))
        if values.shape[0] != count:
            raise ValueError(f"{values.shape[0]} rows for {count} environments")
        return values

    def set_qpos(self, qpos: Any, joint_ids: Any = None, env_ids: Any = None, target: bool = True) -> None:
        """Sets position targets, or with ``target=False`` the positions themselves. Both are clamped to the limits."""
        values = self._rows(qpos, env_ids)
        if target:
            self.native.set_qpos_target(values, ids(joint_ids), ids(env_ids))
            return
        limits = self.native.qpos_limits
        limits = limits if env_ids is None else limits[array(env_ids)]
        limits = limits if joint_ids is None else limits[:, array(joint_ids)]
        self.native.write_qpos(np.clip(values, limits[..., 0], limits[..., 1]), ids(joint_ids), ids(env_ids))

    def set_qvel(self, qvel: Any, joint_ids: Any = None, env_ids: Any = None, target: bool = True) -> None:
        """Sets velocity targets, or with ``target=False`` the velocities themselves."""
        write = self.native.set_qvel_target if target else self.native.write_qvel
        write(self._rows(qvel, env_ids), ids(joint_ids), ids(env_ids))

    def set_qf(self, qf: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        """Sets efforts that act in addition to the drives."""
        self.native.set_qf_target(self._rows(qf, env_ids), ids(joint_ids), ids(env_ids))

    def get_qpos(self, target: bool = False) -> Any:
        return tensor(self.native.qpos_target if target else self.native.qpos)

    def get_qvel(self, target: bool = False) -> Any:
        return tensor(self.native.qvel_target if target else self.native.qvel)

    def get_qf(self) -> Any:
        return tensor(self.native.qf)

    def _selected(self, values: Any, joint_ids: Any, env_ids: Any) -> Any:
        """Values of all environments and joints, or of the selected ones."""
        values = values if env_ids is None else values[array(env_ids)]
        return tensor(values if joint_ids is None else values[:, array(joint_ids)])

    def get_qpos_limits(self, joint_ids: Any = None, env_ids: Any = None) -> Any:
        """Lower and upper limits, shape (n, joints, 2)."""
        return self._selected(self.native.qpos_limits, joint_ids, env_ids)

    def get_qvel_limits(self, joint_ids: Any = None, env_ids: Any = None) -> Any:
        return self._selected(self.native.qvel_limits, joint_ids, env_ids)

    def get_qf_limits(self, joint_ids: Any = None, env_ids: Any = None) -> Any:
        return self._selected(self.native.qf_limits, joint_ids, env_ids)

    def set_qpos_limits(self, qpos_limits: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.native.set_qpos_limits(array(qpos_limits), ids(joint_ids), ids(env_ids))

    def set_qvel_limits(self, qvel_limits: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.native.set_qvel_limits(array(qvel_limits), ids(joint_ids), ids(env_ids))

    def set_qf_limits(self, qf_limits: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.native.set_qf_limits(array(qf_limits), ids(joint_ids), ids(env_ids))

    def get_joint_drive(self, joint_ids: Any = None, env_ids: Any = None) -> tuple[Any, ...]:
        """Stiffness, damping, largest effort, largest velocity, friction and armature, each of shape (n, joints)."""
        robot = self.native
        values = (robot.stiffness, robot.damping, robot.qf_limits, robot.qvel_limits, robot.friction, robot.armature)
        return tuple(self._selected(value, joint_ids, env_ids) for value in values)

    def get_user_ids(self, link_name: str | None = None) -> Any:
        """Values in the mask channel, the same in every environment: shape (n,) of a link, (n, links) of all."""
        table = {(entity, link): mask_id for mask_id, entity, link, _ in self.manager.native.mask_ids}
        links = self.native.link_names if link_name is None else [link_name]
        values = np.array([table.get((self.uid, link), 0) for link in links], dtype=np.int32)
        rows = np.tile(values, (self.manager.num_envs, 1))
        return tensor(rows if link_name is None else np.ascontiguousarray(rows[:, 0]))

    def clear_dynamics(self, env_ids: Any = None) -> None:
        """Sets velocities, their targets and efforts to 0."""
        count = self.manager.num_envs if env_ids is None else len(array(env_ids))
        zero = np.zeros((count, self.native.dof))
        self.native.write_qvel(zero, None, ids(env_ids))
        self.native.set_qvel_target(zero, None, ids(env_ids))
        self.native.set_qf_target(zero, None, ids(env_ids))

    def get_local_pose(self, to_matrix: bool = False) -> Any:
        return poses(self.native.root_pose, to_matrix)

    def set_local_pose(self, pose: Any, env_ids: Any = None) -> None:
        self.native.write_root_pose(rows(array(pose)), ids(env_ids))

    def get_link_pose(self, link_name: str, env_ids: Any = None, to_matrix: bool = False) -> Any:
        values = self.native.link_pose(link_name)
        return poses(values if env_ids is None else values[array(env_ids)], to_matrix)

    def set_joint_drive(
        self,
        stiffness: Any = None,
        damping: Any = None,
        max_effort: Any = None,
        max_velocity: Any = None,
        friction: Any = None,
        armature: Any = None,
        drive_type: DriveType | None = None,
        joint_ids: Any = None,
        env_ids: Any = None,
    ) -> None:
        """Changes drives. Quantities that are not given stay, the drive type too."""
        chosen = (ids(joint_ids), ids(env_ids))
        if drive_type is not None:
            self.native.set_drive_type(drive_type, *chosen)
        changes = [
            (stiffness, self.native.set_stiffness),
            (damping, self.native.set_damping),
            (max_effort, self.native.set_qf_limits),
            (max_velocity, self.native.set_qvel_limits),
            (friction, self.native.set_friction),
            (armature, self.native.set_armature),
        ]
        for values, write in changes:
            if values is not None:
                write(array(values), *chosen)

    def reset(self, env_ids: Any = None) -> None:
        """Returns to the initial pose, positions and targets; velocities and their targets, and efforts, become 0."""
        chosen = slice(None) if env_ids is None else array(env_ids)
        start = self.native.default_qpos[chosen]
        self.native.write_joint_state(start, np.zeros_like(start), None, ids(env_ids))
        self.native.set_qpos_target(start, None, ids(env_ids))
        self.native.set_qvel_target(np.zeros_like(start), None, ids(env_ids))
        self.native.set_qf_target(np.zeros_like(start), None, ids(env_ids))
        if not self.cfg.fix_base:
            self.native.write_root_state(self.native.default_root_state[chosen], ids(env_ids))


class Robot(Articulation):
    """A robot with control parts."""

    @property
    def control_parts(self) -> list[str]:
        return self.native.control_parts

    def get_joint_ids(self, name: str | None = None, remove_mimic: bool = False) -> list[int]:
        """Indices of the joints of a control part, or of all joints. ``remove_mimic`` leaves out mimic joints."""
        return self.native.active_joint_ids(name) if remove_mimic else self.native.joint_ids(name)

    def _chosen(self, joint_ids: Any, name: str | None) -> Any:
        return joint_ids if name is None else self.native.joint_ids(name)

    def set_qpos(
        self, qpos: Any, joint_ids: Any = None, env_ids: Any = None, target: bool = True, name: str | None = None
    ) -> None:
        super().set_qpos(qpos, self._chosen(joint_ids, name), env_ids, target)

    def set_qvel(
        self, qvel: Any, joint_ids: Any = None, env_ids: Any = None, target: bool = True, name: str | None = None
    ) -> None:
        super().set_qvel(qvel, self._chosen(joint_ids, name), env_ids, target)

    def set_qf(self, qf: Any, joint_ids: Any = None, env_ids: Any = None, name: str | None = None) -> None:
        super().set_qf(qf, self._chosen(joint_ids, name), env_ids)

    # As in EmbodiChain, the argument comes before that of Articulation.
    def get_qpos(self, name: str | None = None, target: bool = False) -> Any:  # type: ignore[override]
        values = self.native.qpos_target if target else self.native.qpos
        return tensor(values if name is None else values[:, self.native.joint_ids(name)])

    # As in EmbodiChain, the argument comes before that of Articulation.
    def get_qvel(self, name: str | None = None, target: bool = False) -> Any:  # type: ignore[override]
        values = self.native.qvel_target if target else self.native.qvel
        return tensor(values if name is None else values[:, self.native.joint_ids(name)])

    def get_qf(self, name: str | None = None) -> Any:
        values = self.native.qf
        return tensor(values if name is None else values[:, self.native.joint_ids(name)])

    def compute_fk(self, qpos: Any, name: str, env_ids: Any = None, to_matrix: bool = False) -> Any:
        """Poses of the end of a control part, in the environment."""
        return poses(self.native.compute_fk(np.atleast_2d(array(qpos)), name, env_ids=ids(env_ids)), to_matrix)

    def compute_ik(self, pose: Any, joint_seed: Any = None, name: str = "arm", env_ids: Any = None) -> Any:
        """Joint positions for poses of the end of a control part: success (n,) and positions (n, joints)."""
        start = None if joint_seed is None else np.atleast_2d(array(joint_seed))
        found = self.native.compute_ik(rows(array(pose)), name, initial=start, env_ids=ids(env_ids))
        return tensor(found.success), tensor(found.qpos)


    def compute_batch_fk(self, qpos: Any, name: str, env_ids: Any = None, to_matrix: bool = False) -> Any:
        """Poses of the end of a control part for several positions in each environment, shape (n, batch, joints)."""
        qpos = np.asarray(array(qpos), dtype=float)
        columns = [self.native.compute_fk(qpos[:, at], name, env_ids=ids(env_ids)) for at in range(qpos.shape[1])]
        return poses(np.stack(columns, axis=1), to_matrix)

    def compute_batch_ik(self, pose: Any, joint_seed: Any = None, name: str = "arm", env_ids: Any = None) -> Any:
        """Joint positions for several poses in each environment, shape (n, batch, 7) or (n, batch, 4, 4): success (n, batch)
        and positions (n, batch, joints)."""
        pose = np.asarray(array(pose), dtype=float)
        seeds = None if joint_seed is None else np.asarray(array(joint_seed), dtype=float)
        found = [
            self.native.compute_ik(
                rows(pose[:, at]), name, initial=None if seeds is None else seeds[:, at], env_ids=ids(env_ids)
            )
            for at in range(pose.shape[1])
        ]
        return tuple(tensor(np.stack([getattr(one, part) for one in found], axis=1)) for part in ("success", "qpos"))


class RigidObjectData(Layer):
    """State of a rigid object."""

    def __init__(self, native: ks.RigidObject | ks.RigidObjectGroup) -> None:
        self._native = native

    @property
    def pose(self) -> Any:
        return tensor(self._native.pose)

    @property
    def vel(self) -> Any:
        return tensor(self._native.velocity)

    @property
    def lin_vel(self) -> Any:
        return tensor(self._native.velocity[:, :3])

    @property
    def ang_vel(self) -> Any:
        return tensor(self._native.velocity[:, 3:])


class RigidObject(Layer):
    """A rigid object. ``native`` is the object of this package."""

    def __init__(self, manager: SimulationManager, native: ks.RigidObject, cfg: RigidObjectCfg) -> None:
        self.manager = manager
        self.native = native
        self.cfg = cfg
        self.body_data = RigidObjectData(native)

    @property
    def uid(self) -> str:
        return self.native.uid

    def get_local_pose(self, to_matrix: bool = False) -> Any:
        return poses(self.native.pose, to_matrix)

    def set_local_pose(self, pose: Any, env_ids: Any = None) -> None:
        self.native.write_pose(rows(array(pose)), ids(env_ids))

    def set_velocity(self, lin_vel: Any = None, ang_vel: Any = None, env_ids: Any = None) -> None:
        velocity = self.native.velocity
        velocity = velocity if env_ids is None else velocity[array(env_ids)]
        for values, columns in ((lin_vel, slice(0, 3)), (ang_vel, slice(3, 6))):
            if values is not None:
                velocity[:, columns] = array(values)
        self.native.write_velocity(velocity, ids(env_ids))

    def add_force_torque(self, force: Any = None, torque: Any = None, env_ids: Any = None) -> None:
        count = self.manager.num_envs if env_ids is None else len(array(env_ids))
        none = np.zeros((count, 3))
        force, torque = (none if values is None else array(values) for values in (force, torque))
        self.native.set_external_wrench(force, torque, env_ids=ids(env_ids))

    def get_mass(self) -> Any:
        return tensor(self.native.mass)

    def set_mass(self, mass: Any, env_ids: Any = None) -> None:
        self.native.set_mass(array(mass), ids(env_ids))

    def get_friction(self) -> Any:
        """Sliding friction, shape (n,)."""
        return tensor(self.native.friction[:, 0])

    def set_friction(self, friction: Any, env_ids: Any = None) -> None:
        """Sets the sliding friction, shape (n,)."""
        values = self.native.friction if env_ids is None else self.native.friction[array(env_ids)]
        values[:, 0] = array(friction)
        self.native.set_friction(values, ids(env_ids))

    def get_inertia(self) -> Any:
        """Principal moments of inertia, shape (n, 3)."""
        return tensor(self.native.inertia)

    def set_inertia(self, inertia: Any, env_ids: Any = None) -> None:
        self.native.set_inertia(array(inertia), ids(env_ids))

    @property
    def body_state(self) -> Any:
        """Pose and velocity, shape (n, 13)."""
        return tensor(np.concatenate([self.native.pose, self.native.velocity], axis=1))

    @property
    def is_static(self) -> bool:
        return self.cfg.body_type == "static"

    @property
    def is_non_dynamic(self) -> bool:
        return self.cfg.body_type != "dynamic"

    def clear_dynamics(self, env_ids: Any = None) -> None:
        """Sets velocities, external forces and torques to 0."""
        count = self.manager.num_envs if env_ids is None else len(array(env_ids))
        if not self.is_non_dynamic:
            self.native.write_velocity(np.zeros((count, 6)), ids(env_ids))
            self.add_force_torque(env_ids=env_ids)

    def get_user_ids(self) -> Any:
        """Value in the mask channel, the same in every environment."""
        return tensor(np.full(self.manager.num_envs, self.native.mask_id, dtype=np.int32))
