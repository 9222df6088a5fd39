"""Members of the layers for scripts of other simulators beyond the tutorials, and advice for those that do not exist."""

import numpy as np
import pytest
from test_sim_compat import isaac_scene

import kinetoscope as ks
from kinetoscope.compat import _poses


def test_missing_names_have_advice():
    """The error names the nearest members of the layer, and those of the object of this package."""
    scene = isaac_scene()
    robot = scene["robot"]
    for owner, name, expected in (
        (robot, "find_joint", ("Articulation.find_joint", "find_joints")),
        (robot, "compute_jacobian", ("Robot of this package, has ", "jacobian")),
        (robot, "compute_ik", ("Robot of this package, has compute_ik",)),
        (robot.data, "joint_positions", ("ArticulationData.joint_positions", "joint_pos")),
        (scene, "record", ("SimulationManager of this package, has record",)),
        (scene, "zzz", ("known names: articulations",)),
    ):
        with pytest.raises(AttributeError) as caught:
            getattr(owner, name)
        assert all(text in str(caught.value) for text in expected), caught.value
    # Names with an underscore are protocols of Python, not of the layer; `hasattr` works.
    assert not hasattr(robot, "__array__") and not hasattr(robot, "nothing") and hasattr(robot, "find_joints")
    # The error of a property stays that of the property.
    data = robot.data
    del data._native
    with pytest.raises(AttributeError, match="_native"):
        data.joint_pos  # noqa: B018
    scene.native.destroy()


def test_articulations_of_isaac():
    from kinetoscope.compat.isaaclab.sim import SimulationContext

    scene = isaac_scene()
    context = SimulationContext.instance()
    robot, native, origins = scene["robot"], scene["robot"].native, np.asarray(scene.env_origins)
    assert {str(owner.device) for owner in (scene, context, robot)} == {"cpu"}
    assert scene.physics_dt == context.get_rendering_dt() == 0.005 and not context.has_gui() and not robot.is_fixed_base
    # Names: in the order of the joints, of the patterns, and in a subset.
    assert robot.find_joints(["RH_HAA", "LF_HAA"])[1] == [name for name in robot.joint_names if name in ("LF_HAA", "RH_HAA")]
    ids, names = robot.find_joints(["RH_HAA", "LF_HAA"], preserve_order=True)
    assert names == ["RH_HAA", "LF_HAA"] and [robot.joint_names[at] for at in ids] == names
    assert robot.find_joints("LF.*", joint_subset=["RH_HAA", "LF_HAA"]) == ([1], ["LF_HAA"])
    assert robot.find_bodies(["RH_FOOT", "base"], preserve_order=True)[1] == ["RH_FOOT", "base"]
    with pytest.raises(ValueError, match="no joint matches 'LF_HAB'; joints: "):
        robot.find_joints("LF_HAB")
    # Writers take effect at once; a number stands for all joints.
    for write, read, values in (
        (robot.write_joint_position_to_sim, "joint_pos", 0.1),
        (robot.write_joint_velocity_to_sim, "joint_vel", 0.2),
        (robot.write_joint_stiffness_to_sim, "joint_stiffness", 50.0),
        (robot.write_joint_damping_to_sim, "joint_damping", 3.0),
        (robot.write_joint_effort_limit_to_sim, "joint_effort_limits", 70.0),
        (robot.write_joint_velocity_limit_to_sim, "joint_vel_limits", 9.0),
        (robot.write_joint_armature_to_sim, "joint_armature", 0.01),
    ):
        before = np.asarray(getattr(robot.data, read)).copy()
        write(values, joint_ids=[3], env_ids=[1])
        after = np.asarray(getattr(robot.data, read))
        assert after[1, 3] == pytest.approx(values) != before[1, 3], read
        after[1, 3] = before[1, 3]
        np.testing.assert_array_equal(after, before)
        write(values)
        np.testing.assert_allclose(np.asarray(getattr(robot.data, read)), np.full((2, 12), values), rtol=1e-6)
    # Dry friction needs a joint with friction in its actuator, 0 is enough; the error says so.
    with pytest.raises(ks.UnknownNameError, match="drive.friction"):
        robot.write_joint_friction_to_sim(0.02)
    robot.write_joint_position_limit_to_sim(np.full((2, 12, 2), [-0.4, 0.4]))
    np.testing.assert_allclose(np.asarray(robot.data.joint_pos_limits), np.full((2, 12, 2), [-0.4, 0.4]), rtol=1e-6)
    np.testing.assert_array_equal(np.asarray(robot.data.joint_limits), np.asarray(robot.data.joint_pos_limits))
    # Velocities and poses of links and of the root.
    native.write_root_velocity(np.tile([1.0, 2, 3, 0.4, 0.5, 0.6], (2, 1)))
    scene.native.update()
    data = robot.data
    np.testing.assert_allclose(np.asarray(data.body_lin_vel_w), native.link_velocities[..., :3], atol=1e-5)
    np.testing.assert_allclose(np.asarray(data.body_vel_w)[..., 3:], np.asarray(data.body_ang_vel_w))
    np.testing.assert_allclose(np.asarray(data.root_link_pos_w), native.root_pose[:, :3] + origins, atol=1e-6)
    np.testing.assert_allclose(np.asarray(data.root_link_vel_w), native.root_velocity, atol=1e-5)
    np.testing.assert_allclose(np.asarray(data.root_com_vel_w), native.root_com_velocity, atol=1e-5)
    # The origin of the root and its center of mass are joined rigidly.
    arm = np.asarray(data.root_com_pos_w) - np.asarray(data.root_link_pos_w)
    joined = native.root_velocity[:, :3] + np.cross(native.root_velocity[:, 3:], arm)
    np.testing.assert_allclose(np.asarray(data.root_com_vel_w)[:, :3], joined, atol=1e-4)
    np.testing.assert_allclose(np.asarray(data.root_ang_vel_b), native.root_ang_vel_b, atol=1e-5)
    SimulationContext.clear_instance()
    assert SimulationContext.instance() is None
    with pytest.raises(ks.DestroyedError):
        scene.native.update()


