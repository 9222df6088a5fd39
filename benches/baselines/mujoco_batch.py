"""Steps a `mujoco.batch.Batch` on command, for benches/src/mujoco_batch.rs.

mujoco_batch.py JOB.json: the model file, what is set in the model, starts and number of threads. It then reads lines from
standard input and answers each with one line: `restart`, `block K` (answers with the seconds that K steps took), `qpos`
(answers with all positions as hexadecimal bytes).
"""

import json
import sys
import time

import mujoco
import mujoco.batch
import numpy as np


def load(job):
    model = mujoco.MjModel.from_xml_path(job["model"])
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if not job["islands"]:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    for name, values in job["arrays"].items():
        array = getattr(model, name)
        array[...] = np.array(values, dtype=array.dtype).reshape(array.shape)
    return model


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    batch = mujoco.batch.Batch(load(job), nsim=job["envs"], nthread=job["threads"])
    starts = {name: np.array(rows) for name, rows in job["starts"].items()}
    # Views of the state rows: reading them back costs nothing.
    views = {name: batch.bind(name) for name in ["qpos", "qvel", *starts]}
    for line in sys.stdin:
        command, *args = line.split()
        answer = "done"
        if command == "restart":
            for name, rows in starts.items():
                views[name][...] = rows
        elif command == "block":
            begin = time.perf_counter()
            for _ in range(int(args[0])):
                batch.step()
            answer = repr(time.perf_counter() - begin)
        elif command == "qpos":
            answer = np.ascontiguousarray(views["qpos"]).tobytes().hex()
        print(answer, flush=True)


if __name__ == "__main__":
    main()
