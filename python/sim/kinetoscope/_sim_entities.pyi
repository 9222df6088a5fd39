"""Types of handles of the extension module: robots, objects, sensors. ``_sim.pyi`` has the module."""

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, Self, TypeAlias, TypeVar, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .cfg import DriveType, IkCfg

_Array: TypeAlias = NDArray[Any]
_Envs: TypeAlias = int | Sequence[int] | Sequence[bool] | NDArray[Any] | None
_Joints: TypeAlias = str | Sequence[str] | int | Sequence[int] | NDArray[Any] | None
_Patterns: TypeAlias = str | Sequence[str]
_Numbers: TypeAlias = Sequence[float] | NDArray[Any]
_Fields: TypeAlias = Mapping[str, Any]
_Axes: TypeAlias = Literal["ros", "opengl", "world"]
_Level: TypeAlias = Literal["instance", "link", "semantic"]
_Side: TypeAlias = Literal["left", "right"]
_Out = TypeVar("_Out", bound=_Array)


@final
class IkResult:
    """Result of inverse kinematics: one entry for each environment of ``Robot.compute_ik``, or for each target of
    ``KinematicChain.compute_ik``.
    """

    @property
    def iterations(self) -> _Array:
        """Solver iterations, shape (N,)."""
    @property
    def position_error(self) -> _Array:
        """Distance to the target [m], shape (N,)."""
    @property
    def qpos(self) -> _Array:
        """Joint positions [rad or m], shape (N, joints); the best ones found where ``success`` is false."""
    @property
    def rotation_error(self) -> _Array:
        """Angle to the target [rad], shape (N,)."""
    @property
    def seed(self) -> _Array:
        """Index of the start that led to the result, shape (N,); 0 is the start from the initial positions."""
    @property
    def success(self) -> _Array:
        """True where the target is reached, shape (N,)."""
    def __repr__(self) -> str: ...

