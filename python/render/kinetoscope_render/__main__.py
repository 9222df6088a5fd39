"""`python -m kinetoscope_render doctor`: checks an installation."""

from __future__ import annotations

import argparse
import platform
import sys
import time

_MODEL = """<mujoco>
  <asset><texture name="grid" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".1 .2 .3" width="64" height="64"/>
    <material name="grid" texture="grid" texrepeat="4 4"/></asset>
  <worldbody><light pos="0 0 3"/><geom type="plane" size="1 1 .1" material="grid"/>
    <geom name="ball" pos="0 0 .2" size=".2" rgba=".8 .2 .1 1"/></worldbody></mujoco>"""


def doctor() -> int:
    """Prints versions, renders a test frame and lists what `patch_mujoco` replaces. Returns the exit code."""
    import numpy as np

    print(f"python      {platform.python_version()} on {platform.platform()}")
    print(f"numpy       {np.__version__}")
    start = time.perf_counter()
    try:
        import mujoco
    except ImportError as error:
        print(f"mujoco      missing: {error}. Install it: pip install mujoco")
        return 1
    import kinetoscope_render as kr
    from kinetoscope_render.layout import LayoutError, layouts

    print(f"mujoco      {mujoco.__version__}")
    print(f"this        {kr.__version__}")
    try:
        found = layouts()
    except LayoutError as error:
        print(f"layouts     not recognized: {error}")
        return 1
    print(f"layouts     mjvGeom {found.geom['stride']} bytes, mjvLight {found.light['stride']} bytes")
    model = mujoco.MjModel.from_xml_string(_MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with kr.Renderer(model, 120, 160) as renderer:
        renderer.update_scene(data)
        rgb = renderer.render()
        renderer.enable_segmentation_rendering()
        ids = renderer.render()[..., 0]
    seconds = time.perf_counter() - start
    if set(np.unique(ids)) != {0, 1} and set(np.unique(ids)) != {-1, 0, 1} or rgb.std() < 5:
        print(f"test frame  wrong: ids {np.unique(ids)}, mean color {rgb.mean():.1f}")
        return 1
    print(f"test frame  160 x 120, mean color {rgb.mean():.1f}, {seconds:.2f} s from the import of mujoco on")
    print("patch_mujoco() replaces:")
    for name in kr.patch_mujoco():
        print(f"  {name}")
    return 0


def main() -> int:
    """Runs the command line."""
    parser = argparse.ArgumentParser(prog="python -m kinetoscope_render", description=__doc__)
    parser.add_argument("command", choices=["doctor"])
    parser.parse_args()
    return doctor()


if __name__ == "__main__":
    sys.exit(main())
