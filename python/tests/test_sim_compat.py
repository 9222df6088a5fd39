"""The tutorials of other simulators with nothing but other import lines, and the layer that they run on.

The scripts belong to their projects and are not in this one: ``KINETOSCOPE_SEEDS`` names their folder.
"""

import ast
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import seeds

import kinetoscope as ks
from kinetoscope.compat import _poses, numpy_torch
from kinetoscope.compat._tensors import torch as installed_torch
from kinetoscope.compat.configclass import configclass

TENSORS = ["numpy"] if installed_torch is None else ["numpy", "torch"]
# Set where torch cannot be installed, so that its tests are left out by name.
WITHOUT_TORCH = "KINETOSCOPE_TESTS_WITHOUT_TORCH"


def test_torch_is_installed_or_left_out_by_name():
    """Without torch, half of these tests do not exist."""
    assert (installed_torch is None) == (os.environ.get(WITHOUT_TORCH) == "1"), f"install torch, or set {WITHOUT_TORCH}=1"


def run(name, tensors, flags, steps, **variables):
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    environment |= {"KINETOSCOPE_COMPAT_STEPS": str(steps), **variables}
    command = [sys.executable, Path(seeds.__file__), name, tensors, *flags]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment, check=False)


def without_imports(source):
    """The syntax tree of a script without its import statements, and their number."""
    tree, count = ast.parse(source), 0
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [item for item in body if not isinstance(item, ast.Import | ast.ImportFrom)]
            count += len(body) - len(kept)
            node.body = kept
    return ast.dump(tree), count


@pytest.mark.needs_seeds
def test_only_import_lines_change():
    for name in ("create_robot.py", "create_sensor.py", "add_sensors_on_robot.py"):
        source = (seeds.folder() / name).read_text()
        for with_torch in (False, True):
            new = seeds.adapted(source, with_torch)
            # Judge: Python's parser. Everything but the import statements is the same.
            assert new != source and without_imports(new) == without_imports(source)
            assert without_imports(source)[1] >= 5
            assert without_imports(new + "\nprint()")[0] != without_imports(source)[0]


@pytest.mark.needs_seeds
@pytest.mark.parametrize("tensors", TENSORS)
@pytest.mark.parametrize("envs", [1, 4])
def test_create_robot(tensors, envs):
    result = run("create_robot.py", tensors, ["--headless", "--num_envs", str(envs)], 3100)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.split("\n")
    assert "Robot created successfully with 17 joints" in lines
    moves = ["Moving to arm position 1", "Moving to arm position 2", "Closing hand", "Opening hand"]
    assert [line for line in lines if line in moves] == moves
    assert lines[-3:-1] == ["Stopping simulation...", "Cleaning up..."]


@pytest.mark.needs_seeds
@pytest.mark.parametrize("tensors", TENSORS)
@pytest.mark.parametrize("flags", [[], ["--attach_sensor"], ["--enable_rt"]])
def test_create_sensor(tensors, flags, tmp_path):
    result = run("create_sensor.py", tensors, ["--headless", *flags], 1100, KINETOSCOPE_COMPAT_IMAGES=str(tmp_path))
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("Moving to arm position 1") == 2
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3 and all(file.read_bytes()[:4] == b"\x89PNG" for file in files)
    if flags != ["--attach_sensor"]:
        # The grid of color, depth, mask and normals: the camera looks down at the cube, 0.75 m below its center.
        from PIL import Image

        grid = np.asarray(Image.open(files[-1]))
        assert grid.shape == (960, 1280, 3)
        mask = grid[480:, :640].reshape(-1, 3)
        assert len(np.unique(mask, axis=0)) >= 2
        # The script converts RGB to BGR: the normal of the ground, up, is blue in RGB and red in BGR; files are RGB.
        np.testing.assert_array_equal(grid[490, 650], [127, 127, 255])


@pytest.mark.needs_seeds
def test_create_sensor_with_four_environments_fails_in_the_script():
    """The script colors one mask image, (h, w), and gets four, (4, h, w), as from EmbodiChain."""
    result = run("create_sensor.py", "numpy", ["--headless", "--num_envs", "4"], 10)
    assert result.returncode == 1 and "in mask_to_color_map" in result.stderr
    assert "kinetoscope" not in result.stderr.strip().split("\n")[-1]


@pytest.mark.needs_seeds
@pytest.mark.parametrize("tensors", TENSORS)
@pytest.mark.parametrize("envs", [1, 4])
def test_add_sensors_on_robot(tensors, envs):
    result = run("add_sensors_on_robot.py", tensors, ["--headless", "--num_envs", str(envs)], 620)
    assert result.returncode == 0, result.stderr
    shape = f"{envs}, 480, 640"
    expected = f"torch.Size([{shape}" if tensors == "torch" else f"({shape}"
    assert result.stdout.count("Received shape of rgb   image:  " + expected) == 620
    # The reset at the start and after 500 steps.
    assert result.stdout.count("[INFO]: Resetting robot state...") == 2
    assert set(re.findall(r"max height value:  (\S+)", result.stdout)) == {"0.0"}
    forces = [float(force) for force in re.findall(r"max contact force of:  (\S+)", result.stdout)]
    # A quarter of the weight of the standing robot, 52 kg, on each foot; more where it leans.
    assert 115 < forces[490] < 200


@pytest.mark.needs_seeds
@pytest.mark.parametrize("tensors", TENSORS)
@pytest.mark.parametrize(
    ("name", "envs"),
    # With four environments, create_sensor.py fails, as above.
    [("create_robot.py", 1), ("create_robot.py", 4), ("add_sensors_on_robot.py", 1), ("add_sensors_on_robot.py", 4), ("create_sensor.py", 1)],
)
def test_under_a_display(name, envs, tensors, display):
    """Windows open where there is a display and the script is not headless. A control: without a display, none opens."""
    flags = ["--num_envs", str(envs)]
    result = run(name, tensors, flags, 40, DISPLAY=display)
    assert result.returncode == 0, result.stderr
    assert "no window" not in result.stderr
    result = run(name, tensors, flags, 5)
    assert result.returncode == 0 and "no window" in result.stderr