@final
class MjcfPart:
    """An attached MJCF file in all environments. Arrays are float64 with the environments on the first axis."""

    @property
    def actuator_force(self) -> _Array:
        """Forces of the actuators, shape (num_envs, actuators)."""
    @property
    def actuator_names(self) -> list[str]:
        """Names of the actuators."""
    @property
    def body_names(self) -> list[str]:
        """Names of the bodies."""
    @property
    def body_poses(self) -> _Array:
        """Poses of all bodies in the environment, in the order of ``body_names``, shape (num_envs, bodies, 7)."""
    @property
    def ctrl(self) -> _Array:
        """Controls of the actuators, shape (num_envs, actuators)."""
    @property
    def joint_names(self) -> list[str]:
        """Names of the joints."""
    @property
    def qpos(self) -> _Array:
        """Positions of all joints, shape (num_envs, nq)."""
    @property
    def qvel(self) -> _Array:
        """Velocities of all joints, shape (num_envs, nv)."""
    @property
    def sensor_names(self) -> list[str]:
        """Names of the sensors of the file."""
    @property
    def site_names(self) -> list[str]:
        """Names of the sites."""
    @property
    def total_mass(self) -> float:
        """Mass of all bodies [kg]."""
    @property
    def uid(self) -> str:
        """Name of the attached file."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def actuator_ids(self, /, patterns: _Patterns) -> list[int]:
        """Indices of the actuators whose names match a pattern, or one of several."""
    def body_pose(self, /, body: str) -> _Array:
        """Poses of a body in the environment, shape (num_envs, 7)."""
    def qpos_columns(self, /, patterns: _Patterns) -> list[tuple[int, int]]:
        """Columns of ``qpos`` of the joints that match a pattern, or one of several, as (first, end) of each joint."""
    def qvel_columns(self, /, patterns: _Patterns) -> list[tuple[int, int]]:
        """Columns of ``qvel`` of the joints that match a pattern, or one of several, as (first, end) of each joint."""
    def set_ctrl(self, /, values: ArrayLike, actuators: _Envs = None, env_ids: _Envs = None) -> None:
        """Sets controls of actuators, shape (num_envs, actuators)."""
    def site_pose(self, /, site: str) -> _Array:
        """Poses of a site in the environment, shape (num_envs, 7)."""
    def write_mocap_pose(self, /, body: str, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes poses of a mocap body, rows x y z qw qx qy qz."""
    def write_qpos(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes positions of all joints, shape (num_envs, nq)."""
    def write_qvel(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes velocities of all joints, shape (num_envs, nv)."""

@final
class RigidObject:
    """A rigid object in all environments. Arrays are float64 with the environments on the first axis."""

    @property
    def center_of_mass(self) -> _Array:
        """Centers of mass in the frame of the object [m], shape (num_envs, 3)."""
    @property
    def damping(self) -> _Array:
        """Linear [N s/m] and angular damping [N m s/rad], shape (num_envs, 2)."""
    @property
    def external_wrench(self) -> _Array:
        """External force [N] and torque [N m], world axes, shape (num_envs, 6)."""
    @property
    def friction(self) -> _Array:
        """Friction coefficients: sliding, torsional [m], rolling [m], shape (num_envs, 3)."""
    @property
    def inertia(self) -> _Array:
        """Principal moments of inertia [kg m²], shape (num_envs, 3)."""
    @property
    def mask_id(self) -> int:
        """Value of the object in the mask channel of cameras."""
    @property
    def mass(self) -> _Array:
        """Masses [kg], shape (num_envs,)."""
    @property
    def nominal_mass(self) -> float:
        """Mass of the configuration [kg]."""
    @property
    def pose(self) -> _Array:
        """Poses in the environment, rows x y z qw qx qy qz, shape (num_envs, 7)."""
    @property
    def uid(self) -> str:
        """Name of the object."""
    @property
    def velocity(self) -> _Array:
        """Linear and angular velocities, world axes, shape (num_envs, 6)."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def set_center_of_mass(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets centers of mass [m], shape (num_envs, 3)."""
    def set_damping(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets linear and angular damping, shape (num_envs, 2)."""
    def set_external_wrench(self, /, force: ArrayLike, torque: ArrayLike, frame: Literal["world", "link"] = "world", env_ids: _Envs = None) -> None:
        """Sets a force [N] and a torque [N m] that act until they are set again or the environment is reset, shape
        (num_envs, 3). ``frame`` is ``"world"`` or ``"link"`` (the axes of the object).
        """
    def set_friction(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets friction coefficients, shape (num_envs, 3)."""
    def set_inertia(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets principal moments of inertia [kg m²], shape (num_envs, 3)."""
    def set_mass(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets masses [kg], shape (num_envs,)."""
    def write_pose(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes poses, rows x y z qw qx qy qz."""
    def write_velocity(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes linear and angular velocities, shape (num_envs, 6)."""

@final
class RigidObjectGroup:
    """A group of rigid objects in all environments."""

    @property
    def names(self) -> list[str]:
        """Names of the objects, in the order of the arrays."""
    @property
    def pose(self) -> _Array:
        """Poses in the environment, shape (num_envs, objects, 7)."""
    @property
    def uid(self) -> str:
        """Name of the group."""
    @property
    def velocity(self) -> _Array:
        """Linear and angular velocities, shape (num_envs, objects, 6)."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __len__(self) -> int: ...
    def __repr__(self) -> str: ...
    def write_pose(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes poses, shape (num_envs, objects, 7)."""
    def write_velocity(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes velocities, shape (num_envs, objects, 6)."""

@final
class RenderProgress:
    """Progress of the path tracing of a camera, made by ``Sensor.progress``. Another thread can watch and cancel a
    read of the camera: the values do not wait for the simulation.
    """

    @property
    def elapsed(self) -> float | None:
        """Time since the start of the path tracing [s], also after its end; None before the first."""
    @property
    def fraction(self) -> float | None:
        """Finished fraction, 0 to 1; None without any paths."""
    @property
    def is_canceled(self) -> bool:
        """True after ``cancel``, until ``resume``."""
    @property
    def rays(self) -> int:
        """Number of rays, for the paths themselves and for shadows."""
    @property
    def remaining(self) -> float | None:
        """Estimated time left [s], at the mean speed so far; None before the first path."""
    @property
    def samples(self) -> int:
        """Number of paths of the images that are traced so far."""
    @property
    def total(self) -> int:
        """Number of paths of the images: pixels times samples."""
    def __repr__(self) -> str: ...
    def cancel(self, /) -> None:
        """Cancels the current path tracing, whose read raises ``SensorError``, and any that starts before
        ``resume``.
        """
    def resume(self, /) -> None:
        """Allows path tracing again. The camera renders canceled images when they are read again."""

@final
class Robot:
    """A robot or a passive articulation in all environments.

    Arrays have the environments on the first axis, and are float64 unless another type is given. Methods that write
    take one row for each of ``env_ids`` (all environments if omitted), or one row for all of them, and one column
    for each of ``joint_ids``: indices, the name of a control part, or a list of patterns of joint names.
    """

    @property
    def active_dof(self) -> int:
        """Number of movable joints that follow no other joint."""
    @property
    def active_joint_names(self) -> list[str]:
        """Names of the movable joints that follow no other joint."""
    @property
    def armature(self) -> _Array:
        """Rotor inertia of the joints [kg m² or kg], shape (num_envs, dof)."""
    @property
    def control_parts(self) -> list[str]:
        """Names of the control parts."""
    @property
    def damping(self) -> _Array:
        """Damping of the drives, shape (num_envs, dof)."""
    @property
    def default_qpos(self) -> _Array:
        """Initial joint positions [rad or m], shape (num_envs, dof)."""
    @property
    def default_qvel(self) -> _Array:
        """Initial joint velocities [rad/s or m/s], shape (num_envs, dof)."""
    @property
    def default_root_pose(self) -> _Array:
        """Initial poses of the root link, rows x y z qw qx qy qz, shape (num_envs, 7)."""
    @property
    def default_root_state(self) -> _Array:
        """Initial poses and velocities of the root link, shape (num_envs, 13)."""
    @property
    def delay(self) -> _Array:
        """Delays of the drives [steps], uint32, shape (num_envs, dof)."""
    @property
    def description(self) -> dict[str, list[dict[str, Any]]]:
        """Structure of the robot after merging its files: a dict of ``links`` (dicts with ``name``, ``mass`` [kg],
        None without an inertia) and ``joints``, fixed ones included (dicts with ``name``, ``type`` as in URDF,
        ``parent`` and ``child``, names of links, and ``axis`` in the frame of the joint).
        """
    @property
    def dof(self) -> int:
        """Number of movable joints, the columns of joint arrays."""
    @property
    def drive_types(self) -> list[list[str]]:
        """Meaning of the gains of each drive, rows of texts, shape (num_envs, dof)."""
    @property
    def driven_joint_ids(self) -> list[int]:
        """Indices of the joints with a drive, for which ``set_qpos_target`` sets targets. Passive joints and joints
        that follow another have none. A drive that ``set_drive_type`` switched to ``"none"`` counts.
        """
    @property
    def external_wrenches(self) -> _Array:
        """External forces and torques on the links, shape (num_envs, links, 6)."""
    @property
    def fixed_link_ids(self) -> list[int]:
        """Indices of the links that are fixed in the world: the base is fixed, and no joint moves the link. They do
        not collide with the ground.
        """
    @property
    def friction(self) -> _Array:
        """Dry friction of the joints [N m or N], shape (num_envs, dof)."""
    @property
    def gravity_compensation(self) -> _Array:
        """True where gravity of a link is compensated, bool, shape (num_envs, links)."""
    @property
    def joint_damping(self) -> _Array:
        """Passive damping of the joints, shape (num_envs, dof)."""
    @property
    def joint_names(self) -> list[str]:
        """Names of the movable joints, in the order of the columns."""
    @property
    def kind(self) -> str:
        """``"robot"`` or ``"articulation"``."""
    @property
    def link_lowest_heights(self) -> _Array:
        """Height of the lowest collision point of each link [m], shape (num_envs, links)."""
    @property
    def link_names(self) -> list[str]:
        """Names of all links."""
    @property
    def link_poses(self) -> _Array:
        """Poses of all links in the environment, shape (num_envs, links, 7)."""
    @property
    def link_velocities(self) -> _Array:
        """Velocities of all links, shape (num_envs, links, 6)."""
    @property
    def lowest_heights(self) -> _Array:
        """Height of the lowest collision point of the robot [m], shape (num_envs,)."""
    @property
    def mimic_drivers(self) -> list[tuple[int, float, float]]:
        """For each joint: the joint that drives it, the multiplier and the offset. An independent joint drives
        itself.
        """
    @property
    def mimic_joint_ids(self) -> list[int]:
        """Indices of the joints that follow another joint."""
    @property
    def projected_gravity_b(self) -> _Array:
        """Direction of gravity in the axes of the root link, shape (num_envs, 3)."""
    @property
    def qacc(self) -> _Array:
        """Joint accelerations [rad/s² or m/s²], shape (num_envs, dof)."""
    @property
    def qf(self) -> _Array:
        """Joint efforts of the drives in the last step [N m or N], shape (num_envs, dof)."""
    @property
    def qf_limits(self) -> _Array:
        """Effort limits [N m or N], shape (num_envs, dof)."""
    @property
    def qf_target(self) -> _Array:
        """Feed-forward efforts [N m or N], shape (num_envs, dof)."""
    @property
    def qpos(self) -> _Array:
        """Joint positions [rad or m], shape (num_envs, dof)."""
    @property
    def qpos_limits(self) -> _Array:
        """Position limits [rad or m], shape (num_envs, dof, 2)."""
    @property
    def qpos_target(self) -> _Array:
        """Position targets [rad or m], shape (num_envs, dof)."""
    @property
    def qvel(self) -> _Array:
        """Joint velocities [rad/s or m/s], shape (num_envs, dof)."""
    @property
    def qvel_limits(self) -> _Array:
        """Velocity limits [rad/s or m/s], shape (num_envs, dof)."""
    @property
    def qvel_target(self) -> _Array:
        """Velocity targets [rad/s or m/s], shape (num_envs, dof)."""
    @property
    def root_ang_vel_b(self) -> _Array:
        """Angular velocity of the root link in its own axes [rad/s], shape (num_envs, 3)."""
    @property
    def root_com_position(self) -> _Array:
        """Positions of the center of mass of the root link [m], shape (num_envs, 3)."""
    @property
    def root_com_velocity(self) -> _Array:
        """Velocities of the center of mass of the root link, shape (num_envs, 6)."""
    @property
    def root_heading(self) -> _Array:
        """Heading of the root link [rad], shape (num_envs,)."""
    @property
    def root_lin_vel_b(self) -> _Array:
        """Linear velocity of the root link in its own axes [m/s], shape (num_envs, 3)."""
    @property
    def root_pose(self) -> _Array:
        """Poses of the root link in the environment, rows x y z qw qx qy qz, shape (num_envs, 7)."""
    @property
    def root_state(self) -> _Array:
        """Poses and velocities of the root link, shape (num_envs, 13)."""
    @property
    def root_velocity(self) -> _Array:
        """Linear and angular velocities of the root link, world axes, shape (num_envs, 6)."""
    @property
    def soft_qpos_limits(self) -> _Array:
        """Soft position limits [rad or m], shape (num_envs, dof, 2)."""
    @property
    def stiffness(self) -> _Array:
        """Stiffness of the drives, shape (num_envs, dof)."""
    @property
    def total_mass(self) -> float:
        """Mass of all links as in the files [kg]."""
    @property
    def uid(self) -> str:
        """Name of the robot."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def _repr_html_(self, /) -> str: ...
    def active_joint_ids(self, /, part: str | None = None) -> list[int]:
        """Indices of the joints of a control part, or of the robot, that follow no other joint."""
    def compute_fk(self, /, qpos: ArrayLike, tip: str, link: str | None = None, tcp: _Numbers | None = None, env_ids: _Envs = None) -> _Array:
        """Poses of a frame at joint positions, rows x y z qw qx qy qz in the environment, shape (num_envs, 7).
        ``tip`` is a control part or a link, ``link`` another link of the same joints, ``tcp`` the pose of the tool
        in that link.
        """
    def compute_ik(self, /, targets: ArrayLike, tip: str, cfg: IkCfg | _Fields | None = None, initial: ArrayLike | None = None, link: str | None = None, tcp: _Numbers | None = None, env_ids: _Envs = None) -> IkResult:
        """Joint positions at which a frame reaches target poses (rows x y z qw qx qy qz). Settings are those of
        ``IkCfg``. A target that cannot be reached is not an error: see ``IkResult.success``.
        """
    def compute_link_fk(self, /, qpos: ArrayLike, env_ids: _Envs = None) -> _Array:
        """Poses of all links at joint positions, shape (num_envs, links, 7)."""
    def find_joints(self, /, patterns: _Patterns) -> list[int]:
        """Indices of the joints whose names match a pattern, or one of several, in the order of the joints."""
    def find_links(self, /, patterns: _Patterns) -> list[int]:
        """Indices of the links whose names match a pattern, or one of several."""
    def jacobian(self, /, tip: str, qpos: ArrayLike | None = None, link: str | None = None, tcp: _Numbers | None = None, env_ids: _Envs = None) -> _Array:
        """Jacobians of a frame, shape (num_envs, 6, joints); at the current positions without ``qpos``."""
    def bias_force(self, /, qpos: ArrayLike | None = None, qvel: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Generalized forces at zero acceleration, c(q, v) + g(q) of the equation of motion [N m or N],
        ``qfrc_bias`` of MuJoCo, shape (num_envs, columns), with the columns of ``mass_matrix``. Joint positions and
        velocities are the current ones by default; a floating base has its current pose and velocity. Velocities of
        mimic joints are used as given.
        """
    def center_of_mass(self, /, qpos: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Centers of mass of the robot in the environment [m], shape (num_envs, 3), at joint positions, by default
        the current ones.
        """
    def inverse_dynamics(self, /, qacc: ArrayLike, qpos: ArrayLike | None = None, qvel: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Generalized forces M a + c + g that produce accelerations, shape (num_envs, columns), with the columns of
        ``mass_matrix`` [N m or N], rotor inertias included. Accelerations are the rates of change of the velocities
        of these columns, shape (num_envs, columns) [rad/s² or m/s²]. Damping and friction of joints are not
        included. Joint positions and velocities are those of ``bias_force``.
        """
    def kinetic_energy(self, /, qpos: ArrayLike | None = None, qvel: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Kinetic energies [J], rotor inertias included, shape (num_envs,). Joint positions and velocities are those
        of ``bias_force``.
        """
    def momentum(self, /, qpos: ArrayLike | None = None, qvel: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Momenta of the links in the axes of the environment, shape (num_envs, 6): linear [kg m/s], then angular
        about the center of mass [kg m²/s]. Joint positions and velocities are those of ``bias_force``.
        """
    def potential_energy(self, /, qpos: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Potential energies in the gravity of the simulation [J], zero at the origin of the environment, shape
        (num_envs,), at joint positions, by default the current ones.
        """
    def gravity_torque(self, /, qpos: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Generalized forces that hold the robot still against gravity at joint positions, by default the current
        ones [N m or N], shape (num_envs, columns), with the columns of ``mass_matrix``. Gravity itself exerts the
        negative.
        """
    def joint_ids(self, /, part: str | None = None) -> list[int]:
        """Indices of the joints of a control part, or of all joints."""
    def mass_matrix(self, /, qpos: ArrayLike | None = None, env_ids: _Envs = None) -> _Array:
        """Joint-space inertia at joint positions, by default the current ones [kg m², kg m or kg], rotor inertias
        included, shape (num_envs, columns, columns). Columns are the joints; a floating base comes before them with
        six: the velocity of its origin in the axes of the environment, then its angular velocity in its own axes.
        Masses are those of the files and payloads, without changes by ``set_property`` or ``randomize``.
        """
    def link_pose(self, /, link: str) -> _Array:
        """Poses of a link in the environment, rows x y z qw qx qy qz, shape (num_envs, 7)."""
    def link_velocity(self, /, link: str) -> _Array:
        """Velocities of a link, shape (num_envs, 6)."""
    def set_armature(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the rotor inertia of joints [kg m² or kg]."""
    def set_damping(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the damping of the drives."""
    def set_delay(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the delays of drives with the actuator model ``delayed_pd`` [steps]."""
    def set_drive_type(self, /, drive_type: DriveType, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the meaning of the gains: ``"force"``, ``"acceleration"`` or ``"none"`` (passive)."""
    def set_external_wrench(self, /, forces: ArrayLike, torques: ArrayLike, frame: Literal["world", "link"] = "world", link_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets forces [N] and torques [N m] that act on links until they are set again or the environment is reset,
        shape (num_envs, links, 3). ``frame`` is ``"world"`` or ``"link"``.
        """
    def set_friction(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the dry friction of joints [N m or N]."""
    def set_gravity_compensation(self, /, on: bool, link_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Compensates gravity of links, or ends the compensation."""
    def set_joint_damping(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the passive damping of joints."""
    def set_qf_limits(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets effort limits [N m or N]."""
    def set_qf_target(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets feed-forward efforts [N m or N]."""
    def set_qpos_limits(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets position limits [rad or m], shape (num_envs, joints, 2)."""
    def set_qpos_target(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets position targets [rad or m]; they are clamped to the limits."""
    def set_qvel_limits(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets velocity limits [rad/s or m/s]."""
    def set_qvel_target(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets velocity targets [rad/s or m/s]."""
    def set_stiffness(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Sets the stiffness of the drives."""
    def write_joint_state(self, /, positions: ArrayLike, velocities: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Writes joint positions and velocities to the state."""
    def write_qacc(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Writes joint accelerations [rad/s² or m/s²] to the state."""
    def write_qpos(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Writes joint positions [rad or m] to the state."""
    def write_qvel(self, /, values: ArrayLike, joint_ids: _Joints = None, env_ids: _Envs = None) -> None:
        """Writes joint velocities [rad/s or m/s] to the state."""
    def write_root_com_velocity(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes velocities of the center of mass of the root link, shape (num_envs, 6)."""
    def write_root_pose(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes poses of the root link, rows x y z qw qx qy qz."""
    def write_root_state(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes poses and velocities of the root link, shape (num_envs, 13)."""
    def write_root_velocity(self, /, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Writes velocities of the root link, shape (num_envs, 6)."""

@final
class Segmentation:
    """Meaning of the mask ids of cameras, made by ``SimulationManager.segmentation``. ``level`` is ``"instance"``
    (whole objects and robots), ``"link"`` or ``"semantic"`` (classes).
    """

    def __repr__(self) -> str: ...
    def boxes_2d(self, /, sensor: Sensor, env: int = 0, level: _Level = "instance") -> list[dict[str, Any]]:
        """2D bounding boxes in the image of a camera with the channel ``mask``: dicts with ``id`` and ``name`` of
        the segment, ``tight`` (around its visible pixels) and ``loose`` (around all of it in the view), each (left,
        upper, right, lower) edge [pixels] or None, and ``visible_pixels``.
        """
    def boxes_3d(self, /, sensor: Sensor, env: int = 0, level: _Level = "instance") -> list[dict[str, Any]]:
        """3D bounding boxes of everything that a camera can render, inside the image or not: dicts with ``id`` and
        ``name`` of the segment, ``pose`` of its frame in the environment (x y z qw qx qy qz), and ``min`` and
        ``max``, the smallest and largest coordinates in that frame [m].
        """
    def colorize(self, /, mask: ArrayLike, level: _Level = "instance") -> NDArray[np.uint8]:
        """Colors of the segments of images of the channel ``mask``: RGBA, u8, shape (..., height, width, 4)."""
    def occlusions(self, /, sensor: Sensor, env: int = 0, level: _Level = "instance") -> list[dict[str, Any]]:
        """Occlusion of the segments in the image of a camera with the channel ``mask``: dicts with ``id`` and
        ``name`` of the segment, ``visible_pixels``, ``unoccluded_pixels`` (without other objects) and ``ratio``, the
        hidden fraction. Each segment is rendered once more.
        """
    def segment(self, /, mask: ArrayLike, level: _Level = "instance") -> NDArray[np.int32]:
        """Segment ids of images of the channel ``mask``, int32, in the same shape: 0 where nothing was hit, -1 for
        mask ids of entities that were added later.
        """
    def segments(self, /, level: _Level = "instance") -> list[dict[str, Any]]:
        """All segments of a level: dicts with ``id``, ``name``, ``class`` and ``mask_ids``."""

@final
class Sensor:
    """A sensor in all environments. ``sensor["depth"]`` is a channel by name; ``sensor.channels`` lists the names."""

    @property
    def channels(self) -> list[str]:
        """Names of the channels."""
    @property
    def columns(self) -> list[str]:
        """Names of the bodies, joints or other items that the values belong to."""
    @property
    def debug_vis(self) -> bool:
        """True if the markers of the sensor are shown in views and in images with ``draw_markers``."""
    @property
    def due_in(self) -> int | None:
        """Physics steps until the sensor next measures, delivers a delayed measurement or opens its shutter in any
        environment, at least 1; None for a sensor that failed.
        """
    @property
    def env_ids(self) -> list[int]:
        """Environments that a camera sees, one for each row of its channels."""
    @property
    def filters(self) -> list[str]:
        """Names along the third axis of the matrix channels of a contact sensor."""
    @property
    def force_stamps(self) -> _Array:
        """Times of the current forces, efforts and accelerations of a numeric sensor [s], shape (num_envs,). They
        are of the beginning of the last step, and ``stamps`` of its end.
        """
    @property
    def image_shape(self) -> tuple[int, int]:
        """Height and width of the images of a camera [pixels]."""
    @property
    def intrinsic_matrices(self) -> _Array:
        """Intrinsic matrices of a camera [pixels], shape (num_envs, 3, 3)."""
    @property
    def is_attached(self) -> bool:
        """True if a camera is attached to a body."""
    @property
    def kind(self) -> str:
        """Type of the sensor in scene files, such as ``"camera"``."""
    @property
    def sample_counts(self) -> _Array:
        """Number of measurements since the last reset, shape (num_envs,)."""
    @property
    def stamps(self) -> _Array:
        """Times of capture of the current values [s], shape (num_envs,)."""
    @property
    def uid(self) -> str:
        """Name of the sensor."""
    @property
    def units(self) -> dict[str, str]:
        """Units of the numeric channels, by name; empty for numbers without a unit."""
    @property
    def update_period(self) -> float:
        """Time between measurements [s], after rounding to whole physics steps."""
    def __contains__(self, name: object, /) -> bool: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __getitem__(self, name: str, /) -> _Array: ...
    def __hash__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...
    def __repr__(self) -> str: ...
    def __str__(self) -> str: ...
    def _repr_html_(self, /) -> str: ...
    @property
    def latest_delivered_intrinsic_matrices(self) -> _Array:
        """Intrinsic matrices of a camera at the delivery of the latest delivered images [pixels], shape (num_envs,
        3, 3). Without a latency, they equal ``intrinsic_matrices``.
        """
    @property
    def progress(self) -> RenderProgress:
        """Progress of the path tracing of a camera, and a way to cancel it from another thread; of a pair, those of
        the left camera.
        """
    def latest_delivered_pose_w(self, /, convention: _Axes = "ros") -> _Array:
        """Poses of a camera in the environment at the latest delivered images, as ``pose_w``, shape (num_envs, 7):
        the pose of the parent at the capture, and the local pose at the delivery. Without a latency, they equal
        ``pose_w``.
        """
    @property
    def latest_delivered_stamps(self) -> _Array:
        """Capture times of the latest delivered images of a camera [s], shape (num_envs,)."""
    @property
    def stamp_history(self) -> _Array:
        """Capture times of the measurements in the history [s], newest first, shape (num_envs, history); 0 for
        entries that are not filled yet.
        """
    def camera_info(self, /, env: int = 0, side: _Side | None = None) -> dict[str, Any]:
        """Calibration of a camera in one environment, in the form of ROS's ``camera_info``: a dict of ``name``,
        ``width``, ``height``, ``distortion_model``, ``distortion_coefficients``, and the float64 matrices
        ``camera_matrix`` (3, 3), ``rectification_matrix`` (3, 3) and ``projection_matrix`` (3, 4). The center of the
        first pixel is at (0, 0). ``side`` is the camera of a pair, ``"left"`` or ``"right"``.
        """
    def latest_delivered(self, /, channel: str) -> _Array:
        """Latest delivered images of a channel of a camera, shape (num_envs, ...). With a latency and after a write
        to the state, they are older than the current ones, which show the state at once.
        """
    def rectification(self, /, env: int = 0) -> dict[str, _Array]:
        """Rectification of the images of a stereo camera in one environment: a dict of ``rotations``, shape (2, 3,
        3), from the frames of the left and the right camera to their rectified frames, and ``projections``, shape
        (2, 3, 4), from the rectified left frame to the pixels of the rectified images, with the center of the first
        pixel at (0.5, 0.5).
        """
    def set_left_right_intrinsics(self, /, left: ArrayLike, right: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets different intrinsics for the cameras of a pair: rows fx fy cx cy [pixels] of the left and of the
        right camera.
        """
    def write_calibration(self, /, path: str | os.PathLike[str], env: int = 0, side: _Side | None = None) -> None:
        """Writes the calibration of a camera to a YAML file of ROS, which ``read_calibration`` and ROS's tools read.
        An existing file is replaced. ``side`` is the camera of a pair, ``"left"`` or ``"right"``.
        """
    def history(self, /, channel: str) -> _Array:
        """Past values of a channel, newest first on the second axis: the shape is (num_envs, history, ...)."""
    def local_pose(self, /, convention: _Axes = "ros") -> _Array:
        """Poses of a camera in the frame of its parent, shape (num_envs, 7)."""
    def look_at(self, /, eye: ArrayLike, target: ArrayLike, up: ArrayLike | None = None, env_ids: _Envs = None) -> None:
        """Places a camera at ``eye``, looking at ``target``, in the frame of its parent [m]."""
    def point_cloud(self, /, env: int = 0, frame: Literal["camera", "world"] = "world") -> _Array:
        """Points seen by a camera with the channel ``depth`` in one environment [m], shape (points, 3). ``frame`` is
        ``"camera"`` or ``"world"`` (the environment).
        """
    def point_map(self, /, env: int = 0, frame: Literal["camera", "world"] = "world") -> _Array:
        """Points seen by the pixels of a camera with the channel ``depth`` in one environment [m], shape (height,
        width, 3), infinite without a hit. ``frame`` is ``"camera"`` or ``"world"`` (the environment).
        """
    def pose_w(self, /, convention: _Axes = "ros") -> _Array:
        """Poses of a camera in the environment, rows x y z qw qx qy qz, shape (num_envs, 7). ``convention`` is
        ``"ros"`` (x right, y down, z forward), ``"opengl"`` or ``"world"``.
        """
    @overload
    def read(self, /, channel: str, out: None = None) -> _Array:
        """Current values of a channel, shape (num_envs, ...). With ``out``, they are copied into that array, which
        is returned: it has the same shape and element type.
        """
    @overload
    def read(self, /, channel: str, out: _Out) -> _Out:
        """Current values of a channel, shape (num_envs, ...). With ``out``, they are copied into that array, which
        is returned: it has the same shape and element type.
        """
    def restore(self, /, env_ids: _Envs = None) -> None:
        """Restores the configured poses and intrinsics of a camera."""
    def set_debug_vis(self, /, shown: bool) -> None:
        """Shows or hides the markers of the sensor in views and in images with ``draw_markers``."""
    def set_intrinsics(self, /, intrinsics: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets intrinsics: rows fx fy cx cy [pixels]."""
    def set_local_pose(self, /, poses: ArrayLike, env_ids: _Envs = None, convention: _Axes = "ros") -> None:
        """Sets poses of a camera in the frame of its parent, rows x y z qw qx qy qz."""
    def set_world_poses(self, /, poses: ArrayLike, env_ids: _Envs = None, convention: _Axes = "ros") -> None:
        """Sets poses of a camera in the environment, rows x y z qw qx qy qz."""

@final
class Terrain:
    """A terrain."""

    @property
    def height_range(self) -> list[float]:
        """Lowest and highest height above the origin of the terrain [m]."""
    @property
    def heights(self) -> _Array:
        """Heights of the points of the grid [m], shape (rows, columns)."""
    @property
    def mask_id(self) -> int:
        """Value of the terrain in the mask channel of cameras."""
    @property
    def uid(self) -> str:
        """Name of the terrain."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def height_at(self, /, x: float, y: float) -> float | None:
        """Height at a point of the terrain frame [m]; None outside."""

@final
class Weld:
    """A weld between two bodies, attached and released in single environments."""

    @property
    def is_attached(self) -> _Array:
        """True where the weld holds, bool, shape (num_envs,)."""
    @property
    def uid(self) -> str:
        """Name of the weld."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def attach(self, /, env_ids: _Envs = None) -> None:
        """Welds the bodies in their current relative pose."""
    def release(self, /, env_ids: _Envs = None) -> None:
        """Releases the bodies."""
