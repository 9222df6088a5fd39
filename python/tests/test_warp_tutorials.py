"""The scenes of the tutorials on a device, for a few steps, against the same on the CPU: reports and images.

The programs are ``create_robot``, ``create_sensor``, ``add_sensors_on_robot`` and ``grasp`` of the folder ``examples``.
``KINETOSCOPE_ROBOTS`` is the folder of the vendors' robots.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from test_warp_simulation import EFFORT, POSITION, both

import kinetoscope as ks

pytestmark = pytest.mark.needs_warp

# An image has up to 140 pixels per meter of its objects. If those move by POSITION, that share of a pixel on an edge gets another
# color; less than half of the pixels are on edges. Elsewhere, levels are rounded.
PIXELS = 140
LEVELS = 1


def camera(sim, eye, target, **fields):
    """A camera that does not move."""
    extrinsics = ks.Extrinsics(placement=ks.Placement.look_at(eye=eye, target=target))
    return sim.add_sensor("camera", ks.CameraCfg(width=160, height=120, extrinsics=extrinsics, **fields))


def arm_with_hand(sim, **fields):
    return sim.add_robot(ks.bundled_robot("sr5_with_hand", uid="robot", **fields))


def create_robot(device):
    """The arm moves, then the hand closes."""
    sim = ks.SimulationManager(num_envs=2, device=device)
    robot = arm_with_hand(sim)
    view = camera(sim, [2.0, 1.5, 1.2], [0.0, 0.0, 0.5])

    def play():
        rows = []
        for part, target in (("arm", [0.0, -0.5, 0.5, -1.0, 0.5, 0.0]), ("hand", robot.qpos_limits[0, robot.joint_ids("hand"), 0])):
            robot.set_qpos_target(np.tile(target, (2, 1)), joint_ids=part)
            sim.update(50)
            rows.append((robot.qpos, robot.qf, view["color"]))
        position, effort, color = (np.stack(values) for values in zip(*rows, strict=True))
        return {"qpos": position, "qf": effort, "color": color}

    return sim, play


def create_sensor(device):
    """The arm passes a cube, with an image of each channel."""
    sim = ks.SimulationManager(num_envs=2, device=device)
    robot = arm_with_hand(sim)
    cube = sim.add_rigid_object(uid="cube", shape=ks.ObjectShape.box(size=[0.05] * 3), mass=1.0, init_pose=[1.2, -0.2, 0.1, 1, 0, 0, 0])
    view = camera(sim, [1.8, 0.3, 0.7], [0.8, -0.1, 0.2], channels=["color", "depth", "mask", "normal"])

    def play():
        robot.set_qpos_target(np.tile([0.0, 0.5, -1.5, 0.3, -0.5, 0.0], (2, 1)), joint_ids="arm")
        sim.update(60)
        return {"qpos": robot.qpos, "pose": cube.pose, **{name: view[name] for name in ("color", "depth", "mask", "normal")}}

    return sim, play


def add_sensors_on_robot(device):
    """The bundled scene of a quadruped that lands on its feet."""
    sim = ks.SimulationManager.from_file(ks.asset("scenes/quadruped.toml"), device=device)

    def play():
        sim.update(100)
        robot = sim["robot"]
        return {
            "qpos": robot.qpos, "pose": robot.root_pose, "hits": sim["height_scanner"]["hits"],
            "forces": sim["contact_forces"]["net_forces_w"] / (9.81 * robot.total_mass), "color": sim["camera"]["rgb"],
            "inverse_distance": 1 / sim["camera"]["distance_to_image_plane"],
        }

    return sim, play


def vendor_quadruped(device):
    """A real robot that lands on its feet, of a file with broken inertias and fixed joints."""
    sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=2, device=device))
    urdf = Path(os.environ["KINETOSCOPE_ROBOTS"], "anymal_c_simple_description/urdf/anymal.urdf")
    robot = sim.add_robot(ks.bundled_robot("quadruped", uid="robot", urdf=str(urdf)))
    feet = sim.add_sensor("feet", ks.ContactSensorCfg(bodies=["robot/.*_FOOT"], sampling=ks.SamplingCfg()))

    def play():
        sim.update(100)
        return {"qpos": robot.qpos, "pose": robot.root_pose, "forces": feet["net_forces_w"] / (9.81 * robot.total_mass)}

    return sim, play


# The grip frame in the frame of the palm, as in `examples/launcher/grip.rs`: fingers down, tilted by 20 degrees.
SIN, COS = (f(math.radians(10)) / math.sqrt(2) for f in (math.sin, math.cos))
TCP = [-0.02, 0.0962, 0.0576, SIN, COS, COS, -SIN]
OPEN, CLOSED = (0.0, -0.35, -0.35), (-0.18, -1.2, -1.2)


def grasp(device):
    """The hand closes on a cube, and lifts it by 5 cm."""
    sim = ks.SimulationManager(ks.SimulationManagerCfg.manipulation(num_envs=2, device=device, physics_dt=0.005))
    fingers = ["LEFT_HAND_THUMB1", "LEFT_HAND_INDEX", "LEFT_HAND_MIDDLE"]
    start = {"JOINT2": 0.3, "JOINT3": -2.2, "JOINT5": 0.6, "JOINT6": math.pi / 2, "LEFT_HAND_THUMB2": -math.pi / 2}
    gains = {"stiffness": {"JOINT[1-6]": 1e4, "LEFT_.*": 1e3}, "damping": {"JOINT[1-6]": 1e3, "LEFT_.*": 1e2}}
    drive = ks.DriveCfg(**gains, max_effort={"LEFT_HAND_(INDEX|MIDDLE|RING|PINKY)": 1.0})
    robot = arm_with_hand(sim, drive=drive, init_qpos=start | dict(zip(fingers, OPEN, strict=True)))
    table = ks.ObjectShape.box(size=[0.4, 0.5, 0.06])
    sim.add_rigid_object(uid="table", shape=table, body_type="static", init_pose=[0.6, -0.15, 0.03, 1, 0, 0, 0])
    cube = sim.add_rigid_object(uid="cube", shape=ks.ObjectShape.box(size=[0.06] * 3), mass=0.2, init_pose=[0.6, -0.15, 0.09, 1, 0, 0, 0])
    view = camera(sim, [1.25, -0.65, 0.75], [0.45, 0.05, 0.25])

    def reach(height):
        target = np.tile([0.6, -0.15, height, 1, 0, 0, 0], (2, 1))
        found = robot.compute_ik(target, "arm", link="left_hand_base", tcp=TCP)
        assert found.success.all()
        return found.qpos

    def move(joints, target, calls):
        start = robot.qpos_target[:, joints]
        for k in range(1, calls + 1):
            robot.set_qpos_target(start + (target - start) * k / calls, joint_ids=joints)
            sim.update(10)

    def play():
        arm = robot.joint_ids("arm")
        robot.write_qpos(reach(0.09), joint_ids=arm)
        robot.set_qpos_target(reach(0.09), joint_ids=arm)
        move(robot.find_joints(fingers), np.array(CLOSED), 20)
        before = cube.pose
        move(arm, reach(0.14), 10)
        sim.update(40)
        return {"lift": cube.pose[:, 2] - before[:, 2], "pose": cube.pose, "color": view["color"]}

    return sim, play


# MuJoCo finds three contact points of the thumb's box and the cube's in this grip, MuJoCo Warp one: the cube turns in the hand by
# the depth of its soft contacts, up to 3 mm. Both hold it.
GRIP = 3e-3
# The camera of the quadruped is 0.4 m or more above the ground. There, the inverse of a distance is linear in its pose.
INVERSE = POSITION / 0.4
# Of forces in weights of the robot, as in test_warp_simulation.
FORCE = 1e-3
# The scene, tolerances of its results, and of its images the largest share of pixels beyond them.
TUTORIALS = {
    "create_robot": (create_robot, {"qpos": POSITION, "qf": EFFORT}, 0.5 * PIXELS * POSITION),
    "create_sensor": (
        create_sensor, {"qpos": POSITION, "pose": POSITION, "depth": POSITION, "mask": 0, "normal": POSITION}, 0.5 * PIXELS * POSITION,
    ),
    "add_sensors_on_robot": (
        add_sensors_on_robot,
        {"qpos": POSITION, "pose": POSITION, "hits": POSITION, "forces": FORCE, "inverse_distance": INVERSE},
        0.5 * PIXELS * POSITION,
    ),
    "vendor_quadruped": (vendor_quadruped, {"qpos": POSITION, "pose": POSITION, "forces": FORCE}, 0),
    # Less than a twentieth of the pixels are on edges of the hand and the cube.
    "grasp": (grasp, {"lift": GRIP, "pose": GRIP}, 0.05 * PIXELS * GRIP),
}
IMAGES = ("color", "depth", "mask", "normal", "inverse_distance")


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.needs_robots] if name.startswith("vendor") else []) for name in TUTORIALS
])
def test_results_are_those_of_the_cpu(name):
    make, tolerances, share = TUTORIALS[name]
    results, others = both(make, lambda _, play: play())
    for key, expected in results.items():
        difference = np.abs(others[key].astype(float) - expected.astype(float))
        beyond = ~(difference <= (tolerances | {"color": LEVELS})[key])
        if key in IMAGES:
            assert beyond.mean() <= share, f"{key}: {beyond.mean()} of the image"
            assert np.ptp(expected) > 0.5, f"{key}: nothing is seen"
        else:
            assert not beyond.any(), f"{key}: {difference.max()}"
    if name == "grasp":
        assert min(results["lift"].min(), others["lift"].min()) > 0.045, "the hand holds the cube"
