"""MuJoCo's own renderer on OSMesa (Mesa's software renderer): color, depth and segmentation of every image.

By `passes`: `api` is `mujoco.Renderer`, MuJoCo's renderer as its documentation shows it, a pass for each of the three;
`by_hand` is the same library with as few passes as there can be, one for color and one for depth and segmentation
together, read without copies, for which members of `mujoco.Renderer` are used that are not public.

The looks: `plain` (shadows, reflections, skybox, fog and multisampling off, buffers of the image's size), `full` (the same
with shadows and four samples per pixel; `shadow_size` replaces the size of the shadow map), `defaults` (the model's own
quality, nothing switched off). See camera_job.py for the commands.
"""

import os
import sys

os.environ["MUJOCO_GL"] = "osmesa"

import camera_job
import mujoco
import numpy as np

Flag = mujoco.mjtRndFlag


def renderer_of(job):
    """`mujoco.Renderer` with the settings of the job's look."""
    model, look = job.mj_model, job.look
    if look == "defaults":
        model.vis.global_.offwidth = max(model.vis.global_.offwidth, job.width)
        model.vis.global_.offheight = max(model.vis.global_.offheight, job.height)
        return mujoco.Renderer(model, job.height, job.width)
    model.vis.global_.offwidth, model.vis.global_.offheight = job.width, job.height
    model.vis.quality.offsamples = 4 if look == "full" else 0
    if job.shadow_size:
        model.vis.quality.shadowsize = job.shadow_size
    renderer = mujoco.Renderer(model, job.height, job.width)
    for flag in (Flag.mjRND_REFLECTION, Flag.mjRND_SKYBOX, Flag.mjRND_FOG, Flag.mjRND_HAZE):
        renderer.scene.flags[flag] = False
    renderer.scene.flags[Flag.mjRND_SHADOW] = look == "full"
    return renderer


class Api:
    """What `mujoco.Renderer` offers."""

    def __init__(self, job):
        self.job, self.renderer, self.option = job, renderer_of(job), option(job)

    def draw(self, data):
        renderer = self.renderer
        renderer.update_scene(data, self.job.camera, self.option)
        color = renderer.render()
        renderer.enable_depth_rendering()
        depth = renderer.render()
        renderer.enable_segmentation_rendering()
        segmentation = renderer.render()
        renderer.disable_segmentation_rendering()
        return color, depth, segmentation


class ByHand:
    """Two passes, and no copies."""

    def __init__(self, job):
        model = job.mj_model
        self.job, self.renderer, self.option = job, renderer_of(job), option(job)
        self.rect = mujoco.MjrRect(0, 0, job.width, job.height)
        self.color = np.empty((job.height, job.width, 3), np.uint8)
        self.ids = np.empty((job.height, job.width, 3), np.uint8)
        self.depth = np.empty((job.height, job.width), np.float32)
        near, far = (np.float32(z * model.stat.extent) for z in (model.vis.map.znear, model.vis.map.zfar))
        # As in mujoco.Renderer: with a reversed depth buffer, distance = d / (buffer + c).
        self.c = np.float32(0.5) * (far + near) / (far - near) - np.float32(0.5)
        self.d = far * near / (far - near)

    def draw(self, data):
        renderer, scene = self.renderer, self.renderer.scene
        context = renderer._mjr_context
        renderer.update_scene(data, self.job.camera, self.option)
        mujoco.mjr_render(self.rect, scene, context)
        mujoco.mjr_readPixels(self.color, None, self.rect, context)
        scene.flags[Flag.mjRND_SEGMENT] = scene.flags[Flag.mjRND_IDCOLOR] = True
        mujoco.mjr_render(self.rect, scene, context)
        mujoco.mjr_readPixels(self.ids, self.depth, self.rect, context)
        scene.flags[Flag.mjRND_SEGMENT] = scene.flags[Flag.mjRND_IDCOLOR] = False
        # All scenes here have fewer than 65535 geoms.
        numbers = self.ids[:, :, 0].astype(np.uint16) | (self.ids[:, :, 1].astype(np.uint16) << 8)
        # The bottom row is the first: a view costs nothing.
        return self.color[::-1], (self.d / (self.depth + self.c))[::-1], numbers[::-1]


def option(job):
    option = mujoco.MjvOption()
    option.geomgroup[:] = [group in job.groups for group in range(len(option.geomgroup))]
    option.sitegroup[:] = 0
    return option


def main():
    job = camera_job.Job(sys.argv[1])
    drawer = Api(job) if job.passes == "api" else ByHand(job)
    datas = job.datas()
    turn = 0

    def step():
        nonlocal turn
        for _ in range(job.images):
            data = datas[turn % job.envs]
            turn += 1
            for _ in range(job.physics):
                mujoco.mj_step(job.mj_model, data)
            drawer.draw(data)

    camera_job.serve(job, lambda: job.restart(datas), step, lambda: drawer.draw(datas[0])[1])


if __name__ == "__main__":
    main()
