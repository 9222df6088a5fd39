"""Images per second of `mujoco.Renderer` on OSMesa and of this package, in turns: python speed.py MODEL.xml ...

Prints medians over rounds: milliseconds of wall time and of CPU time of the process per image (OSMesa uses all cores),
and their ratios. `update_scene` is part of an image.
"""

import os
import statistics
import sys
import time

os.environ.setdefault("MUJOCO_GL", "osmesa")

import mujoco  # noqa: E402

import kinetoscope_render as kr  # noqa: E402

ROUNDS = 3
SECONDS = 0.25


def measure(renderer, data, camera):
    """Wall and CPU milliseconds per image."""
    start, cpu, count = time.perf_counter(), time.process_time(), 0
    while count < 2 or time.perf_counter() - start < SECONDS:
        renderer.update_scene(data, camera)
        renderer.render()
        count += 1
    return 1e3 * (time.perf_counter() - start) / count, 1e3 * (time.process_time() - cpu) / count


def main():
    for path in sys.argv[1:]:
        model = mujoco.MjModel.from_xml_path(path)
        model.vis.global_.offwidth, model.vis.global_.offheight = 640, 480
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        camera = 0 if model.ncam else -1
        for height, width in ((64, 64), (256, 256), (480, 640)):
            renderers = [mujoco.Renderer(model, height, width), kr.Renderer(model, height, width, threads=1)]
            for kind in ("rgb", "rgb without shadows", "depth", "segmentation"):
                for renderer in renderers:
                    renderer.disable_depth_rendering()
                    renderer.disable_segmentation_rendering()
                    if kind == "depth":
                        renderer.enable_depth_rendering()
                    elif kind == "segmentation":
                        renderer.enable_segmentation_rendering()
                    shadow = int(kind != "rgb without shadows")
                    for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                        renderer.scene.flags[int(flag)] = shadow
                    renderer.update_scene(data, camera)
                    renderer.render()
                times = [[], []]
                for _ in range(ROUNDS):
                    for k, renderer in enumerate(renderers):
                        times[k].append(measure(renderer, data, camera))
                (wall, cpu), (ours, ours_cpu) = (
                    tuple(statistics.median(column) for column in zip(*times[k])) for k in (0, 1)
                )
                print(f"{os.path.basename(path):20} {width:3} x {height:3} {kind:20} wall {wall:7.2f} {ours:6.2f} ms, "
                      f"{wall / ours:5.1f} x;  CPU {cpu:7.2f} {ours_cpu:6.2f} ms, {cpu / ours_cpu:5.1f} x", flush=True)
            for renderer in renderers:
                if hasattr(renderer, "close"):
                    renderer.close()


if __name__ == "__main__":
    main()