@pytest.mark.needs_seeds
def test_windows_run_in_real_time(display):
    def seconds(steps, **variables):
        started = time.perf_counter()
        assert run("create_robot.py", "numpy", [] if variables else ["--headless"], steps, **variables).returncode == 0
        return time.perf_counter() - started

    # 500 more steps of 10 ms take 5 s more, apart from the start. Without a window, less.
    assert seconds(540, DISPLAY=display) - seconds(40, DISPLAY=display) > 4.5 > seconds(540) - seconds(40)


def test_targets_and_states_of_embodichain():
    from kinetoscope.compat.embodichain.data import get_data_path
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import JointDrivePropertiesCfg, RigidObjectCfg, RobotCfg, URDFCfg
    from kinetoscope.compat.embodichain.lab.sim.sensors import CameraCfg
    from kinetoscope.compat.embodichain.lab.sim.shapes import CubeCfg

    sim = SimulationManager(SimulationManagerCfg())
    sim.build_multiple_arenas(3)
    transform = np.eye(4)
    transform[2, 3] = 0.02
    hand = get_data_path("BrainCoHandRevo1/BrainCoLeftHand/BrainCoLeftHand.urdf")
    robot = sim.add_robot(
        RobotCfg(
            uid="r",
            urdf_cfg=URDFCfg(
                components=[
                    {"component_type": "arm", "urdf_path": get_data_path("Rokae/SR5/SR5.urdf")},
                    {"component_type": "hand", "urdf_path": hand, "transform": transform},
                ]
            ),
            control_parts={"arm": ["JOINT[1-6]"], "hand": ["LEFT_.*"]},
            drive_pros=JointDrivePropertiesCfg(stiffness={"JOINT[1-6]": 5e3}, damping={"arm": 700.0}),
        )
    )
    arm, fingers = robot.get_joint_ids("arm"), robot.get_joint_ids("hand")
    assert robot.dof == 17 and len(arm) == 6 and len(fingers) == 11
    assert len(robot.get_joint_ids("hand", remove_mimic=True)) == 6
    driven = robot.get_joint_ids("hand", remove_mimic=True)
    # Named joints have the given gains, all others those of the class; limits of the file are replaced.
    assert set(robot.native.stiffness[0, arm]) == {5e3} and set(robot.native.stiffness[0, driven]) == {1e4}
    assert set(robot.native.damping[0, arm]) == {700.0} and set(robot.native.qf_limits[0, arm]) == {1e10}
    limits = np.asarray(robot.body_data.qpos_limits)
    assert limits.shape == (3, 17, 2) and limits.dtype == np.float32
    robot.set_qpos(np.full((3, 6), 100.0), joint_ids=arm)
    np.testing.assert_allclose(np.asarray(robot.get_qpos(name="arm", target=True)), limits[:, arm, 1], rtol=1e-6)
    # Both are clamped to the limits that are set now, not to those of the file.
    robot.native.set_qpos_limits([[[-0.5, 0.5]] * 6], joint_ids="arm")
    for target in (True, False):
        robot.set_qpos(np.full((3, 6), 100.0), name="arm", target=target)
        np.testing.assert_allclose(np.asarray(robot.get_qpos(name="arm", target=target)), 0.5)
    robot.set_qpos(np.full((3, 6), 0.25), name="arm", target=False)
    np.testing.assert_allclose(np.asarray(robot.get_qpos(name="arm")), 0.25)
    with pytest.raises(ValueError, match="1 rows for 3 environments"):
        robot.set_qpos([0.0] * 6, joint_ids=arm)
    with pytest.raises(NotImplementedError, match="profiler"):
        SimulationManager(SimulationManagerCfg(profiler={}))
    cube = sim.add_rigid_object(RigidObjectCfg(uid="cube", shape=CubeCfg(size=[0.05] * 3), init_pos=[1.2, -0.2, 0.1]))
    assert cube.native.nominal_mass == 1.0
    # Without a parent, the rotation is that of ROS axes; with one, of OpenGL axes in the link.
    turned = [0.5, 0.5, -0.5, 0.5]
    free = sim.add_sensor(CameraCfg(width=8, height=6, extrinsics=CameraCfg.ExtrinsicsCfg(pos=[1, 2, 3], quat=turned)))
    held = sim.add_sensor(sensor_cfg=CameraCfg(width=8, height=6, extrinsics=CameraCfg.ExtrinsicsCfg(parent="ee_link")))
    np.testing.assert_allclose(free.native.pose_w("ros")[0], [1, 2, 3, *turned], atol=1e-12)
    own, link = held.native.pose_w("opengl")[0], robot.native.link_pose("ee_link")[0]
    np.testing.assert_allclose(own * np.sign(own[3]), link * np.sign(link[3]), atol=1e-6)
    assert (free.uid, held.uid) == ("camera_0", "camera_1") and held.is_attached
    sim.update()
    assert sim.native.time[0] == pytest.approx(0.1)
    ok, found = robot.compute_ik(robot.compute_fk(np.full((3, 6), 0.3), "arm"), name="arm")
    assert np.asarray(ok).all() and tuple(found.shape) == (3, 6)
    assert not sim.is_use_gpu_physics and str(sim.device) == "cpu"
    sim.destroy()


