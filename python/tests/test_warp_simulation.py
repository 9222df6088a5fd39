"""Simulations on a device against the same on the CPU: MuJoCo Warp computes in single precision.

``KINETOSCOPE_TEST_DEVICE`` names another device than "warp-cpu", such as "cuda:0".
"""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import kinetoscope as ks
from kinetoscope.errors import DeviceError
from kinetoscope.warp import WarpPhysics

pytestmark = pytest.mark.needs_warp

DEVICE = os.environ.get("KINETOSCOPE_TEST_DEVICE", "warp-cpu")

# Rounding of positions below 4 rad or m to single precision, 2**-22, grows in the motion of a stiff arm: measured 1.0e-6 rad over
# 4000 steps. Ten times that is the limit.
POSITION = 1e-5
# One unit in the last place of 113 N m is 7.6e-6; stiffness 1e4 turns 1e-6 rad into 1e-2 N m.
EFFORT = 2e-2


def arm(device, num_envs=3, **fields):
    sim = ks.SimulationManager(num_envs=num_envs, device=device, **fields)
    robot = sim.add_robot(ks.bundled_robot("sr5", uid="arm"))
    return sim, robot


def both(make, act):
    """Results of `act` on both devices."""
    results = []
    for device in ("cpu", DEVICE):
        sim, *handles = make(device)
        try:
            results.append(act(sim, *handles))
        finally:
            sim.destroy()
    return results


def test_motion_of_an_arm():
    def act(sim, robot):
        target = np.array([[0.1, 0.5, -1.5, 0.3, -0.5, 0.0], [0.5, -0.5, 1.0, -0.6, 0.8, 1.0], [0.0] * 6])
        robot.set_qpos_target(target)
        rows = []
        for _ in range(20):
            sim.update(10)
            rows.append((robot.qpos, robot.qvel, robot.qf))
        return [np.stack(values) for values in zip(*rows, strict=True)], sim.time

    ((q, v, f), time), ((q_w, v_w, f_w), time_w) = both(arm, act)
    assert np.abs(q_w - q).max() < POSITION
    assert np.abs(f_w - f).max() < EFFORT
    # At rest; in motion, an error of the position of 1e-6 rad belongs to 1e-4 rad/s at 100 steps per second.
    assert np.abs(v_w[-1] - v[-1]).max() < 1e-4
    assert np.array_equal(time, time_w), "time is counted in double precision"
    assert np.abs(q[-1, 0]).max() > 1.0, "it moves"


def test_writes_and_resets():
    def act(sim, robot):
        robot.set_qpos_target(np.full((3, 6), 0.2))
        sim.update(50)
        robot.write_qpos(np.full((1, 6), 0.5), env_ids=[1])
        robot.write_qvel(np.zeros((1, 6)), env_ids=[1])
        written = robot.qpos
        sim.update(5)
        sim.reset([2])
        after = robot.qpos
        sim.update(20)
        return written, after, robot.qpos, sim.time

    one, other = both(arm, act)
    for a, b in zip(one, other, strict=True):
        assert np.abs(a - b).max() < POSITION
    assert np.array_equal(other[0][1], np.full(6, 0.5)), "a write is exact until the next step"
    assert other[3][2] < other[3][0], "the reset environment starts at time 0"


