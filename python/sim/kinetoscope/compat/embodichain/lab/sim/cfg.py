"""Configurations of EmbodiChain. Euler angles are in degrees, quaternions in the order w x y z."""

from __future__ import annotations

from typing import Any, Literal

from kinetoscope.compat import unsupported
from kinetoscope.compat.configclass import configclass
from kinetoscope.compat.embodichain.lab.visualization import VisualizationCfg

PerJoint = Any


@configclass
class RenderCfg:
    """Renderer: ``auto`` is the rasterizer, ``hybrid`` adds ray-traced shadows, ``fast-rt`` and ``rt`` trace rays."""

    renderer: Literal["auto", "hybrid", "fast-rt", "rt"] = "auto"
    spp: int = 1
    tone_mapping_enabled: bool = False
    tone_mapping_exposure: float = 1.0


@configclass
class PhysicsCfg:
    """Physics: only gravity has a meaning here."""

    gravity: Any = (0.0, 0.0, -9.81)
    bounce_threshold: float = 2.0
    enable_ccd: bool = False
    length_tolerance: float = 0.05
    speed_tolerance: float = 0.25


@configclass
class JointDrivePropertiesCfg:
    """Drives of joints: numbers, or dicts of numbers by joint pattern or control part. As in EmbodiChain, limits of the
    URDF are replaced by those given here."""

    drive_type: str = "force"
    stiffness: PerJoint = 1e4
    damping: PerJoint = 1e3
    max_effort: PerJoint = 1e10
    max_velocity: PerJoint = 1e10
    friction: PerJoint = 0.0
    armature: PerJoint = 0.0


class URDFCfg:
    """Components of a robot: dicts of ``component_type``, ``urdf_path`` and ``transform`` (4 x 4)."""

    def __init__(
        self,
        components: Any = None,
        base_link_name: str = "base_link",
        component_prefix: Any = None,
        name_case: Any = None,
        **others: Any,
    ) -> None:
        unsupported("URDFCfg", **{name: value is not None for name, value in others.items()})
        self.components: dict[str, dict[str, Any]] = {}
        self.base_link_name = base_link_name
        self.component_prefix = dict(component_prefix or {})
        self.name_case = name_case
        for component in components or []:
            self.add_component(**component)

    def add_component(self, component_type: str, urdf_path: str, transform: Any = None, **params: Any) -> URDFCfg:
        """Adds a component; a second one of the same type replaces the first."""
        self.components[component_type] = {"urdf_path": urdf_path, "transform": transform, **params}
        return self

    def set_urdf(self, urdf_path: str) -> URDFCfg:
        """Uses one URDF file."""
        self.components = {"robot": {"urdf_path": urdf_path, "transform": None}}
        return self


@configclass
class RigidBodyAttributesCfg:
    """Physical attributes of rigid bodies. Dampings are rates [1/s]."""

    mass: float = 1.0
    density: float = 1000.0
    angular_damping: float = 0.7
    linear_damping: float = 0.7
    restitution: float = 0.0
    dynamic_friction: float = 0.5
    static_friction: float = 0.5
    enable_collision: bool = True
    contact_offset: float = 0.002
    rest_offset: float = 0.0
    sleep_threshold: float = 0.001
    enable_ccd: bool = False
    max_depenetration_velocity: float = 10.0
    min_position_iters: int = 4
    min_velocity_iters: int = 1
    max_linear_velocity: float = 100.0
    max_angular_velocity: float = 100.0


@configclass
class ArticulationCfg:
    """A passive articulation."""

    uid: str | None = None
    init_pos: Any = (0.0, 0.0, 0.0)
    init_rot: Any = (0.0, 0.0, 0.0)
    init_local_pose: Any = None
    fpath: str | None = None
    drive_pros: JointDrivePropertiesCfg = JointDrivePropertiesCfg(drive_type="none")
    fix_base: bool = True
    disable_self_collision: bool = True
    init_qpos: Any = None


@configclass
class RobotCfg(ArticulationCfg):
    """A robot."""

    drive_pros: JointDrivePropertiesCfg = JointDrivePropertiesCfg()
    control_parts: dict[str, list[str]] | None = None
    urdf_cfg: URDFCfg | None = None
    solver_cfg: Any = None


@configclass
class RigidObjectCfg:
    """A rigid object."""

    uid: str | None = None
    init_pos: Any = (0.0, 0.0, 0.0)
    init_rot: Any = (0.0, 0.0, 0.0)
    init_local_pose: Any = None
    shape: Any = None
    attrs: RigidBodyAttributesCfg = RigidBodyAttributesCfg()
    body_type: Literal["dynamic", "kinematic", "static"] = "dynamic"


@configclass
class RigidObjectGroupCfg:
    """Rigid objects under one uid, by name. ``body_type`` is that of all objects."""

    uid: str | None = None
    rigid_objects: Any = {}
    body_type: Literal["dynamic", "kinematic"] = "dynamic"
    folder_path: str | None = None
    max_num: int = 1
    ext: str = ".obj"


@configclass
class LightCfg:
    """A light: ``point``, or ``sun`` or ``direction`` from far away."""

    uid: str | None = None
    light_type: str = "point"
    color: Any = (1.0, 1.0, 1.0)
    intensity: float = 30.0
    enable_shadow: bool = True
    radius: float = 10.0
    direction: Any = (0.0, 0.0, -1.0)
    init_pos: Any = (0.0, 0.0, 0.0)


@configclass
class SimulationManagerCfg:
    """A simulation."""

    width: int = 1920
    height: int = 1080
    headless: bool = False
    render_cfg: RenderCfg = RenderCfg()
    enable_rt: bool = False
    gpu_id: int = 0
    cpu_num: int | None = None
    num_envs: int = 1
    arena_space: float = 5.0
    physics_dt: float = 0.01
    sim_device: Any = "cpu"
    physics_config: PhysicsCfg = PhysicsCfg()
    profiler: Any = None
    visualization: VisualizationCfg | None = None