def test_images_of_attached_cameras_of_embodichain():
    """A camera on a link has OpenGL axes: it looks along -z of the link, from its position in the link."""
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import RigidObjectCfg, RobotCfg
    from kinetoscope.compat.embodichain.lab.sim.sensors import CameraCfg
    from kinetoscope.compat.embodichain.lab.sim.shapes import CubeCfg

    def camera(parent, pos, quat):
        extrinsics = CameraCfg.ExtrinsicsCfg(parent=parent, pos=pos, quat=quat)
        intrinsics = (40, 40, 16, 12)
        return CameraCfg(width=32, height=24, intrinsics=intrinsics, extrinsics=extrinsics, enable_depth=True, enable_mask=True)

    sim = SimulationManager(SimulationManagerCfg(num_envs=2))
    start = [0.3, 0.4, -1.2, 0.5, -0.6, 0.2]
    robot = sim.add_robot(RobotCfg(uid="r", fpath=ks.asset("sr5/SR5.urdf"), init_qpos=start))
    np.testing.assert_allclose(np.asarray(robot.get_qpos()), [start] * 2, rtol=1e-6)
    held = sim.add_sensor(camera("ee_link", [0.3, 0.0, 0.9], [1, 0, 0, 0]))
    turned = sim.add_sensor(camera("ee_link", [0.0, 0.0, 0.1], [0, 1, 0, 0]))
    # Kinematic cubes with edges of 0.1 m, 0.6 m in front of each camera, with the rotation of the link.
    link = _poses.to_matrix(robot.native.link_pose("ee_link")[0])
    places = {}
    # The arm is behind the flange, at negative z of the link. A half turn about x maps -z to z.
    for name, place in (("held", [0.3, 0, 0.3]), ("turned", [0, 0, 0.7])):
        pose = link.copy()
        pose[:3, 3] = (link @ [*place, 1])[:3]
        cfg = RigidObjectCfg(uid=name, shape=CubeCfg(size=[0.1] * 3), body_type="kinematic", init_local_pose=pose)
        places[name] = sim.add_rigid_object(cfg)
    for name, sensor in (("held", held), ("turned", turned)):
        sensor.update()
        data = {key: np.asarray(value) for key, value in sensor.get_data().items()}
        np.testing.assert_allclose(data["depth"][:, 12, 16], 0.55, atol=1e-4)
        assert (data["mask"][:, 12, 16] == places[name].native.mask_id).all(), name
    # A control: with the axes of ROS, the camera would look the other way.
    flipped = sim.native.add_sensor("flipped", {"type": "camera", "width": 32, "height": 24, "extrinsics": {
        "parent": "r/ee_link", "convention": "ros", "placement": {"pose": {"pos": [0.3, 0.0, 0.9]}}}, "channels": ["mask"]})  # fmt: skip
    assert (flipped["mask"][:, 12, 16] != places["held"].native.mask_id).all()
    # The initial positions are those of a reset, too.
    robot.set_qpos(np.zeros((2, 6)), target=False)
    robot.reset()
    np.testing.assert_allclose(np.asarray(robot.get_qpos()), [start] * 2, rtol=1e-6)
    np.testing.assert_allclose(np.asarray(robot.get_qpos(target=True)), [start] * 2, rtol=1e-6)
    sim.reset_objects_state()
    np.testing.assert_allclose(np.asarray(robot.get_qpos()), [start] * 2, rtol=1e-6)
    with pytest.raises(ks.ConfigError, match="init_qpos has 2 values; the joints are JOINT1"):
        sim.add_robot(RobotCfg(uid="s", fpath=ks.asset("sr5/SR5.urdf"), init_qpos=[0.0, 0.0]))
    sim.destroy()


def test_stereo_and_contacts_of_embodichain():
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import RigidBodyAttributesCfg, RigidObjectCfg
    from kinetoscope.compat.embodichain.lab.sim.sensors import ContactSensorCfg, StereoCameraCfg
    from kinetoscope.compat.embodichain.lab.sim.shapes import CubeCfg

    sim = SimulationManager(SimulationManagerCfg(num_envs=2))
    attrs = RigidBodyAttributesCfg(mass=2.0, linear_damping=0.0, angular_damping=0.0)
    lower, upper = (
        sim.add_rigid_object(RigidObjectCfg(uid=uid, shape=CubeCfg(size=[0.2] * 3), init_pos=[0, 0, z], attrs=attrs))
        for uid, z in (("lower", 0.1), ("upper", 0.3))
    )
    extrinsics = StereoCameraCfg.ExtrinsicsCfg(eye=(0, 0, 2.0), target=(0, 0, 0), up=(0, 1, 0))
    stereo = sim.add_sensor(
        StereoCameraCfg(
            width=64, height=48, intrinsics=(80, 80, 32, 24), intrinsics_right=(80, 80, 32, 24), extrinsics=extrinsics,
            left_to_right_pos=(0.1, 0, 0), enable_depth=True, enable_disparity=True, enable_mask=True,
        )  # fmt: skip
    )
    assert stereo.uid == "stereocamera_0"
    both = sim.add_sensor(ContactSensorCfg(rigid_uid_list=["lower", "upper"]))
    any_of = sim.add_sensor(ContactSensorCfg(rigid_uid_list=["lower"], filter_need_both_actor=False, max_contacts_per_env=16))
    sim.update(step=200)
    stereo.update()
    data = {name: np.asarray(values) for name, values in stereo.get_data().items()}
    assert data["depth"].shape == data["mask_right"].shape == data["disparity"].shape == (2, 48, 64, 1)
    assert data["color"].shape == data["color_right"].shape == (2, 48, 64, 4)
    # The top of the upper cube is 1.6 m below the cameras: 80 x 0.1 / 1.6 = 5 pixels.
    np.testing.assert_allclose(data["disparity"][:, 24, 32], 5.0, rtol=1e-2)
    columns = [np.flatnonzero(data[name][0, 24, :, 0] == upper.native.mask_id) for name in ("mask", "mask_right")]
    assert columns[0].mean() - columns[1].mean() == pytest.approx(5.0, abs=0.6)
    left, right = (np.asarray(pose) for pose in stereo.get_left_right_arena_pose())
    np.testing.assert_allclose((left + right)[:, :3, 3] / 2, [[0, 0, 2]] * 2, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm((right - left)[:, :3, 3], axis=1), 0.1, rtol=1e-5)

    both.update()
    any_of.update()
    pairs, grounded = ({n: np.asarray(v) for n, v in sensor.get_data().items()} for sensor in (both, any_of))
    assert pairs["position"].shape == (2, 64, 3) and grounded["impulse"].shape == (2, 16) and pairs["user_ids"].shape == (2, 64, 2)
    # Newton: the lower cube carries the upper one, 2 kg, and the ground both.
    carried = (pairs["impulse"] * pairs["is_valid"]).sum(axis=1)
    np.testing.assert_allclose(carried, 2 * 9.81 * 0.01, rtol=0.02)
    np.testing.assert_allclose(grounded["impulse"].sum(axis=1), (2 + 4) * 9.81 * 0.01, rtol=0.02)
    valid = pairs["is_valid"]
    assert (np.diff(valid.astype(int), axis=1) <= 0).all() and valid.any(axis=1).all()
    assert {tuple(sorted(ids)) for ids in pairs["user_ids"][valid].tolist()} == {tuple(sorted((lower.native.mask_id, upper.native.mask_id)))}
    np.testing.assert_allclose(np.abs(pairs["normal"][valid]), [[0, 0, 1]] * valid.sum(), atol=1e-3)
    np.testing.assert_allclose(pairs["position"][valid][:, 2], 0.2, atol=0.01)
    chosen = any_of.filter_by_user_ids([upper.native.mask_id], env_ids=[1])
    assert np.asarray(chosen["impulse"]).sum() == pytest.approx(2 * 9.81 * 0.01, rel=0.02)
    with pytest.raises(ValueError, match="there is no 'upper2'; known: .*upper"):
        sim.add_sensor(ContactSensorCfg(rigid_uid_list=["upper2"]))
    with pytest.raises(NotImplementedError, match="left_to_right_rot"):
        sim.add_sensor(StereoCameraCfg(left_to_right_rot=(0, 0, 1)))
    sim.destroy()