def test_sensors_of_a_standing_quadruped():
    def make(device):
        cfg = ks.SimulationManagerCfg.legged(num_envs=2, device=device)
        sim = ks.SimulationManager(cfg)
        robot = sim.add_robot(ks.bundled_robot("quadruped", uid="robot"))
        every_step = ks.SamplingCfg()
        feet = sim.add_sensor("feet", ks.ContactSensorCfg(bodies=["robot/.*_FOOT"], sampling=every_step))
        imu = sim.add_sensor("imu", ks.ImuCfg(body="robot/base", sampling=every_step))
        pattern = ks.RayPattern.grid(ks.GridPattern(resolution=0.2, size=(1.0, 0.6)))
        scanner = sim.add_sensor("scanner", ks.RayCasterCfg(parent="robot/base", pattern=pattern, sampling=every_step))
        camera = sim.add_sensor("camera", ks.CameraCfg(width=64, height=48))
        return sim, robot, feet, imu, scanner, camera

    def act(sim, robot, feet, imu, scanner, camera):
        sim.update(300)
        return feet["net_forces_w"], imu["lin_acc_b"], scanner["hits"], camera["rgb"], robot.total_mass

    (force, acceleration, hits, image, mass), (force_w, acceleration_w, hits_w, image_w, _) = both(make, act)
    weight = 9.81 * mass
    # The solver of MuJoCo Warp stops at a residual of single precision: measured 7e-4 N of 511 N.
    assert np.abs(force_w[..., 2].sum(axis=1) - weight).max() < 1e-4 * weight, "the feet carry the robot"
    assert np.abs(force_w - force).max() < 1e-3 * weight
    # 1e-3 of the weight on a leg of a tenth of the mass.
    assert np.abs(acceleration_w - acceleration).max() < 1e-2 * 9.81
    assert np.abs(hits_w - hits).max() < POSITION
    assert (np.abs(image.astype(int) - image_w.astype(int)).max(axis=-1) > 8).mean() < 0.01


def test_randomized_masses_and_gains():
    def act(sim, robot):
        scale = ks.RandomizationOp.scale
        sim.randomize([
            ks.RandomizationTerm(property="mass", pattern="arm/.*", draw=scale([0.8, 1.2])),
            ks.RandomizationTerm(property="stiffness", pattern="arm/.*", draw=scale([0.1, 1.5])),
        ])
        robot.set_qpos_target(np.full((3, 6), 0.4))
        sim.update(100)
        return robot.qpos

    one, other = both(arm, act)
    assert np.abs(one - other).max() < 3e-5, "softer gains sag more"
    assert np.ptp(one, axis=0).max() > 10 * POSITION, "environments differ"


def test_snapshots_move_between_devices():
    sim, robot = arm(DEVICE)
    robot.set_qpos_target(np.full((3, 6), 0.3))
    sim.update(30)
    snapshot, before = sim.snapshot(), robot.qpos
    sim.update(30)
    sim.restore(snapshot)
    assert np.array_equal(robot.qpos, before)
    sim.update(30)
    again = robot.qpos
    sim.restore(snapshot)
    sim.update(30)
    # The order of sums on a GPU, and so the last bits, differ from run to run.
    assert np.abs(robot.qpos - again).max() <= (0.0 if DEVICE == "warp-cpu" else POSITION)
    sim.destroy()


def test_threads_and_reads_change_nothing():
    """Rows are copied when they are read, on all threads."""

    def run(threads, is_read):
        # More environments than one thread copies alone.
        sim, robot = arm(DEVICE, num_envs=40, threads=threads)
        seen = []
        for k in range(1, 11):
            robot.set_qpos_target(np.outer(np.linspace(-0.05, 0.05, 40) * k, np.ones(6)))
            sim.update(2)
            if is_read:
                seen.append((robot.qpos, robot.qf))
        results = [robot.qpos, robot.qvel, robot.qf, np.asarray(sim.time)]
        sim.destroy()
        return results

    expected = run(1, True)
    assert np.abs(expected[0]).max() > 0.1, "it moves"
    for threads, is_read in ((1, False), (2, True), (2, False), (3, False)):
        for number, (one, other) in enumerate(zip(run(threads, is_read), expected, strict=True)):
            # The order of sums on a GPU, and so the last bits, differ from run to run.
            if DEVICE == "warp-cpu":
                assert np.array_equal(one, other), (threads, is_read, number)
            elif number == 0:
                assert np.abs(one - other).max() < POSITION, (threads, is_read)


