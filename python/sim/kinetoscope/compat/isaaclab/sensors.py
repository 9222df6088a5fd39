"""Sensors of Isaac: cameras, ray casters, contact sensors, frames, IMUs. Positions are in the world frame."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np

from ..._sim import Sensor
from .._layer import Layer
from .._poses import to_row, to_world
from .._tensors import array, tensor
from ..configclass import configclass
from . import patterns
from .names import resolve
from .sim import PinholeCameraCfg

__all__ = [
    "Camera",
    "CameraCfg",
    "ContactSensor",
    "ContactSensorCfg",
    "FrameTransformer",
    "FrameTransformerCfg",
    "Imu",
    "ImuCfg",
    "OffsetCfg",
    "RayCaster",
    "RayCasterCfg",
    "SensorBaseCfg",
    "TiledCamera",
    "TiledCameraCfg",
    "patterns",
]


# Axes of cameras.
Axes: TypeAlias = Literal["ros", "opengl", "world"]


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
    convention: Axes = "ros"


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
class TiledCameraCfg(CameraCfg):
    """A camera whose images of all environments are rendered together, as those of ``CameraCfg`` are here."""


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


@configclass
class OffsetCfg:
    """Pose of a frame on its body: position [m], rotation w x y z."""

    pos: Any = (0.0, 0.0, 0.0)
    rot: Any = (1.0, 0.0, 0.0, 0.0)


@configclass
class FrameCfg:
    """A target frame, or one on each body that the last part of the path matches. Its name is that of the body by default."""

    prim_path: str = ""
    name: str | None = None
    offset: OffsetCfg = OffsetCfg()


@configclass
class FrameTransformerCfg(SensorBaseCfg):
    """Poses of target frames in a source frame. The path is that of the body of the source."""

    FrameCfg = FrameCfg

    source_frame_offset: OffsetCfg = OffsetCfg()
    target_frames: Any = ()


# Inside of ImuCfg, the name of the class is that of an attribute.
_Offset: TypeAlias = OffsetCfg


@configclass
class ImuCfg(SensorBaseCfg):
    """An IMU. Its path is that of a body. ``gravity_bias`` is added to the acceleration, in world axes [m/s²]."""

    OffsetCfg = OffsetCfg

    offset: _Offset = OffsetCfg()
    gravity_bias: Any = (0.0, 0.0, 9.81)


class _Sensor(Layer):
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

    def set_debug_vis(self, debug_vis: bool) -> bool:
        """Shows or hides the markers of the sensor."""
        self.native.set_debug_vis(debug_vis)
        return True

    def reset(self, env_ids: Any = None) -> None:
        """Not supported for one sensor: ``InteractiveScene.reset`` clears the buffers of all."""
        raise NotImplementedError(f"{type(self).__name__}.reset: use InteractiveScene.reset, which clears all sensors")


class CameraData(Layer):
    """Images and poses of a camera."""

    def __init__(self, sensor: Camera) -> None:
        self._sensor = sensor

    @property
    def output(self) -> dict[str, Any]:
        """Images by name, read now. As in Orbit, normals have a fourth number, which has no meaning."""
        images = {name: self._sensor.native[name] for name in self._sensor.cfg.data_types}
        if "normals" in images:
            images["normals"] = np.pad(images["normals"], [(0, 0)] * 3 + [(0, 1)])
        return {name: tensor(image) for name, image in images.items()}

    @property
    def image_shape(self) -> tuple[int, int]:
        return self._sensor.native.image_shape

    @property
    def intrinsic_matrices(self) -> Any:
        return tensor(self._sensor.native.intrinsic_matrices)

    def _pose(self, convention: Axes) -> Any:
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

    def set_world_poses(self, positions: Any, orientations: Any, env_ids: Any = None, convention: Axes = "ros") -> None:
        """Places the camera in the world frame, rotations w x y z."""
        positions = np.array(array(positions), dtype=float)
        positions -= self._origins if env_ids is None else self._origins[array(env_ids)]
        rows = np.concatenate([positions, array(orientations)], axis=1)
        self.native.set_world_poses(rows, None if env_ids is None else array(env_ids), convention)


    def set_world_poses_from_view(self, eyes: Any, targets: Any, env_ids: Any = None) -> None:
        """Places the camera at ``eyes``, looking at ``targets``, in the world frame, shape (n, 3), with the vertical up."""
        eyes, targets = (np.atleast_2d(np.asarray(array(values), dtype=float)) for values in (eyes, targets))
        poses = np.array([view_pose(eye, target) for eye, target in zip(eyes, targets, strict=True)])
        self.set_world_poses(poses[:, :3], poses[:, 3:], env_ids, "opengl")

    def set_intrinsic_matrices(self, matrices: Any, focal_length: float = 1.0, env_ids: Any = None) -> None:  # noqa: ARG002
        """Sets intrinsic matrices [pixels], shape (n, 3, 3). The focal length in units of length has no effect here."""
        k = np.asarray(array(matrices), dtype=float).reshape(-1, 3, 3)
        rows = np.stack([k[:, 0, 0], k[:, 1, 1], k[:, 0, 2], k[:, 1, 2]], axis=1)
        self.native.set_intrinsics(rows, None if env_ids is None else array(env_ids))


def view_pose(eye: Any, target: Any) -> list[float]:
    """Pose x y z qw qx qy qz of a camera in OpenGL's axes. A camera that looks straight up or down has its image's right
    side along -y, as if it had tilted there from looking along x."""
    backward = np.asarray(eye) - np.asarray(target)
    length = np.linalg.norm(backward)
    if not length > 0:
        raise ValueError(f"eye and target are both {list(eye)}; they must differ")
    backward = backward / length
    right = np.cross([0.0, 0.0, 1.0], backward)
    right = np.array([0.0, -1.0, 0.0]) if np.linalg.norm(right) < 1e-9 else right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :4] = np.stack([right, np.cross(backward, right), backward, eye], axis=1)
    return to_row(matrix)


class TiledCamera(Camera):
    """A camera whose images of all environments are rendered together, as those of ``Camera`` are here."""


class RayCasterData(Layer):
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

    @property
    def num_rays(self) -> int:
        return int(self.native["hits"].shape[1])


class ContactSensorData(Layer):
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

    def find_bodies(self, name_keys: Any, preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Indices and names of the bodies that match a pattern or a list of patterns, in the order of the bodies, or with
        ``preserve_order`` in that of the patterns. Each pattern must match."""
        return resolve(name_keys, self.body_names, preserve_order, "body")

    def compute_first_contact(self, dt: float, abs_tol: float = 1.0e-8) -> Any:
        """True for bodies that came into contact within the last ``dt`` seconds, shape (n, bodies)."""
        return self._shorter("current_contact_time", dt + abs_tol)

    def compute_first_air(self, dt: float, abs_tol: float = 1.0e-8) -> Any:
        """True for bodies that lost contact within the last ``dt`` seconds, shape (n, bodies)."""
        return self._shorter("current_air_time", dt + abs_tol)

    def _shorter(self, channel: str, limit: float) -> Any:
        if not self.cfg.track_air_time:
            raise RuntimeError("the contact sensor has no times: set track_air_time in its configuration")
        times = self.native[channel]
        return tensor((times > 0) & (times < limit))