def test_poses_of_isaac_are_in_the_world():
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.assets import AssetBaseCfg
    from kinetoscope.compat.isaaclab.orbit_assets.anymal import ANYMAL_C_CFG
    from kinetoscope.compat.isaaclab.scene import InteractiveScene, InteractiveSceneCfg
    from kinetoscope.compat.isaaclab.sensors import CameraCfg

    @configclass
    class Cfg(InteractiveSceneCfg):
        ground = AssetBaseCfg(prim_path="/World/g", spawn=sim_utils.GroundPlaneCfg())
        robot = ANYMAL_C_CFG.replace(prim_path="{ENV_REGEX_NS}/Robot")
        camera = CameraCfg(prim_path="{ENV_REGEX_NS}/Robot/base/cam", width=8, height=6, data_types=["rgb"])

    sim = sim_utils.SimulationContext(sim_utils.SimulationCfg(dt=0.005))
    scene = InteractiveScene(Cfg(num_envs=2, env_spacing=2.0))
    sim.reset()
    origins = np.asarray(scene.env_origins)
    np.testing.assert_allclose(origins, [[1, 0, 0], [-1, 0, 0]])
    robot = scene["robot"]
    state = robot.data.default_root_state
    state[:, :3] += scene.env_origins
    robot.write_root_state_to_sim(state)
    np.testing.assert_allclose(robot.native.root_pose[:, :3], [[0, 0, 0.6]] * 2, atol=1e-7)
    np.testing.assert_allclose(np.asarray(robot.data.root_pos_w), origins + [0, 0, 0.6], atol=1e-6)
    np.testing.assert_allclose(np.asarray(scene["camera"].data.pos_w), origins + [0, 0, 0.6], atol=1e-6)
    robot.set_joint_position_target(robot.data.default_joint_pos)
    robot.set_joint_position_target([[0.7]], joint_ids=[2], env_ids=[1])
    before = robot.native.qpos_target
    scene.write_data_to_sim()
    after = robot.native.qpos_target
    assert after[1, 2] == pytest.approx(0.7) and (np.abs(after - before) > 1e-6).sum() == 1
    sim.step()
    scene.update(sim.get_physics_dt())
    scene.reset()
    assert np.asarray(scene["camera"].frame).tolist() == [0, 0]
    with pytest.raises(KeyError, match="robot"):
        scene["dog"]
    sim.close()


GROUPS = {
    "none": ({}, 0.0, 0.0),
    "partial": ({"a": {"joint_names_expr": (".*HAA",), "stiffness": 40.0, "damping": 5.0}}, 40.0, 0.0),
    "dict": ({"a": {"stiffness": {".*HAA": 40.0}, "damping": {".*HAA": 5.0}}}, 40.0, 0.0),
    "without gains": ({"a": {}}, 0.0, 0.0),
    "two groups": (
        {
            "a": {"joint_names_expr": (".*HAA",), "stiffness": 40.0, "damping": 5.0},
            "b": {"joint_names_expr": [".*HFE", ".*KFE"], "stiffness": 7.0, "damping": 1.0},
        },
        40.0,
        7.0,
    ),
}


def isaac_scene(robot=None, **attributes):
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.orbit_assets.anymal import ANYMAL_C_CFG
    from kinetoscope.compat.isaaclab.scene import InteractiveScene, InteractiveSceneCfg

    @configclass
    class Cfg(InteractiveSceneCfg):
        robot = ANYMAL_C_CFG.replace(prim_path="{ENV_REGEX_NS}/Robot")

    cfg = Cfg(num_envs=2, env_spacing=2.0)
    if robot is not None:
        cfg.robot = robot
    for name, value in attributes.items():
        setattr(cfg, name, value)
    sim_utils.SimulationContext(sim_utils.SimulationCfg(dt=0.005))
    return InteractiveScene(cfg)


