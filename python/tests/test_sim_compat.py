"""The tutorials of other simulators with nothing but other import lines, and the layer that they run on.

The scripts belong to their projects and are not in this one: ``KINETOSCOPE_SEEDS`` names their folder.
"""

import ast
import os
import re
import shutil
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


def run(name, tensors, flags, steps, **variables):
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    environment |= {"KINETOSCOPE_COMPAT_STEPS": str(steps), **variables}
    command = [sys.executable, Path(seeds.__file__), name, tensors, *flags]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment, check=False)


@pytest.fixture
def display():
    """A virtual display."""
    if shutil.which("Xvfb") is None:
        pytest.fail("this test needs Xvfb")
    process = subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "1280x800x24"], stdout=subprocess.PIPE, text=True)
    try:
        yield f":{process.stdout.readline().strip()}"
    finally:
        process.terminate()
        process.wait()


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
def test_under_a_display(display):
    """Windows open where there is a display and the script is not headless."""
    for name, flags in (("create_robot.py", []), ("add_sensors_on_robot.py", []), ("create_sensor.py", [])):
        result = run(name, "numpy", flags, 40, DISPLAY=display)
        assert result.returncode == 0, result.stderr
        assert "no window" not in result.stderr

    def seconds(steps, **variables):
        started = time.perf_counter()
        assert run("create_robot.py", "numpy", [] if variables else ["--headless"], steps, **variables).returncode == 0
        return time.perf_counter() - started

    # The window runs in real time: 500 more steps of 10 ms take 5 s more, apart from the start. Without a window, less.
    assert seconds(540, DISPLAY=display) - seconds(40, DISPLAY=display) > 4.5 > seconds(540) - seconds(40)
    result = run("create_robot.py", "numpy", [], 5)
    assert result.returncode == 0 and "no window" in result.stderr


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
    with pytest.raises(NotImplementedError, match="init_qpos"):
        sim.add_robot(RobotCfg(fpath=hand, init_qpos=[0.0] * 11))
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
    """As in Orbit: a joint that no actuator names, or that has no gain, was driven with the gains of this package."""
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
