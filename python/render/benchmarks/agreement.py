"""Compares images with those of the installed `mujoco.Renderer`: python agreement.py [--images FOLDER] MODEL.xml ...

Prints a row for each model and camera: PSNR of color with the default flags and without shadows and reflections, the
fraction of pixels whose bytes differ by at most 4, equal segmentation inside silhouettes, and errors of depth. Then the
medians over models. With --images, writes MuJoCo's image, ours and four times their difference.
"""

import argparse
import os
import pathlib

os.environ.setdefault("MUJOCO_GL", "osmesa")

import mujoco  # noqa: E402
import numpy as np  # noqa: E402

import kinetoscope_render as kr  # noqa: E402


def images(cls, model, data, camera, size):
    renderer = cls(model, *size)
    renderer.update_scene(data, camera)
    rgb = renderer.render().copy()
    renderer.enable_depth_rendering()
    depth = renderer.render().copy()
    renderer.disable_depth_rendering()
    renderer.enable_segmentation_rendering()
    ids = renderer.render().copy()
    renderer.disable_segmentation_rendering()
    for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
        renderer.scene.flags[int(flag)] = 0
    plain = renderer.render().copy()
    if hasattr(renderer, "close"):
        renderer.close()
    return rgb, plain, depth, ids


def psnr(a, b):
    mse = ((a.astype(float) - b) ** 2).mean()
    return min(99.0, 10 * np.log10(255**2 / max(mse, 1e-12)))


def compare(path, folder):
    """Rows (PSNR, PSNR without effects, near, segmentation, depth) of a model; empty if it does not load."""
    name = f"{path.parent.name}/{path.name}"
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        print(f"{name}: does not load: {str(error).splitlines()[0][:80]}")
        return []
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    size = min(240, model.vis.global_.offheight), min(320, model.vis.global_.offwidth)
    rows = []
    for camera in [-1, *range(min(2, model.ncam))]:
        try:
            ours = images(kr.Renderer, model, data, camera, size)
        except NotImplementedError as error:
            print(f"{name} camera {camera}: {error}")
            continue
        theirs = images(mujoco.Renderer, model, data, camera, size)
        same = (theirs[3] == ours[3]).all(-1)
        key = theirs[3][..., 0].astype(np.int64) * 1000 + theirs[3][..., 1]
        inside = np.ones(key.shape, bool)
        for y in (-1, 0, 1):
            for x in (-1, 0, 1):
                inside &= np.roll(np.roll(key, y, 0), x, 1) == key
        hit = same & inside & (theirs[2] < 0.99 * model.vis.map.zfar * model.stat.extent)
        error = np.abs(theirs[2] - ours[2])[hit] / theirs[2][hit] if hit.any() else np.zeros(1)
        near = (np.abs(theirs[0].astype(int) - ours[0]).max(-1) <= 4).mean()
        row = (
            psnr(theirs[0], ours[0]), psnr(theirs[1], ours[1]), near,
            same[inside].mean() if inside.any() else 1.0, float(np.median(error)),
        )
        rows.append(row)
        print(f"{name:44} camera {camera:2}  PSNR {row[0]:5.1f} plain {row[1]:5.1f}  within 4 {row[2]:.3f}  "
              f"segmentation {row[3]:.5f}  depth {row[4]:.1e}", flush=True)
        if folder:
            from PIL import Image

            difference = np.clip(4 * np.abs(theirs[0].astype(int) - ours[0]), 0, 255).astype(np.uint8)
            Image.fromarray(np.concatenate([theirs[0], ours[0], difference], 1)).save(
                folder / f"{path.parent.name}-{path.stem}.{camera}.png"
            )
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+", type=pathlib.Path)
    parser.add_argument("--images", type=pathlib.Path)
    args = parser.parse_args()
    if args.images:
        args.images.mkdir(parents=True, exist_ok=True)
    models = [rows for rows in (compare(path, args.images) for path in args.models) if rows]
    views = np.array([row for rows in models for row in rows])
    if not len(views):
        return
    worst = np.array([np.min(np.array(rows)[:, :4], axis=0) for rows in models])
    print(f"\n{len(models)} models, {len(views)} views, mujoco {mujoco.__version__}")
    for k, name in enumerate(("PSNR", "PSNR plain", "within 4", "segmentation")):
        quartiles = np.percentile(views[:, k], [0, 10, 25, 50])
        print(f"{name:13} minimum {quartiles[0]:.4g}, 10 % {quartiles[1]:.4g}, 25 % {quartiles[2]:.4g}, "
              f"median {quartiles[3]:.4g}; median of the worst view of each model {np.median(worst[:, k]):.4g}")
    print(f"PSNR: {(views[:, 0] >= 40).mean():.2f} of views at 40 dB and more, {(views[:, 0] >= 30).mean():.2f} at 30")
    print(f"segmentation: {(views[:, 3] >= 0.999).mean():.2f} of views at 0.999 and more")
    print(f"depth: median of medians {np.median(views[:, 4]):.1e}, {(views[:, 4] < 1e-6).mean():.2f} of views below 1e-6")


if __name__ == "__main__":
    main()
