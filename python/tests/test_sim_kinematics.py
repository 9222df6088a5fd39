"""Kinematics without a simulation, against closed forms, MuJoCo, and the robot of a simulation."""

import threading
import time
import xml.etree.ElementTree as ElementTree
from math import pi

import mujoco
import numpy as np
import pytest

import kinetoscope as ks

L1, L2 = 0.7, 0.4
PLANAR = f"""<robot name="planar">
  <link name="base"/><link name="upper"/><link name="lower"/><link name="tip"/><link name="branch"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="{L1} 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="{L2} 0 0"/></joint>
  <joint name="other" type="prismatic"><parent link="base"/><child link="branch"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
</robot>"""

SR5, HAND = ks.asset("sr5/SR5.urdf"), ks.asset("revo1_left/revo1_left.urdf")
QUADRUPED = ks.asset("quadruped/quadruped.xml")


@pytest.fixture
def planar(tmp_path):
    path = tmp_path / "planar.urdf"
    path.write_text(PLANAR)
    return path


@pytest.fixture
def arm():
    return ks.KinematicChain(SR5, tip="ee_link")


def matrix(row):
    """Homogeneous matrix of a pose x y z qw qx qy qz."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(row[3:], float))
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation.reshape(3, 3), row[:3]
    return out


def exported(cfg, folder):
    """MuJoCo's model of a robot: the file that a simulation exports for plain MuJoCo. The robot stands at the origin."""
    with ks.SimulationManager(num_envs=1, threads=1, ground=None) as sim:
        sim.add_robot(cfg)
        sim.dump(folder)
    return mujoco.MjModel.from_xml_path(str(folder / "robot.mjcf4.xml"))


def named(model, kind, name):
    """Index of an element by the end of its name, which may have the uid of the robot before it."""
    names = [mujoco.mj_id2name(model, kind, k) or "" for k in range(getattr(model, {1: "nbody", 3: "njnt"}[int(kind)]))]
    (found,) = (k for k, own in enumerate(names) if own.rsplit("/", 1)[-1] == name)
    return found


def placed(model, positions):
    """MuJoCo's data with joints at positions by name."""
    data = mujoco.MjData(model)
    for name, value in positions.items():
        data.qpos[model.jnt_qposadr[named(model, mujoco.mjtObj.mjOBJ_JOINT, name)]] = value
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def body_pose(model, data, name):
    body = named(model, mujoco.mjtObj.mjOBJ_BODY, name)
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return out


def body_jacobian(model, data, name, joint):
    """Column of MuJoCo's Jacobian of a body: the velocity of its origin, then its angular velocity."""
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, linear, angular, named(model, mujoco.mjtObj.mjOBJ_BODY, name))
    column = model.jnt_dofadr[named(model, mujoco.mjtObj.mjOBJ_JOINT, joint)]
    return np.concatenate([linear[:, column], angular[:, column]])