def test_objects_and_cameras_of_isaac():
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.assets import RigidObjectCfg
    from kinetoscope.compat.isaaclab.sensors import CameraCfg

    spawn = sim_utils.CuboidCfg(
        size=(0.2, 0.2, 0.2), mass_props=sim_utils.MassPropertiesCfg(mass=1.0), rigid_props=sim_utils.RigidBodyPropertiesCfg(),
        collision_props=sim_utils.CollisionPropertiesCfg(),
    )  # fmt: skip
    half = np.sqrt(0.5)
    start = RigidObjectCfg.InitialStateCfg(pos=(0, 0, 2.0), rot=(half, half, 0, 0), lin_vel=(0, 0, 1.0), ang_vel=(0, 3.0, 0))
    scene = isaac_scene(
        box=RigidObjectCfg(prim_path="{ENV_REGEX_NS}/Box", spawn=spawn, init_state=start),
        cam=CameraCfg(prim_path="{ENV_REGEX_NS}/cam", width=8, height=6),
    )
    # A quarter turn about x: z of the world is y of the box, and y of the world is -z of the box.
    data = scene["box"].data
    np.testing.assert_allclose(np.asarray(data.root_lin_vel_b), [[0, 1, 0]] * 2, atol=1e-6)
    np.testing.assert_allclose(np.asarray(data.root_ang_vel_b), [[0, 0, -3]] * 2, atol=1e-6)
    np.testing.assert_allclose(np.asarray(data.projected_gravity_b), [[0, -1, 0]] * 2, atol=1e-6)
    np.testing.assert_allclose(np.asarray(data.heading_w), [0, 0], atol=1e-6)
    # Cameras look from eyes to targets in the world frame, also straight down.
    camera, origins = scene["cam"], np.asarray(scene.env_origins)
    for eye, target, right in (((2, 1, 1), (0, 0, 0.5), None), ((0, 0, 3), (0, 0, 0), (0, -1, 0)), ((0, 0, 1), (0, 0, 3), (0, -1, 0))):
        eyes, targets = origins + eye, origins + target
        camera.set_world_poses_from_view(eyes, targets)
        np.testing.assert_allclose(np.asarray(camera.data.pos_w), eyes, atol=1e-6)
        quat = np.asarray(camera.data.quat_w_opengl)
        axes = _poses.to_matrix(np.concatenate([np.zeros((2, 3)), quat], axis=1))[:, :3, :3]
        forward = (targets - eyes) / np.linalg.norm(targets - eyes, axis=1, keepdims=True)
        np.testing.assert_allclose(-axes[:, :, 2], forward, atol=1e-6)
        # The right side of the image is level.
        np.testing.assert_allclose(axes[:, 2, 0], 0, atol=1e-6)
        assert right is None or np.allclose(axes[0, :, 0], right, atol=1e-6)
    with pytest.raises(ValueError, match="differ"):
        camera.set_world_poses_from_view([[0, 0, 1]] * 2, [[0, 0, 1]] * 2)
    matrix = np.array([[50.0, 0, 4], [0, 60.0, 3], [0, 0, 1]])
    camera.set_intrinsic_matrices([matrix], env_ids=[1])
    np.testing.assert_allclose(np.asarray(camera.data.intrinsic_matrices)[1], matrix, rtol=1e-6)
    assert np.asarray(camera.data.intrinsic_matrices)[0, 0, 0] != 50
    assert camera.set_debug_vis(True)
    scene.native.destroy()


