"""Articulations and other assets of Isaac. Poses of data and writers are in the world frame, in which the environments stand
side by side; velocities of the root are those of its center of mass."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._sim import Robot
from ...errors import ConfigError
from .._poses import to_world
from .._tensors import array, random_integers, tensor
from ..configclass import configclass
from .actuators import DCMotorCfg, DelayedPDActuatorCfg, IdealPDActuatorCfg
from .asset_base import AssetBaseCfg, RootAsset, RootData, ids_of
from .names import resolve
from .rigid_object import RigidObject, RigidObjectCfg

__all__ = ["Articulation", "ArticulationCfg", "AssetBaseCfg", "RigidObject", "RigidObjectCfg"]


@configclass
class InitialStateCfg:
    """Initial state: position [m], rotation w x y z, joint positions and velocities by pattern."""

    pos: Any = (0.0, 0.0, 0.0)
    rot: Any = (1.0, 0.0, 0.0, 0.0)
    lin_vel: Any = (0.0, 0.0, 0.0)
    ang_vel: Any = (0.0, 0.0, 0.0)
    joint_pos: Any = {".*": 0.0}
    joint_vel: Any = {".*": 0.0}


@configclass
class ArticulationCfg(AssetBaseCfg):
    """A robot: ``spawn`` names its file, ``actuators`` its drives. Joints without an actuator are passive."""

    InitialStateCfg = InitialStateCfg

    init_state: Any = InitialStateCfg()
    actuators: Any = {}
    soft_joint_pos_limit_factor: float = 1.0


# Types of joints that move.
MOVING = ("revolute", "continuous", "prismatic")


def joints_of_file(path: str) -> list[str]:
    """Names of the joints of a URDF file that move."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ConfigError(f"{path}: {error}") from None
    return [joint.get("name", "") for joint in root.iter("joint") if joint.get("type") in MOVING]


def matching(patterns: Any, names: Sequence[str], owner: str) -> list[str]:
    """The names that a pattern or a list of patterns matches as a whole. Each pattern must match."""
    found: list[str] = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        matched = [name for name in names if re.fullmatch(pattern, name)]
        if not matched:
            raise ConfigError(f"{owner}: no joint matches {pattern!r}; joints: {', '.join(names)}")
        found += [name for name in matched if name not in found]
    return found


def joint_values(values: Any, names: Sequence[str], owner: str) -> dict[str, float]:
    """Numbers by joint, from one number or a dict of numbers by pattern."""
    if not isinstance(values, dict):
        return {name: float(values) for name in names}
    numbers: dict[str, float] = {}
    for pattern, value in values.items():
        numbers |= {name: float(value) for name in matching(pattern, names, owner)}
    return numbers


def drive_fields(cfg: ArticulationCfg) -> dict[str, Any]:
    """Drives of all joints. A joint without an actuator, or without a gain, has the gain 0."""
    joints = joints_of_file(cfg.spawn.asset_path)
    names = {
        "stiffness": "stiffness",
        "damping": "damping",
        "effort_limit": "max_effort",
        "velocity_limit": "max_velocity",
        "armature": "armature",
        "friction": "friction",
    }
    zero = dict.fromkeys(joints, 0.0)
    drive: dict[str, Any] = {"stiffness": dict(zero), "damping": dict(zero)}
    for group, actuator in cfg.actuators.items():
        owner = f"actuators[{group!r}]"
        own = matching(actuator.joint_names_expr, joints, owner)
        for field, name in names.items():
            values = getattr(actuator, field)
            if values is not None:
                drive.setdefault(name, {}).update(joint_values(values, own, f"{owner}.{field}"))
        model = actuator_model(actuator, owner)
        if model is not None:
            drive.setdefault("actuators", {}).update(dict.fromkeys(own, model))
    # Keys of this package are patterns.
    return {field: {re.escape(name): value for name, value in values.items()} for field, values in drive.items()}


