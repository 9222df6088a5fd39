"""Declared scenes of Isaac."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ... import SimulationManager
from ... import cfg as native
from ...errors import ConfigError
from .. import unsupported
from .._layer import Layer
from .._tensors import array, tensor
from ..configclass import MISSING, configclass, fields_of
from .asset_base import AssetBaseCfg
from .assets import Articulation, ArticulationCfg, articulation_fields, joints_of_file
from .rigid_object import RigidObject, RigidObjectCfg, object_fields
from .sensors import (
    Camera,
    CameraCfg,
    ContactSensor,
    ContactSensorCfg,
    FrameTransformer,
    FrameTransformerCfg,
    Imu,
    ImuCfg,
    RayCaster,
    RayCasterCfg,
    SensorBaseCfg,
    TiledCamera,
    TiledCameraCfg,
)
from .sim import DistantLightCfg, DomeLightCfg, GroundPlaneCfg, SimulationContext

# Intensity of Isaac's lights that counts as 1.
FULL_INTENSITY = 3000.0
ENV = "{ENV_REGEX_NS}/"


@configclass
class InteractiveSceneCfg:
    """A scene: every further attribute of a subclass or of an object is an entity."""

    _accepts_new = True

    num_envs: int = MISSING  # type: ignore[assignment]
    env_spacing: float = MISSING  # type: ignore[assignment]
    lazy_sensor_update: bool = True
    replicate_physics: bool = True


class InteractiveScene(Layer):
    """A running scene. ``native`` is the simulation of this package, with the preset for legged robots."""

    def __init__(self, cfg: InteractiveSceneCfg) -> None:
        self.cfg = cfg
        context = SimulationContext.instance() or SimulationContext()
        own = fields_of(InteractiveSceneCfg)
        names = [name for name in {**fields_of(type(cfg)), **vars(cfg)} if name not in own and not name.startswith("_")]
        entities = {name: getattr(cfg, name) for name in names if getattr(cfg, name) is not None}
        self.native = SimulationManager(self._simulation(context, entities))
        self._origins = self.native.env_origins
        # Names of entities by the last part of their paths.
        self._uids = {
            entity.prim_path.rsplit("/", 1)[-1]: name
            for name, entity in entities.items()
            if isinstance(entity, ArticulationCfg | RigidObjectCfg)
        }
        self._grounds = {
            entity.prim_path
            for entity in entities.values()
            if isinstance(entity, AssetBaseCfg) and isinstance(entity.spawn, GroundPlaneCfg)
        }
        self.articulations: dict[str, Articulation] = {}
        self.rigid_objects: dict[str, RigidObject] = {}
        self.sensors: dict[str, Any] = {}
        self.extras: dict[str, Any] = {}
        for name, entity in entities.items():
            if isinstance(entity, ArticulationCfg):
                robot = self.native.add_robot(articulation_fields(name, entity))
                unnamed = set(robot.joint_names) - set(joints_of_file(entity.spawn.asset_path))
                if unnamed:
                    # Their drives would be those of this package.
                    raise ConfigError(f"{name}: actuators do not know the joints {', '.join(sorted(unnamed))}")
                self.articulations[name] = Articulation(robot, self._origins, entity)
            elif isinstance(entity, RigidObjectCfg):
                body = self.native.add_rigid_object(object_fields(name, entity))
                self.rigid_objects[name] = RigidObject(body, self._origins, entity)
        for name, entity in entities.items():
            if isinstance(entity, SensorBaseCfg):
                self.sensors[name] = self._sensor(name, entity)
            elif isinstance(entity, ArticulationCfg | RigidObjectCfg):
                continue
            elif isinstance(entity, AssetBaseCfg):
                self.extras[name] = entity
            else:
                raise ValueError(f"{name}: unknown type of configuration {type(entity).__name__}")
        # The state is complete once all entities are added.
        for asset in self._assets():
            asset.write_start()
        context.attach(self.native)
        self._context = context

    def _assets(self) -> list[Any]:
        return [*self.articulations.values(), *self.rigid_objects.values()]

    def _simulation(self, context: SimulationContext, entities: dict[str, Any]) -> native.SimulationManagerCfg:
        spawned = [entity.spawn for entity in entities.values() if isinstance(entity, AssetBaseCfg)]
        ground = next((spawn for spawn in spawned if isinstance(spawn, GroundPlaneCfg)), None)
        if ground is not None:
            unsupported("GroundPlaneCfg", size=tuple(numbers(ground.size)) != (100.0, 100.0))
        lights = []
        for light in spawned:
            if isinstance(light, DomeLightCfg):
                intensity = float(light.intensity) / FULL_INTENSITY
                lights.append(native.LightCfg(kind=native.LightKindCfg.dome(intensity=intensity), color=colors(light.color)))
            elif isinstance(light, DistantLightCfg):
                strength = float(light.intensity) / FULL_INTENSITY
                lights.append(native.LightCfg(color=tuple(strength * c for c in colors(light.color))))
        return native.SimulationManagerCfg.legged(
            num_envs=self.cfg.num_envs,
            device=str(context.cfg.device),
            arena_space=float(self.cfg.env_spacing),
            physics_dt=float(context.cfg.dt),
            gravity=tuple(float(x) for x in context.cfg.gravity),
            ground=None if ground is None else native.GroundCfg(color=colors(ground.color)),
            lights=lights,
        )

    def _path(self, path: str, name: str) -> list[str]:
        """Parts of a path below the environment, of which the first is the name of an entity."""
        if not path.startswith(ENV):
            raise ConfigError(f"{name}: prim_path is {path!r}; it must begin with {ENV}")
        parts = path.removeprefix(ENV).split("/")
        if parts[0] in self._uids:
            return [self._uids[parts[0]], *parts[1:]]
        known = ", ".join(self._uids) or "none"
        raise ConfigError(f"{name}: prim_path is {path!r}; there is no entity {parts[0]!r} (known: {known})")

    def _sensor(self, name: str, cfg: Any) -> Any:
        sampling = {"update_period": float(cfg.update_period), "history_length": int(cfg.history_length)}
        fields: dict[str, Any]
        if isinstance(cfg, CameraCfg):
            lens = cfg.spawn
            aperture = {"focal_length": float(lens.focal_length), "horizontal_aperture": float(lens.horizontal_aperture)}
            if lens.vertical_aperture is not None:
                aperture["vertical_aperture"] = float(lens.vertical_aperture)
            aperture["horizontal_offset"] = float(lens.horizontal_aperture_offset)
            aperture["vertical_offset"] = float(lens.vertical_aperture_offset)
            unsupported(name, f_stop=lens.f_stop != 0.0, history_length=cfg.history_length != 0)
            near, far = lens.clipping_range
            pose = {"pos": numbers(cfg.offset.pos), "rotation": numbers(cfg.offset.rot)}
            parent = "/".join(self._path(cfg.prim_path, name)[:-1]) if cfg.prim_path.count("/") > 1 else None
            fields = {
                "type": "camera",
                "width": cfg.width,
                "height": cfg.height,
                "near": float(near),
                "far": float(far),
                "update_period": float(cfg.update_period),
                "intrinsics": {"aperture": aperture},
                "extrinsics": {"parent": parent, "convention": cfg.offset.convention, "placement": {"pose": pose}},
                "channels": list(cfg.data_types),
                "debug_vis": cfg.debug_vis,
            }
            kind = TiledCamera if isinstance(cfg, TiledCameraCfg) else Camera
            return kind(self.native.add_sensor(name, fields), self._origins, cfg)
        if isinstance(cfg, RayCasterCfg):
            grounds = [path for path in cfg.mesh_prim_paths if path in self._grounds]
            if len(grounds) != len(cfg.mesh_prim_paths):
                raise ConfigError(f"{name}: mesh_prim_paths is {list(cfg.mesh_prim_paths)}; known: {sorted(self._grounds)}")
            fields = {
                "type": "ray_caster",
                "parent": "/".join(self._path(cfg.prim_path, name)),
                "offset": [*numbers(cfg.offset.pos), *numbers(cfg.offset.rot)],
                "alignment": "yaw" if cfg.attach_yaw_only else "base",
                "pattern": cfg.pattern_cfg.to_native(),
                "targets": {"named": ["ground"]},
                "max_distance": float(cfg.max_distance),
                "drift": numbers(cfg.drift_range),
                "sampling": sampling,
                "debug_vis": cfg.debug_vis,
            }
            return RayCaster(self.native.add_sensor(name, fields), self._origins, cfg)
        if isinstance(cfg, ContactSensorCfg):
            filters = ["ground" if path in self._grounds else self._pattern(path, name) for path in cfg.filter_prim_paths_expr]
            fields = {
                "type": "contact_sensor",
                "bodies": [self._pattern(cfg.prim_path, name)],
                "filters": filters,
                "track_pose": cfg.track_pose,
                "track_air_time": cfg.track_air_time,
                "force_threshold": float(cfg.force_threshold),
                "sampling": sampling,
                "debug_vis": cfg.debug_vis,
            }
            return ContactSensor(self.native.add_sensor(name, fields), self._origins, cfg)
        if isinstance(cfg, FrameTransformerCfg):
            targets = [
                {
                    "bodies": self._pattern(frame.prim_path, name),
                    **({} if frame.name is None else {"name": frame.name}),
                    "offset": [*numbers(frame.offset.pos), *numbers(frame.offset.rot)],
                }
                for frame in cfg.target_frames
            ]
            offset = cfg.source_frame_offset
            fields = {
                "type": "frame_transformer",
                "source": "/".join(self._path(cfg.prim_path, name)),
                "source_offset": [*numbers(offset.pos), *numbers(offset.rot)],
                "targets": targets,
                "sampling": sampling,
                "debug_vis": cfg.debug_vis,
            }
            return FrameTransformer(self.native.add_sensor(name, fields), self._origins, cfg)
        if isinstance(cfg, ImuCfg):
            fields = {
                "type": "imu",
                "body": "/".join(self._path(cfg.prim_path, name)),
                "offset": [*numbers(cfg.offset.pos), *numbers(cfg.offset.rot)],
                "gravity_bias": numbers(cfg.gravity_bias),
                "sampling": sampling,
                "debug_vis": cfg.debug_vis,
            }
            return Imu(self.native.add_sensor(name, fields), self._origins, cfg)
        raise ValueError(f"{name}: unknown type of sensor {type(cfg).__name__}")

    def _pattern(self, path: str, name: str) -> str:
        """Pattern of the bodies of a path whose last part may be a pattern."""
        uid, *rest = self._path(path, name)
        return "/".join([re.escape(uid), *rest])

    @property
    def num_envs(self) -> int:
        return self.native.num_envs

    @property
    def env_origins(self) -> Any:
        """Origins of the environments [m], shape (n, 3)."""
        return tensor(self._origins)

    @property
    def physics_dt(self) -> float:
        """Time step [s]."""
        return self._context.get_physics_dt()

    def __getitem__(self, name: str) -> Any:
        for entities in (self.articulations, self.rigid_objects, self.sensors, self.extras):
            if name in entities:
                return entities[name]
        raise KeyError(f"there is no entity {name!r}; known names: {', '.join(self.keys())}")

    def keys(self) -> list[str]:
        return [*self.articulations, *self.rigid_objects, *self.sensors, *self.extras]

    def reset(self, env_ids: Any = None) -> None:
        """Clears the buffers of entities and sensors, and draws the delays of delayed actuators. States do not change."""
        chosen = None if env_ids is None else array(env_ids)
        self.native.reset_buffers(chosen)
        for articulation in self.articulations.values():
            articulation.draw_delays(chosen)

    def write_data_to_sim(self) -> None:
        """Writes the targets of all articulations."""
        for asset in self._assets():
            asset.write_data_to_sim()

    def update(self, dt: float) -> None:
        """Does nothing: the simulation updates its sensors."""


def numbers(values: Any) -> list[float]:
    return [float(x) for x in np.asarray(array(values))]


def colors(values: Any) -> tuple[float, ...]:
    return tuple(numbers(values))