@pytest.mark.parametrize("explicit", [False, True])
@pytest.mark.parametrize("case", GROUPS)
def test_joints_without_an_actuator_have_no_drive(case, explicit):
    """As in Orbit, a joint that no actuator names, or that has no gain, has no drive.

    Regression: it was driven with the gains of this package.
    """
    from kinetoscope.compat.isaaclab.actuators import IdealPDActuatorCfg, ImplicitActuatorCfg
    from kinetoscope.compat.isaaclab.orbit_assets.anymal import ANYMAL_C_CFG

    groups, abducted, others = GROUPS[case]
    kind = IdealPDActuatorCfg if explicit else ImplicitActuatorCfg
    actuators = {name: kind(**fields) for name, fields in groups.items()}
    scene = isaac_scene(ANYMAL_C_CFG.replace(prim_path="{ENV_REGEX_NS}/Robot", actuators=actuators))
    native = scene["robot"].native
    expected = [abducted if name.endswith("HAA") else others for name in native.joint_names]
    np.testing.assert_array_equal(native.stiffness, [expected] * 2)
    assert ((native.damping > 0) == (np.array(expected) > 0)).all()
    # Judge: with a target far away, only driven joints feel an effort.
    native.set_qpos_target(native.qpos + 0.5)
    scene.native.update()
    assert ((np.abs(native.qf) > 1e-3) == (np.array(expected) > 0)).all()
    scene.native.destroy()


def test_patterns_of_actuators_name_joints():
    from kinetoscope.compat.isaaclab.actuators import ImplicitActuatorCfg
    from kinetoscope.compat.isaaclab.orbit_assets.anymal import ANYMAL_C_CFG

    for fields in ({"joint_names_expr": (".*HAB",)}, {"stiffness": {".*HAB": 1.0}}):
        actuators = {"legs": ImplicitActuatorCfg(**fields)}
        with pytest.raises(ks.ConfigError, match=r"legs.*HAB.*LF_HAA"):
            isaac_scene(ANYMAL_C_CFG.replace(prim_path="{ENV_REGEX_NS}/Robot", actuators=actuators))


def test_scenes_of_isaac_take_attributes_of_the_object():
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.assets import AssetBaseCfg
    from kinetoscope.compat.isaaclab.sensors import CameraCfg

    camera = CameraCfg(prim_path="{ENV_REGEX_NS}/Robot/base/cam", width=8, height=6)
    scene = isaac_scene(cam=camera)
    assert scene.keys() == ["robot", "cam"]
    robot = scene["robot"]
    # Indices may be slices.
    robot.set_joint_position_target(np.full((2, 12), 0.1), joint_ids=slice(None))
    robot.set_joint_position_target(np.full((2, 2), 0.2), joint_ids=slice(0, 2), env_ids=slice(None))
    scene.write_data_to_sim()
    np.testing.assert_allclose(robot.native.qpos_target[:, 1:4], [[0.2, 0.1, 0.1]] * 2)
    # Isaac removes external forces in reset.
    push = np.full((2, 1, 3), 100.0)
    robot.set_external_force_and_torque(push, 0 * push, body_ids=[0])
    assert np.abs(robot.native.external_wrenches).max() >= 100.0
    robot.reset([1])
    assert np.abs(robot.native.external_wrenches[0]).max() >= 100.0 and not robot.native.external_wrenches[1].any()
    robot.reset()
    assert not robot.native.external_wrenches.any()
    with pytest.raises(NotImplementedError, match="InteractiveScene.reset"):
        scene["cam"].reset()
    with pytest.raises(NotImplementedError, match="size"):
        isaac_scene(ground=AssetBaseCfg(prim_path="/World/g", spawn=sim_utils.GroundPlaneCfg(size=(1.0, 1.0))))
    with pytest.raises(AttributeError, match="enable_dpeth"):
        camera.enable_dpeth = True


def test_initial_velocities_and_centers_of_mass_of_isaac():
    """Velocities of the root are those of its center of mass, as in Orbit."""
    from kinetoscope.compat.isaaclab.orbit_assets.anymal import ANYMAL_C_CFG

    start = ANYMAL_C_CFG.init_state.replace(
        pos=(0.0, 0.0, 2.0), lin_vel=(0.5, 0.0, 1.0), ang_vel=(0.0, 0.0, 2.0), joint_vel={".*HAA": 0.3, ".*FE": -0.2}
    )
    scene = isaac_scene(ANYMAL_C_CFG.replace(prim_path="{ENV_REGEX_NS}/Robot", init_state=start))
    robot = scene["robot"]
    names = robot.joint_names
    expected = [0.3 if name.endswith("HAA") else -0.2 for name in names]
    np.testing.assert_allclose(np.asarray(robot.data.default_joint_vel), [expected] * 2)
    np.testing.assert_allclose(robot.native.qvel, [expected] * 2, atol=1e-9)
    velocity = [0.5, 0, 1, 0, 0, 2]
    np.testing.assert_allclose(np.asarray(robot.data.default_root_state)[:, 7:], [velocity] * 2)
    np.testing.assert_allclose(np.asarray(robot.data.root_vel_w), [velocity] * 2, atol=1e-6)
    # Judge: v(com) = v(origin) + w x r, with r from the origin to the center of mass. A control: they differ.
    scene.native.set_property("center_of_mass", "robot/base", [[0.1, 0.05, 0.02]] * 2)
    robot.write_start()
    np.testing.assert_allclose(np.asarray(robot.data.root_vel_w), [velocity] * 2, atol=1e-6)
    arm = robot.native.root_com_position - robot.native.root_pose[:, :3]
    origin = robot.native.root_velocity
    assert np.abs(arm).max() > 0.05
    moved = origin[:, :3] + np.cross(origin[:, 3:], arm)
    np.testing.assert_allclose(np.asarray(robot.data.root_lin_vel_w), moved, atol=1e-6)
    turn = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    states = np.asarray(robot.data.root_state_w).copy()
    states[:, 3:7] = turn
    robot.write_root_state_to_sim(states)
    np.testing.assert_allclose(np.asarray(robot.data.root_state_w), states, atol=1e-5)
    # A quarter turn about z: x of the world is -y of the body.
    np.testing.assert_allclose(np.asarray(robot.data.root_lin_vel_b), [[0, -0.5, 1.0]] * 2, atol=1e-5)
    with pytest.raises(ks.ConfigError, match=r"joint_vel.*HIP"):
        isaac_scene(ANYMAL_C_CFG.replace(init_state=start.replace(joint_vel={".*HIP": 1.0})))


