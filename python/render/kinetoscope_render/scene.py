"""A scene of MuJoCo's visualizer, and its capture for rendering."""

from __future__ import annotations

import contextlib
import difflib
import os
import threading
from typing import Any, Iterator, Optional, Union

import mujoco
import numpy as np

from kinetoscope_render import _render
from kinetoscope_render.flag_colors import FlagColors
from kinetoscope_render.layout import layouts, scene_memory
from kinetoscope_render.model import model_arrays
from kinetoscope_render.room import RoomTransform

_FLAGS = {name: int(value) for name, value in mujoco.mjtRndFlag.__members__.items()}
# Arrays of a state whose lengths are compared with those of the model.
_SIZES = (
    ("qpos", "nq"), ("qvel", "nv"), ("ctrl", "nu"), ("act", "na"), ("xpos", "nbody"), ("xaxis", "njnt"),
    ("geom_xpos", "ngeom"), ("site_xpos", "nsite"), ("cam_xpos", "ncam"), ("light_xpos", "nlight"),
    ("ten_length", "ntendon"), ("mocap_pos", "nmocap"), ("sensordata", "nsensordata"), ("flexvert_xpos", "nflexvert"),
)
_MAX_THREADS = 1024
# Numbers per pixel of the channels of `FrameList.render`.
_COMPONENTS = {"rgb": 3, "depth": 1, "segmentation": 2, "segments": 1, "normal": 3}
# True for versions whose spheres, boxes, ... have texture coordinates.
_WRAPS_TEXTURES = tuple(int(part) for part in mujoco.__version__.split(".")[:2]) >= (3, 12)
# True for versions in which decoration casts no shadows.
_DECOR_IS_LIGHT = hasattr(mujoco.mjtGeom, "mjGEOM_FLEX")


def default_threads() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_size(height: Any, width: Any) -> tuple[int, int]:
    """Height and width of images as integers.

    Raises:
        TypeError: One of them is not an integer.
        ValueError: One of them is not between 1 and 8192.
    """
    sizes = []
    for name, value in (("height", height), ("width", width)):
        try:
            number = int(value.__index__())
        except AttributeError:
            raise TypeError(f"{name} must be an integer, not {type(value).__name__}") from None
        if not 1 <= number <= 8192:
            raise ValueError(f"{name} must be between 1 and 8192 pixels, not {number}")
        sizes.append(number)
    return sizes[0], sizes[1]


def _check_threads(threads: Any) -> int:
    try:
        number = int(threads.__index__())
    except AttributeError:
        raise TypeError(f"threads must be an integer, not {type(threads).__name__}") from None
    if not 1 <= number <= _MAX_THREADS:
        raise ValueError(f"threads must be between 1 and {_MAX_THREADS}, not {number}")
    return number


def _names(model: mujoco.MjModel, kind: Any, count: int) -> list[str]:
    names = (mujoco.mj_id2name(model, int(kind), index) for index in range(count))
    return [name for name in names if name]


def resolve_camera(model: mujoco.MjModel, camera: Union[int, str, "mujoco.MjvCamera"]) -> "mujoco.MjvCamera":
    """Camera of the visualizer for a name, an id (-1 for the free camera) or a camera.

    Raises:
        ValueError: The model has no such camera.
    """
    if isinstance(camera, mujoco.MjvCamera):
        # MuJoCo ends the process for ids that do not exist.
        kinds = mujoco.mjtCamera
        for kind, field, count, size in (
            (kinds.mjCAMERA_FIXED, "fixedcamid", "ncam", model.ncam),
            (kinds.mjCAMERA_TRACKING, "trackbodyid", "nbody", model.nbody),
        ):
            index = getattr(camera, field)
            if int(camera.type) == int(kind) and not 0 <= index < size:
                raise ValueError(f"camera.{field} = {index} is out of range: the model has {count} = {size}")
        return camera
    index = camera
    if isinstance(index, str):
        index = mujoco.mj_name2id(model, int(mujoco.mjtObj.mjOBJ_CAMERA), index)
        if index == -1:
            names = _names(model, mujoco.mjtObj.mjOBJ_CAMERA, model.ncam)
            similar = difflib.get_close_matches(str(camera), names, n=3, cutoff=0.3) or names[:8]
            hint = f" Candidates: {', '.join(map(repr, similar))}." if similar else " The model has no named cameras."
            raise ValueError(f'The camera "{camera}" does not exist.{hint}')
    if not hasattr(index, "__index__"):
        raise TypeError(f"camera must be a name, an id or a mujoco.MjvCamera, not {type(camera).__name__}")
    index = int(index.__index__())
    if not -1 <= index < model.ncam:
        raise ValueError(f"The camera id {index} is out of range [-1, {model.ncam}).")
    found = mujoco.MjvCamera()
    found.fixedcamid = index
    if index == -1:
        found.type = int(mujoco.mjtCamera.mjCAMERA_FREE)
        mujoco.mjv_defaultFreeCamera(model, found)
    else:
        found.type = int(mujoco.mjtCamera.mjCAMERA_FIXED)
    return found