def test_a_planar_arm(planar, rng):
    chain = ks.KinematicChain(planar, "tip")
    assert (chain.base, chain.tip, chain.dof) == ("base", "tip", 2)
    assert chain.joint_names == ["shoulder", "elbow"] and chain.link_names == ["base", "upper", "lower", "tip"]
    np.testing.assert_array_equal(chain.qpos_limits, [[-3, 3], [-np.inf, np.inf]])
    assert chain.reach == pytest.approx(L1 + L2)
    assert repr(chain) == '<KinematicChain from "base" to "tip": 2 joints>'
    q = rng.uniform(-3, 3, (20, 2))
    a, b = q[:, 0], q.sum(1)
    elbow = np.stack([L1 * np.cos(a), L1 * np.sin(a), 0 * a], 1)
    tip = elbow + np.stack([L2 * np.cos(b), L2 * np.sin(b), 0 * a], 1)
    poses = chain.compute_fk(q)
    assert poses.shape == (20, 7) and poses.dtype == np.float64
    np.testing.assert_allclose(poses[:, :3], tip, atol=1e-14)
    # q and -q are the same rotation.
    turn = np.stack([np.cos(b / 2), 0 * b, 0 * b, np.sin(b / 2)], 1)
    np.testing.assert_allclose(np.abs((poses[:, 3:] * turn).sum(1)), 1, atol=1e-14)
    links = chain.compute_link_fk(q)
    assert links.shape == (20, 4, 7)
    np.testing.assert_allclose(links[:, 2, :3], elbow, atol=1e-14)
    np.testing.assert_allclose(links[:, 3], poses, atol=1e-14)
    z, zero = np.array([0, 0, 1.0]), np.zeros_like(tip)
    expected = np.stack([np.hstack([np.cross(z, arm), zero + z]) for arm in (tip, tip - elbow)], 2)
    np.testing.assert_allclose(chain.jacobian(q), expected, atol=1e-14)

    # The law of cosines: an arm that reaches the point (0.6, 0.5), with the elbow to either side.
    target = np.array([0.6, 0.5, 0, 1, 0, 0, 0])
    bend = np.arccos((target[:2] @ target[:2] - L1**2 - L2**2) / (2 * L1 * L2))
    for side in (1, -1):
        found = chain.compute_ik(target, ks.IkCfg(task="position", num_seeds=1), initial=[0.7, side])
        assert found.success.tolist() == [True]
        np.testing.assert_allclose(found.qpos[0, 1], side * bend, atol=1e-3)
    # Beyond the reach: the stretched arm is nearest, and the error is the rest of the distance.
    far = chain.compute_ik([2, 0, 0, 1, 0, 0, 0], {"task": "position"})
    assert not far.success[0]
    np.testing.assert_allclose(far.position_error[0], 2 - L1 - L2, atol=1e-6)


def test_poses_and_jacobians_are_those_of_mujoco(tmp_path, rng):
    chain = ks.KinematicChain(SR5, "link6")
    model = exported(ks.RobotCfg(urdf=SR5), tmp_path)
    low, high = chain.qpos_limits.T
    q = rng.uniform(low, high, (8, 6))
    poses, links, jacobians = chain.compute_fk(q), chain.compute_link_fk(q), chain.jacobian(q)
    for k, row in enumerate(q):
        data = placed(model, dict(zip(chain.joint_names, row, strict=True)))
        np.testing.assert_allclose(matrix(poses[k]), body_pose(model, data, "link6"), atol=1e-9)
        for link, pose in zip(chain.link_names[1:], links[k, 1:], strict=True):
            np.testing.assert_allclose(matrix(pose), body_pose(model, data, link), atol=1e-9)
        expected = np.stack([body_jacobian(model, data, "link6", joint) for joint in chain.joint_names], 1)
        np.testing.assert_allclose(jacobians[k], expected, atol=1e-9)


def test_a_chain_from_another_base(tmp_path, rng):
    """Poses and Jacobians in the frame of ``link2``: those of MuJoCo, divided by the pose of that link."""
    chain = ks.KinematicChain(SR5, "link5", base="link2", tcp=[0.1, 0.2, 0.3, 1, 0, 0, 0])
    assert chain.joint_names == ["JOINT3", "JOINT4", "JOINT5"] and chain.link_names == ["link2", "link3", "link4", "link5"]
    model = exported(ks.RobotCfg(urdf=SR5), tmp_path)
    q = rng.uniform(-1, 1, (4, 6))
    poses, links = chain.compute_fk(q[:, 2:5]), chain.compute_link_fk(q[:, 2:5])
    for k, row in enumerate(q):
        data = placed(model, {f"JOINT{n + 1}": value for n, value in enumerate(row)})
        base = np.linalg.inv(body_pose(model, data, "link2"))
        tool = np.eye(4)
        tool[:3, 3] = [0.1, 0.2, 0.3]
        np.testing.assert_allclose(matrix(poses[k]), base @ body_pose(model, data, "link5") @ tool, atol=1e-9)
        for link, pose in zip(chain.link_names, links[k], strict=True):
            np.testing.assert_allclose(matrix(pose), base @ body_pose(model, data, link), atol=1e-9)
    # The Jacobian, against differences of poses.
    at, step = q[0, 2:5], 1e-6
    for joint in range(3):
        shift = np.eye(3)[joint] * step
        ahead, behind = (matrix(row) for row in chain.compute_fk([at + shift, at - shift]))
        turned = (ahead[:3, :3] @ behind[:3, :3].T - behind[:3, :3] @ ahead[:3, :3].T) / 2
        rates = np.array([*(ahead - behind)[:3, 3], turned[2, 1], turned[0, 2], turned[1, 0]]) / (2 * step)
        np.testing.assert_allclose(chain.jacobian(at)[0, :, joint], rates, atol=1e-8)
    found = chain.compute_ik(poses)
    assert found.success.all()
    for pose, row in zip(poses, chain.compute_fk(found.qpos), strict=True):
        np.testing.assert_allclose(matrix(row), matrix(pose), atol=2e-3)


