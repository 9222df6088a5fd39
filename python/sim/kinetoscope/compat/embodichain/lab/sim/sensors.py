"""Cameras and contact sensors of EmbodiChain. A sensor changes only in ``update``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from kinetoscope import Sensor
from kinetoscope.compat import unsupported
from kinetoscope.compat._layer import Layer
from kinetoscope.compat._poses import rows, to_matrix
from kinetoscope.compat._tensors import array, tensor
from kinetoscope.compat.configclass import configclass

if TYPE_CHECKING:
    from .manager import SimulationManager


@configclass
class ExtrinsicsCfg:
    """Pose of a camera. ``quat`` is w x y z. As in EmbodiChain, the axes are those of ROS (z forward) without a parent,
    and those of OpenGL (looking along -z) with a parent link. ``eye``, ``target`` and ``up`` replace the pose."""

    pos: Any = (0.0, 0.0, 0.0)
    quat: Any = (1.0, 0.0, 0.0, 0.0)
    parent: str | None = None
    eye: Any = None
    target: Any = None
    up: Any = None


# Inside of CameraCfg, the name of the class is that of an attribute.
_Extrinsics: TypeAlias = ExtrinsicsCfg


@configclass
class CameraCfg:
    """A camera: ``intrinsics`` are fx fy cx cy [pixels]."""

    ExtrinsicsCfg = ExtrinsicsCfg

    uid: str | None = None
    width: int = 640
    height: int = 480
    near: float = 0.005
    far: float = 100.0
    intrinsics: Any = (600.0, 600.0, 320.0, 240.0)
    extrinsics: _Extrinsics = ExtrinsicsCfg()
    enable_color: bool = True
    enable_depth: bool = False
    enable_mask: bool = False
    enable_normal: bool = False
    enable_position: bool = False


@configclass
class StereoCameraCfg(CameraCfg):
    """A pair of cameras: the left one, and a right one at ``left_to_right_pos`` (x right) [m]. The pose is that of the
    middle."""

    intrinsics_right: Any = (600.0, 600.0, 320.0, 240.0)
    left_to_right_pos: Any = (0.05, 0.0, 0.0)
    left_to_right_rot: Any = (0.0, 0.0, 0.0)
    enable_disparity: bool = False


@configclass
class ArticulationContactFilterCfg:
    """Links of an articulation, by their whole names; all links for an empty list."""

    articulation_uid: str = ""
    link_name_list: Any = ()


@configclass
class ContactSensorCfg:
    """Contacts of objects and links. With ``filter_need_both_actor``, both bodies of a contact must be listed."""

    uid: str | None = None
    rigid_uid_list: Any = ()
    articulation_cfg_list: Any = ()
    filter_need_both_actor: bool = True
    max_contacts_per_env: int = 64


def channels(cfg: CameraCfg) -> list[str]:
    names = ("color", "depth", "mask", "normal", "position")
    return [name for name in names if getattr(cfg, f"enable_{name}")]


def camera_cfg(cfg: CameraCfg) -> dict[str, Any]:
    """Fields of this package's camera."""
    extrinsics = cfg.extrinsics
    if extrinsics.eye is not None:
        placement = {"look_at": {"eye": vector(extrinsics.eye), "target": vector(extrinsics.target)}}
        if extrinsics.up is not None:
            placement["look_at"]["up"] = vector(extrinsics.up)
    else:
        placement = {"pose": {"pos": vector(extrinsics.pos), "rotation": vector(extrinsics.quat)}}
    fx, fy, cx, cy = vector(cfg.intrinsics)
    return {
        "type": "camera",
        "width": cfg.width,
        "height": cfg.height,
        "near": float(cfg.near),
        "far": float(cfg.far),
        "intrinsics": {"pixels": {"fx": fx, "fy": fy, "cx": cx, "cy": cy}},
        "extrinsics": {
            "parent": extrinsics.parent,
            "placement": placement,
            "convention": "ros" if extrinsics.parent is None else "opengl",
        },
        "channels": channels(cfg),
        # EmbodiChain's consumers treat a depth of 0 as invalid.
        "depth_miss": "zero",
    }


def vector(values: Any) -> list[float]:
    return [float(x) for x in array(values)]