def test_rigid_objects_frames_and_imus_of_isaac():
    from kinetoscope.compat.isaaclab import sim as sim_utils
    from kinetoscope.compat.isaaclab.assets import AssetBaseCfg, RigidObjectCfg
    from kinetoscope.compat.isaaclab.sensors import (
        CameraCfg,
        ContactSensorCfg,
        FrameTransformerCfg,
        ImuCfg,
        OffsetCfg,
        RayCasterCfg,
        patterns,
    )

    def ball(**fields):
        spawn = sim_utils.SphereCfg(
            radius=0.25,
            rigid_props=sim_utils.RigidBodyPropertiesCfg(),
            mass_props=sim_utils.MassPropertiesCfg(mass=0.5),
            collision_props=sim_utils.CollisionPropertiesCfg(),
            visual_material=sim_utils.PreviewSurfaceCfg(diffuse_color=(0.0, 0.0, 1.0)),
        )
        state = RigidObjectCfg.InitialStateCfg(pos=(0.5, 0.0, 1.0), lin_vel=(0.0, 0.2, 0.0))
        return RigidObjectCfg(prim_path="{ENV_REGEX_NS}/Ball", spawn=spawn.replace(**fields), init_state=state)

    foot = OffsetCfg(pos=(0.0, 0.0, 0.1), rot=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)))
    scene = isaac_scene(
        ground=AssetBaseCfg(prim_path="/World/g", spawn=sim_utils.GroundPlaneCfg()),
        ball=ball(),
        contact=ContactSensorCfg(prim_path="{ENV_REGEX_NS}/Ball", track_air_time=True),
        feet=ContactSensorCfg(prim_path="{ENV_REGEX_NS}/Robot/.*_FOOT"),
        frames=FrameTransformerCfg(
            prim_path="{ENV_REGEX_NS}/Robot/base",
            source_frame_offset=OffsetCfg(pos=(0.1, 0.0, 0.0)),
            target_frames=[
                FrameTransformerCfg.FrameCfg(prim_path="{ENV_REGEX_NS}/Robot/LF_FOOT", name="foot", offset=foot),
                FrameTransformerCfg.FrameCfg(prim_path="{ENV_REGEX_NS}/Robot/.*H_FOOT"),
            ],
        ),
        imu=ImuCfg(prim_path="{ENV_REGEX_NS}/Ball", offset=OffsetCfg(pos=(0.1, 0.0, 0.0))),
        rays=RayCasterCfg(
            prim_path="{ENV_REGEX_NS}/Ball", attach_yaw_only=True, mesh_prim_paths=["/World/g"],
            pattern_cfg=patterns.GridPatternCfg(resolution=0.1, size=[0.2, 0.2]),
        ),  # fmt: skip
        cam=CameraCfg(prim_path="{ENV_REGEX_NS}/Robot/base/cam", width=8, height=6, data_types=["normals"]),
    )
    assert scene.keys() == ["robot", "ball", "contact", "feet", "frames", "imu", "rays", "cam", "ground"]
    body, origins = scene["ball"], np.asarray(scene.env_origins)
    assert (body.num_instances, body.num_bodies, body.body_names) == (2, 1, ["Ball"])
    assert body.find_bodies("B.*") == ([0], ["Ball"])
    with pytest.raises(ValueError, match="Box"):
        body.find_bodies("Box")
    assert body.native.nominal_mass == 0.5
    start = np.asarray(body.data.default_root_state)
    np.testing.assert_allclose(np.asarray(body.data.root_pos_w), origins + [0.5, 0, 1], atol=1e-6)
    np.testing.assert_allclose(np.asarray(body.data.root_vel_w), start[:, 7:], atol=1e-6)
    # Free fall for 0.1 s: v = g t, and an accelerometer with the bias of gravity measures 0.
    scene.native.update(19)
    # An IMU measures the state at which the last step computes its accelerations.
    before = np.asarray(body.data.root_state_w)
    scene.native.update(1)
    np.testing.assert_allclose(np.asarray(body.data.root_lin_vel_w), [[0, 0.2, -0.981]] * 2, atol=1e-5)
    # Bodies of both kinds of assets, against the native poses.
    for asset, poses in ((body, body.native.pose[:, None]), (scene["robot"], scene["robot"].native.link_poses)):
        np.testing.assert_allclose(np.asarray(asset.data.body_pos_w), poses[..., :3] + origins[:, None], atol=1e-6)
        np.testing.assert_allclose(np.asarray(asset.data.body_quat_w), poses[..., 3:], atol=1e-6)
        np.testing.assert_allclose(np.asarray(asset.data.root_quat_w), asset.data.body_quat_w[:, 0], atol=1e-6)
    imu = scene["imu"].data
    np.testing.assert_allclose(np.asarray(imu.lin_acc_b), 0, atol=1e-4)
    np.testing.assert_allclose(np.asarray(imu.pos_w), before[:, :3] + [0.1, 0, 0], atol=1e-5)
    np.testing.assert_allclose(np.asarray(imu.lin_vel_b), before[:, 7:10], atol=1e-5)
    hits = np.asarray(scene["rays"].data.ray_hits_w)
    assert hits.shape == (2, 9, 3)
    np.testing.assert_allclose(hits[..., 2], 0, atol=1e-6)
    np.testing.assert_allclose(hits.mean(axis=1)[:, :2], np.asarray(body.data.root_pos_w)[:, :2], atol=1e-5)
    # Times of contact: the ball is in the air, then lands and comes to rest.
    sensor = scene["contact"]
    assert not np.asarray(sensor.compute_first_contact(0.5)).any()
    assert np.asarray(sensor.compute_first_air(0.5)).all() and not np.asarray(sensor.compute_first_air(0.05)).any()
    landed = 0
    for _ in range(200):
        scene.native.update(1)
        landed += np.asarray(sensor.compute_first_contact(0.005)).astype(int)
    # It may bounce, but is found at each landing only.
    assert (landed >= 1).all() and (landed < 40).all()
    with pytest.raises(RuntimeError, match="track_air_time"):
        scene["feet"].compute_first_air(0.1)
    feet = scene["feet"]
    assert feet.find_bodies(["RH.*", "LF.*"], preserve_order=True) == ([3, 0], ["RH_FOOT", "LF_FOOT"])
    assert feet.find_bodies(".*") == ([0, 1, 2, 3], feet.body_names)
    with pytest.raises(ValueError, match="HIP"):
        feet.find_bodies("HIP")
    # Frames: the judge is matrices.
    data = scene["frames"].data
    assert data.target_frame_names == ["foot", "LH_FOOT", "RH_FOOT"]
    native = scene["robot"].native
    source = _poses.to_matrix(native.root_pose) @ _poses.to_matrix([0.1, 0, 0, 1, 0, 0, 0])
    target = _poses.to_matrix(native.link_pose("LF_FOOT")) @ _poses.to_matrix([*foot.pos, *foot.rot])
    relative = np.linalg.inv(source) @ target
    np.testing.assert_allclose(np.asarray(data.target_pos_source)[:, 0], relative[:, :3, 3], atol=1e-5)
    np.testing.assert_allclose(np.asarray(data.target_pos_w)[:, 0], origins + target[:, :3, 3], atol=1e-5)
    quat = np.concatenate([np.zeros((2, 3)), np.asarray(data.target_quat_source)[:, 0]], axis=1)
    np.testing.assert_allclose(_poses.to_matrix(quat)[:, :3, :3], relative[:, :3, :3], atol=1e-5)
    # Orbit's normals have four numbers.
    assert np.asarray(scene["cam"].data.output["normals"]).shape == (2, 6, 8, 4)
    # A push for one step: dv = F dt / m.
    before = body.native.velocity.copy()
    body.write_root_pose_to_sim(start[:, :7] + np.concatenate([origins, np.zeros((2, 4))], axis=1))
    body.write_root_velocity_to_sim(np.zeros((2, 6)))
    body.set_external_force_and_torque(np.full((1, 1, 3), [3.0, 0, 0]), np.zeros((1, 1, 3)), env_ids=[1])
    scene.native.update(1)
    np.testing.assert_allclose(body.native.velocity[:, 0], [0, 3 * 0.005 / 0.5], atol=1e-6)
    body.reset()
    scene.native.update(1)
    np.testing.assert_allclose(body.native.velocity[:, 0], [0, 3 * 0.005 / 0.5], atol=1e-6)
    assert (before != body.native.velocity).any()
    for fields, name in (
        ({"rigid_props": sim_utils.RigidBodyPropertiesCfg(disable_gravity=True)}, "disable_gravity"),
        ({"collision_props": sim_utils.CollisionPropertiesCfg(rest_offset=0.1)}, "rest_offset"),
        ({"physics_material": sim_utils.RigidBodyMaterialCfg(static_friction=0.9)}, "static_friction"),
    ):
        with pytest.raises(NotImplementedError, match=name):
            isaac_scene(ball=ball(**fields))
    with pytest.raises(ks.ConfigError, match="rigid_props"):
        isaac_scene(ball=ball(rigid_props=None))


