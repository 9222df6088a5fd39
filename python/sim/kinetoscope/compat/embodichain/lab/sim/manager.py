"""``SimulationManager`` of EmbodiChain on the one of this package."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from kinetoscope import SimulationManager as NativeSimulationManager
from kinetoscope import cfg as native
from kinetoscope.errors import ConfigError, ViewerError
from kinetoscope.compat import step_limit, unsupported
from kinetoscope.compat._layer import Layer
from kinetoscope.compat._poses import to_row
from kinetoscope.compat._tensors import array, tensor
from kinetoscope.compat.embodichain.lab.visualization import VisualizationCfg
from .cfg import (
    ArticulationCfg,
    JointDrivePropertiesCfg,
    LightCfg,
    PhysicsCfg,
    RenderCfg,
    RigidBodyAttributesCfg,
    RigidObjectCfg,
    RigidObjectGroupCfg,
    RobotCfg,
    SimulationManagerCfg,
    URDFCfg,
)
from .object_group import RigidObjectGroup
from .objects import Articulation, RigidObject, Robot
from .sensors import (
    Camera,
    CameraCfg,
    ContactSensor,
    ContactSensorCfg,
    StereoCamera,
    StereoCameraCfg,
    camera_cfg,
    stereo_cfg,
)
from .shapes import CubeCfg, MeshCfg, SphereCfg

Asset = TypeVar("Asset", Robot, Articulation, RigidObject, RigidObjectGroup, Camera, ContactSensor)

# Fields of RigidBodyAttributesCfg that only PhysX has.
WITHOUT_MEANING = (
    "contact_offset",
    "rest_offset",
    "sleep_threshold",
    "enable_ccd",
    "max_depenetration_velocity",
    "min_position_iters",
    "min_velocity_iters",
    "max_linear_velocity",
    "max_angular_velocity",
)
BACKENDS = ("none", "viser")
RENDERERS = {"auto": "raster", "hybrid": "hybrid", "fast-rt": "fast_ray_traced", "rt": "ray_traced"}


class SimulationManager(Layer):
    """A simulation with EmbodiChain's methods. ``native`` is the simulation of this package."""

    def __init__(self, sim_config: SimulationManagerCfg | None = None) -> None:
        self.cfg = sim_config or SimulationManagerCfg()
        physics, defaults = self.cfg.physics_config, PhysicsCfg()
        changed("PhysicsCfg", physics, defaults, "bounce_threshold", "enable_ccd", "length_tolerance", "speed_tolerance")
        render = self.cfg.render_cfg
        changed("RenderCfg", render, RenderCfg(), "spp", "tone_mapping_enabled", "tone_mapping_exposure")
        unsupported("SimulationManagerCfg", profiler=self.cfg.profiler is not None)
        view = self.cfg.visualization
        if view is not None and view.backend not in BACKENDS:
            raise ConfigError(f"VisualizationCfg.backend is {view.backend!r}; known names: {', '.join(BACKENDS)}")
        self._steps = 0
        self._lights: list[native.LightCfg] = []
        self._assets: dict[str, Any] = {}
        self.native = self._build()
        self.window: Any = None
        self.server: Any = None
        self._is_shown = view is not None and view.backend == "viser"

    def _build(self) -> NativeSimulationManager:
        lights: dict[str, Any] = {"lights": self._lights} if self._lights else {}
        return NativeSimulationManager(
            num_envs=self.cfg.num_envs,
            device=str(self.cfg.sim_device),
            physics_dt=self.cfg.physics_dt,
            arena_space=self.cfg.arena_space,
            gravity=tuple(float(x) for x in array(self.cfg.physics_config.gravity)),
            threads=self.cfg.cpu_num,
            **lights,
        )

    @property
    def num_envs(self) -> int:
        return self.native.num_envs

    @property
    def is_use_gpu_physics(self) -> bool:
        return False

    @property
    def is_window_opened(self) -> bool:
        return self.window is not None and self.window.is_open

    @property
    def arena_offsets(self) -> Any:
        """Origins of the arenas [m], shape (n, 3): a grid with arena 0 at the origin. Poses do not contain them, and the
        overview of this package has a grid of its own, around the origin."""
        side = int(np.ceil(np.sqrt(self.num_envs)))
        arenas = np.arange(self.num_envs)
        return tensor(np.stack([arenas % side, arenas // side, 0 * arenas], axis=1) * float(self.cfg.arena_space))

    @property
    def asset_uids(self) -> list[str]:
        return ["default_plane", *self._assets]

    def init_gpu_physics(self) -> None:
        """Does nothing: physics runs on the CPU."""

    def build_multiple_arenas(self, num: int) -> None:
        """Sets the number of environments, before anything is added."""
        if self._assets:
            raise ConfigError("build_multiple_arenas: call it before objects are added, or set num_envs in the configuration")
        self.cfg.num_envs = num
        self._close_server()
        self.native.destroy()
        self.native = self._build()

    def update(self, physics_dt: float | None = None, step: int = 10) -> None:
        """Steps the simulation ``step`` times."""
        if physics_dt is not None and abs(physics_dt - self.cfg.physics_dt) > 1e-12:
            raise ConfigError(f"physics_dt is {physics_dt}; it is {self.cfg.physics_dt} from the creation of the simulation on")
        limit = step_limit()
        if limit is not None and self._steps >= limit:
            raise KeyboardInterrupt
        if self._is_shown:
            self.start_visualization()
        self.native.update(step)
        self._steps += step

    def open_window(self) -> bool:
        """Opens a window. Without a display, warns and returns False."""
        try:
            self.window = self.native.open_window()
        except ViewerError as error:
            warnings.warn(f"no window: {error}", stacklevel=2)
            return False
        return True

    def close_window(self) -> None:
        if self.window is not None:
            self.window.close()
            self.window = None

    def start_visualization(self) -> None:
        """Opens the browser view of ``visualization`` in the configuration and prints its address, as the first ``update``
        does with the backend ``viser``. It runs in real time."""
        self._is_shown = True
        if self.server is None:
            view = self.cfg.visualization or VisualizationCfg()
            address = f"{view.viser_server.host}:{view.viser_server.port}"
            self.server = self.native.serve(address, speed=1.0, max_fps=float(view.scene_fps))
            print(f"open {self.server.url}", flush=True)

    def stop_visualization(self) -> None:
        """Closes the browser view."""
        self._is_shown = False
        self._close_server()

    def _close_server(self) -> None:
        if self.server is not None:
            self.server.close()
            self.server = None

    def add_robot(self, cfg: RobotCfg) -> Robot:
        fields = articulation_fields(cfg)
        fields["control_parts"] = {name: list(patterns) for name, patterns in (cfg.control_parts or {}).items()}
        fields["drive"] = drive(cfg.drive_pros)
        fields |= self._start(cfg, fields)
        robot = self.native.add_robot(fields)
        lift_limits(robot, cfg.drive_pros, fields["control_parts"])
        return self._register(Robot(self, robot, cfg))

    def add_articulation(self, cfg: ArticulationCfg) -> Articulation:
        fields = articulation_fields(cfg)
        if cfg.drive_pros.drive_type != "none":
            fields["drive"] = drive(cfg.drive_pros)
        fields |= self._start(cfg, fields)
        articulation = self.native.add_articulation(fields)
        if cfg.drive_pros.drive_type != "none":
            lift_limits(articulation, cfg.drive_pros, {})
        return self._register(Articulation(self, articulation, cfg))

    @staticmethod
    def _start(cfg: ArticulationCfg, fields: dict[str, Any]) -> dict[str, Any]:
        """Initial joint positions by name. EmbodiChain's are in the order of the joints, which only the built robot has.
        Joints that follow others need none."""
        if cfg.init_qpos is None:
            return {}
        values = [float(x) for x in np.asarray(array(cfg.init_qpos)).ravel()]
        with NativeSimulationManager(lights=[], ground=None) as probe:
            robot = probe.add_robot({name: fields[name] for name in ("urdf", "fix_base")})
            names, following = robot.joint_names, robot.mimic_joint_ids
        if len(values) != len(names):
            raise ConfigError(f"init_qpos has {len(values)} values; the joints are {', '.join(names)}")
        own = {re.escape(name): value for at, (name, value) in enumerate(zip(names, values, strict=True)) if at not in following}
        return {"init_qpos": own}

    def add_rigid_object(self, cfg: RigidObjectCfg) -> RigidObject:
        if cfg.uid is None:
            raise ConfigError("a rigid object needs a uid")
        return self._register(RigidObject(self, self.native.add_rigid_object(object_fields(cfg)), cfg))

    def add_rigid_object_group(self, cfg: RigidObjectGroupCfg) -> RigidObjectGroup:
        """Adds rigid objects as a group, whose arrays have one row per environment and object."""
        if cfg.uid is None:
            raise ConfigError("a group of rigid objects needs a uid")
        unsupported("RigidObjectGroupCfg", folder_path=cfg.folder_path is not None)
        objects = []
        for name, one in cfg.rigid_objects.items():
            fields = object_fields(one.replace(uid=name, body_type=cfg.body_type))
            objects.append(fields)
        group = self.native.add_rigid_object_group(uid=cfg.uid, objects=objects)
        return self._register(RigidObjectGroup(self, group, cfg))

    def add_sensor(self, sensor_cfg: CameraCfg | ContactSensorCfg) -> Any:
        """Adds a camera, a pair of cameras, or a contact sensor. Bodies of a contact sensor must exist."""
        if isinstance(sensor_cfg, ContactSensorCfg):
            return self._register(ContactSensor(self, sensor_cfg.uid or self._default_uid(ContactSensor), sensor_cfg))
        if not isinstance(sensor_cfg, CameraCfg):
            raise ConfigError(f"add_sensor: {type(sensor_cfg).__name__} is not the configuration of a sensor")
        kind = StereoCamera if isinstance(sensor_cfg, StereoCameraCfg) else Camera
        uid = sensor_cfg.uid or self._default_uid(kind)
        fields = stereo_cfg(sensor_cfg) if isinstance(sensor_cfg, StereoCameraCfg) else camera_cfg(sensor_cfg)
        render = self.cfg.render_cfg
        if render.renderer not in RENDERERS:
            raise ConfigError(f"RenderCfg.renderer is {render.renderer!r}; known names: {', '.join(RENDERERS)}")
        fields.get("camera", fields)["renderer"] = "hybrid" if self.cfg.enable_rt else RENDERERS[render.renderer]
        return self._register(kind(self, self.native.add_sensor(uid, fields), sensor_cfg))

    def _default_uid(self, kind: type[Layer]) -> str:
        """Name of a sensor without one."""
        return f"{kind.__name__.lower()}_{sum(type(asset) is kind for asset in self._assets.values())}"

    def add_light(self, cfg: LightCfg) -> None:
        """Adds a light, before anything else is added."""
        if self._assets:
            raise ConfigError("add_light: call it before objects are added")
        changed("LightCfg", cfg, LightCfg(), "intensity", "radius")
        far = cfg.light_type in ("sun", "direction")
        self._lights.append(
            native.LightCfg(
                kind="directional" if far else "point",
                position=tuple(cfg.init_pos),
                direction=tuple(cfg.direction),
                color=tuple(float(c) for c in cfg.color),
                cast_shadow=cfg.enable_shadow,
            )
        )
        self._close_server()
        self.native.destroy()
        self.native = self._build()

    def get_robot(self, uid: str) -> Any:
        return self._assets.get(uid)

    get_articulation = get_rigid_object = get_rigid_object_group = get_sensor = get_asset = get_robot

    def _uids(self, *kinds: type) -> list[str]:
        return [uid for uid, asset in self._assets.items() if type(asset) in kinds]

    def get_robot_uid_list(self) -> list[str]:
        return self._uids(Robot)

    def get_articulation_uid_list(self) -> list[str]:
        return self._uids(Articulation)

    def get_rigid_object_uid_list(self) -> list[str]:
        return self._uids(RigidObject)

    def get_rigid_object_group_uid_list(self) -> list[str]:
        return self._uids(RigidObjectGroup)

    def get_sensor_uid_list(self) -> list[str]:
        return self._uids(Camera, StereoCamera, ContactSensor)

    def reset_objects_state(self, env_ids: Any = None, excluded_uids: Any = None) -> None:
        """Resets environments to their initial state."""
        if excluded_uids:
            raise NotImplementedError("reset_objects_state: excluded_uids")
        self.native.reset(None if env_ids is None else array(env_ids))

    def destroy(self, exit_process: bool | None = None) -> None:  # noqa: ARG002
        """Frees the simulation. The process goes on."""
        self.native.destroy()

    def _register(self, asset: Asset) -> Asset:
        self._assets[asset.uid] = asset
        return asset


def pose(cfg: Any) -> Any:
    """Initial pose of an entity."""
    if cfg.init_local_pose is not None:
        return to_row(array(cfg.init_local_pose))
    position = [float(x) for x in array(cfg.init_pos)]
    return {"pos": position, "rpy_deg": [float(x) for x in array(cfg.init_rot)]}


def per_joint(values: Any) -> Any:
    return {key: float(value) for key, value in values.items()} if isinstance(values, dict) else float(values)


def changed(owner: str, cfg: Any, defaults: Any, *names: str) -> None:
    """Refuses fields without a meaning here that differ from their defaults."""
    unsupported(owner, **{name: getattr(cfg, name) != getattr(defaults, name) for name in names})


def lift_limits(native_robot: Any, cfg: JointDrivePropertiesCfg, parts: Any) -> None:
    """Gives the limits of the class to the joints that a dict of limits does not name, instead of those of the URDF."""
    setters = {"max_effort": native_robot.set_qf_limits, "max_velocity": native_robot.set_qvel_limits}
    for name, set_limits in setters.items():
        limits = getattr(cfg, name)
        if not isinstance(limits, dict):
            continue
        named = set()
        for key in limits:
            named |= set(native_robot.joint_ids(key) if key in parts else native_robot.find_joints([key]))
        rest = [joint for joint in range(native_robot.dof) if joint not in named]
        if rest:
            set_limits(np.full((1, len(rest)), getattr(JointDrivePropertiesCfg(), name)), rest)


def drive(cfg: JointDrivePropertiesCfg) -> dict[str, Any]:
    """Drive configuration. A joint that a dict does not name keeps the default of the class."""
    fields: dict[str, Any] = {"drive_type": cfg.drive_type}
    for name in ("stiffness", "damping", "max_effort", "max_velocity", "friction", "armature"):
        fields[name] = per_joint(getattr(cfg, name))
    return fields


def urdf(cfg: URDFCfg | None, fpath: str | None) -> Any:
    """URDF configuration and the stem of its files. A single file is used as it is, as in EmbodiChain."""
    if fpath is not None:
        return fpath, Path(fpath).stem
    if cfg is None or not cfg.components:
        raise ConfigError("the robot has no files: set fpath or urdf_cfg")
    paths = [component["urdf_path"] for component in cfg.components.values()]
    if len(paths) == 1:
        return paths[0], Path(paths[0]).stem
    components = []
    for name, component in cfg.components.items():
        fields: dict[str, Any] = {"name": name, "urdf": component["urdf_path"]}
        if component.get("transform") is not None:
            fields["transform"] = to_row(array(component["transform"]))
        if name in cfg.component_prefix:
            fields["prefix"] = cfg.component_prefix[name]
        components.append(fields)
    merged: dict[str, Any] = {"components": components, "base_link_name": cfg.base_link_name}
    if cfg.name_case:
        merged["name_case"] = dict(cfg.name_case)
    return merged, "_".join(Path(path).stem for path in paths)


def articulation_fields(cfg: Any) -> dict[str, Any]:
    unsupported("RobotCfg", solver_cfg=getattr(cfg, "solver_cfg", None) is not None)
    files, stem = urdf(getattr(cfg, "urdf_cfg", None), cfg.fpath)
    return {
        "uid": cfg.uid or stem,
        "urdf": files,
        "fix_base": cfg.fix_base,
        "init_pose": pose(cfg),
        "self_collision": not cfg.disable_self_collision,
    }


def object_fields(cfg: RigidObjectCfg) -> dict[str, Any]:
    attrs = cfg.attrs
    unsupported(
        "RigidObjectCfg",
        enable_collision=not attrs.enable_collision,
        static_friction=attrs.static_friction != attrs.dynamic_friction,
    )
    changed("RigidBodyAttributesCfg", attrs, RigidBodyAttributesCfg(), *WITHOUT_MEANING)
    fields: dict[str, Any] = {"uid": cfg.uid, "init_pose": pose(cfg), "body_type": cfg.body_type}
    moments: float | None = None
    if isinstance(cfg.shape, CubeCfg):
        size = np.array(array(cfg.shape.size), dtype=float)
        fields["shape"] = native.ObjectShape.box(size=size.tolist())
        # Mean of the principal moments of inertia per mass.
        moments = float((size**2).sum() / 18)
    elif isinstance(cfg.shape, SphereCfg):
        fields["shape"] = native.ObjectShape.sphere(radius=float(cfg.shape.radius))
        moments = 0.4 * cfg.shape.radius**2
    elif isinstance(cfg.shape, MeshCfg):
        fields["shape"] = native.ObjectShape.mesh(path=cfg.shape.fpath)
        pieces = int(cfg.shape.max_convex_hull_num)
        if pieces > 1:
            fields["mesh_collision"] = native.MeshCollision.pieces({"max_pieces": pieces})
    else:
        raise ConfigError(f"{cfg.uid}: shape is {cfg.shape!r}; use CubeCfg, SphereCfg or MeshCfg")
    if attrs.mass > 0:
        fields["mass"] = float(attrs.mass)
    else:
        fields["density"] = float(attrs.density)
    fields["friction"] = [float(attrs.dynamic_friction), 0.005, 0.0001]
    if attrs.restitution > 0:
        fields["restitution"] = float(attrs.restitution)
    if cfg.body_type == "dynamic" and attrs.mass > 0:
        # Dampings of EmbodiChain are rates: a force per mass and velocity.
        fields["linear_damping"] = float(attrs.linear_damping * attrs.mass)
        if moments is not None:
            fields["angular_damping"] = float(attrs.angular_damping * attrs.mass * moments)
    return fields