class FrameTransformerData(Layer):
    """Poses of frames. Rotations are w x y z."""

    def __init__(self, sensor: FrameTransformer) -> None:
        self._sensor = sensor

    @property
    def target_frame_names(self) -> list[str]:
        """Names of the target frames, in the order of the configuration."""
        return self._sensor.frame_names

    def _channel(self, name: str) -> Any:
        return tensor(self._sensor.native[name])

    def _world(self, name: str) -> Any:
        return tensor(to_world(self._sensor.native[name], self._sensor._origins))

    @property
    def source_pos_w(self) -> Any:
        return self._world("source_pos_w")

    @property
    def source_quat_w(self) -> Any:
        return self._channel("source_quat_w")

    @property
    def target_pos_w(self) -> Any:
        """Positions [m], shape (n, frames, 3)."""
        return self._world("target_pos_w")

    @property
    def target_quat_w(self) -> Any:
        return self._channel("target_quat_w")

    @property
    def target_pos_source(self) -> Any:
        """Positions in the source frame [m], shape (n, frames, 3)."""
        return self._channel("target_pos_source")

    @property
    def target_quat_source(self) -> Any:
        return self._channel("target_quat_source")


class FrameTransformer(_Sensor):
    """Poses of target frames in a source frame."""

    @property
    def data(self) -> FrameTransformerData:
        return FrameTransformerData(self)

    @property
    def frame_names(self) -> list[str]:
        """Names of the target frames: given names, or the last parts of the paths of the bodies."""
        return [name.rsplit("/", 1)[-1] for name in self.native.columns]

    @property
    def num_bodies(self) -> int:
        return len(self.native.columns)


class ImuData(Layer):
    """Measurements of an IMU: velocities and accelerations in its own axes."""

    def __init__(self, sensor: Imu) -> None:
        self._sensor = sensor

    def _channel(self, name: str) -> Any:
        return tensor(self._sensor.native[name])

    @property
    def pos_w(self) -> Any:
        return tensor(to_world(self._sensor.native["pos_w"], self._sensor._origins))

    @property
    def quat_w(self) -> Any:
        return self._channel("quat_w")

    @property
    def lin_vel_b(self) -> Any:
        return self._channel("lin_vel_b")

    @property
    def ang_vel_b(self) -> Any:
        return self._channel("ang_vel_b")

    @property
    def lin_acc_b(self) -> Any:
        """Acceleration with the bias of gravity [m/s²], shape (n, 3)."""
        return self._channel("lin_acc_b")

    @property
    def ang_acc_b(self) -> Any:
        return self._channel("ang_acc_b")


class Imu(_Sensor):
    """An IMU."""

    @property
    def data(self) -> ImuData:
        return ImuData(self)
