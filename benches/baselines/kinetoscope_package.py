"""Uses the Python package `kinetoscope` on command, for benches/src/python.rs.

kinetoscope_package.py JOB.json: the case and its size. It then reads lines from standard input and answers each with one
line of numbers: seconds, or bytes in hexadecimal.
"""

import json
import sys
import time

import numpy as np

import kinetoscope as ks


class Loop:
    """Steps quadrupeds with new targets, and reads their joints."""

    def __init__(self, job):
        self.sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=job["envs"], threads=job["threads"]))
        self.robot = self.sim.add_robot(ks.bundled_robot("quadruped"))
        start = self.robot.default_qpos
        self.targets = [start + 0.05, start - 0.05]
        self.start = self.sim.snapshot()
        self.restart()

    def restart(self):
        self.sim.restore(self.start)
        self.steps = 0
        self.last = self.robot.qpos
        return "done"

    def block(self, count):
        sim, robot, targets = self.sim, self.robot, self.targets
        begin = time.perf_counter()
        for step in range(self.steps, self.steps + int(count)):
            robot.set_qpos_target(targets[step // 10 % 2])
            sim.update(1)
            self.last = robot.qpos
        seconds = time.perf_counter() - begin
        self.steps += int(count)
        return repr(seconds)

    def qpos(self):
        return np.ascontiguousarray(self.last).tobytes().hex()


class Calls:
    """Calls small functions of a simulation with one arm."""

    def __init__(self, job):
        self.sim = ks.SimulationManager(threads=1)
        self.robot = self.sim.add_robot(ks.bundled_robot("sr5"))
        self.targets = np.zeros((1, 6))

    def call(self, name, count):
        sim, robot, targets = self.sim, self.robot, self.targets
        call = {
            "qpos": lambda: robot.qpos,
            "time": lambda: sim.time,
            "set_qpos_target": lambda: robot.set_qpos_target(targets),
        }[name]
        begin = time.perf_counter()
        for _ in range(int(count)):
            call()
        return repr(time.perf_counter() - begin)


class Image:
    """Reads the images of a camera into an array, and copies an array of the same size."""

    def __init__(self, job):
        width, height = job["size"]
        self.sim = ks.SimulationManager(num_envs=job["envs"], threads=1)
        self.sim.add_robot(ks.bundled_robot("sr5"))
        look = ks.Placement.look_at(eye=[2, 0, 1], target=[0, 0, 0.3])
        extrinsics = ks.Extrinsics(placement=look)
        self.camera = self.sim.add_sensor("camera", ks.CameraCfg(width=width, height=height, extrinsics=extrinsics))
        self.source = self.camera["color"]
        self.out = np.zeros_like(self.source)
        assert self.source.nbytes == 4 * width * height * job["envs"]

    def read(self, count):
        camera, out = self.camera, self.out
        begin = time.perf_counter()
        for _ in range(int(count)):
            camera.read("color", out=out)
        seconds = time.perf_counter() - begin
        assert (out == self.source).all()
        return repr(seconds)

    def copy(self, count):
        source, out = self.source, self.out
        begin = time.perf_counter()
        for _ in range(int(count)):
            np.copyto(out, source)
        return repr(time.perf_counter() - begin)


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    case = {"loop": Loop, "calls": Calls, "image": Image}[job["case"]](job)
    for line in sys.stdin:
        command, *args = line.split()
        print(getattr(case, command)(*args), flush=True)


if __name__ == "__main__":
    main()