def actuator_model(cfg: Any, owner: str) -> dict[str, Any] | None:
    """Model of an explicit drive of this package; None for an implicit one."""
    if isinstance(cfg, DelayedPDActuatorCfg):
        low, high = int(cfg.min_delay), int(cfg.max_delay)
        if not 0 <= low <= high:
            raise ConfigError(f"{owner}: min_delay is {low} and max_delay is {high}; expected 0 <= min_delay <= max_delay")
        return {"delayed_pd": {"delay": low, "max_delay": high}}
    if isinstance(cfg, DCMotorCfg):
        return {"dc_motor": {"saturation_effort": float(cfg.saturation_effort)}}
    return {"ideal_pd": {}} if isinstance(cfg, IdealPDActuatorCfg) else None


def articulation_fields(uid: str, cfg: ArticulationCfg) -> dict[str, Any]:
    """Fields of this package's robot."""
    start = cfg.init_state
    # The initial position of a joint that no pattern names is 0 here, too.
    joint_pos = {pattern: float(value) for pattern, value in start.joint_pos.items() if pattern != ".*" or value != 0}
    return {
        "uid": uid,
        "urdf": cfg.spawn.asset_path,
        "fix_base": cfg.spawn.fix_base,
        "self_collision": cfg.spawn.self_collisions,
        "init_pose": [float(x) for x in (*start.pos, *start.rot)],
        "init_qpos": joint_pos,
        "drive": drive_fields(cfg),
        "soft_limit_factor": float(cfg.soft_joint_pos_limit_factor),
    }


class ArticulationData(RootData):
    """State of an articulation as tensors."""

    def __init__(self, native: Robot, origins: Any, cfg: ArticulationCfg) -> None:
        self._native = native
        self._origins = origins
        start = cfg.init_state
        names = native.joint_names
        velocities = joint_values(start.joint_vel, names, "init_state.joint_vel")
        rows = native.default_qvel
        rows[:] = [velocities.get(name, 0.0) for name in names]
        states = native.default_root_state
        states[:, 7:] = [*start.lin_vel, *start.ang_vel]
        self.default_joint_pos = tensor(native.default_qpos)
        self.default_joint_vel = tensor(rows)
        self.default_root_state = tensor(states)

    @property
    def joint_names(self) -> list[str]:
        return self._native.joint_names

    @property
    def body_names(self) -> list[str]:
        return self._native.link_names

    @property
    def joint_pos(self) -> Any:
        return tensor(self._native.qpos)

    @property
    def joint_vel(self) -> Any:
        return tensor(self._native.qvel)

    @property
    def joint_acc(self) -> Any:
        return tensor(self._native.qacc)

    @property
    def joint_pos_target(self) -> Any:
        return tensor(self._native.qpos_target)

    @property
    def joint_vel_target(self) -> Any:
        return tensor(self._native.qvel_target)

    @property
    def applied_torque(self) -> Any:
        return tensor(self._native.qf)

    @property
    def joint_effort_target(self) -> Any:
        return tensor(self._native.qf_target)

    @property
    def joint_stiffness(self) -> Any:
        return tensor(self._native.stiffness)

    @property
    def joint_damping(self) -> Any:
        return tensor(self._native.damping)

    @property
    def joint_armature(self) -> Any:
        return tensor(self._native.armature)

    @property
    def joint_friction(self) -> Any:
        return tensor(self._native.friction)

    @property
    def joint_pos_limits(self) -> Any:
        """Lower and upper limits, shape (N, J, 2)."""
        return tensor(self._native.qpos_limits)

    @property
    def joint_limits(self) -> Any:
        return self.joint_pos_limits

    @property
    def joint_vel_limits(self) -> Any:
        return tensor(self._native.qvel_limits)

    @property
    def joint_effort_limits(self) -> Any:
        return tensor(self._native.qf_limits)

    @property
    def soft_joint_pos_limits(self) -> Any:
        return tensor(self._native.soft_qpos_limits)

    @property
    def soft_joint_vel_limits(self) -> Any:
        return self.joint_vel_limits

    @property
    def root_state_w(self) -> Any:
        states = np.concatenate([self._native.root_pose, self._native.root_com_velocity], axis=1)
        return tensor(to_world(states, self._origins))

    @property
    def root_link_state_w(self) -> Any:
        """Pose of the root link and velocity of its origin, shape (N, 13)."""
        return tensor(to_world(self._native.root_state, self._origins))

    @property
    def root_link_pose_w(self) -> Any:
        return self.root_link_state_w[:, :7]

    @property
    def root_link_pos_w(self) -> Any:
        return self.root_link_state_w[:, :3]

    @property
    def root_link_quat_w(self) -> Any:
        return self.root_link_state_w[:, 3:7]

    @property
    def root_link_vel_w(self) -> Any:
        return self.root_link_state_w[:, 7:13]

    @property
    def root_com_pos_w(self) -> Any:
        """Center of mass of the root link, shape (N, 3)."""
        return tensor(to_world(self._native.root_com_position, self._origins))

    @property
    def root_com_vel_w(self) -> Any:
        return self.root_vel_w

    @property
    def root_ang_vel_b(self) -> Any:
        return tensor(self._native.root_ang_vel_b)

    @property
    def projected_gravity_b(self) -> Any:
        return tensor(self._native.projected_gravity_b)

    @property
    def heading_w(self) -> Any:
        return tensor(self._native.root_heading)

    @property
    def body_state_w(self) -> Any:
        states = np.concatenate([self._native.link_poses, self._native.link_velocities], axis=-1)
        return tensor(to_world(states, self._origins))