def test_robots_and_objects_of_embodichain():
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import RigidObjectCfg, RobotCfg
    from kinetoscope.compat.embodichain.lab.sim.sensors import CameraCfg
    from kinetoscope.compat.embodichain.lab.sim.shapes import CubeCfg

    sim = SimulationManager(SimulationManagerCfg(num_envs=2))
    robot = sim.add_robot(RobotCfg(uid="r", fpath=ks.asset("sr5/SR5.urdf"), control_parts={"arm": ["JOINT[1-6]"]}))
    cube = sim.add_rigid_object(RigidObjectCfg(uid="cube", shape=CubeCfg(size=[0.1] * 3), init_pos=[2, 0, 0.5]))
    camera = sim.add_sensor(CameraCfg(uid="cam", width=8, height=6))
    assert sim.get_robot_uid_list() == ["r"] and sim.get_rigid_object_uid_list() == ["cube"]
    assert sim.get_sensor_uid_list() == ["cam"] and sim.get_articulation_uid_list() == []
    assert str(robot.device) == str(cube.device) == str(camera.device) == "cpu"
    assert robot.active_joint_ids == [0, 1, 2, 3, 4, 5] and robot.active_dof == 6 and robot.root_link_name == robot.link_names[0]
    # Limits and drives, of selected joints and environments.
    for quantity, value in (("qvel", 2.0), ("qf", 30.0)):
        before = np.asarray(getattr(robot, f"get_{quantity}_limits")()).copy()
        getattr(robot, f"set_{quantity}_limits")([[value]], joint_ids=[1], env_ids=[1])
        after = np.asarray(getattr(robot, f"get_{quantity}_limits")())
        assert after[1, 1] == value != before[1, 1] and (after != before).sum() == 1
        assert np.asarray(getattr(robot, f"get_{quantity}_limits")(joint_ids=[1, 2], env_ids=[1])).shape == (1, 2)
    robot.set_qpos_limits([[[-1.0, 1.0]]], joint_ids=[0], env_ids=[0])
    np.testing.assert_allclose(np.asarray(robot.get_qpos_limits(joint_ids=[0], env_ids=[0])), [[[-1, 1]]])
    robot.set_joint_drive(stiffness=[[123.0] * 6] * 2)
    stiffness, damping, effort, velocity, friction, armature = robot.get_joint_drive(joint_ids=[0, 1])
    np.testing.assert_allclose(np.asarray(stiffness), [[123.0] * 2] * 2)
    np.testing.assert_allclose(np.asarray(effort)[1, 1], 30.0)
    for values, name in ((damping, "damping"), (velocity, "qvel_limits"), (friction, "friction"), (armature, "armature")):
        np.testing.assert_allclose(np.asarray(values), getattr(robot.native, name)[:, :2], rtol=1e-6)
    # Mask ids, by the judge of the table of the simulation.
    table = {link: mask_id for mask_id, entity, link, _ in sim.native.mask_ids if entity == "r"}
    ids = np.asarray(robot.get_user_ids())
    assert ids.shape == (2, len(robot.link_names)) and set(table.values()) == set(ids[0][ids[0] > 0])
    assert np.asarray(robot.get_user_ids(next(iter(table)))).shape == (2,)
    robot.set_qvel(np.ones((2, 6)), target=False)
    robot.clear_dynamics([1])
    np.testing.assert_array_equal(np.asarray(robot.get_qvel()), [[1] * 6, [0] * 6])
    # Kinematics of a batch, against that of single rows.
    qpos = np.linspace(-0.4, 0.4, 2 * 3 * 6).reshape(2, 3, 6)
    batch = np.asarray(robot.compute_batch_fk(qpos, "arm"))
    assert batch.shape == (2, 3, 7)
    np.testing.assert_allclose(batch[:, 2], np.asarray(robot.compute_fk(qpos[:, 2], "arm")), atol=1e-6)
    assert np.asarray(robot.compute_batch_fk(qpos, "arm", to_matrix=True)).shape == (2, 3, 4, 4)
    success, found = robot.compute_batch_ik(batch, qpos, "arm")
    assert np.asarray(success).all() and np.asarray(found).shape == (2, 3, 6)
    np.testing.assert_allclose(np.asarray(robot.compute_batch_fk(found, "arm"))[..., :3], batch[..., :3], atol=1e-3)
    # The cube.
    cube.set_friction([0.3, 0.6])
    np.testing.assert_allclose(np.asarray(cube.get_friction()), [0.3, 0.6], rtol=1e-6)
    cube.set_friction([0.9], env_ids=[1])
    np.testing.assert_allclose(np.asarray(cube.get_friction()), [0.3, 0.9], rtol=1e-6)
    cube.set_inertia([[0.1, 0.2, 0.25]] * 2)
    np.testing.assert_allclose(np.asarray(cube.get_inertia()), [[0.1, 0.2, 0.25]] * 2, rtol=1e-6)
    cube.set_velocity(lin_vel=[[1.0, 0, 0]] * 2)
    assert np.asarray(cube.body_state)[0, 7] == 1 and not cube.is_static and not cube.is_non_dynamic
    cube.clear_dynamics([0])
    assert np.asarray(cube.body_state)[:, 7].tolist() == [0, 1]
    # The camera returns to its configuration.
    before = np.asarray(camera.get_local_pose()).copy()
    camera.look_at([[3.0, 0, 1]] * 2, [[0, 0, 0]] * 2)
    assert np.abs(np.asarray(camera.get_local_pose()) - before).max() > 0.1
    camera.reset()
    np.testing.assert_allclose(np.asarray(camera.get_local_pose()), before, atol=1e-6)
    with pytest.raises(AttributeError, match="SimulationManager.remove_asset is not in this layer"):
        sim.remove_asset("cube")
    sim.destroy()