class Camera(Layer):
    """A camera. ``native`` is the sensor of this package."""

    def __init__(self, manager: SimulationManager, native: Sensor, cfg: CameraCfg) -> None:
        self.manager = manager
        self.native = native
        self.cfg = cfg
        self._data: dict[str, Any] = {}

    @property
    def uid(self) -> str:
        return self.native.uid

    @property
    def is_attached(self) -> bool:
        return self.cfg.extrinsics.parent is not None

    def update(self, fetch_only: bool = False) -> None:  # noqa: ARG002
        """Renders the current state."""
        self._data = {name: tensor(self.native[name]) for name in channels(self.cfg)}

    def get_data(self) -> dict[str, Any]:
        """Images of the last ``update``: color (n, h, w, 4), depth and mask (n, h, w), normal and position
        (n, h, w, 3)."""
        if not self._data:
            self.update()
        return self._data

    def get_intrinsics(self) -> Any:
        return tensor(self.native.intrinsic_matrices)

    def set_intrinsics(self, intrinsics: Any, env_ids: Any = None) -> None:
        values = np.asarray(array(intrinsics), dtype=float)
        if values.shape[-2:] == (3, 3):
            values = np.stack([values[..., 0, 0], values[..., 1, 1], values[..., 0, 2], values[..., 1, 2]], axis=-1)
        self.native.set_intrinsics(values, None if env_ids is None else array(env_ids))

    def get_local_pose(self, to_matrix_form: bool = False) -> Any:
        values = self.native.local_pose("opengl")
        return tensor(to_matrix(values) if to_matrix_form else values)

    def set_local_pose(self, pose: Any, env_ids: Any = None) -> None:
        self.native.set_local_pose(rows(array(pose)), None if env_ids is None else array(env_ids), "opengl")

    def get_arena_pose(self, to_matrix_form: bool = False) -> Any:
        values = self.native.pose_w("opengl")
        return tensor(to_matrix(values) if to_matrix_form else values)

    def reset(self, env_ids: Any = None) -> None:
        """Restores the poses and intrinsics of the configuration."""
        self.native.restore(None if env_ids is None else array(env_ids))

    def look_at(self, eye: Any, target: Any, up: Any = None, env_ids: Any = None) -> None:
        up = None if up is None else array(up)
        self.native.look_at(array(eye), array(target), up, None if env_ids is None else array(env_ids))


def stereo_cfg(cfg: StereoCameraCfg) -> dict[str, Any]:
    """Fields of this package's pair of cameras."""
    right, rotation = vector(cfg.left_to_right_pos), vector(cfg.left_to_right_rot)
    # In EmbodiChain, these values place the cameras in axes that are not documented, or have no effect.
    unsupported("StereoCameraCfg", left_to_right_pos=right[1:] != [0.0, 0.0], left_to_right_rot=any(rotation))
    if cfg.enable_disparity and not cfg.enable_depth:
        raise ValueError("StereoCameraCfg: enable_disparity needs enable_depth")
    fx, fy, cx, cy = vector(cfg.intrinsics_right)
    camera = camera_cfg(cfg)
    del camera["type"]
    return {
        "type": "stereo_camera",
        "camera": camera,
        "intrinsics_right": {"pixels": {"fx": fx, "fy": fy, "cx": cx, "cy": cy}},
        "left_to_right_pos": right,
        "origin": "middle",
    }


class StereoCamera(Camera):
    """A pair of cameras. As in EmbodiChain, images of depth, mask and disparity have a last axis of length 1."""

    cfg: StereoCameraCfg

    def update(self, fetch_only: bool = False) -> None:  # noqa: ARG002
        """Renders the current state."""
        images = {}
        for side, suffix in (("left", ""), ("right", "_right")):
            for name in channels(self.cfg):
                image = self.native[f"{side}/{name}"]
                images[name + suffix] = image[..., None] if name in ("depth", "mask") else image
        if self.cfg.enable_disparity:
            depth = images["depth"]
            seen = depth > 0
            scale = vector(self.cfg.intrinsics)[0] * abs(vector(self.cfg.left_to_right_pos)[0])
            images["disparity"] = np.where(seen, scale / np.where(seen, depth, 1), 0).astype(np.float32)
        self._data = {name: tensor(image) for name, image in images.items()}

    def get_left_right_arena_pose(self) -> tuple[Any, Any]:
        """Poses of both cameras as matrices, shape (n, 4, 4), OpenGL axes."""
        middle = to_matrix(self.native.pose_w("opengl"))
        half = np.eye(4)
        half[0, 3] = vector(self.cfg.left_to_right_pos)[0] / 2
        return tensor(middle @ np.linalg.inv(half)), tensor(middle @ half)