def test_mimic_joints_move_with_their_drivers(tmp_path):
    """MuJoCo's columns of a driver and its follower, added with the multiplier of the file."""
    chain = ks.KinematicChain(HAND, "left_index_dist")
    (follower,) = (joint for joint in ElementTree.parse(HAND).iter("joint") if joint.get("name") == "LEFT_INDEX_PIP")
    driver, factor = follower.find("mimic").get("joint"), float(follower.find("mimic").get("multiplier"))
    assert chain.joint_names == [driver]
    model = exported(ks.RobotCfg(urdf=HAND), tmp_path)
    for q in (0.2, 0.9):
        data = placed(model, {driver: q, "LEFT_INDEX_PIP": factor * q})
        np.testing.assert_allclose(matrix(chain.compute_fk([q])[0]), body_pose(model, data, "left_index_dist"), atol=1e-9)
        columns = [body_jacobian(model, data, "left_index_dist", joint) for joint in (driver, "LEFT_INDEX_PIP")]
        np.testing.assert_allclose(chain.jacobian([q])[0, :, 0], columns[0] + factor * columns[1], atol=1e-9)
    # The range of the driver is that of the robot in a simulation.
    with ks.SimulationManager(num_envs=1, threads=1) as sim:
        robot = sim.add_robot(ks.RobotCfg(urdf=HAND))
        np.testing.assert_array_equal(chain.qpos_limits[0], robot.qpos_limits[0, robot.find_joints(driver)[0]])


def test_a_robot_of_an_mjcf_file():
    """Against MuJoCo, which reads the same file. Its joints have limits, the base floats."""
    chain = ks.KinematicChain(ks.MjcfFile(path=QUADRUPED), "LF_FOOT")
    same = ks.KinematicChain(ks.RobotCfg(mjcf=ks.MjcfFile(path=QUADRUPED), fix_base=False), "LF_FOOT")
    assert chain.joint_names == same.joint_names == ["LF_HAA", "LF_HFE", "LF_KFE"] and chain.base == same.base == "base"
    q = [0.3, -0.5, 0.9]
    np.testing.assert_array_equal(chain.compute_fk(q), same.compute_fk(q))
    model = mujoco.MjModel.from_xml_path(QUADRUPED)
    data = placed(model, dict(zip(chain.joint_names, q, strict=True)))
    expected = np.linalg.inv(body_pose(model, data, "base")) @ body_pose(model, data, "LF_FOOT")
    np.testing.assert_allclose(matrix(chain.compute_fk(q)[0]), expected, atol=1e-12)
    np.testing.assert_allclose(chain.qpos_limits[0], np.radians([-41.253, 28.0749]), atol=1e-12)


