"""Entities, states, kinematics, properties, snapshots, shards, recordings and views of the package kinetoscope."""

import copy
import http.client
import json
import pickle
import socket
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from types import MappingProxyType
from urllib.parse import urlparse

import mujoco
import numpy as np
import pytest

import kinetoscope as ks

G = 9.81
CABINET = {"urdf": "cabinet/cabinet.urdf"}


def free_fall(steps, dt):
    """Drop of a body under semi-implicit Euler [m]."""
    return G * dt * dt * steps * (steps + 1) / 2


def test_rigid_objects_fall_and_are_pushed():
    sim = ks.SimulationManager(num_envs=3, ground=None)
    ball = sim.add_rigid_object(
        uid="ball", shape=ks.ObjectShape.sphere(radius=0.1), mass=2.0, init_pose={"pos": [0, 0, 5], "rpy_deg": [0, 0, 90]}
    )
    assert ball.nominal_mass == 2.0 and (ball.mass == 2.0).all() and "dynamic" in repr(ball)
    np.testing.assert_allclose(ball.pose[0], [0, 0, 5, np.sqrt(0.5), 0, 0, np.sqrt(0.5)], atol=1e-12)
    sim.update(100)
    np.testing.assert_allclose(ball.pose[:, 2], 5 - free_fall(100, 0.01), atol=1e-9)
    np.testing.assert_allclose(ball.velocity[:, 2], -G, atol=1e-9)
    sim.reset()
    # A force that carries the weight, and one along x in the second environment: v = F t / m.
    force = np.tile([0, 0, 2 * G], (3, 1))
    force[1, 0] = 4.0
    ball.set_external_wrench(force, [0, 0, 0])
    sim.update(100)
    np.testing.assert_allclose(ball.velocity[:, :3], [[0, 0, 0], [2, 0, 0], [0, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(ball.external_wrench[:, :3], force)
    ball.write_pose([1, 2, 3, 1, 0, 0, 0], env_ids=[2])
    ball.write_velocity(np.zeros(6), env_ids=2)
    np.testing.assert_allclose(ball.pose[2], [1, 2, 3, 1, 0, 0, 0])
    ball.set_mass([1.0, 2.0, 4.0])
    assert ball.mass.tolist() == [1, 2, 4]
    with pytest.raises(ks.ArgumentError, match="frame"):
        ball.set_external_wrench(force, force, frame="body")


def test_groups_terrains_and_welds():
    sim = ks.SimulationManager(num_envs=2, ground=None)
    one = ks.RigidObjectCfg(uid="a", init_pose=[0, 0, 2, 1, 0, 0, 0])
    group = sim.add_rigid_object_group(
        uid="boxes", objects=[one, ks.RigidObjectCfg(uid="b", init_pose=[0.5, 0, 2, 1, 0, 0, 0])]
    )
    assert len(group) == 2 and group.pose.shape == (2, 2, 7) and group.names == ["boxes.a", "boxes.b"]
    terrain = sim.add_terrain(uid="hills", heights=ks.TerrainGenerator.rough(ks.RoughTerrain(seed=3)))
    low, high = terrain.height_range
    assert low <= terrain.height_at(0.1, 0.2) <= high and terrain.height_at(100, 0) is None
    assert terrain.heights.min() == low
    slope = sim.add_terrain(uid="plate", heights=np.zeros((3, 3)), size=[1, 1], init_pose=[20, 0, 0, 1, 0, 0, 0])
    assert slope.height_range == [0, 0]
    weld = sim.add_weld(uid="joint", first="boxes.a", second="boxes.b")
    assert not weld.is_attached.any()
    weld.attach(env_ids=[1])
    assert weld.is_attached.tolist() == [False, True]
    poses = group.pose
    poses[:, 0, 2] = 3
    weld.release()
    group.write_pose(poses)
    sim["joint"].attach([1])
    sim.update(20)
    # In the second environment the boxes keep their distance; they all fall alike.
    np.testing.assert_allclose(group.pose[:, 0, 2] - group.pose[:, 1, 2], [1, 1], atol=1e-6)
    assert {sim[name].uid for name in sim} == {"boxes", "hills", "plate", "joint"}


def test_articulations():
    sim = ks.SimulationManager(num_envs=2)
    cabinet = sim.add_articulation(uid="cabinet", urdf=ks.asset("cabinet/cabinet.urdf"))
    assert cabinet.kind == "articulation" == sim["cabinet"].kind and "Articulation" in repr(cabinet)
    assert (np.array(cabinet.drive_types) == "none").all() and cabinet.stiffness.max() == 0
    cabinet.write_qpos(cabinet.qpos_limits[:, :, 1] * 0.5)
    np.testing.assert_allclose(cabinet.qpos, cabinet.qpos_limits[:, :, 1] * 0.5)
    cabinet.set_qf_target(np.ones(cabinet.dof))
    sim.update(2)
    assert (cabinet.qvel > 0).all()


def test_mjcf_parts():
    text = """<mujoco><worldbody><body name="cart"><joint name="slide" type="slide" axis="1 0 0"/>
      <geom size="0.1" mass="3"/><site name="s"/></body>
      <body name="target" mocap="true" pos="0 0 1"><geom size="0.05" contype="0" conaffinity="0"/></body></worldbody>
      <actuator><motor name="push" joint="slide"/></actuator></mujoco>"""
    sim = ks.SimulationManager(num_envs=2, ground=None)
    cart = sim.add_mjcf(uid="cart", text=text)
    assert cart.joint_names == ["slide"] and cart.actuator_names == ["push"] and cart.total_mass == pytest.approx(3, rel=0.5)
    cart.set_ctrl([[6.0], [0.0]], actuators=cart.actuator_ids("push"))
    sim.update(50)
    # v = F t / m.
    np.testing.assert_allclose(cart.qvel[:, 0], [1.0, 0.0], atol=1e-9)
    assert cart.qpos_columns(["slide"]) == cart.qvel_columns(("slide",)) == cart.qpos_columns("slide") == [(0, 1)]
    assert cart.body_poses.shape == (2, len(cart.body_names), 7)
    np.testing.assert_array_equal(cart.body_poses[:, cart.body_names.index("cart")], cart.body_pose("cart"))
    np.testing.assert_allclose(cart.body_pose("cart")[:, 0], cart.qpos[:, 0], atol=1e-12)
    cart.write_mocap_pose("target", [0, 0, 2, 1, 0, 0, 0], env_ids=[1])
    np.testing.assert_allclose(cart.body_pose("target")[:, 2], [1, 2])
    robot = sim.add_robot(uid="arm", mjcf=ks.MjcfFile(text="""<mujoco><worldbody><body name="b"><geom size="0.1"/>
      <body name="l"><joint name="j" axis="0 1 0"/><geom size="0.05" pos="0.3 0 0" mass="1"/></body></body></worldbody></mujoco>"""))
    assert robot.joint_names == ["j"]


def test_structure_of_robots():
    """The description against the URDF file."""
    sim = ks.SimulationManager()
    arm = sim.add_robot(ks.bundled_robot("sr5", uid="arm"))
    file = ElementTree.parse(ks.asset("sr5/SR5.urdf"))
    joints = {joint.get("name"): joint for joint in file.findall("joint")}
    assert {joint["name"] for joint in arm.description["joints"]} == set(joints)
    for joint in arm.description["joints"]:
        element = joints[joint["name"]]
        assert joint["type"] == element.get("type") and joint["child"] == element.find("child").get("link")
        assert joint["parent"] == element.find("parent").get("link")
        if joint["type"] != "fixed":
            axis = np.array([float(x) for x in element.find("axis").get("xyz").split()])
            np.testing.assert_allclose(joint["axis"], axis / np.linalg.norm(axis))
    masses = {link["name"]: link["mass"] for link in arm.description["links"]}
    for link in file.findall("link"):
        mass = link.find("inertial/mass")
        assert masses[link.get("name")] == (None if mass is None else pytest.approx(float(mass.get("value"))))
    html = arm._repr_html_()
    assert "<table>" in html and "JOINT1" in html
    sim.destroy()
    assert arm._repr_html_() == "&lt;Robot of a simulation that is destroyed&gt;"
    assert "simulation that is destroyed" in sim._repr_html_()


def every_entity():
    """A simulation with an entity of each type."""
    sim = ks.SimulationManager(num_envs=2)
    sim.add_robot(ks.bundled_robot("sr5", uid="arm"))
    sim.add_articulation(uid="cabinet", urdf=ks.asset("cabinet/cabinet.urdf"), init_pose=[3, 0, 0, 1, 0, 0, 0])
    sim.add_rigid_object(uid="cube", init_pose=[0, 3, 1, 1, 0, 0, 0])
    sim.add_rigid_object_group(uid="group", objects=[ks.RigidObjectCfg(uid="a", init_pose=[0, -3, 1, 1, 0, 0, 0])])
    sim.add_terrain(uid="plate", heights=np.zeros((3, 3)), size=[1, 1], init_pose=[20, 0, 0, 1, 0, 0, 0])
    sim.add_mjcf(uid="part", text="<mujoco><worldbody><body name='b'><joint/><geom size='0.1'/></body></worldbody></mujoco>")
    sim.add_weld(uid="weld", first="cube", second="group.a")
    sim.add_sensor("imu", ks.ImuCfg(body="cube"))
    return sim


def test_handles_of_an_entity_are_equal():
    sim, other = every_entity(), every_entity()
    for name in sim:
        handle = sim[name]
        assert handle == sim[name] and hash(handle) == hash(sim[name]), name
        # Controls: other entities, the same entity of another simulation, and values that are no handles.
        assert all(handle != sim[second] for second in sim if second != name), name
        assert handle != other[name] and handle != name, name
    assert len({entity[name] for entity in (sim, sim, other) for name in entity}) == 2 * len(sim) == 16
    assert sim == sim and sim != other
    task = ks.Task(sim, {"decimation": 1, "actions": {"a": {"type": "relative_joint_positions", "step": 0.1, "robot": "arm"}}, "observations": {"policy": {"j": {"type": "joint_pos_rel", "robot": "arm"}}}})
    assert task.sim == sim != other and task == task and len({task.sim, sim}) == 1


def test_states_of_robots(rng):
    sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=3, ground=None))
    dog = sim.add_robot(ks.bundled_robot("quadruped", uid="dog"))
    for name in [n for n in dir(dog) if not n.startswith("_") and isinstance(getattr(type(dog), n, None), type(type(dog).qpos))]:
        value = getattr(dog, name)
        if isinstance(value, np.ndarray):
            assert value.shape[0] == 3, name
    state = dog.default_root_state
    state[:, 7:] = rng.normal(size=(3, 6))
    dog.write_root_state(state)
    np.testing.assert_allclose(dog.root_state, state, atol=1e-12)
    q, v = rng.normal(size=(2, 3, 12)) * 0.1
    dog.write_joint_state(q, v)
    np.testing.assert_allclose(dog.qpos, q)
    np.testing.assert_allclose(dog.qvel, v)
    feet = dog.find_links([".*_FOOT"])
    assert [dog.link_names[i] for i in feet] == [f"{leg}_FOOT" for leg in ("LF", "RF", "LH", "RH")]
    np.testing.assert_array_equal(dog.link_poses[:, feet[0]], dog.link_pose("LF_FOOT"))
    np.testing.assert_allclose(dog.compute_link_fk(q), dog.link_poses, atol=1e-9)
    dog.set_external_wrench([0, 0, dog.total_mass * G], [0, 0, 0], link_ids=["base"])
    assert dog.external_wrenches[:, 0, 2] == pytest.approx([dog.total_mass * G] * 3)
    dog.set_stiffness([100.0], joint_ids=["LF_HAA"], env_ids=[1])
    assert dog.stiffness[:, dog.joint_names.index("LF_HAA")].tolist() == [80, 100, 80]
    dog.set_drive_type("none", joint_ids=["RF_HAA"])
    assert {row[dog.joint_names.index("RF_HAA")] for row in dog.drive_types} == {"none"}
    with pytest.raises(ks.ArgumentError, match="acceleration"):
        dog.set_drive_type("torque")


def test_inverse_kinematics(arm_sim, rng):
    sim, arm = arm_sim
    q = rng.uniform(-1, 1, (2, 6))
    targets = arm.compute_fk(q, "arm")
    found = arm.compute_ik(targets, "arm", ks.IkCfg(position_tolerance=1e-5))
    assert found.success.all() and found.success.dtype == bool
    # The judge is forward kinematics, and physics at these positions.
    np.testing.assert_allclose(arm.compute_fk(found.qpos, "arm")[:, :3], targets[:, :3], atol=1e-5)
    arm.write_qpos(found.qpos)
    link = arm.link_names[-1]
    np.testing.assert_allclose(arm.link_pose(link)[:, :3], arm.compute_fk(found.qpos, link)[:, :3], atol=1e-9)
    far = targets.copy()
    far[:, 0] += 10
    assert not arm.compute_ik(far, "arm").success.any()
    # The Jacobian against a difference quotient of forward kinematics.
    jacobian = arm.jacobian("arm", q)
    step = np.zeros(6)
    step[2] = 1e-6
    slope = (arm.compute_fk(q + step, "arm") - arm.compute_fk(q - step, "arm"))[:, :3] / 2e-6
    np.testing.assert_allclose(jacobian[:, :3, 2], slope, atol=1e-6)
    moved = arm.compute_fk(q, "arm", tcp=[0, 0, 0.1, 1, 0, 0, 0])
    np.testing.assert_allclose(np.linalg.norm(moved[:, :3] - targets[:, :3], axis=1), 0.1, atol=1e-9)
    with pytest.raises(ks.ConfigError, match="distance_tolerance"):
        arm.compute_ik(targets, "arm", {"distance_tolerance": 1})
    with pytest.raises(ks.KinetoscopeError, match="amr"):
        arm.compute_ik(targets, "amr")


LINKAGE = """<mujoco><option><flag contact="disable"/></option><worldbody><body name="base" pos="0 0 2"><geom size="0.1" mass="3"/>
  <body name="upper" pos="0.1 0 0"><joint name="a" axis="0 1 0" armature="0.2"/><geom size="0.05" pos="0.3 0 0.1" mass="1"/>
    <body name="lower" pos="0.5 0 0"><joint name="b" axis="1 0 1"/><geom size="0.04" pos="0.2 0.1 0" mass="0.7"/>
      <body name="tip" pos="0.3 0 0"><joint name="c" type="slide" axis="0 0.6 0.8" armature="0.1"/><geom size="0.05" mass="0.4"/>
</body></body></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("fix_base", [True, False], ids=["fixed", "floating"])
def test_dynamics_of_robots(fix_base, rng):
    """Accelerations from rest, M a + g = tau, against those of MuJoCo's step."""
    gravity = np.array([0.3, -1.0, -9.0])
    sim = ks.SimulationManager(num_envs=3, ground=None, gravity=gravity, integrator="euler")
    robot = sim.add_robot(uid="r", mjcf=ks.MjcfFile(text=LINKAGE), fix_base=fix_base, drive={"drive_type": "none"})
    assert robot.dof == 3
    root = robot.root_pose
    root[:, 3:] = rng.normal(size=(3, 4))
    root[:, 3:] /= np.linalg.norm(root[:, 3:], axis=1, keepdims=True)
    if not fix_base:
        robot.write_root_pose(root)
    qpos, effort = rng.uniform(-0.5, 0.5, (3, 3)), rng.normal(size=(3, 3))
    robot.write_qpos(qpos)
    robot.set_qf_target(effort)
    matrix, held = robot.mass_matrix(), robot.gravity_torque()
    first = 0 if fix_base else 6
    assert matrix.shape == (3, first + 3, first + 3) and held.shape == (3, first + 3)
    np.testing.assert_allclose(matrix, matrix.transpose(0, 2, 1), rtol=0, atol=0)
    # At given positions, of chosen environments: the root stays where it is.
    np.testing.assert_array_equal(robot.mass_matrix(qpos[2:], env_ids=[2]), matrix[2:])
    np.testing.assert_array_equal(robot.gravity_torque(qpos), held)
    assert (robot.gravity_torque(np.zeros(3)) != held).any()
    if not fix_base:
        # The whole robot has its mass, and weighs as much.
        mass = robot.total_mass
        np.testing.assert_allclose(matrix[:, :3, :3], np.tile(mass * np.eye(3), (3, 1, 1)), atol=1e-12)
        np.testing.assert_allclose(held[:, :3], np.tile(-mass * gravity, (3, 1)), atol=1e-12)
    forces = np.concatenate([np.zeros((3, first)), effort], axis=1) - held
    acceleration = np.linalg.solve(matrix, forces[..., None])[..., 0]
    sim.update(1)
    # Double precision, and a condition number of the matrix below 1e4.
    assert np.linalg.cond(matrix).max() < 1e4
    np.testing.assert_allclose(robot.qacc, acceleration[:, first:], rtol=1e-9, atol=1e-9)
    with pytest.raises(ks.ArgumentError, match="mass_matrix"):
        robot.mass_matrix(np.zeros((2, 3)))
    with pytest.raises(ks.ArgumentError, match="gravity_torque"):
        robot.gravity_torque(np.zeros(2))
    with pytest.raises(ks.OutOfRangeError):
        robot.mass_matrix(env_ids=[3])


@pytest.mark.parametrize("fix_base", [True, False], ids=["fixed", "floating"])
def test_dynamics_of_moving_robots(fix_base, rng):
    """Bias forces, inverse dynamics, centers of mass, energies and momenta against MuJoCo's own of the same model and state."""
    gravity = np.array([0.3, -1.0, -9.0])
    model = mujoco.MjModel.from_xml_string(LINKAGE if fix_base else LINKAGE.replace('pos="0 0 2">', 'pos="0 0 2"><freejoint/>'))
    model.opt.gravity = gravity
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    sim = ks.SimulationManager(num_envs=3, ground=None, gravity=gravity)
    robot = sim.add_robot(uid="r", mjcf=ks.MjcfFile(text=LINKAGE), fix_base=fix_base, drive={"drive_type": "none"})
    qpos, qvel = rng.uniform(-0.5, 0.5, (3, 3)), rng.normal(size=(3, 3))
    robot.write_joint_state(qpos, qvel)
    root = robot.root_state
    if not fix_base:
        root[:, :3] += rng.normal(size=(3, 3))
        root[:, 3:7] = rng.normal(size=(3, 4))
        root[:, 3:7] /= np.linalg.norm(root[:, 3:7], axis=1, keepdims=True)
        root[:, 7:] = rng.normal(size=(3, 6))
        robot.write_root_state(root)
    acceleration = rng.normal(size=(3, model.nv))
    found = {
        "bias_force": robot.bias_force(), "inverse_dynamics": robot.inverse_dynamics(acceleration), "center_of_mass": robot.center_of_mass(),
        "potential_energy": robot.potential_energy(), "kinetic_energy": robot.kinetic_energy(), "momentum": robot.momentum(),
        "mass_matrix": robot.mass_matrix(),
    }  # fmt: skip
    for env in range(3):
        if not fix_base:
            data.qpos[:7] = root[env, :7]
            # Angular velocities of a free joint are in the axes of the body.
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, root[env, 3:7])
            data.qvel[:6] = [*root[env, 7:10], *(turn.reshape(3, 3).T @ root[env, 10:])]
        data.qpos[-3:], data.qvel[-3:] = qpos[env], qvel[env]
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        data.qacc[:] = acceleration[env]
        matrix = np.zeros((model.nv, model.nv))
        for column, unit in zip(matrix, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        potential, kinetic = data.energy
        mujoco.mj_inverse(model, data)
        expected = {
            "bias_force": data.qfrc_bias, "inverse_dynamics": data.qfrc_inverse, "center_of_mass": data.subtree_com[1],
            "potential_energy": potential, "kinetic_energy": kinetic, "mass_matrix": matrix,
            "momentum": [*(model.body_subtreemass[1] * data.subtree_linvel[1]), *data.subtree_angmom[1]],
        }  # fmt: skip
        for name, value in expected.items():
            np.testing.assert_allclose(found[name][env], value, rtol=1e-9, atol=1e-9, err_msg=name)
    # At given positions and velocities, of chosen environments, against the state itself. Controls: others are others.
    at = {"qpos": qpos[1:], "qvel": qvel[1:], "env_ids": [1, 2]}
    np.testing.assert_array_equal(robot.inverse_dynamics(acceleration[1:], **at), found["inverse_dynamics"][1:])
    for name in ("bias_force", "kinetic_energy", "momentum"):
        np.testing.assert_array_equal(getattr(robot, name)(**at), found[name][1:])
        assert (getattr(robot, name)(qpos=qpos, qvel=2 * qvel) != found[name]).any()
    for name in ("center_of_mass", "potential_energy"):
        np.testing.assert_array_equal(getattr(robot, name)(qpos[1:], env_ids=[1, 2]), found[name][1:])
        assert (getattr(robot, name)(np.zeros(3)) != found[name]).any()
    for call, text in (
        (lambda: robot.bias_force(qvel=np.zeros(2)), r"bias_force: qvel has the shape \[1, 2\]"),
        (lambda: robot.inverse_dynamics(np.zeros(2)), "inverse_dynamics: qacc has the shape"),
        (lambda: robot.kinetic_energy(qvel=[np.nan] * 3), "kinetic_energy: qvel must not contain NaN"),
        (lambda: robot.momentum(np.zeros((2, 3))), "momentum: qpos has the shape"),
    ):
        with pytest.raises(ks.ArgumentError, match=text):
            call()
    with pytest.raises(ks.OutOfRangeError):
        robot.momentum(env_ids=[3])


def test_reports_of_robots():
    """The report of a file, against the simulation of the same file."""
    report = ks.inspect(urdf=ks.asset("sr5/SR5.urdf"), qpos={"JOINT2": 0.5})
    sim = ks.SimulationManager(gravity=[0, 0, -9.81])
    arm = sim.add_robot(ks.RobotCfg(uid="arm", urdf=ks.asset("sr5/SR5.urdf")))
    assert report["joint_names"] == report["columns"] == arm.joint_names
    assert report["total_mass"] == pytest.approx(arm.total_mass, rel=1e-12)
    qpos = [0.5 if name == "JOINT2" else 0.0 for name in arm.joint_names]
    assert report["qpos"] == qpos
    np.testing.assert_allclose(report["mass_matrix"], arm.mass_matrix(qpos)[0], atol=1e-12)
    np.testing.assert_allclose(report["gravity_torque"], arm.gravity_torque(qpos)[0], atol=1e-12)
    mjcf = ks.inspect(mjcf=ks.MjcfFile(text=LINKAGE))
    assert mjcf["joint_names"] == ["a", "b", "c"] and len(mjcf["links"]) > 3
    assert ks.inspect(ks.InspectCfg(urdf=ks.asset("sr5/SR5.urdf"), floating_base=True))["columns"][:2] == ["base.vx", "base.vy"]
    with pytest.raises(ks.ModelError, match="JOINT2"):
        ks.inspect(urdf=ks.asset("sr5/SR5.urdf"), qpos={"JOINT02": 0.5})


def test_randomization_and_shards():
    def build(**fields):
        sim = ks.SimulationManager(seed=5, **fields)
        sim.add_rigid_object(uid="cube", mass=2.0)
        sim.add_sensor("imu", ks.ImuCfg(body="cube", sampling=ks.SamplingCfg(noise={"ang_vel_b": ks.NoiseCfg(std=0.1)})))
        sim.randomize([ks.RandomizationTerm(property="mass", pattern="cube", draw=ks.RandomizationOp.scale([0.5, 1.5]))])
        sim.update(3)
        return sim

    whole = build(num_envs=8)
    masses = whole["cube"].mass
    assert len(set(masses)) == 8 and (masses >= 1).all() and (masses <= 3).all()
    np.testing.assert_array_equal(whole.property("mass", "cube")[:, 0], masses)
    assert "cube" in whole.property_names("mass")
    # Two processes of four environments have the bits of one of eight.
    halves = [build(num_envs=4, shard=ks.Shard(rank=rank, world=2)) for rank in range(2)]
    np.testing.assert_array_equal(np.concatenate([half["cube"].mass for half in halves]), masses)
    noise = np.concatenate([half["imu"]["ang_vel_b"] for half in halves])
    np.testing.assert_array_equal(noise, whole["imu"]["ang_vel_b"])
    assert (noise != 0).all()
    whole.set_property("mass", "cube", 3.0, env_ids=[1])
    whole.set_property("mass", "cube", [[1.0], [2.0]], env_ids=[2, 3])
    assert whole["cube"].mass[1:4].tolist() == [3, 1, 2]
    whole.reset_properties()
    assert (whole["cube"].mass == 2).all()
    with pytest.raises(ks.ArgumentError, match="expected"):
        whole.set_property("mass", "cube", [1.0, 2.0])
    with pytest.raises(ks.ConfigError, match="scale"):
        whole.randomize({"terms": [{"property": "mass", "pattern": "cube", "draw": {"scael": [1, 1]}}]})


def test_snapshots_and_rollouts(arm_sim, tmp_path):
    sim, arm = arm_sim
    arm.set_qpos_target([0.3] * 6)
    sim.update(20)
    snapshot = sim.snapshot()
    snapshot.save(tmp_path / "state.kts")
    controls = np.tile([0.3] * 6, (2, 15, 1))
    assert sim.control_names == [f"arm/{name}" for name in arm.joint_names]
    states, final, diverged = sim.rollout(controls)
    assert states.shape == (2, 15, 12) and not diverged and len(final) == 2
    before = arm.qpos
    sim.update(15)
    np.testing.assert_array_equal(states[:, -1, :6], arm.qpos)
    sim.restore(ks.Snapshot.load(tmp_path / "state.kts"))
    np.testing.assert_array_equal(arm.qpos, before)
    sim.restore(final, properties=True)
    np.testing.assert_array_equal(arm.qpos, states[:, -1, :6])
    one = sim.snapshot(env_ids=[1])
    assert one.env_ids == [1] and len(one) == 1
    (tmp_path / "bad").write_bytes(b"x" * 100)
    with pytest.raises(ks.SnapshotError):
        ks.Snapshot.load(tmp_path / "bad")
    with pytest.raises(ks.FileError):
        ks.Snapshot.load(tmp_path / "missing")


def test_recordings_are_replayed_bit_by_bit(tmp_path):
    def build():
        sim = ks.SimulationManager(num_envs=2, threads=2)
        return sim, sim.add_robot(ks.bundled_robot("sr5", uid="arm"))

    sim, arm = build()
    path = tmp_path / "run.npz"
    with sim.record(path, ["events", *(getattr(ks.Topic, t)("arm") for t in ("joint_states", "targets", "link_poses"))]) as recorder:
        for step in range(30):
            if step % 10 == 0:
                arm.set_qpos_target([0.1 * step] * 6)
            sim.update()
        recorder.note("half", env=1)
    archive = np.load(path)
    recorded = archive["arm/joint_states/positions"]
    np.testing.assert_array_equal(recorded[-1], arm.qpos)
    again, _ = build()
    result = again.verify_recording(path)
    assert result["identical"] and result["steps"] == 30 and result["values"] > 0 and result["difference"] is None
    # A control: another scene gives another motion.
    other = ks.SimulationManager(num_envs=2, gravity=[0, 0, -1])
    other.add_robot(ks.bundled_robot("sr5", uid="arm"))
    assert not other.verify_recording(path)["identical"]
    names = dict(ks.recording_topics(path))
    topic = next(name for name in names if name.endswith("env_0/arm/joint_states"))
    field = next(field for field in names[topic] if "position" in field)
    times, values = ks.read_series(path, topic, field)
    np.testing.assert_array_equal(values[-1], recorded[-1, 0, 0])
    assert (np.diff(times) >= 0).all()
    pairs = ks.read_series(path, topic, [field, names[topic][1]])
    assert len(pairs) == 2
    np.testing.assert_array_equal(pairs[0], [times, values])
    np.testing.assert_array_equal(pairs[1][1], ks.read_series(path, topic, names[topic][1])[1])
    playback = ks.Playback(path)
    assert playback.joints_without_data == []
    assert len(playback) == len(playback.times) >= 30
    (part,) = (playback.sim[name] for name in playback.sim)
    ((column, _),) = part.qpos_columns([".*JOINT2"])
    for frame in (3, 17):
        playback.seek(frame)
        assert playback.frame_at(playback.times[frame]) >= frame
        seen = playback.sim[part.uid].qpos[:, column]
        assert any((seen == row[:, 1]).all() for row in recorded), seen
    with pytest.raises(ks.OutOfRangeError):
        playback.seek(len(playback))
    playback = ks.Playback(path, again)
    playback.seek(len(playback) - 1)
    np.testing.assert_array_equal(playback.sim[part.uid].qpos[:, column], recorded[-1, :, 1])
    with pytest.raises(ks.RecordingError, match="exists"):
        sim.record(path)
    summary = sim.record(path, overwrite=True).finish()
    assert summary.path == path or str(summary.path) == str(path)
    with pytest.raises(ks.RecordingError):
        sim.record(tmp_path / "x.mp5")
    with pytest.raises(ks.ArgumentError, match="Topic"):
        sim.record(tmp_path / "y.npz", ["all"])


def test_topics_and_periods(tmp_path, arm_sim):
    """One topic or a list, a dict of periods or any other mapping."""
    sim, _ = arm_sim
    for number, topics in enumerate((ks.Topic.joint_states("arm"), [ks.Topic.joint_states("arm")], (ks.Topic.joint_states("arm"),))):
        with sim.record(tmp_path / f"{number}.npz", topics, stream_periods=MappingProxyType({"arm": 5})):
            sim.update(20)
        archive = np.load(tmp_path / f"{number}.npz")
        assert archive["arm/joint_states/positions"].shape == (5, 2, 6)
    with sim.record(tmp_path / "events.mcap", "events"):
        sim.update()
    for topics in (3, ["events", 3]):
        with pytest.raises(ks.ArgumentError, match="topic"):
            sim.record(tmp_path / "x.npz", topics)
    with pytest.raises(ks.ArgumentError, match="stream_periods"):
        sim.record(tmp_path / "x.npz", stream_periods=[("arm", 5)])


def test_learning_datasets(tmp_path, arm_sim):
    """A LeRobot dataset: the numbers of its description, and tables in Parquet's format."""
    sim, arm = arm_sim
    path = tmp_path / "run.lerobot"
    with sim.record(path, [ks.Topic.joint_states("arm"), ks.Topic.targets("arm")], task="reach"):
        arm.set_qpos_target([0.1] * 6)
        sim.update(30)
    info = json.loads((path / "meta" / "info.json").read_text())
    assert info["codebase_version"] == "v3.0" and info["total_episodes"] == 2 and info["total_tasks"] == 1
    assert info["fps"] == 100 and info["features"]["action"]["shape"] == [6]
    tables = sorted(path.rglob("*.parquet"))
    assert tables and all(table.read_bytes()[:4] == b"PAR1" == table.read_bytes()[-4:] for table in tables)


def test_a_stream_to_foxglove(arm_sim):
    """A client opens the WebSocket and is welcomed; the stream ends when it is closed."""
    sim, _ = arm_sim
    server = sim.stream_to_foxglove("127.0.0.1:0", ks.Topic.joint_states("arm"))
    url = urlparse(server.url)
    assert url.scheme == "ws" and f"127.0.0.1:{url.port}" in repr(server) and server.failure is None
    with socket.create_connection((url.hostname, url.port), timeout=20) as client:
        client.sendall(
            f"GET / HTTP/1.1\r\nHost: {url.netloc}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        received = b""
        while b"arm/joint_states" not in received:
            sim.update()
            received += client.recv(4096)
        assert received.startswith(b"HTTP/1.1 101 ") and b"serverInfo" in received
        assert server.clients == 1 and server.dropped_rows == 0
    server.close()
    assert server.clients == 0
    with pytest.raises(ks.KinetoscopeError):
        server.close()
    with pytest.raises(ks.RecordingError, match="nowhere"):
        sim.stream_to_foxglove("nowhere:1")


def test_views(tmp_path):
    sim = ks.SimulationManager(num_envs=2)
    sim.add_rigid_object(uid="cube", rgba=[1, 0, 0, 1], init_pose=[0, 0, 0.5, 1, 0, 0, 0], shape=ks.ObjectShape.box(size=[1, 1, 1]))
    image = sim.screenshot(size=[64, 48], eye=[4, 0, 1], target=[0, 0, 0.5], env=0)
    assert image.shape == (48, 64, 4) and image.dtype == np.uint8
    red, green, blue, _ = image[24, 32].astype(int)
    assert red > 2 * green and red > 2 * blue
    assert sim.screenshot(tmp_path / "scene.png") is None
    assert (tmp_path / "scene.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(ks.ViewerError, match="png"):
        sim.screenshot(tmp_path / "scene.jpg")
    with pytest.raises(ks.ArgumentError, match="both"):
        sim.screenshot(eye=[1, 1, 1])
    frame = sim.show(width=300)
    url = urlparse(frame.server.url)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=20)
    connection.request("GET", "/")
    page = connection.getresponse()
    assert page.status == 200 and b"<html" in page.read().lower()
    # A notebook shows the page in a frame; the browser tests of the view show that this suffices.
    assert "frame-ancestors http://localhost:*" in page.getheader("Content-Security-Policy")
    plain = urlparse(sim.serve().url)
    connection = http.client.HTTPConnection(plain.hostname, plain.port, timeout=20)
    connection.request("HEAD", "/")
    assert "frame-ancestors 'none'" in connection.getresponse().getheader("Content-Security-Policy")
    assert frame.server.url in frame._repr_html_() and 'width="300"' in frame._repr_html_()
    frame.server.close()
    with pytest.raises(OSError):
        http.client.HTTPConnection(url.hostname, url.port, timeout=5).request("GET", "/")
    with pytest.raises(ks.ViewerError):
        sim.serve("nonsense:address:1")


def test_a_window_needs_a_display():
    code = (
        "import os, kinetoscope as ks\nos.environ.pop('DISPLAY', None)\n"
        "try:\n    ks.SimulationManager().open_window()\nexcept ks.ViewerError as error:\n    print('DISPLAY' in str(error))\n"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True).stdout == "True\n"


def test_diagnostics_and_divergence(tmp_path):
    urdf = """<robot name="r"><link name="a"/>
      <link name="b"><inertial><mass value="1"/>
      <inertia ixx="1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/></joint></robot>"""
    (tmp_path / "r.urdf").write_text(urdf)
    sim = ks.SimulationManager(num_envs=2)
    sim.add_robot(uid="r", urdf=tmp_path / "r.urdf")
    assert any("r.urdf:" in text and "b" in text for text in sim.diagnostics)
    assert "inertia-repaired" in sim.warnings
    # The parts of a diagnostic: the judge of the line is the text of the file.
    repaired = next(found for found in sim.diagnostics if found.kind == "inertia-repaired")
    assert repaired.file == tmp_path / "r.urdf" and "<inerti" in urdf.split("\n")[repaired.line - 1]
    assert repaired == f"{repaired.file}:{repaired.line}: {repaired.message} [{repaired.kind}]" and isinstance(repaired, ks.Diagnostic)
    for copied in (pickle.loads(pickle.dumps(repaired)), copy.deepcopy(repaired)):
        assert vars(copied) == vars(repaired) and copied == repaired
    robot = sim["r"]
    robot.write_qvel([1e12], env_ids=[1])
    sim.update(2)
    assert [env for env, *_ in sim.diverged] == [1]
    # Those of single environments add up to the counts of all.
    assert sim.env_warnings(0) == {} and sum(sim.env_warnings(1).values()) > 0
    assert all(sim.warnings[name] == count for name, count in sim.env_warnings(1).items())
    assert np.isfinite(robot.qpos).all()
    sim.reset([1])
    assert not sim.diverged
    notes = sim.dump(tmp_path / "dump")
    assert (tmp_path / "dump").is_dir() and isinstance(notes, list)
    assert "<mujoco" in sim.mjcf
    sim.exclude_collision("r", "world")
    with pytest.raises(ks.KinetoscopeError):
        sim.exclude_collision("r", "nowhere")
    json.dumps(sim.warnings)