def test_settings_of_embodichain_without_a_meaning_are_refused():
    from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
    from kinetoscope.compat.embodichain.lab.sim.cfg import (
        JointDrivePropertiesCfg,
        LightCfg,
        PhysicsCfg,
        RenderCfg,
        RigidBodyAttributesCfg,
        RigidObjectCfg,
        RobotCfg,
        URDFCfg,
    )
    from kinetoscope.compat.embodichain.lab.sim.shapes import CubeCfg

    for cfg, name in (
        ({"physics_config": PhysicsCfg(enable_ccd=True)}, "enable_ccd"),
        ({"render_cfg": RenderCfg(spp=4)}, "spp"),
        ({"render_cfg": RenderCfg(tone_mapping_enabled=True)}, "tone_mapping_enabled"),
    ):
        with pytest.raises(NotImplementedError, match=name):
            SimulationManager(SimulationManagerCfg(**cfg))
    with pytest.raises(NotImplementedError, match="fname"):
        URDFCfg(fname="robot")
    sim = SimulationManager(SimulationManagerCfg(num_envs=4, arena_space=3.0))
    np.testing.assert_array_equal(np.asarray(sim.arena_offsets), [[0, 0, 0], [3, 0, 0], [0, 3, 0], [3, 3, 0]])
    with pytest.raises(NotImplementedError, match="intensity"):
        sim.add_light(LightCfg(uid="l", intensity=3.0))
    for attrs, name in (
        ({"enable_collision": False}, "enable_collision"),
        ({"static_friction": 0.9}, "static_friction"),
        ({"max_linear_velocity": 1.0}, "max_linear_velocity"),
    ):
        with pytest.raises(NotImplementedError, match=name):
            sim.add_rigid_object(RigidObjectCfg(uid="c", shape=CubeCfg(), attrs=RigidBodyAttributesCfg(**attrs)))
    # A dict of limits: all other joints have the limits of the class, not those of the file.
    drive = JointDrivePropertiesCfg(max_effort={"JOINT1": 50.0}, max_velocity={"arm": 2.0})
    robot = sim.add_robot(
        RobotCfg(uid="r", fpath=ks.asset("sr5/SR5.urdf"), control_parts={"arm": ["JOINT[12]"]}, drive_pros=drive)
    )
    np.testing.assert_array_equal(robot.native.qf_limits, [[50.0] + [1e10] * 5] * 4)
    np.testing.assert_array_equal(robot.native.qvel_limits, [[2.0] * 2 + [1e10] * 4] * 4)
    robot.native.set_qvel_target(np.ones(6))
    robot.native.set_qf_target(np.ones(6))
    robot.reset([1])
    for target in (robot.native.qvel_target, robot.native.qf_target):
        assert target[0].any() and not target[1].any()
    sim.destroy()