class Articulation(RootAsset):
    """A robot. ``native`` is the object of this package. Targets take effect in ``write_data_to_sim``."""

    def __init__(self, native: Robot, origins: Any, cfg: ArticulationCfg) -> None:
        super().__init__(origins)
        self.native = native
        self.cfg = cfg
        self.data = ArticulationData(native, origins, cfg)
        self._pending: dict[str, NDArray[Any]] = {}

    @property
    def num_joints(self) -> int:
        return self.native.dof

    @property
    def num_bodies(self) -> int:
        return len(self.native.link_names)

    @property
    def joint_names(self) -> list[str]:
        return self.native.joint_names

    @property
    def body_names(self) -> list[str]:
        return self.native.link_names

    @property
    def is_fixed_base(self) -> bool:
        return bool(self.cfg.spawn.fix_base)

    def find_joints(
        self, name_keys: Any, joint_subset: Sequence[str] | None = None, preserve_order: bool = False
    ) -> tuple[list[int], list[str]]:
        """Indices and names of the joints that match a pattern or a list of patterns. As in Isaac, indices are those in
        ``joint_subset``, if it is given."""
        return resolve(name_keys, self.joint_names if joint_subset is None else joint_subset, preserve_order, "joint")

    def find_bodies(self, name_keys: Any, preserve_order: bool = False) -> tuple[list[int], list[str]]:
        return resolve(name_keys, self.body_names, preserve_order, "body")

    def _write_root_pose(self, poses: Any, env_ids: Any) -> None:
        self.native.write_root_pose(poses, env_ids)

    def _write_root_velocity(self, velocities: Any, env_ids: Any) -> None:
        self.native.write_root_com_velocity(velocities, env_ids)

    def write_joint_state_to_sim(self, position: Any, velocity: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.native.write_joint_state(array(position), array(velocity), ids_of(joint_ids, self.num_joints), ids_of(env_ids, self.num_instances))

    def write_joint_position_to_sim(self, position: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("write_qpos", position, joint_ids, env_ids)

    def write_joint_velocity_to_sim(self, velocity: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("write_qvel", velocity, joint_ids, env_ids)

    def write_joint_stiffness_to_sim(self, stiffness: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("set_stiffness", stiffness, joint_ids, env_ids)

    def write_joint_damping_to_sim(self, damping: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("set_damping", damping, joint_ids, env_ids)

    def write_joint_effort_limit_to_sim(self, limits: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("set_qf_limits", limits, joint_ids, env_ids)

    def write_joint_velocity_limit_to_sim(self, limits: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("set_qvel_limits", limits, joint_ids, env_ids)

    def write_joint_armature_to_sim(self, armature: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("set_armature", armature, joint_ids, env_ids)

    def write_joint_friction_to_sim(self, joint_friction: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._write("set_friction", joint_friction, joint_ids, env_ids)

    def write_joint_position_limit_to_sim(self, limits: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        """Lower and upper limits, shape (n, joints, 2)."""
        self._write("set_qpos_limits", limits, joint_ids, env_ids)

    write_joint_limits_to_sim = write_joint_position_limit_to_sim

    def _write(self, writer: str, values: Any, joint_ids: Any, env_ids: Any) -> None:
        """Calls a writer of this package at once. A number stands for all joints."""
        values, joints = array(values), ids_of(joint_ids, self.num_joints)
        if values.ndim == 0:
            values = np.full((1, self.num_joints if joints is None else np.atleast_1d(joints).size), float(values))
        getattr(self.native, writer)(values, joints, ids_of(env_ids, self.num_instances))

    def set_joint_position_target(self, target: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._set("set_qpos_target", "qpos_target", target, joint_ids, env_ids)

    def set_joint_velocity_target(self, target: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._set("set_qvel_target", "qvel_target", target, joint_ids, env_ids)

    def set_joint_effort_target(self, target: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self._set("set_qf_target", "qf_target", target, joint_ids, env_ids)

    def _set(self, writer: str, reader: str, target: Any, joint_ids: Any, env_ids: Any) -> None:
        """Changes the buffer of targets."""
        values = np.array(array(target), dtype=float)
        joint_ids, env_ids = ids_of(joint_ids, self.num_joints), ids_of(env_ids, self.num_instances)
        if joint_ids is None and env_ids is None:
            self._pending[writer] = values
            return
        current = self._pending.get(writer)
        current = getattr(self.native, reader) if current is None else current
        rows = np.arange(self.num_instances) if env_ids is None else np.atleast_1d(env_ids)
        columns = np.arange(self.num_joints) if joint_ids is None else np.atleast_1d(joint_ids)
        current[np.ix_(rows, columns)] = values
        self._pending[writer] = current

    def set_external_force_and_torque(self, forces: Any, torques: Any, body_ids: Any = None, env_ids: Any = None) -> None:
        """Forces and torques on links, in the axes of the links, until they are set again."""
        links = ids_of(body_ids, self.num_bodies)
        self.native.set_external_wrench(array(forces), array(torques), "link", links, ids_of(env_ids, self.num_instances))

    def write_data_to_sim(self) -> None:
        """Writes the targets to the simulation."""
        for writer, values in self._pending.items():
            getattr(self.native, writer)(values)
        self._pending.clear()

    def reset(self, env_ids: Any = None) -> None:
        """Removes the external forces and torques, and draws the delays of delayed actuators. ``InteractiveScene.reset`` clears
        all buffers."""
        chosen = ids_of(env_ids, self.num_instances)
        self.draw_delays(chosen)
        none = np.zeros((self.num_instances if chosen is None else np.atleast_1d(chosen).size, self.num_bodies, 3))
        if len(none):
            self.native.set_external_wrench(none, none, "link", None, chosen)

    def draw_delays(self, env_ids: Any = None) -> None:
        """Draws a delay for each environment and delayed actuator, as torch or NumPy is seeded."""
        rows = self.num_instances if env_ids is None else np.atleast_1d(env_ids).size
        for actuator in self.cfg.actuators.values():
            if isinstance(actuator, DelayedPDActuatorCfg) and rows:
                ids, _ = self.find_joints(actuator.joint_names_expr)
                steps = random_integers(int(actuator.min_delay), int(actuator.max_delay), rows)
                self.native.set_delay(np.repeat(steps[:, None], len(ids), axis=1), ids, env_ids)

    def write_start(self) -> None:
        """Writes the initial velocities, if there are any, and draws delays."""
        self.draw_delays()
        start = self.cfg.init_state
        if np.asarray(self.data.default_joint_vel).any():
            self.native.write_qvel(np.asarray(self.data.default_joint_vel, dtype=float))
        if any(start.lin_vel) or any(start.ang_vel):
            self.write_root_velocity_to_sim(np.asarray(self.data.default_root_state)[:, 7:])
