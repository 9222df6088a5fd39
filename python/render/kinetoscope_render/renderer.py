"""The drop-in for `mujoco.Renderer`."""

from __future__ import annotations

from typing import Any, Optional, Union

import mujoco
import numpy as np

from kinetoscope_render.scene import SceneCapture, check_size


class Renderer:
    """Renders MuJoCo scenes, with the interface of `mujoco.Renderer`.

    One thread at a time uses a renderer. It releases the GIL while it renders.
    """

    _capture: Optional[SceneCapture] = None
    # Attributes of mujoco.Renderer that some programs read: there are no such contexts here.
    _gl_context = None
    _mjr_context = None

    def __init__(
        self,
        model: mujoco.MjModel,
        height: int = 240,
        width: int = 320,
        max_geom: Optional[int] = 10000,
        font_scale: Any = None,
        *,
        threads: Optional[int] = None,
        samples: Optional[int] = None,
    ) -> None:
        """Creates a renderer.

        Args:
            model: The model. Its meshes, textures and materials are copied.
            height: Height of images [pixels], up to 8192, whatever the model's `offheight`.
            width: Width of images [pixels], up to 8192, whatever the model's `offwidth`.
            max_geom: Largest number of geoms in the scene.
            font_scale: Ignored: labels are not rendered.
            threads: Number of threads, up to 1024; all cores by default.
            samples: Samples per pixel of color, 1 or 4; by default 4, or 1 if the model's `offsamples` is 0.

        Raises:
            TypeError: `model` is not a `mujoco.MjModel`.
            ValueError: A size or number is out of range.
        """
        del font_scale
        self._height, self._width = check_size(height, width)
        self._model = model
        self._capture = SceneCapture(model, max_geom, threads, samples)
        self._scene = self._capture.scene
        self._scene_option = self._capture.option
        self._depth_rendering = False
        self._segmentation_rendering = False

    @property
    def model(self) -> mujoco.MjModel:
        """The model."""
        return self._model

    @property
    def scene(self) -> "mujoco.MjvScene":
        """The scene that `update_scene` fills and `render` draws. Geoms may be appended, flags and lights changed."""
        return self._scene

    @property
    def height(self) -> int:
        """Height of images [pixels]."""
        return self._height

    @property
    def width(self) -> int:
        """Width of images [pixels]."""
        return self._width

    def enable_depth_rendering(self) -> None:
        """Lets `render` return depth."""
        self._segmentation_rendering = False
        self._depth_rendering = True

    def disable_depth_rendering(self) -> None:
        """Ends the rendering of depth."""
        self._depth_rendering = False

    def enable_segmentation_rendering(self) -> None:
        """Lets `render` return object ids and types."""
        self._segmentation_rendering = True
        self._depth_rendering = False

    def disable_segmentation_rendering(self) -> None:
        """Ends the rendering of object ids and types."""
        self._segmentation_rendering = False

    def update_scene(
        self,
        data: mujoco.MjData,
        camera: Union[int, str, "mujoco.MjvCamera"] = -1,
        scene_option: Optional["mujoco.MjvOption"] = None,
    ) -> None:
        """Updates the scene to a state.

        Args:
            data: The state, of the model of this renderer.
            camera: Name or id of a camera of the model, -1 for the free camera, or a `mujoco.MjvCamera`.
            scene_option: Options of the visualizer; the default ones by default.

        Raises:
            ValueError: The model has no such camera, or `data` belongs to another model.
            RuntimeError: The renderer is closed, or another thread uses it.
        """
        capture = self._open()
        with capture.exclusive():
            capture.update(data, camera, scene_option)

    def render(self, *, out: Optional[np.ndarray] = None) -> np.ndarray:
        """Renders the scene.

        Args:
            out: Array for the image, of the shape of the result. Numbers are converted to its type.

        Returns:
            Color, uint8, (height, width, 3). With depth rendering: depth along the optical axis [m], float32,
            (height, width), and the distance of the far clipping plane in the background. With segmentation rendering:
            object id and object type (`mujoco.mjtObj`), int32, (height, width, 2), and (-1, -1) in the background.

        Raises:
            RuntimeError: The renderer is closed, or another thread uses it.
            ValueError: `out` has another shape, or the transform of the scene (`scene.enabletransform`) has no positive
                scale or no unit quaternion.
        """
        capture = self._open()
        size = (self._height, self._width)
        shape: tuple[int, ...]
        dtype: Any
        if self._depth_rendering:
            channel, shape, dtype = "depth", size, np.float32
        elif self._segmentation_rendering:
            channel, shape, dtype = "segmentation", (*size, 2), np.int32
        else:
            channel, shape, dtype = "rgb", (*size, 3), np.uint8
        buffer = output_buffer(out, shape, dtype, "out")
        with capture.exclusive():
            capture.frames.clear()
            capture.capture(self._height, self._width)
            capture.render(self._height, self._width, {channel: buffer})
        if out is None or out is buffer:
            return buffer
        np.copyto(out, buffer, casting="unsafe")
        return out

    def omitted(self) -> list[str]:
        """Messages about elements of the scenes so far that are not rendered."""
        return self._open().frames.omitted()

    def _open(self) -> SceneCapture:
        if self._capture is None:
            raise RuntimeError("render cannot be called after close.")
        return self._capture

    def close(self) -> None:
        """Frees the memory of the renderer. A second call does nothing; other methods raise `RuntimeError`."""
        self._capture = None

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()


def output_buffer(out: Optional[np.ndarray], shape: tuple[int, ...], dtype: Any, name: str) -> np.ndarray:
    """`out` if it can be written directly, or a new array.

    Raises:
        TypeError: `out` is not an array.
        ValueError: `out` has another shape, or is read-only.
    """
    if out is None:
        return np.empty(shape, dtype)
    if not isinstance(out, np.ndarray):
        raise TypeError(f"`{name}` must be a numpy array, not {type(out).__name__}")
    if out.shape != shape:
        raise ValueError(f"Expected `{name}.shape == {shape}`. Got `{name}.shape={out.shape}` instead.")
    if not out.flags.writeable:
        raise ValueError(f"`{name}` is read-only")
    return out if out.dtype == dtype and out.flags.c_contiguous else np.empty(shape, dtype)
