"""Pictures by MuJoCo's own renderer on OSMesa, for mujoco_renderer.rs.

MODEL.xml CAMERA WIDTH HEIGHT OUT: writes OUT/depth (32-bit floats, meters along the optical axis), OUT/element (32-bit
integers: the number of a geom, of a tendon, skin or flex that and a multiple of a million, -1 where nothing is) and OUT/color (bytes, red, green, blue), top row first. Geom groups 0 to 2 are drawn, with
fine tessellation and one sample per pixel; shadows, reflections, fog and skybox are off.
"""

import os
import sys

os.environ["MUJOCO_GL"] = "osmesa"

import mujoco
import numpy as np

model_file, camera, width, height, out = sys.argv[1:]
model = mujoco.MjModel.from_xml_path(model_file)
model.vis.global_.offwidth, model.vis.global_.offheight = int(width), int(height)
model.vis.quality.offsamples = 0
model.vis.quality.numslices, model.vis.quality.numstacks, model.vis.quality.numquads = 256, 128, 1
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
option = mujoco.MjvOption()
option.geomgroup[:] = [1, 1, 1, 0, 0, 0]
option.sitegroup[:] = 0
renderer = mujoco.Renderer(model, int(height), int(width))


def draw():
    renderer.update_scene(data, camera, option)
    for flag in ("SHADOW", "REFLECTION", "FOG", "HAZE", "SKYBOX"):
        renderer.scene.flags[getattr(mujoco.mjtRndFlag, "mjRND_" + flag)] = False
    return renderer.render()


draw().astype(np.uint8).tofile(os.path.join(out, "color"))
renderer.enable_depth_rendering()
draw().astype("<f4").tofile(os.path.join(out, "depth"))
renderer.disable_depth_rendering()
renderer.enable_segmentation_rendering()
segmentation = draw()
renderer.close()
elements = np.full(segmentation.shape[:2], -1)
for multiple, kind in enumerate(("GEOM", "TENDON", "SKIN", "FLEX")):
    is_kind = segmentation[:, :, 1] == int(getattr(mujoco.mjtObj, "mjOBJ_" + kind))
    elements[is_kind] = 1_000_000 * multiple + segmentation[:, :, 0][is_kind]
elements.astype("<i4").tofile(os.path.join(out, "element"))
