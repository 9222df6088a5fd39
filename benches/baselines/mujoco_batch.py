"""Steps a `mujoco.batch.Batch` or an `mjbatch.Batch` on command, for benches/src/mujoco_batch.rs.

mujoco_batch.py JOB.json: the package, the model file, what is set in the model, starts and number of threads. It then
reads lines from standard input and answers each with one line: `restart`, `block K` (answers with the seconds that K
steps took), `qpos` (answers with all positions as hexadecimal bytes).
"""

import json
import sys
import time

import mujoco
import numpy as np


def load(job):
    if job["reads_poses_and_forces"]:
        # MuJoCo computes cfrc_ext in a step only if a sensor needs it.
        spec = mujoco.MjSpec.from_file(job["model"])
        # Images of textures are not beside the file.
        for material in spec.materials:
            material.textures = [""] * len(material.textures)
        for texture in list(spec.textures):
            spec.delete(texture)
        spec.bodies[1].add_site(name="accelerometer")
        sensor = mujoco.mjtSensor.mjSENS_ACCELEROMETER
        spec.add_sensor(name="a", type=sensor, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="accelerometer")
        model = spec.compile()
    else:
        model = mujoco.MjModel.from_xml_path(job["model"])
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if not job["islands"]:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    for name, values in job["arrays"].items():
        array = getattr(model, name)
        array[...] = np.array(values, dtype=array.dtype).reshape(array.shape)
    return model


def make_batch(job):
    """The batch, and the arguments of its steps."""
    model = load(job)
    if job["package"] == "mjbatch":
        import mjbatch

        return mjbatch.Batch(model, job["envs"], job["threads"]), {}
    import mujoco.batch

    # With poses, the fields after a step are those of the new state.
    arguments = {"stage": mujoco.mjtStage.mjSTAGE_VEL.value} if job["reads_poses_and_forces"] else {}
    return mujoco.batch.Batch(model, nsim=job["envs"], nthread=job["threads"]), arguments


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    batch, arguments = make_batch(job)
    starts = {name: np.array(rows) for name, rows in job["starts"].items()}
    # Views of the state rows: reading them back costs nothing.
    views = {name: batch.bind(name) for name in ["qpos", "qvel", *starts]}
    derived = ["xpos", "xquat", "cfrc_ext"] if job["reads_poses_and_forces"] else []
    views |= {name: batch.bind(name) for name in derived}
    for line in sys.stdin:
        command, *args = line.split()
        answer = "done"
        if command == "restart":
            for name, rows in starts.items():
                views[name][...] = rows
        elif command == "block":
            begin = time.perf_counter()
            for _ in range(int(args[0])):
                batch.step(**arguments)
            answer = repr(time.perf_counter() - begin)
        elif command == "qpos":
            answer = np.ascontiguousarray(views["qpos"]).tobytes().hex()
        print(answer, flush=True)


if __name__ == "__main__":
    main()