class ContactSensor(Layer):
    """Contacts of the listed bodies, at the front of arrays of ``max_contacts_per_env`` rows; others are left out."""

    def __init__(self, manager: SimulationManager, uid: str, cfg: ContactSensorCfg) -> None:
        self.manager = manager
        self.uid = uid
        self.cfg = cfg
        self._bodies: dict[str, int] = {}
        links: dict[str, dict[str | None, int]] = {}
        for row, entity, link, _ in manager.native.mask_ids:
            links.setdefault(entity, {})[link] = row
        for name in cfg.rigid_uid_list:
            self._bodies[name] = self._known(links, name, "rigid_uid_list")[None]
        for chosen in cfg.articulation_cfg_list:
            own = self._known(links, chosen.articulation_uid, "articulation_cfg_list")
            for link in list(chosen.link_name_list) or manager.native[chosen.articulation_uid].link_names:
                if link not in own and list(chosen.link_name_list):
                    raise ValueError(f"{chosen.articulation_uid} has no link {link!r} with a shape; links: {', '.join(map(str, own))}")
                self._bodies[f"{chosen.articulation_uid}/{link}"] = own.get(link, 0)
        self._ids = {
            (entity if link is None else f"{entity}/{link}"): row for entity, own in links.items() for link, row in own.items()
        }
        self._data: dict[str, Any] = {}

    @staticmethod
    def _known(links: dict[str, dict[str | None, int]], uid: str, field: str) -> dict[str | None, int]:
        if uid not in links:
            raise ValueError(f"ContactSensorCfg.{field}: there is no {uid!r}; known: {', '.join(links)}")
        return links[uid]

    def update(self, fetch_only: bool = False) -> None:  # noqa: ARG002
        """Reads the contacts of the last step."""
        count, limit = self.manager.num_envs, self.cfg.max_contacts_per_env
        vectors = {name: np.zeros((count, limit, 3)) for name in ("position", "normal", "friction")}
        numbers = {name: np.zeros((count, limit)) for name in ("impulse", "distance")}
        user_ids, is_valid = np.zeros((count, limit, 2), np.int32), np.zeros((count, limit), bool)
        needed = 2 if self.cfg.filter_need_both_actor else 1
        dt = self.manager.cfg.physics_dt
        for env, contacts in enumerate(self.manager.native.contacts()):
            listed = [contact for contact in contacts if sum(body in self._bodies for body in contact["bodies"]) >= needed]
            for row, contact in enumerate(listed[:limit]):
                normal, force = np.array(contact["normal"]), np.array(contact["force"])
                vectors["position"][env, row] = contact["point"]
                vectors["normal"][env, row] = normal
                vectors["friction"][env, row] = (force - normal * (force @ normal)) * dt
                numbers["impulse"][env, row] = contact["normal_force"] * dt
                numbers["distance"][env, row] = contact["distance"]
                user_ids[env, row] = [self._ids.get(body, 0) for body in contact["bodies"]]
                is_valid[env, row] = True
        arrays = {**vectors, **numbers, "user_ids": user_ids, "is_valid": is_valid}
        self._data = {name: tensor(values) for name, values in arrays.items()}

    def get_data(self) -> dict[str, Any]:
        """Contacts of the last ``update``: position [m], normal and friction [N s] (n, rows, 3); impulse [N s], distance [m]
        and is_valid (n, rows); user_ids (n, rows, 2), 0 for the ground. Normals point to the second body."""
        if not self._data:
            self.update()
        return self._data

    def filter_by_user_ids(self, user_ids: Any, env_ids: Any = None) -> dict[str, Any]:
        """Valid contacts with one of the ids, all environments in a row."""
        data = {name: np.asarray(array(values)) for name, values in self.get_data().items()}
        chosen = data["is_valid"] & np.isin(data["user_ids"], np.asarray(array(user_ids))).any(axis=-1)
        if env_ids is not None:
            others = np.ones(len(chosen), bool)
            others[np.asarray(array(env_ids))] = False
            chosen[others] = False
        return {name: tensor(values[chosen]) for name, values in data.items()}
