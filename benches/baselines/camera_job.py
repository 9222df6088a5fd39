"""The job description and the commands that the camera baselines share, for benches/src/camera/sides.rs.

SCRIPT JOB.json, then lines on standard input, each answered with one line: `restart`, `block K` (answers with the seconds
that K steps took; a step draws `images` images), `depth` (answers with the depth image of the first environment as
hexadecimal bytes, 32-bit floats, top row first), `triangles` (of all meshes that are drawn).

The job: `model` (an MJCF file with a camera "bench"), `size` (width and height), `groups` (geom groups that are drawn),
`envs`, `starts` (positions of the joints of every environment), `images` (environments drawn per step, in turn),
`physics` (physics steps of an environment before it is drawn), `look` and `passes` (what is drawn and how, see the scripts).
"""

import json
import sys
import time

import mujoco
import numpy as np


class Job:
    def __init__(self, path):
        with open(path) as file:
            self.__dict__.update(json.load(file))
        self.width, self.height = self.size
        self.mj_model = mujoco.MjModel.from_xml_path(self.model)
        self.camera = self.mj_model.camera("bench").id

    def datas(self):
        """An `MjData` for each environment, at its start."""
        datas = [mujoco.MjData(self.mj_model) for _ in range(self.envs)]
        self.restart(datas)
        return datas

    def restart(self, datas):
        for data, qpos in zip(datas, self.starts):
            mujoco.mj_resetData(self.mj_model, data)
            data.qpos[:] = qpos
            mujoco.mj_forward(self.mj_model, data)

    def drawn_geoms(self):
        model = self.mj_model
        return [g for g in range(model.ngeom) if model.geom_group[g] in self.groups and model.geom(g).rgba[3] > 0]

    def triangles(self):
        model = self.mj_model
        meshes = [g for g in self.drawn_geoms() if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH]
        return int(sum(model.mesh_facenum[model.geom_dataid[g]] for g in meshes))


def serve(job, restart, step, depth):
    """Answers commands: `step()` is what is timed, `depth()` the first environment's image."""
    for line in sys.stdin:
        command, *args = line.split()
        answer = "done"
        if command == "restart":
            restart()
        elif command == "block":
            begin = time.perf_counter()
            for _ in range(int(args[0])):
                step()
            answer = repr(time.perf_counter() - begin)
        elif command == "depth":
            answer = np.ascontiguousarray(depth(), dtype="<f4").tobytes().hex()
        elif command == "triangles":
            answer = str(job.triangles())
        print(answer, flush=True)