def test_mimic_joints_of_embodichain():
    """A hand whose joints follow others: the numbers of its file."""
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import RobotCfg

    sim = SimulationManager(SimulationManagerCfg(num_envs=1))
    cfg = ks.bundled_robot("revo1_left")
    robot = sim.add_robot(RobotCfg(uid="hand", fpath=cfg.urdf if isinstance(cfg.urdf, str) else cfg.urdf["components"][0]["urdf"]))
    assert len(robot.mimic_ids) == len(robot.mimic_parents) == len(robot.mimic_multipliers) == len(robot.mimic_offsets) > 0
    assert not set(robot.mimic_parents) & set(robot.mimic_ids) and set(robot.active_joint_ids).isdisjoint(robot.mimic_ids)
    robot.native.write_qpos(np.full(robot.dof, 0.2))
    qpos = robot.native.qpos[0]
    for joint, parent, factor, offset in zip(robot.mimic_ids, robot.mimic_parents, robot.mimic_multipliers, robot.mimic_offsets, strict=True):
        assert qpos[joint] == pytest.approx(factor * qpos[parent] + offset)
    sim.destroy()


def spawned(cls, **fields):
    """A rigid object of 2 kg of Isaac with a shape."""
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.assets import RigidObjectCfg

    body = {"rigid_props": sim_utils.RigidBodyPropertiesCfg(), "mass_props": sim_utils.MassPropertiesCfg(mass=2.0)}
    spawn = getattr(sim_utils, cls)(radius=0.2, height=0.6, **body, **fields)
    return RigidObjectCfg(prim_path="{ENV_REGEX_NS}/Body", spawn=spawn)


