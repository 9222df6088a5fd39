"""Comparison of images with those of MuJoCo's own renderer: for the tests, and for `benchmarks/agreement.py`."""

from __future__ import annotations

import os
from dataclasses import dataclass

os.environ.setdefault("MUJOCO_GL", "osmesa")

import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import kinetoscope_render as kr  # noqa: E402


@dataclass(frozen=True)
class Images:
    """Images of one view: color, color without shadows and reflections, depth [m], object ids and types."""

    rgb: np.ndarray
    plain: np.ndarray
    depth: np.ndarray
    ids: np.ndarray


def segmentation(renderer):
    """Segmentation of the scene.

    MuJoCo 2 sometimes reads no pixels in long runs of many renderers, and takes the content of new memory for ids: then
    it fails with an IndexError, and the next call succeeds.
    """
    attempts = 3 if mujoco.__version__.startswith("2.") else 1
    for attempt in range(attempts):
        try:
            return renderer.render().copy()
        except IndexError:
            if attempt + 1 == attempts:
                raise


def images(renderer, data, camera) -> Images:
    """All images of a state."""
    renderer.update_scene(data, camera)
    rgb = renderer.render().copy()
    renderer.enable_depth_rendering()
    depth = renderer.render().copy()
    renderer.disable_depth_rendering()
    renderer.enable_segmentation_rendering()
    ids = segmentation(renderer)
    renderer.disable_segmentation_rendering()
    flags = renderer.scene.flags
    effects = [int(flag) for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)]
    before = flags[effects].copy()
    flags[effects] = 0
    plain = renderer.render().copy()
    flags[effects] = before
    return Images(rgb, plain, depth, ids)


def close(renderer) -> None:
    """Closes a renderer; those of some versions of MuJoCo cannot be closed."""
    if hasattr(renderer, "close"):
        renderer.close()


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal to noise ratio of two images of bytes [dB], at most 99."""
    mse = ((a.astype(float) - b) ** 2).mean()
    return min(99.0, 10 * np.log10(255**2 / max(mse, 1e-12)))


def inside(ids: np.ndarray) -> np.ndarray:
    """Pixels whose eight neighbors show the same object."""
    key = ids[..., 0].astype(np.int64) * 1000 + ids[..., 1]
    same = np.ones(key.shape, bool)
    for y in (-1, 0, 1):
        for x in (-1, 0, 1):
            same &= np.roll(np.roll(key, y, 0), x, 1) == key
    return same


@dataclass(frozen=True)
class Agreement:
    """Agreement of two images of a view.

    PSNR of color and of color without shadows and reflections [dB]; fraction of pixels whose bytes differ by at most 4;
    fraction of equal ids inside silhouettes; median of relative differences of depth there.
    """

    psnr: float
    plain: float
    near: float
    segmentation: float
    depth: float


def agreement(theirs: Images, ours: Images, far: float) -> Agreement:
    """Agreement of images; `far` is the depth of the background [m]."""
    same, inner = (theirs.ids == ours.ids).all(-1), inside(theirs.ids)
    hit = same & inner & (theirs.depth < 0.99 * far)
    error = np.abs(theirs.depth - ours.depth)[hit] / theirs.depth[hit] if hit.any() else np.zeros(1)
    return Agreement(
        psnr=psnr(theirs.rgb, ours.rgb),
        plain=psnr(theirs.plain, ours.plain),
        near=float((np.abs(theirs.rgb.astype(int) - ours.rgb).max(-1) <= 4).mean()),
        segmentation=float(same[inner].mean()) if inner.any() else 1.0,
        depth=float(np.median(error)),
    )


def cameras(model: mujoco.MjModel) -> list[tuple[str, object]]:
    """Three views with names: the free camera, the first cameras of the model, and further free cameras."""
    views: list[tuple[str, object]] = [("free", -1), *((f"camera {k}", k) for k in range(min(2, model.ncam)))]
    while len(views) < 3:
        camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, camera)
        camera.azimuth += 120 * len(views)
        camera.elevation = -20
        views.append((f"free {len(views) + 1}", camera))
    return views


def compare_model(model: mujoco.MjModel, size: tuple[int, int], folder=None, name: str = "") -> dict[str, Agreement]:
    """Agreement of three views by name. With a folder, writes MuJoCo's image, ours and four times their difference."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    visual = model.vis
    visual.global_.offheight = max(visual.global_.offheight, size[0])
    visual.global_.offwidth = max(visual.global_.offwidth, size[1])
    rows = {}
    theirs, ours = mujoco.Renderer(model, *size), kr.Renderer(model, *size)
    for view, camera in cameras(model):
        pair = images(theirs, data, camera), images(ours, data, camera)
        rows[view] = agreement(*pair, visual.map.zfar * model.stat.extent)
        if folder is not None:
            from PIL import Image

            difference = np.clip(4 * np.abs(pair[0].rgb.astype(int) - pair[1].rgb), 0, 255).astype(np.uint8)
            joined = np.concatenate([pair[0].rgb, pair[1].rgb, difference], 1)
            Image.fromarray(joined).save(folder / f"{name.replace('/', '-')}.{view}.png")
    close(theirs)
    close(ours)
    return rows
