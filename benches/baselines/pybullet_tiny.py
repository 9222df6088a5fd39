"""PyBullet's TinyRenderer, which uses one core: color, depth and segmentation from one call.

The scene is MuJoCo's, geom by geom, so that all baselines draw the same; colors of materials become plain colors. The looks:
`plain` (without shadows), `full` (with shadows; there is no multisampling). See camera_job.py for the commands.
"""

import os
import sys
import tempfile

import camera_job
import mujoco
import numpy as np
import pybullet

Geom = mujoco.mjtGeom


def shape(job, geom, folder):
    model = job.mj_model
    kind, size = model.geom_type[geom], model.geom_size[geom]
    rgba = model.geom(geom).rgba if model.geom_matid[geom] < 0 else model.mat_rgba[model.geom_matid[geom]]
    add = lambda kind, **args: pybullet.createVisualShape(kind, rgbaColor=[float(c) for c in rgba], **args)
    if kind == Geom.mjGEOM_PLANE:
        # Its own planes are drawn with a texture; a thin box is what others draw in their place.
        half = [float(s) if s > 0 else 50.0 for s in size[:2]]
        return add(pybullet.GEOM_BOX, halfExtents=[*half, 0.001], visualFramePosition=[0, 0, -0.001])
    if kind == Geom.mjGEOM_SPHERE:
        return add(pybullet.GEOM_SPHERE, radius=float(size[0]))
    if kind == Geom.mjGEOM_CAPSULE:
        return add(pybullet.GEOM_CAPSULE, radius=float(size[0]), length=2 * float(size[1]))
    if kind == Geom.mjGEOM_CYLINDER:
        return add(pybullet.GEOM_CYLINDER, radius=float(size[0]), length=2 * float(size[1]))
    if kind == Geom.mjGEOM_BOX:
        return add(pybullet.GEOM_BOX, halfExtents=[float(s) for s in size])
    if kind == Geom.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[geom])
        first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
        faces = model.mesh_face[int(mesh.faceadr[0]) :][: int(mesh.facenum[0])]
        path = os.path.join(folder, f"{geom}.obj")
        with open(path, "w") as file:
            for x, y, z in model.mesh_vert[first : first + count]:
                file.write(f"v {x:.9g} {y:.9g} {z:.9g}\n")
            for a, b, c in faces + 1:
                file.write(f"f {a} {b} {c}\n")
        return add(pybullet.GEOM_MESH, fileName=path)
    raise ValueError(f"geom {geom} of type {kind}")


def main():
    job = camera_job.Job(sys.argv[1])
    datas = job.datas()
    pybullet.connect(pybullet.DIRECT)
    geoms = job.drawn_geoms()
    with tempfile.TemporaryDirectory() as folder:
        bodies = [pybullet.createMultiBody(baseVisualShapeIndex=shape(job, g, folder)) for g in geoms]
    place(job, datas[0], geoms, bodies)
    data, model = datas[0], job.mj_model
    position, rotation = data.cam_xpos[job.camera], data.cam_xmat[job.camera].reshape(3, 3)
    target = position - rotation[:, 2]
    near, far = 0.01, 100.0
    view = pybullet.computeViewMatrix(position.tolist(), target.tolist(), rotation[:, 1].tolist())
    fovy = float(model.cam_fovy[job.camera])
    projection = pybullet.computeProjectionMatrixFOV(fovy, job.width / job.height, near, far)
    args = {"renderer": pybullet.ER_TINY_RENDERER, "shadow": int(job.look == "full"), "lightDirection": [0.3, -0.4, 1]}
    turn = 0

    def draw():
        _, _, color, depth, segmentation = pybullet.getCameraImage(job.width, job.height, view, projection, **args)
        return color, far * near / (far - (far - near) * depth), segmentation

    def step():
        nonlocal turn
        for _ in range(job.images):
            if job.envs > 1:
                place(job, datas[turn % job.envs], geoms, bodies)
            turn += 1
            draw()

    def depth():
        place(job, datas[0], geoms, bodies)
        return np.reshape(draw()[1], (job.height, job.width))

    camera_job.serve(job, lambda: None, step, depth)


def place(job, data, geoms, bodies):
    quat = np.empty(4)
    for geom, body in zip(geoms, bodies):
        mujoco.mju_mat2Quat(quat, data.geom_xmat[geom])
        pybullet.resetBasePositionAndOrientation(body, data.geom_xpos[geom].tolist(), quat[[1, 2, 3, 0]].tolist())


if __name__ == "__main__":
    main()
