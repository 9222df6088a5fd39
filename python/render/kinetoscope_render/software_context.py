"""The rendering functions of `mujoco` (`MjrContext`, `mjr_render`, `mjr_readPixels`, ...) without OpenGL.

`patch_mujoco` puts them in the place of the originals, which Gymnasium, dm_control and robosuite call. Calls with an
original context, from before `patch_mujoco`, go to the originals.
"""

from __future__ import annotations

import functools
from typing import Any, Callable, Optional

import mujoco
import numpy as np

from kinetoscope_render.flag_colors import FlagColors
from kinetoscope_render.scene import SceneCapture


class GLContext:
    """An OpenGL context that does nothing."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    def make_current(self) -> None:
        """Does nothing."""

    def free(self) -> None:
        """Does nothing."""


class MjrContext:
    """A rendering context: the renderer of one model, with the attributes of `mujoco.MjrContext` that programs read."""

    def __init__(self, model: Any = None, font_scale: Any = None) -> None:
        """Creates a context. Without a model it renders nothing."""
        del font_scale
        self._capture: Optional[SceneCapture] = None
        self._size = (0, 0)
        self._colors: Optional[FlagColors] = None
        self.offWidth = self.offHeight = 0
        self.offSamples = 0
        self.currentBuffer = int(mujoco.mjtFramebuffer.mjFB_OFFSCREEN)
        self.readDepthMap = 0
        # Model whose textures, meshes or height fields changed since the last image.
        self._changed: Any = None
        if model is not None:
            self._capture = SceneCapture(model, 1, None, None)
            visual = model.vis
            self.offWidth, self.offHeight = visual.global_.offwidth, visual.global_.offheight
            self.offSamples = visual.quality.offsamples

    def free(self) -> None:
        """Frees the memory of the renderer."""
        self._capture = None

    def _open(self) -> SceneCapture:
        if self._capture is None:
            raise RuntimeError("the rendering context has no model, or was freed")
        return self._capture


def _for_our_context(function: Callable[..., None]) -> Callable[..., None]:
    """`function` for contexts of this module, and the original of the same name for others."""
    original = getattr(mujoco, function.__name__, None)

    @functools.wraps(function)
    def dispatch(*args: Any, **kwargs: Any) -> None:
        is_ours = any(isinstance(value, MjrContext) for value in (*args, *kwargs.values()))
        if is_ours or original is None:
            function(*args, **kwargs)
        else:
            original(*args, **kwargs)

    return dispatch


def _extent(viewport: Any) -> tuple[int, int]:
    if viewport.left or viewport.bottom:
        raise NotImplementedError("viewports that do not begin at (0, 0) are not supported")
    return int(viewport.height), int(viewport.width)


@_for_our_context
def mjr_render(viewport: Any, scn: Any, con: MjrContext) -> None:
    """Captures a scene; `mjr_readPixels` renders it."""
    capture, (height, width) = con._open(), _extent(viewport)
    with capture.exclusive():
        if con._changed is not None:
            capture.reload(con._changed)
            con._changed = None
        capture.use_scene(scn)
        capture.frames.clear()
        capture.capture(height, width)
    con._size, con._colors = (height, width), FlagColors(scn)


@_for_our_context
def mjr_readPixels(rgb: Any, depth: Any, viewport: Any, con: MjrContext) -> None:
    """Renders the captured scene, from the lowest row, into the given arrays: color, and OpenGL's depth in 0..=1.

    With the flag `mjRND_SEGMENT`, colors are segmentation ids plus 1.
    """
    capture, (height, width) = con._open(), _extent(viewport)
    colors = con._colors
    if colors is None or (height, width) != con._size:
        raise ValueError(f"the viewport is {width} x {height}, but the scene was rendered to "
                         f"{con._size[1]} x {con._size[0]}")
    wanted: dict[str, np.ndarray] = {}
    if rgb is not None:
        wanted["rgb"] = np.empty((height, width, 3), np.uint8)
    if depth is not None:
        wanted["depth"] = np.empty((height, width), np.float32)
    if not wanted:
        return
    # Without the segmentation flag, depth shows all that color shows.
    with capture.exclusive():
        capture.render(height, width, wanted, surfaces_of_color=not colors.is_segments)
    if rgb is not None:
        _store(rgb, wanted["rgb"][::-1], "rgb")
    if depth is not None:
        from_far = colors.nearness(wanted["depth"])
        zero_far = getattr(mujoco, "mjtDepthMap", None) is not None and int(con.readDepthMap) == int(
            mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        )
        _store(depth, (from_far if zero_far else 1.0 - from_far)[::-1], "depth")


def _store(array: np.ndarray, image: np.ndarray, name: str) -> None:
    if array.size != image.size:
        raise ValueError(f"{name} has {array.size} numbers, but the image has {image.size}")
    array[...] = image.reshape(array.shape)


@_for_our_context
def mjr_setBuffer(framebuffer: Any, con: MjrContext) -> None:
    """Selects the framebuffer: only the offscreen one exists."""
    con.currentBuffer = int(framebuffer)


@_for_our_context
def mjr_resizeOffscreen(width: int, height: int, con: MjrContext) -> None:
    """Sets the size of the offscreen framebuffer, which limits nothing."""
    con.offWidth, con.offHeight = width, height


@_for_our_context
def mjr_uploadTexture(m: Any, con: MjrContext, texid: int) -> None:
    """Copies the textures of a model again before the next image."""
    del texid
    con._open()
    con._changed = m


@_for_our_context
def mjr_uploadMesh(m: Any, con: MjrContext, meshid: int) -> None:
    """Copies the meshes of a model again before the next image."""
    del meshid
    con._open()
    con._changed = m


@_for_our_context
def mjr_uploadHField(m: Any, con: MjrContext, hfieldid: int) -> None:
    """Copies the height fields of a model again before the next image."""
    del hfieldid
    con._open()
    con._changed = m


@_for_our_context
def mjr_overlay(*_: Any, **__: Any) -> None:
    """Text over images is not rendered."""