def test_values_are_those_of_a_robot(rng):
    """``Robot`` has the same methods: its root is at the origin, so equal targets and starts give equal bits."""
    chain = ks.KinematicChain(ks.bundled_robot("sr5"), "ee_link", tcp=[0, 0, 0.1, 1, 0, 0, 0])
    with ks.SimulationManager(num_envs=4, threads=1) as sim:
        robot = sim.add_robot(ks.bundled_robot("sr5"))
        assert robot.joint_names == chain.joint_names
        np.testing.assert_array_equal(robot.qpos_limits[0], chain.qpos_limits)
        tcp = [0, 0, 0.1, 1, 0, 0, 0]
        q, start = rng.uniform(-1, 1, (2, 4, 6))
        poses = chain.compute_fk(q)
        np.testing.assert_allclose(robot.compute_fk(q, "ee_link", tcp=tcp), poses, atol=1e-14)
        np.testing.assert_allclose(robot.jacobian("ee_link", q, tcp=tcp), chain.jacobian(q), atol=1e-14)
        index = [robot.link_names.index(link) for link in chain.link_names]
        np.testing.assert_allclose(robot.compute_link_fk(q)[:, index], chain.compute_link_fk(q), atol=1e-14)
        cfg = ks.IkCfg(num_seeds=8, posture=ks.NullSpacePosture(rest=[0.1] * 6))
        ours, theirs = chain.compute_ik(poses, cfg, start), robot.compute_ik(poses, "ee_link", cfg, start, tcp=tcp)
        for name in ("qpos", "success", "position_error", "rotation_error", "iterations", "seed"):
            own, other = getattr(ours, name), getattr(theirs, name)
            assert own.dtype == other.dtype and own.tobytes() == other.tobytes(), name
        assert ours.success.all()


def test_inverse_kinematics_reach_their_targets(arm, rng):
    low, high = arm.qpos_limits.T
    poses = arm.compute_fk(rng.uniform(low, high, (30, 6)))
    found = arm.compute_ik(poses)
    assert found.success.all() and ((found.qpos >= low) & (found.qpos <= high)).all()
    for pose, row, error in zip(poses, arm.compute_fk(found.qpos), found.position_error, strict=True):
        away = np.linalg.inv(matrix(pose)) @ matrix(row)
        np.testing.assert_allclose(np.linalg.norm(away[:3, 3]), error, atol=1e-12)
        assert error <= 1e-4 and np.arccos(np.clip((np.trace(away[:3, :3]) - 1) / 2, -1, 1)) <= 1e-3
    # A quaternion of another length is the same rotation.
    scaled = poses * [1, 1, 1, 3, 3, 3, 3]
    np.testing.assert_allclose(arm.compute_ik(scaled).qpos, found.qpos, atol=1e-6)


def test_a_batch_is_its_single_rows(arm, rng):
    """Bit for bit, for any layout of memory."""
    q, start = rng.uniform(-2, 2, (2, 40, 6))
    poses = arm.compute_fk(q)
    for method in (arm.compute_fk, arm.compute_link_fk, arm.jacobian):
        whole = method(q)
        assert whole.tobytes() == np.concatenate([method(row) for row in q]).tobytes()
        assert whole.tobytes() == method(np.asfortranarray(q)).tobytes()
    # More rows than those up to which the call runs on its own thread, and one target that is too far.
    poses[7, :3] *= 10
    whole = arm.compute_ik(poses, {"num_seeds": 4}, start)
    assert not whole.success[7] and whole.success.sum() > 30
    single = [arm.compute_ik(pose, {"num_seeds": 4}, row) for pose, row in zip(poses, start, strict=True)]
    for name in ("qpos", "success", "position_error", "rotation_error", "iterations", "seed"):
        assert getattr(whole, name).tobytes() == np.concatenate([getattr(one, name) for one in single]).tobytes(), name
    # One target for all starts, and one start for all targets.
    many = arm.compute_ik(poses[0], {"num_seeds": 4}, start)
    assert many.qpos.tobytes() == np.concatenate([arm.compute_ik(poses[0], {"num_seeds": 4}, row).qpos for row in start]).tobytes()
    zero = arm.compute_ik(poses, {"num_seeds": 4})
    assert zero.qpos.tobytes() == arm.compute_ik(poses, {"num_seeds": 4}, np.zeros(6)).qpos.tobytes()
    assert arm.compute_ik(np.zeros((0, 7))).qpos.shape == (0, 6) and arm.compute_fk(np.zeros((0, 6))).shape == (0, 7)