# Moments of inertia about x and z for 2 kg, radius 0.2 m and height 0.6 m. A capsule is a cylinder with two half balls at its ends.
CYLINDER, BALL = np.pi * 0.2**2 * 0.6, 4 / 3 * np.pi * 0.2**3
M_CYLINDER, M_BALL = 2 * CYLINDER / (CYLINDER + BALL), 2 * BALL / (CYLINDER + BALL)
MOMENTS = {
    "CylinderCfg": (2 * (3 * 0.2**2 + 0.6**2) / 12, 2 * 0.2**2 / 2),
    "CapsuleCfg": (
        M_CYLINDER * (3 * 0.2**2 + 0.6**2) / 12
        + M_BALL * (0.4 * 0.2**2 + 0.3**2 + 2 * 0.3 * 3 / 8 * 0.2),
        M_CYLINDER * 0.2**2 / 2 + M_BALL * 0.4 * 0.2**2,
    ),
    # About the center of mass, a quarter of the height above the base.
    "ConeCfg": (2 * (3 / 20 * 0.2**2 + 3 / 80 * 0.6**2), 2 * 3 / 10 * 0.2**2),
}


@pytest.mark.parametrize("cls", MOMENTS)
def test_shapes_with_an_axis_of_isaac(cls):
    """Closed forms of the moments of inertia: the axis is z, and the height is that of Isaac."""
    scene = isaac_scene(body=spawned(cls))
    inertia = scene["body"].native.inertia[0]
    around, along = MOMENTS[cls]
    # MuJoCo orders principal moments from the largest.
    np.testing.assert_allclose(inertia, [around, around, along], rtol=1e-6)
    assert scene["body"].native.nominal_mass == 2.0
    center = {"ConeCfg": -0.15}.get(cls, 0.0)
    np.testing.assert_allclose(scene["body"].native.center_of_mass[0], [0, 0, center], atol=1e-9)
    scene.native.destroy()
    with pytest.raises(NotImplementedError, match="axis"):
        isaac_scene(body=spawned(cls, axis="X"))


def test_tiled_cameras_and_lidars_of_isaac():
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.assets import AssetBaseCfg
    from kinetoscope.compat.isaaclab.sensors import CameraCfg, RayCasterCfg, TiledCamera, TiledCameraCfg, patterns

    fields = {"prim_path": "{ENV_REGEX_NS}/Robot/base/cam", "width": 8, "height": 6, "data_types": ["rgb", "depth"]}
    lidar = patterns.LidarPatternCfg(channels=3, vertical_fov_range=(-30.0, -10.0), horizontal_fov_range=(-90.0, 90.0), horizontal_res=45.0)
    scene = isaac_scene(
        ground=AssetBaseCfg(prim_path="/World/g", spawn=sim_utils.GroundPlaneCfg()),
        tiled=TiledCameraCfg(**fields),
        cam=CameraCfg(**{**fields, "prim_path": "{ENV_REGEX_NS}/Robot/base/cam_2"}),
        lidar=RayCasterCfg(prim_path="{ENV_REGEX_NS}/Robot/base", pattern_cfg=lidar, mesh_prim_paths=["/World/g"]),
    )
    scene.native.update(2)
    assert type(scene["tiled"]) is TiledCamera
    for name in ("rgb", "depth"):
        np.testing.assert_array_equal(np.asarray(scene["tiled"].data.output[name]), np.asarray(scene["cam"].data.output[name]))
    # Judge: directions of the angles. Channels are elevations, azimuths change fastest, both ends of less than a turn belong to it.
    elevation, azimuth = np.meshgrid(np.radians([-30, -20, -10]), np.radians([-90, -45, 0, 45, 90]), indexing="ij")
    expected = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1)
    native = scene["robot"].native
    turn = _poses.to_matrix(native.root_pose)[:, :3, :3]
    hits, start = scene["lidar"].native["hits"], scene["lidar"].native["pos_w"]
    seen = hits - start[:, None]
    seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
    np.testing.assert_allclose(seen, np.einsum("nij,rj->nri", turn, expected.reshape(-1, 3)), atol=1e-6)
    scene.native.destroy()