class SceneCapture:
    """A scene of one model, and the frames to render."""

    def __init__(self, model: mujoco.MjModel, max_geom: Optional[int], threads: Optional[int], samples: Optional[int]):
        if not isinstance(model, mujoco.MjModel):
            raise TypeError(f"model must be a mujoco.MjModel, not {type(model).__name__}")
        threads = min(default_threads(), _MAX_THREADS) if threads is None else _check_threads(threads)
        if samples is None:
            samples = 4 if model.vis.quality.offsamples > 0 else 1
        if samples not in (1, 4):
            raise ValueError(f"samples must be 1 or 4, not {samples}")
        if max_geom is None:
            max_geom = 10000
        if max_geom < 1:
            raise ValueError(f"max_geom must be at least 1, not {max_geom}")
        found = layouts()
        self.model = model
        self.scene = mujoco.MjvScene(model, max_geom)
        self.option = mujoco.MjvOption()
        self._geoms, self._lights = scene_memory(self.scene)
        visual, extent = model.vis, model.stat.extent
        # Like MuJoCo's context, these keep their values from the beginning.
        self._shadows = [float(extent * visual.map.shadowclip), float(visual.map.shadowscale)]
        self._has_shadows = visual.quality.shadowsize > 0
        self._line_width = float(getattr(visual.global_, "linewidth", 1.0))
        quality = (visual.quality.numslices, visual.quality.numstacks, visual.quality.numquads)
        polygons = [min(max(int(number), 1), 1000) for number in quality]
        self.frames = _render.FrameList(
            model_arrays(model), found.geom, found.light, threads, samples, _WRAPS_TEXTURES, self._shadows,
            not _DECOR_IS_LIGHT, polygons,
        )
        self._haze = [*map(float, visual.rgba.haze[:3]), float(visual.map.haze)]
        self._fog = [*map(float, visual.rgba.fog[:3])]
        self._fog += [float(visual.map.fogstart * extent), float(visual.map.fogend * extent)]
        self._colors = FlagColors(self.scene)
        self._is_stereo = False
        self._lock = threading.Lock()
        self._process = os.getpid()

    @contextlib.contextmanager
    def exclusive(self) -> Iterator[None]:
        """Keeps other threads from using the scene and the frames.

        Raises:
            RuntimeError: Another thread uses them.
        """
        if self._process != os.getpid():
            # A thread of the parent process may have held the lock. It does not exist here.
            self._lock, self._process = threading.Lock(), os.getpid()
        if not self._lock.acquire(blocking=False):
            raise RuntimeError("another thread uses this renderer; each thread needs a renderer of its own")
        try:
            yield
        finally:
            self._lock.release()

    def use_scene(self, scene: "mujoco.MjvScene") -> None:
        """Captures another scene of the model from now on."""
        if scene is not self.scene:
            self.scene = scene
            self._geoms, self._lights = scene_memory(scene)

    def reload(self, model: mujoco.MjModel) -> None:
        """Copies meshes, textures and materials again. Captured frames stay as they are."""
        self.frames.reload(model_arrays(model))

    def update(self, data: mujoco.MjData, camera: Any, option: Optional["mujoco.MjvOption"]) -> None:
        """Updates the scene to a state."""
        model = self.model
        if not isinstance(data, mujoco.MjData):
            raise TypeError(f"data must be a mujoco.MjData, not {type(data).__name__}")
        for array, count in _SIZES:
            if not hasattr(data, array) or not hasattr(model, count):
                continue  # flexes, before 3.0
            found, expected = len(getattr(data, array)), getattr(model, count)
            if found != expected:
                raise ValueError(
                    f"data belongs to another model: {array} has {found} rows, but the model of this renderer has "
                    f"{count} = {expected}"
                )
        # Other sizes differ too: the visualizer reads arrays of the state by the sizes of the model.
        if getattr(data, "signature", None) != getattr(model, "signature", None):
            raise ValueError("data belongs to another model: its signature is not that of the model of this renderer")
        camera = resolve_camera(model, camera)
        # MuJoCo moves infinite planes below the camera that the scene had before. Images do not depend on earlier ones.
        mujoco.mjv_updateCamera(model, data, camera, self.scene)
        mujoco.mjv_updateScene(
            model, data, option or self.option, None, camera, int(mujoco.mjtCatBit.mjCAT_ALL), self.scene
        )

    def capture(self, height: int, width: int) -> None:
        """Adds the scene, as it is now, to the frames: two frames of half the width for a stereo pair.

        Raises:
            ValueError: The transform of the scene is not a rotation, a translation and a positive scale.
        """
        scene = self.scene
        left, right = scene.camera
        self._colors = FlagColors(scene)
        # Stereo of windows (mjSTEREO_QUADBUFFERED) is side by side in images.
        self._is_stereo = int(scene.stereo) != int(mujoco.mjtStereo.mjSTEREO_NONE)
        if not self._is_stereo:
            # The cameras of the pair are averaged, as in MuJoCo's images.
            self._capture_view(left, right, height, width)
        elif width >= 2:
            for camera in (left, right):
                self._capture_view(camera, camera, height, width // 2)

    def _capture_view(self, left: Any, right: Any, height: int, width: int) -> None:
        """Adds the scene, from the mean of two cameras, to the frames."""
        scene, flags = self.scene, self.scene.flags
        orthographic = float(bool(getattr(left, "orthographic", 0)))

        def mean(field: str) -> float:
            # Before 3.0, all pixels are square: there is no width.
            return 0.5 * (float(getattr(left, field, 0.0)) + float(getattr(right, field, 0.0)))

        vectors = [0.5 * (getattr(left, field) + getattr(right, field)) for field in ("pos", "forward", "up")]
        lengths = ("frustum_center", "frustum_width", "frustum_bottom", "frustum_top", "frustum_near", "frustum_far")
        frustum, fog, scale = [mean(length) for length in lengths], self._fog, 1.0
        room = RoomTransform.of(scene)
        if room is not None:
            position, *directions = vectors
            vectors = [room.position_in_model(position), *map(room.direction_in_model, directions)]
            scale = room.scale
            frustum = [length / scale for length in frustum]
            fog = [*fog[:3], *(distance / scale for distance in fog[3:])]
        far = frustum[-1]
        camera = [*np.concatenate(vectors).tolist(), *frustum, orthographic, self._line_width]
        on = [float(flags[_FLAGS[name]]) for name in ("mjRND_SKYBOX", "mjRND_HAZE", "mjRND_FOG")]
        names = ("mjRND_SHADOW", "mjRND_REFLECTION", "mjRND_CULL_FACE", "mjRND_ADDITIVE", "mjRND_WIREFRAME")
        effects = [bool(flags[_FLAGS[name]]) for name in names]
        effects[0] = effects[0] and self._has_shadows
        self.frames.capture(
            self._geoms[: scene.ngeom], self._lights[: scene.nlight], camera, [*on, *self._haze, *fog, far], effects,
            [width, height], scale, self._soft(),
        )

    def render(
        self, height: int, width: int, images: dict[str, np.ndarray], *, surfaces_of_color: bool = False
    ) -> None:
        """Renders the captured scenes.

        Args:
            height: Height of the images [pixels].
            width: Width of the images [pixels].
            images: Contiguous arrays for the images of all scenes, by channel of `FrameList.render`.
            surfaces_of_color: True if depth and normals show geoms without a segmentation id too.
        """
        source = self._colors.source if "rgb" in images else None
        if source is not None:
            # Flags of the scene replace the colors.
            rgb = images["rgb"]
            images = {name: image for name, image in images.items() if name != "rgb"}
            name, dtype = source
            shown = np.empty(rgb.size // 3, dtype)
            self._render_views(height, width, not self._colors.is_segments, {name: shown})
            rgb.reshape(-1, 3)[...] = self._colors.of(shown)
        if images:
            self._render_views(height, width, surfaces_of_color, images)

    def _render_views(
        self, height: int, width: int, surfaces_of_color: bool, images: dict[str, np.ndarray]
    ) -> None:
        """Renders the frames, and joins those of stereo pairs side by side."""
        if not self._is_stereo:
            flat = {name: image.reshape(-1) for name, image in images.items()}
            self.frames.render(**flat, surfaces_of_color=surfaces_of_color)
            return
        # The last column of an odd width stays empty.
        half, halves = width // 2, {}
        far = float(self.scene.camera[0].frustum_far)
        for name, image in images.items():
            components = _COMPONENTS[name]
            count = image.size // (height * width * components)
            image.reshape(-1)[...] = {"depth": far, "segmentation": -1, "segments": -1}.get(name, 0)
            halves[name] = np.empty((count, 2, height, half, components), image.dtype)
        if half == 0:
            return
        self.frames.render(
            **{name: image.reshape(-1) for name, image in halves.items()}, surfaces_of_color=surfaces_of_color
        )
        for name, pair in halves.items():
            whole = images[name].reshape(len(pair), height, width, -1)
            whole[:, :, :half], whole[:, :, half : 2 * half] = pair[:, 0], pair[:, 1]

    def _soft(self) -> Optional[tuple[list[np.ndarray], list[np.ndarray]]]:
        """Vertices of skins and flexes."""
        scene = self.scene
        has_flexes = getattr(scene, "nflex", 0) > 0
        if not has_flexes and scene.nskin == 0:
            return None

        def flat(name: str, dtype: Any) -> np.ndarray:
            array = getattr(scene, name, None) if has_flexes or name.startswith("skin") else None
            return np.zeros(0, dtype) if array is None else np.ascontiguousarray(np.ravel(array), dtype)

        floats = ("skinvert", "skinnormal", "flexface", "flexnormal", "flextexcoord")
        return [flat(name, np.float32) for name in floats], [
            flat(name, np.int32) for name in ("flexfaceadr", "flexfaceused")
        ]