@pytest.mark.parametrize("method", ["compute_fk", "compute_link_fk", "jacobian", "compute_ik"])
def test_other_threads_run_during_a_call(arm, method):
    """The interpreter is released: this thread counts while another one computes for a while."""
    rows = np.tile([3.0, 0, 0, 1, 0, 0, 0], (40, 1)) if method == "compute_ik" else np.zeros((400_000, 6))
    tries = []

    def compute(began, spent):
        began.set()
        start = time.perf_counter()
        getattr(arm, method)(rows)
        spent.append(time.perf_counter() - start)

    # A machine with other load may stop this thread for as long as the call takes, but not each time.
    for _ in range(5):
        began, spent = threading.Event(), []
        thread = threading.Thread(target=compute, args=(began, spent))
        counted, longest, last = 0, 0.0, time.perf_counter()
        thread.start()
        began.wait()
        while thread.is_alive():
            time.sleep(0.001)
            now = time.perf_counter()
            counted, longest, last = counted + 1, max(longest, now - last), now
        thread.join()
        if counted > 3 and longest < 0.7 * spent[0]:
            return
        tries.append((counted, longest, spent[0]))
    pytest.fail(f"the interpreter was held: {tries}")


FAR = [0.0, 0, 0, 0, 0, 0, 0]
# Call, exception, and a part of the message.
REFUSED = {
    "tip": (lambda path: ks.KinematicChain(path, "tipp"), ks.UnknownNameError, 'unknown link "tipp"; known names: "tip"'),
    "base": (lambda path: ks.KinematicChain(path, "tip", base="bas"), ks.UnknownNameError, 'unknown link "bas"; known names: "base"'),
    "branch": (
        lambda path: ks.KinematicChain(path, "tip", base="branch"),
        ks.ArgumentError,
        'link "branch" is no base of a chain to link "tip"; links above it: "lower", "upper", "base"',
    ),
    "below": (lambda path: ks.KinematicChain(path, "base", base="tip"), ks.ArgumentError, "no other link is above it"),
    "file": (lambda path: ks.KinematicChain(path.with_name("none.urdf"), "tip"), ks.ModelError, "none.urdf"),
    "number": (lambda path: ks.KinematicChain(3, "tip"), ks.ConfigError, "expected a configuration or a dict of its fields, not int"),
    "class": (lambda path: ks.KinematicChain(ks.TerrainCfg(), "tip"), ks.ConfigError, "a TerrainCfg is not a RobotCfg"),
    "field": (lambda path: ks.KinematicChain({"component": []}, "tip"), ks.ConfigError, "unknown field `component`, expected one of `components`"),
    "empty": (lambda path: ks.KinematicChain(ks.RobotCfg(), "tip"), ks.ModelError, "component"),
    "tcp": (lambda path: ks.KinematicChain(path, "tip", tcp=FAR), ks.ArgumentError, "tcp: .* is not a pose x y z qw qx qy qz"),
    "columns": (lambda path: ks.KinematicChain(path, "tip").compute_fk([1, 2, 3]), ks.ArgumentError, r'compute_fk, qpos: the shape is \[1, 3\]; expected \(N, 2\): .*"shoulder", "elbow"'),
    "axes": (lambda path: ks.KinematicChain(path, "tip").jacobian(np.zeros((1, 1, 2))), ks.ArgumentError, r"jacobian, qpos: the shape \[1, 1, 2\] has too many axes"),
    "nan": (lambda path: ks.KinematicChain(path, "tip").jacobian([[0, 0], [0, np.nan]]), ks.ArgumentError, r'jacobian, qpos\[1, 1\] \(joint "elbow"\) is NaN'),
    "links": (lambda path: ks.KinematicChain(path, "tip").compute_link_fk([[0]]), ks.ArgumentError, "compute_link_fk, qpos: the shape"),
    "targets": (lambda path: ks.KinematicChain(path, "tip").compute_ik([[0, 0, 0]]), ks.ArgumentError, r"compute_ik, targets: the shape is \(1, 3\); expected \(N, 7\)"),
    "quaternion": (lambda path: ks.KinematicChain(path, "tip").compute_ik([[0, 0, 0, 1, 0, 0, 0], FAR]), ks.ArgumentError, "compute_ik, targets: row 1, .* is not a pose"),
    "rows": (lambda path: ks.KinematicChain(path, "tip").compute_ik(np.tile([1, 0, 0, 1, 0, 0, 0], (3, 1)), initial=np.zeros((2, 2))), ks.ArgumentError, "compute_ik, initial: there are 2 rows; expected one, or one for each of 3 targets"),
    "cfg": (lambda path: ks.KinematicChain(path, "tip").compute_ik([1, 0, 0, 1, 0, 0, 0], {"seeds": 3}), ks.ConfigError, "unknown field `seeds`"),
    "damping": (lambda path: ks.KinematicChain(path, "tip").compute_ik([1, 0, 0, 1, 0, 0, 0], {"damping": 0.0}), ks.ArgumentError, "damping is 0.0; it must be finite and above 0"),
    "posture": (lambda path: ks.KinematicChain(path, "tip").compute_ik([1, 0, 0, 1, 0, 0, 0], {"posture": {"rest": [0.0]}}), ks.ArgumentError, "posture.rest: expected 2 numbers"),
    "fixed": (lambda path: ks.KinematicChain(path, "tip", base="lower").compute_ik([1, 0, 0, 1, 0, 0, 0]), ks.ArgumentError, 'no joint of the chain from link "lower" moves link "tip"'),
    "mjcf": (lambda path: ks.assemble_urdf({"mjcf": {"path": QUADRUPED}}), ks.ConfigError, "assemble_urdf merges URDF files, and this robot has an MJCF file"),
    "parent": (lambda path: ks.assemble_urdf({"components": [{"name": "arm", "urdf": path}, {"name": "tool", "urdf": path, "parent": "amr"}]}), ks.ModelError, '"amr".*"arm"'),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused_arguments(name, planar):
    call, error, message = REFUSED[name]
    with pytest.raises(error, match=message):
        call(planar)


def test_joints_that_follow_a_curve():
    """Forward kinematics move them freely, and inverse kinematics refuse them, as ``Robot.compute_ik`` does."""
    text = (
        '<mujoco><worldbody><body name="base"><geom size=".1"/><body name="a" pos="0 0 .2"><joint name="lead" axis="0 1 0"/><geom size=".1"/>'
        '<body name="b" pos="0 0 .3"><joint name="curve" axis="0 1 0"/><geom size=".1"/></body></body></body></worldbody>'
        '<equality><joint joint1="curve" joint2="lead" polycoef="0 0 1 0 0"/></equality></mujoco>'
    )
    chain = ks.KinematicChain(ks.MjcfFile(text=text), "b", tcp=[0, 0, 0.5, 1, 0, 0, 0])
    assert chain.joint_names == ["lead", "curve"]
    at = chain.compute_fk([pi / 2, -pi / 2])[0, :3]
    np.testing.assert_allclose(at, [0.3, 0, 0.7], atol=1e-12)
    with pytest.raises(ks.ArgumentError, match='joint "curve", which moves link "b", follows another joint'):
        chain.compute_ik([0.3, 0, 0.7, 1, 0, 0, 0])


def test_warnings_about_files(tmp_path):
    """Those about limits of mimic joints belong to the limits of the chain."""
    text = PLANAR.replace('<axis xyz="1 0 0"/>\n', '<axis xyz="1 0 0"/><mimic joint="shoulder" multiplier="2"/>\n')
    (tmp_path / "robot.urdf").write_text(text)
    chain = ks.KinematicChain(tmp_path / "robot.urdf", "tip")
    np.testing.assert_array_equal(chain.qpos_limits[0], [0, 0.5])
    (clipped,) = (diagnostic for diagnostic in chain.diagnostics if diagnostic.kind == "mimic-range-clipped")
    assert clipped.file == tmp_path / "robot.urdf" and '"other" mimics "shoulder"' in clipped.message


def test_assembled_urdf(tmp_path, rng):
    """An arm with a hand as one file: MuJoCo reads it, and places the links where the chain of both files does."""
    cfg = ks.bundled_robot("sr5_with_hand")
    text = ks.assemble_urdf(cfg)
    path = tmp_path / "merged.urdf"
    path.write_text(text)
    assert ks.assemble_urdf(cfg.urdf) == text
    root = ElementTree.fromstring(text)
    with ks.SimulationManager(num_envs=1, threads=1) as sim:
        robot = sim.add_robot(cfg)
        assert [link.get("name") for link in root.iter("link")] == robot.link_names
        moving = [joint.get("name") for joint in root.iter("joint") if joint.get("type") in ("revolute", "continuous", "prismatic")]
        assert moving == robot.joint_names
    # One joint more than the files have: it attaches the hand, 0.02 m above the flange.
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    sources = [joint.get("name") for file in (SR5, HAND) for joint in ElementTree.parse(file).getroot().findall("joint")]
    (connector,) = set(joints) - set(sources)
    assert len(joints) == len(sources) + 1
    assert joints[connector].find("parent").get("link") == "ee_link" and joints[connector].find("child").get("link") == "left_hand_base"
    np.testing.assert_allclose([float(x) for x in joints[connector].find("origin").get("xyz").split()], [0, 0, 0.02], atol=1e-12)

    model = mujoco.MjModel.from_xml_path(str(path))
    chain, of_file = ks.KinematicChain(cfg, "left_index_prox"), ks.KinematicChain(path, "left_index_prox")
    q = rng.uniform(-0.5, 0.5, chain.dof)
    assert chain.joint_names == of_file.joint_names == [f"JOINT{n}" for n in range(1, 7)] + ["LEFT_HAND_INDEX"]
    data = placed(model, dict(zip(chain.joint_names, q, strict=True)))
    np.testing.assert_allclose(matrix(of_file.compute_fk(q)[0]), body_pose(model, data, "left_index_prox"), atol=1e-9)
    np.testing.assert_allclose(chain.compute_fk(q), of_file.compute_fk(q), atol=1e-12)


def test_meshes_of_an_assembled_urdf_have_absolute_paths(tmp_path, monkeypatch):
    faces = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {' '.join(map(str, corner))}\n" for corner in corners) + "endloop\nendfacet\n"
        for corners in (((0, 0, 0), (0, 1, 0), (1, 0, 0)), ((0, 0, 0), (1, 0, 0), (0, 0, 1)), ((0, 0, 0), (0, 0, 1), (0, 1, 0)), ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    )
    (tmp_path / "part.stl").write_text(f"solid part\n{faces}endsolid part\n")
    shape = '<geometry><mesh filename="part.stl" scale="0.1 0.1 0.1"/></geometry>'
    (tmp_path / "robot.urdf").write_text(f'<robot name="r"><link name="a"><visual>{shape}</visual><collision>{shape}</collision></link></robot>')
    monkeypatch.chdir(tmp_path)
    root = ElementTree.fromstring(ks.assemble_urdf("robot.urdf"))
    meshes = [(mesh.get("filename"), mesh.get("scale")) for mesh in root.iter("mesh")]
    assert meshes == [(str(tmp_path / "part.stl"), "0.1 0.1 0.1")] * 2