def test_configclass():
    @configclass
    class Base:
        size: float = 1.0
        names = ["a"]

    @configclass
    class Cfg(Base):
        needed: int
        size = 2.0

    cfg = Cfg(needed=3)
    cfg.names.append("b")
    assert Cfg(needed=3).names == ["a"] and cfg.size == 2.0 and cfg.replace(size=5).size == 5 and cfg.size == 2.0
    assert cfg.copy() == cfg and cfg.to_dict() == {"size": 2.0, "names": ["a", "b"], "needed": 3}
    with pytest.raises(TypeError, match="needed"):
        Cfg()
    with pytest.raises(TypeError, match="sise"):
        Cfg(needed=1, sise=3)


def test_matrices_and_quaternions(rng):
    rows = rng.normal(size=(20, 7))
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    rows[:, 3:] *= np.sign(rows[:, 3:4])
    np.testing.assert_allclose(_poses.rows(_poses.to_matrix(rows)), rows, atol=1e-12)
    quarter = np.eye(4)
    quarter[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(_poses.to_row(quarter), [0, 0, 0, np.sqrt(0.5), 0, 0, np.sqrt(0.5)], atol=1e-12)


def test_tensors_without_torch():
    one = numpy_torch.tensor([1.0, 2.0]).unsqueeze_(0).repeat(3, 1)
    assert one.shape == (3, 2) and one.dtype == np.float32 and one.device == "cpu"
    assert np.repeat(one, 2, axis=0).shape == (6, 2)
    assert one.clone() is not one and one.cpu().numpy().ptp() == 1.0
    assert numpy_torch.rand_like(one).max() < 1 and numpy_torch.max(one).item() == 2.0
    assert one.unsqueeze(0).squeeze_().shape == (3, 2)


def test_tensors_without_torch_have_the_meaning_of_torch():
    """Values computed by hand from torch's definitions: unbiased spread, values and indices, exchanged axes."""
    nt = numpy_torch
    one = nt.tensor([[1.0, 2.0], [3.0, 5.0]])
    assert one.dtype == np.float32 and nt.tensor(np.zeros(2)).dtype == np.float64 and nt.as_tensor([1.0]).dtype == np.float32
    assert one.to(nt.float64).dtype == np.float64 and one.to("cpu", dtype=nt.int32).dtype == np.int32
    assert one.to(nt.zeros(1, dtype=nt.float64)).dtype == np.float64 and one.to("cpu") is one
    for refused in (lambda: one.to("cuda"), lambda: nt.device("cuda"), lambda: nt.zeros(2, device="cuda:0"), lambda: one.repeat(2)):
        with pytest.raises(RuntimeError):
            refused()
    # Squared deviations from 2.75: 3.0625 + 0.5625 + 0.0625 + 5.0625 = 8.75, divided by 3.
    assert one.var() == pytest.approx(8.75 / 3, rel=1e-6) and np.var(one) == pytest.approx(8.75 / 4, rel=1e-6)
    assert one.std() == pytest.approx((8.75 / 3) ** 0.5, rel=1e-6)
    values, indices = one.max(1)
    assert values.tolist() == [2, 5] and indices.tolist() == [1, 1] and one.min(dim=0).values.tolist() == [1, 2]
    assert one.max() == 5 and np.max(one, axis=1).tolist() == [2, 5]
    assert one.sum(dim=0).tolist() == [4, 7] and one.mean(dim=1, keepdim=True).shape == (2, 1)
    assert one.sort(descending=True).values.tolist() == [[2, 1], [5, 3]] and np.sort(one, axis=0).tolist() == one.tolist()
    assert one.transpose(0, 1).tolist() == [[1, 3], [2, 5]] and one.view(-1).tolist() == [1, 2, 3, 5]
    assert one.size() == (2, 2) and one.size(0) == 2 and one.size == 4
    with pytest.raises(TypeError, match="nonzero"):
        one.nonzero()
    assert "Tensor" in repr(one)


if installed_torch is not None:

    def test_tensors_share_memory_with_torch():
        from kinetoscope.compat._tensors import array, tensor

        values = np.zeros((2, 3), np.float32)
        shared = tensor(values)
        values[0, 0] = 7
        assert isinstance(shared, installed_torch.Tensor) and shared[0, 0] == 7
        assert array(shared).base is not None and array(shared)[0, 0] == 7
        sim = ks.SimulationManager()
        arm = sim.add_robot(ks.bundled_robot("sr5"))
        arm.set_qpos_target(installed_torch.full((1, 6), 0.5), joint_ids=installed_torch.arange(6))
        assert (arm.qpos_target == 0.5).all()