def test_delayed_actuators_of_isaac():
    """Targets arrive after the delay in physics steps, which each reset draws for each environment."""
    from kinetoscope.compat.isaaclab.actuators import DelayedPDActuatorCfg, IdealPDActuatorCfg
    from kinetoscope.compat.isaaclab.orbit_assets.anymal import ANYMAL_C_CFG

    def robot_cfg(**delays):
        gains = {"stiffness": 40.0, "damping": 2.0, "effort_limit": 80.0}
        actuators = {
            "late": DelayedPDActuatorCfg(joint_names_expr=[".*HAA", ".*HFE"], **gains, **delays),
            "prompt": IdealPDActuatorCfg(joint_names_expr=[".*KFE"], **gains),
        }
        return ANYMAL_C_CFG.replace(prim_path="{ENV_REGEX_NS}/Robot", actuators=actuators)

    scene = isaac_scene(robot_cfg(min_delay=3, max_delay=3))
    native = scene["robot"].native
    late = [not name.endswith("KFE") for name in native.joint_names]
    assert (native.delay[:, late] == 3).all() and (native.delay[:, ~np.array(late)] == 0).all()
    start = native.qf.copy()
    native.set_qpos_target(native.qpos + 0.3)
    # A step computes its efforts from the targets at its beginning: the first one has those of joints without a delay.
    changed = []
    for _ in range(5):
        scene.native.update()
        changed.append(np.abs(native.qf - start).min(axis=0) > 5.0)
    assert not np.array(changed)[:3, late].any() and np.array(changed)[3, late].all()
    assert np.array(changed)[0, ~np.array(late)].all()
    scene.native.destroy()
    scene = isaac_scene(robot_cfg(min_delay=1, max_delay=4))
    robot, drawn = scene["robot"], []
    for _ in range(60):
        robot.reset([1])
        assert (robot.native.delay[:, late] == robot.native.delay[:, :1]).all()
        drawn.append(robot.native.delay[:, 0].tolist())
    # The other environment keeps its own. All delays occur: 60 draws miss one of four with a chance of 4 * 0.75**60 = 1e-7.
    assert len({row[0] for row in drawn}) == 1 and {row[1] for row in drawn} == {1, 2, 3, 4}
    scene.native.destroy()
    with pytest.raises(ks.ConfigError, match=r"actuators\['late'\]: min_delay is 2 and max_delay is 1"):
        isaac_scene(robot_cfg(min_delay=2, max_delay=1))


def test_selections_of_entities_of_isaac():
    from kinetoscope.compat.isaaclab.managers import SceneEntityCfg

    scene = isaac_scene()
    names = scene["robot"].joint_names
    for fields, attribute, ids, found in (
        ({}, "joint", slice(None), None),
        ({"joint_names": "LF_HAA"}, "joint", [names.index("LF_HAA")], ["LF_HAA"]),
        ({"joint_names": [".*HAA"]}, "joint", [at for at, name in enumerate(names) if name.endswith("HAA")], [name for name in names if name.endswith("HAA")]),
        ({"joint_names": ["RH_HAA", "LF_HAA"], "preserve_order": True}, "joint", [names.index("RH_HAA"), names.index("LF_HAA")], ["RH_HAA", "LF_HAA"]),
        ({"joint_names": [".*"]}, "joint", slice(None), names),
        ({"joint_ids": [2, 0]}, "joint", [2, 0], [names[2], names[0]]),
        ({"joint_ids": 1}, "joint", [1], [names[1]]),
        ({"body_names": "base"}, "body", [scene["robot"].body_names.index("base")], ["base"]),
    ):  # fmt: skip
        entity = SceneEntityCfg(name="robot", **fields)
        entity.resolve(scene)
        assert getattr(entity, f"{attribute}_ids") == ids and getattr(entity, f"{attribute}_names") == found, fields
    for fields, text in (
        ({"name": "robt"}, "no entity 'robt'; known names: robot"),
        ({"name": "robot", "joint_names": "LF_HAB"}, "LF_HAB"),
        ({"name": "robot", "joint_names": "LF_HAA", "joint_ids": [5]}, "differ"),
    ):
        with pytest.raises(ValueError, match=text):
            SceneEntityCfg(**fields).resolve(scene)
    scene.native.destroy()


