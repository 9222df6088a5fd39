"""MuJoCo Warp's ray caster on its CPU device, which uses one core: color, depth and segmentation of all environments.

The looks: `plain` (without shadows), `full` (with shadows and four samples per pixel). See camera_job.py for the commands.
"""

import contextlib
import sys

# Warp tells on standard output what it compiles; that belongs to the answers here.
answers, sys.stdout = sys.stdout, sys.stderr

import warp as wp

# Before the import of mujoco_warp, which starts it.
wp.config.log_level = wp.LOG_ERROR

import camera_job
import mujoco_warp as mjw

# It gives depths in this unit, at most 1 [m].
FAR = 100.0


def main():
    job = camera_job.Job(sys.argv[1])
    datas = job.datas()
    full = job.look == "full"
    with wp.ScopedDevice("cpu"):
        model = mjw.put_model(job.mj_model)
        data = mjw.put_data(job.mj_model, datas[0], nworld=job.envs)
        for name in ("geom_xpos", "geom_xmat", "cam_xpos", "cam_xmat", "light_xpos", "light_xdir"):
            array = getattr(data, name)
            host = array.numpy()
            for world, one in enumerate(datas):
                host[world] = getattr(one, name).reshape(host[world].shape)
            array.assign(host)
        context = mjw.create_render_context(
            job.mj_model,
            nworld=job.envs,
            cam_res=(job.width, job.height),
            render_rgb=True,
            render_depth=True,
            render_seg=True,
            use_shadows=full,
            samples_per_pixel=2 if full else 1,
            enabled_geom_groups=job.groups,
            cam_active=["bench"],
        )
        shape = (job.envs, job.height, job.width)
        color = wp.zeros(shape, dtype=wp.vec3f)
        depth = wp.zeros(shape, dtype=wp.float32)
        segmentation = wp.zeros(shape, dtype=wp.vec2i)

        def draw():
            mjw.refit_bvh(model, data, context)
            mjw.render(model, data, context)
            mjw.get_rgb(context, 0, color)
            mjw.get_depth(context, 0, FAR, depth)
            mjw.get_segmentation(context, 0, segmentation)

        # Compiles the kernels; a captured graph then starts them with the least overhead there can be.
        draw()
        try:
            with wp.ScopedCapture() as capture:
                draw()
            step = lambda: wp.capture_launch(capture.graph)
            step()
        except Exception as error:
            print(f"warp_rays.py: no graph, {error}", file=sys.stderr)
            step = draw
        with contextlib.redirect_stdout(answers):
            camera_job.serve(job, lambda: None, step, lambda: FAR * depth.numpy()[0])


if __name__ == "__main__":
    main()