def test_arrays_without_a_copy():
    sim, robot = arm(DEVICE)
    robot.set_qpos_target(np.full((3, 6), 0.3))
    sim.update(20)
    array = sim.device_array("qpos")
    assert np.array_equal(array.numpy(), robot.qpos.astype(np.float32))
    sim.update(1)
    assert np.array_equal(array.numpy(), robot.qpos.astype(np.float32)), "the same memory after a step"
    sim.destroy()
    cpu, _ = arm("cpu")
    with pytest.raises(DeviceError, match="the device cpu has no arrays of a GPU"):
        cpu.device_array("qpos")
    cpu.destroy()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"device": "gpu"}, "is not a device of the physics: use cpu, cuda, cuda:N"),
        ({"device": "warp-cpu", "integrator": "rk4"}, "cannot simulate the integrator RK4: expected Euler or implicitfast"),
        ({"device": "cuda:99"}, "cuda:99"),
    ],
)
def test_refused_simulations(fields, message):
    with pytest.raises(ks.KinetoscopeError, match=message):
        ks.SimulationManager(**fields)


def test_refused_welds_leave_the_simulation():
    sim, robot = arm(DEVICE)
    sim.add_rigid_object(uid="cube", shape=ks.ObjectShape.box(size=[0.1] * 3))
    with pytest.raises(DeviceError, match=r'cannot simulate the weld "grip"'):
        sim.add_weld(uid="grip", first="arm/link6", second="cube")
    sim.update(3)
    assert np.isfinite(robot.qpos).all()
    sim.destroy()


def test_refused_sizes_leave_the_simulation():
    sim, robot = arm(DEVICE)
    sim.add_rigid_object(uid="cube", shape=ks.ObjectShape.box(size=[0.1] * 3))
    term = ks.RandomizationTerm(property="size", pattern="cube", draw=ks.RandomizationOp.scale([0.8, 1.2]))
    for change in (lambda: sim.randomize([term]), lambda: sim.set_property("size", "cube", [0.04] * 3)):
        with pytest.raises(ks.KinetoscopeError, match='the size of "cube" cannot differ between environments: a device has one size'):
            change()
    sim.update(3)
    assert np.isfinite(robot.qpos).all()
    sim.destroy()


@pytest.mark.parametrize("call", ["write", "step", "read"])
def test_interrupted_calls_end_first(call, monkeypatch):
    """Ctrl+C in a call of the physics is raised after it, and does not freeze the environments."""
    sim, robot = arm(DEVICE)
    sim.update(1)
    original = getattr(WarpPhysics, call)
    sent = []

    def interrupted(physics, *arguments):
        if not sent:
            sent.append(call)
            os.kill(os.getpid(), signal.SIGINT)
        return original(physics, *arguments)

    monkeypatch.setattr(WarpPhysics, call, interrupted)
    robot.set_qpos_target(np.full((3, 6), 0.1))
    with pytest.raises(KeyboardInterrupt):
        sim.update(1)
        assert robot.qpos.shape == (3, 6)
        pytest.fail("Ctrl+C is raised before the next line of the program")
    assert sent and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert len(sim.diverged) == 0
    sim.update(5)
    assert np.abs(robot.qpos).max() > 1e-3, "the arm moves to its targets"
    sim.destroy()


# A pendulum without a drive.
PENDULUM = """<mujoco><worldbody><body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/></body></worldbody></mujoco>"""


def test_targets_of_joints_without_drives_are_their_positions():
    """Also before anything else of a step is read."""
    sim = ks.SimulationManager(num_envs=2, device=DEVICE)
    robot = sim.add_robot(uid="pendulum", mjcf=ks.MjcfFile(text=PENDULUM), drive={"drive_type": "none"})
    sim.update(20)
    targets = robot.qpos_target
    assert np.array_equal(targets, robot.qpos)
    assert (np.abs(targets) > 0.05).all()
    sim.destroy()