def test_groups_and_convex_pieces_of_embodichain(tmp_path):
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import RigidObjectCfg, RigidObjectGroupCfg
    from kinetoscope.compat.embodichain.lab.sim.shapes import CubeCfg, MeshCfg, SphereCfg

    sim = SimulationManager(SimulationManagerCfg(num_envs=2))
    cubes = {
        "a": RigidObjectCfg(shape=CubeCfg(size=[0.1] * 3), init_pos=[1, 0, 0.5]),
        "b": RigidObjectCfg(shape=SphereCfg(radius=0.1), init_pos=[2, 0, 0.5]),
        "c": RigidObjectCfg(shape=CubeCfg(size=[0.2] * 3), init_pos=[3, 0, 0.5]),
    }
    group = sim.add_rigid_object_group(RigidObjectGroupCfg(uid="toys", rigid_objects=cubes))
    assert sim.get_rigid_object_group("toys") is group and sim.get_rigid_object_group_uid_list() == ["toys"]
    assert (group.uid, group.num_objects, group.native.names) == ("toys", 3, ["toys.a", "toys.b", "toys.c"])
    start = np.asarray(group.get_local_pose()).copy()
    np.testing.assert_allclose(start[..., 0], [[1, 2, 3]] * 2)
    assert np.asarray(group.get_local_pose(to_matrix=True)).shape == (2, 3, 4, 4)
    sim.update(step=10)
    assert (np.asarray(group.body_data.lin_vel)[..., 2] < -0.5).all() and np.asarray(group.body_data.vel).shape == (2, 3, 6)
    # Matrices and rows, of selected objects and environments.
    moved = np.array(start[:, :1])
    moved[..., 2] = 2.0
    group.set_local_pose(_poses.to_matrix(moved[1:]), env_ids=[1], obj_ids=[2])
    heights = np.asarray(group.get_local_pose())[..., 2]
    assert heights[1, 2] == 2.0 and (np.delete(heights.ravel(), 5) < 0.5).all()
    group.clear_dynamics([0])
    assert not np.asarray(group.body_data.vel)[0].any() and np.asarray(group.body_data.vel)[1].any()
    group.reset()
    np.testing.assert_allclose(np.asarray(group.get_local_pose()), start, atol=1e-6)
    for cfg, error, text in (
        (RigidObjectGroupCfg(uid="x", folder_path="meshes"), NotImplementedError, "folder_path"),
        (RigidObjectGroupCfg(rigid_objects=cubes), ks.ConfigError, "uid"),
        (RigidObjectGroupCfg(uid="x"), ks.ConfigError, "at least 1 object"),
    ):
        with pytest.raises(error, match=text):
            sim.add_rigid_object_group(cfg)
    # A mesh of two cubes apart: one hull fills the gap, pieces do not. A ball falls between them.
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4)]
    lines = [f"v {x + 2 * cube} {y} {z}" for cube in (0, 1) for x, y, z in corners]
    lines += [f"f {a + 8 * cube} {b + 8 * cube} {c + 8 * cube}" for cube in (0, 1) for a, b, c in faces]
    (tmp_path / "gap.obj").write_text("\n".join(lines))
    for pieces, (low, high) in ((1, (1.0, 1.4)), (2, (0.05, 0.15))):
        own = SimulationManager(SimulationManagerCfg())
        shape = MeshCfg(fpath=str(tmp_path / "gap.obj"), max_convex_hull_num=pieces)
        own.add_rigid_object(RigidObjectCfg(uid="gap", shape=shape, body_type="static"))
        ball = own.add_rigid_object(RigidObjectCfg(uid="ball", shape=SphereCfg(radius=0.1), init_pos=[1.5, 0.5, 1.3]))
        own.update(step=200)
        height = np.asarray(ball.get_local_pose())[0, 2]
        assert low < height < high, (pieces, height)
        own.destroy()
    sim.destroy()
