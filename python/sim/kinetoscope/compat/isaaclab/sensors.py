"""Sensors of Isaac: cameras, ray casters, contact sensors. Positions are in the world frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._sim import Sensor
from .._poses import to_world
from .._tensors import array, tensor
from ..configclass import configclass
from . import patterns
from .sim import PinholeCameraCfg

__all__ = [
    "Camera",
    "CameraCfg",
    "ContactSensor",
    "ContactSensorCfg",
    "RayCaster",
    "RayCasterCfg",
    "SensorBaseCfg",
    "patterns",
]


@configclass
class SensorBaseCfg:
    """Fields of all sensors: the path of the sensor, the time between measurements [s], markers."""

    prim_path: str = ""
    update_period: float = 0.0
    history_length: int = 0
    debug_vis: bool = False


@configclass
class CameraOffsetCfg:
    """Pose of a camera on its body: rotation w x y z in the axes of ``convention`` (ros, opengl or world)."""

    pos: Any = (0.0, 0.0, 0.0)
    rot: Any = (1.0, 0.0, 0.0, 0.0)
    convention: str = "ros"


@configclass
class CameraCfg(SensorBaseCfg):
    """A camera. Its path is that of the body with a name of its own."""

    OffsetCfg = CameraOffsetCfg

    offset: CameraOffsetCfg = CameraOffsetCfg()
    spawn: Any = PinholeCameraCfg()
    data_types: Any = ("rgb",)
    width: int = 640
    height: int = 480


@configclass
class RayCasterOffsetCfg:
    """Pose of a pattern on its body."""

    pos: Any = (0.0, 0.0, 0.0)
    rot: Any = (1.0, 0.0, 0.0, 0.0)


@configclass
class RayCasterCfg(SensorBaseCfg):
    """A ray caster. Its path is that of a body."""

    OffsetCfg = RayCasterOffsetCfg

    offset: RayCasterOffsetCfg = RayCasterOffsetCfg()
    attach_yaw_only: bool = False
    pattern_cfg: Any = None
    mesh_prim_paths: Any = ()
    max_distance: float = 1e6
    drift_range: Any = (0.0, 0.0)


@configclass
class ContactSensorCfg(SensorBaseCfg):
    """A contact sensor. The last part of its path is a pattern of bodies."""

    track_pose: bool = False
    track_air_time: bool = False
    force_threshold: float = 1.0
    filter_prim_paths_expr: Any = ()


class _Sensor:
    """A sensor. ``native`` is the sensor of this package, which measures in every step at which it is due."""

    def __init__(self, native: Sensor, origins: Any, cfg: Any) -> None:
        self.native = native
        self.cfg = cfg
        self._origins = origins

    def __str__(self) -> str:
        return str(self.native)

    @property
    def num_instances(self) -> int:
        return len(self._origins)

    def update(self, dt: float, force_recompute: bool = False) -> None:
        """Does nothing: the simulation updates its sensors."""

    def reset(self, env_ids: Any = None) -> None:
        """Not supported for one sensor: ``InteractiveScene.reset`` clears the buffers of all."""
        raise NotImplementedError(f"{type(self).__name__}.reset: use InteractiveScene.reset, which clears all sensors")


class CameraData:
    """Images and poses of a camera."""

    def __init__(self, sensor: Camera) -> None:
        self._sensor = sensor

    @property
    def output(self) -> dict[str, Any]:
        """Images by name, read now."""
        return {name: tensor(self._sensor.native[name]) for name in self._sensor.cfg.data_types}

    @property
    def image_shape(self) -> tuple[int, int]:
        return self._sensor.native.image_shape

    @property
    def intrinsic_matrices(self) -> Any:
        return tensor(self._sensor.native.intrinsic_matrices)

    def _pose(self, convention: str) -> Any:
        return to_world(self._sensor.native.pose_w(convention), self._sensor._origins)

    @property
    def pos_w(self) -> Any:
        return tensor(self._pose("ros")[:, :3])

    @property
    def quat_w_ros(self) -> Any:
        return tensor(self._pose("ros")[:, 3:])

    @property
    def quat_w_opengl(self) -> Any:
        return tensor(self._pose("opengl")[:, 3:])

    @property
    def quat_w_world(self) -> Any:
        return tensor(self._pose("world")[:, 3:])


class Camera(_Sensor):
    """A camera."""

    @property
    def data(self) -> CameraData:
        return CameraData(self)

    @property
    def frame(self) -> Any:
        """Number of images since the reset, shape (n,)."""
        return tensor(self.native.sample_counts)

    @property
    def image_shape(self) -> tuple[int, int]:
        return self.native.image_shape

    def set_world_poses(self, positions: Any, orientations: Any, env_ids: Any = None, convention: str = "ros") -> None:
        """Places the camera in the world frame, rotations w x y z."""
        positions = np.array(array(positions), dtype=float)
        positions -= self._origins if env_ids is None else self._origins[array(env_ids)]
        rows = np.concatenate([positions, array(orientations)], axis=1)
        self.native.set_world_poses(rows, None if env_ids is None else array(env_ids), convention)


class RayCasterData:
    """Hits of a ray caster."""

    def __init__(self, sensor: RayCaster) -> None:
        self._sensor = sensor

    @property
    def ray_hits_w(self) -> Any:
        """Points of the hits [m], shape (n, rays, 3); infinite for a miss."""
        return tensor(to_world(self._sensor.native["hits"], self._sensor._origins))

    @property
    def pos_w(self) -> Any:
        return tensor(to_world(self._sensor.native["pos_w"], self._sensor._origins))

    @property
    def quat_w(self) -> Any:
        return tensor(self._sensor.native["quat_w"])


class RayCaster(_Sensor):
    """A ray caster."""

    @property
    def data(self) -> RayCasterData:
        return RayCasterData(self)


class ContactSensorData:
    """Contact forces of bodies. Quantities that are not configured are None."""

    def __init__(self, sensor: ContactSensor) -> None:
        self._sensor = sensor

    def _channel(self, name: str) -> Any:
        native = self._sensor.native
        return tensor(native[name]) if name in native else None

    @property
    def net_forces_w(self) -> Any:
        """Normal forces on the bodies [N], shape (n, bodies, 3)."""
        return self._channel("net_forces_w")

    @property
    def net_forces_w_history(self) -> Any:
        """Past forces, newest first, shape (n, history_length, bodies, 3); without a history, the current ones."""
        if self._sensor.cfg.history_length == 0:
            return self.net_forces_w[:, None]
        return tensor(self._sensor.native.history("net_forces_w"))

    @property
    def force_matrix_w(self) -> Any:
        """Normal forces by filter [N], shape (n, bodies, filters, 3)."""
        return self._channel("force_matrix_w")

    @property
    def pos_w(self) -> Any:
        native = self._sensor.native
        return tensor(to_world(native["pos_w"], self._sensor._origins)) if "pos_w" in native else None

    @property
    def quat_w(self) -> Any:
        return self._channel("quat_w")

    @property
    def current_air_time(self) -> Any:
        return self._channel("current_air_time")

    @property
    def last_air_time(self) -> Any:
        return self._channel("last_air_time")

    @property
    def current_contact_time(self) -> Any:
        return self._channel("current_contact_time")

    @property
    def last_contact_time(self) -> Any:
        return self._channel("last_contact_time")


class ContactSensor(_Sensor):
    """A contact sensor."""

    @property
    def data(self) -> ContactSensorData:
        return ContactSensorData(self)

    @property
    def body_names(self) -> list[str]:
        return [name.split("/", 1)[-1] for name in self.native.columns]

    @property
    def num_bodies(self) -> int:
        return len(self.native.columns)
