"""Simulations, arrays and errors of the package kinetoscope."""

import copy
import gc
import os
import pickle
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import kinetoscope as ks

START = [0.0, 0.5, -1.5, 0.3, -0.5, 0.0]


def test_the_example_of_the_readme():
    sim = ks.SimulationManager(num_envs=64)
    arm = sim.add_robot(
        ks.RobotCfg(
            urdf=ks.asset("sr5/SR5.urdf"),
            control_parts={"arm": ["JOINT[1-6]"]},
            drive=ks.DriveCfg(stiffness=1e4, damping=1e3),
        )
    )
    arm.set_qpos_target(START, joint_ids=arm.joint_ids("arm"))
    look = ks.Placement.look_at(eye=[2, 0, 1], target=[0, 0, 0.3])
    cfg = ks.CameraCfg(width=32, height=24, channels=["rgb", "depth"], extrinsics=ks.Extrinsics(placement=look))
    cam = sim.add_sensor("camera", cfg)
    sim.update(500)
    assert arm.qpos.shape == (64, 6) and arm.qpos.dtype == np.float64
    # The drive sags by the torque of gravity over its stiffness, at most 113 N m / 1e4 N m/rad.
    assert np.abs(arm.qpos - START).max() < 0.0113
    assert cam["rgb"].shape == (64, 24, 32, 4) and cam["rgb"].dtype == np.uint8
    assert cam["depth"].shape == (64, 24, 32) and cam["depth"].dtype == np.float32
    # All environments are alike.
    assert (cam["depth"] == cam["depth"][:1]).all()
    np.testing.assert_array_equal(sim.time, np.full(64, sim.time[0]))
    assert sim.time[0] == pytest.approx(5.0, abs=1e-9)


def test_update_of_n_steps_equals_n_updates(arm_sim):
    sim, arm = arm_sim
    arm.set_qpos_target(START)
    start = sim.snapshot()
    sim.update(120)
    at_once = arm.qpos
    sim.restore(start)
    for _ in range(120):
        sim.update()
    np.testing.assert_array_equal(arm.qpos, at_once)
    assert (arm.qvel != 0).any()


def test_arrays_never_change_under_the_reader(arm_sim):
    sim, arm = arm_sim
    before = arm.qpos
    kept = before.copy()
    assert before.flags.owndata or before.base is not None
    arm.set_qpos_target(START)
    sim.update(50)
    np.testing.assert_array_equal(before, kept)
    assert (arm.qpos != kept).any()
    # An array of the caller is not kept either.
    target = np.tile(START, (2, 1))
    arm.set_qpos_target(target)
    target[:] = 9
    np.testing.assert_array_equal(arm.qpos_target, np.tile(START, (2, 1)))


@pytest.mark.parametrize(
    "form",
    [
        lambda rows: rows.tolist(),
        lambda rows: tuple(map(tuple, rows.tolist())),
        lambda rows: rows.astype(np.float32).astype(np.float64),
        lambda rows: np.asfortranarray(rows),
        lambda rows: rows[:, ::-1][:, ::-1],
        lambda rows: rows[0],
        lambda rows: rows[:1],
    ],
)
def test_forms_of_arrays(arm_sim, form):
    _, arm = arm_sim
    rows = np.tile(np.float32(START).astype(float), (2, 1))
    arm.set_qpos_target(form(rows))
    np.testing.assert_array_equal(arm.qpos_target, rows)


def test_forms_of_indices(arm_sim):
    _, arm = arm_sim
    for joints in ([1, 2], (1, 2), np.array([1, 2]), np.array([1, 2], dtype=np.uint8), range(1, 3), ["JOINT[23]"], ("JOINT2", "JOINT3")):
        arm.set_qpos_target(np.zeros(6))
        arm.set_qpos_target([0.25, -0.5], joint_ids=joints)
        np.testing.assert_array_equal(arm.qpos_target, np.tile([0, 0.25, -0.5, 0, 0, 0], (2, 1)))
    mask = np.array([False, True])
    for envs in (1, [1], np.array([1]), mask, [False, True]):
        arm.set_qpos_target(np.zeros(6))
        arm.set_qpos_target([0.1] * 6, env_ids=envs)
        np.testing.assert_array_equal(arm.qpos_target, [[0] * 6, [0.1] * 6])
    arm.set_qpos_target([0.2] * 6, joint_ids="arm")
    np.testing.assert_array_equal(arm.qpos_target, np.full((2, 6), 0.2))


def test_forms_of_patterns(arm_sim):
    _, arm = arm_sim
    for patterns in ("JOINT[23]", ["JOINT[23]"], ("JOINT2", "JOINT3"), ["JOINT2", "JOINT3"]):
        assert arm.find_joints(patterns) == [1, 2]
    assert arm.find_links("link1") == [arm.link_names.index("link1")]


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda s, a: a.set_qpos_target([1, 2]), ks.ArgumentError, "shape"),
        (lambda s, a: a.set_qpos_target(np.zeros((1, 1, 6))), ks.ArgumentError, "too many axes"),
        (lambda s, a: a.set_qpos_target(np.full((2, 6), np.nan)), ks.ArgumentError, 'joint "JOINT1"'),
        (lambda s, a: a.set_qpos_target(["a"] * 6), ks.ArgumentError, "set_qpos_target"),
        (lambda s, a: a.set_qpos_target(START, env_ids=[2]), ks.OutOfRangeError, "there are 2"),
        (lambda s, a: a.set_qpos_target(START, env_ids=[-1]), ks.OutOfRangeError, "indices start at 0"),
        (lambda s, a: a.set_qpos_target([0], joint_ids=[6]), ks.OutOfRangeError, "joint 6"),
        (lambda s, a: a.set_qpos_target([0], joint_ids=[0.5]), ks.ArgumentError, "indices"),
        (lambda s, a: a.set_qpos_target([0], joint_ids=["JOINT9"]), ks.UnknownNameError, "JOINT1"),
        (lambda s, a: a.set_qpos_target([0, 0], joint_ids=["JOINT1", 2]), ks.ArgumentError, "joint_ids: 2 is not a text"),
        (lambda s, a: a.find_joints(3), ks.ArgumentError, "patterns"),
        (lambda s, a: a.find_links(["link1", None]), ks.ArgumentError, "patterns: None"),
        (lambda s, a: a.joint_ids("amr"), ks.UnknownNameError, "arm"),
        (lambda s, a: a.link_pose("nothing"), ks.UnknownNameError, "nothing"),
        (lambda s, a: s.add_robot(ks.bundled_robot("sr5", uid="arm")), ks.ConfigError, "taken"),
        (lambda s, a: s.add_robot(urdf="missing.urdf"), ks.KinetoscopeError, "missing.urdf"),
        (lambda s, a: s.add_robot(urdf=ks.asset("sr5/SR5.urdf"), drvie={}), ks.ConfigError, "drvie"),
        (lambda s, a: s.add_robot(urdf=ks.asset("sr5/SR5.urdf"), drive={"stiffnes": 1}), ks.ConfigError, "stiffness"),
        (lambda s, a: s.add_sensor("imu", ks.ImuCfg(body="nowhere")), ks.KinetoscopeError, "nowhere"),
        (lambda s, a: s.add_sensor("x", {"type": "camra"}), ks.ConfigError, "camera"),
        (lambda s, a: s.add_sensor("x", {}), ks.ConfigError, "type"),
        (lambda s, a: s["leg"], ks.UnknownNameError, '"arm"'),
        (lambda s, a: s.update(-1), OverflowError, ""),
        (lambda s, a: ks.SimulationManager(num_envs=0), ks.ConfigError, "num_envs is 0"),
        (lambda s, a: ks.SimulationManager(num_evs=1), ks.ConfigError, "num_envs"),
        (lambda s, a: ks.SimulationManager(7), ks.ConfigError, "int"),
        (lambda s, a: ks.asset("no/such.urdf"), ks.FileError, "KINETOSCOPE_ASSETS"),
        (lambda s, a: s.property("mss", "arm/LINK1"), ks.UnknownNameError, "mass"),
    ],
)
def test_errors(arm_sim, call, error, text):
    sim, arm = arm_sim
    with pytest.raises(error) as caught:
        call(sim, arm)
    assert text in str(caught.value), str(caught.value)
    # The simulation is usable after an error.
    sim.update()


def test_errors_are_also_pythons_own():
    pairs = [
        (ks.ConfigError, ValueError),
        (ks.UnknownNameError, LookupError),
        (ks.OutOfRangeError, IndexError),
        (ks.FileError, OSError),
        (ks.DestroyedError, RuntimeError),
        (ks.ForkError, RuntimeError),
    ]
    for own, builtin in pairs:
        assert issubclass(own, builtin) and issubclass(own, ks.KinetoscopeError)
        assert str(own("text")) == "text"


def test_destroyed_simulations(arm_sim):
    sim, arm = arm_sim
    cam = sim.add_sensor("camera", ks.CameraCfg(width=8, height=8))
    sim.destroy()
    sim.destroy()
    for use in (sim.update, lambda: arm.qpos, lambda: cam["color"], lambda: arm.set_qpos_target(START)):
        with pytest.raises(ks.DestroyedError):
            use()
    # Debuggers and notebooks show values at any time.
    for value, name in ((sim, "SimulationManager"), (arm, "Robot"), (cam, "Sensor")):
        assert repr(value) == f"<{name} of a simulation that is destroyed>"
    with ks.SimulationManager() as other:
        other.update()
    with pytest.raises(ks.DestroyedError):
        other.update()


@pytest.mark.parametrize(
    "cfg",
    [
        ks.SimulationManagerCfg(),
        ks.SimulationManagerCfg.legged(num_envs=3, ground=None, threads=2, lights=[]),
        ks.SimulationManagerCfg(
            ground=ks.GroundCfg(checker=False, surface=ks.SurfaceCfg(roughness=0.25)), shard=ks.Shard(rank=1, world=3), seed=9,
            lights=[ks.LightCfg(kind=ks.LightKindCfg.dome(intensity=2.0)), ks.LightCfg(color=(1.0, 0.5, 0.25))],
        ),
    ],
    ids=["default", "legged", "parts"],
)  # fmt: skip
def test_the_configuration_of_a_simulation(cfg):
    """What the program gave, with all its values and classes; a copy that makes an equal simulation."""
    sim = ks.SimulationManager(cfg)
    assert sim.cfg == cfg and repr(sim.cfg) == repr(cfg)
    sim.cfg.num_envs = 100
    assert sim.cfg == cfg and ks.SimulationManager(sim.cfg).cfg == cfg
    # Every field has its own value: a control that none of them is the default by chance.
    changed = ks.SimulationManager(cfg, physics_dt=0.004, friction=[0.5, 0.0, 0.0], solver_iterations=7).cfg
    assert (changed.physics_dt, changed.friction, changed.solver_iterations) == (0.004, (0.5, 0.0, 0.0), 7)


def test_steps_in_seconds(arm_sim):
    sim, _ = arm_sim
    sim.update_for(0.0)
    sim.update_for(0.3)
    np.testing.assert_array_equal(sim.time, np.full(2, sum([0.01] * 30)))


def test_engine_states_have_the_names_of_rollouts(arm_sim):
    sim, arm = arm_sim
    arm.write_qpos([START, [0.1] * 6])
    qpos, qvel = sim.engine_states
    assert [name.split()[0] for name in sim.state_names] == ["qpos"] * qpos.shape[1] + ["qvel"] * qvel.shape[1]
    np.testing.assert_array_equal(qpos, arm.qpos)
    np.testing.assert_array_equal(qvel, arm.qvel)
    np.testing.assert_array_equal(np.concatenate([qpos, qvel], axis=1).shape, (2, len(sim.state_names)))


def test_handles_belong_to_their_simulation(arm_sim):
    sim, arm = arm_sim
    other = ks.SimulationManager(num_envs=2)
    twin = other.add_robot(ks.bundled_robot("sr5", uid="arm"))
    assert arm == sim["arm"] and arm != twin and hash(arm) == hash(sim["arm"])
    twin.set_qpos_target(START)
    np.testing.assert_array_equal(arm.qpos_target, np.zeros((2, 6)))
    assert arm in sim and twin in other and twin not in sim
    cube = sim.add_rigid_object(uid="cube")
    sim.exclude_collision(arm, cube)
    with pytest.raises(ks.ForeignHandleError, match="another simulation"):
        sim.exclude_collision(cube, twin)
    with pytest.raises(ks.ArgumentError, match="int"):
        sim.exclude_collision(cube, 3)
    # A snapshot of another scene is refused.
    with pytest.raises(ks.SnapshotError):
        sim.restore(other.snapshot())
    del other
    gc.collect()
    # A handle keeps its simulation.
    assert twin.qpos.shape == (2, 6)


def test_a_recording_is_played_in_a_window_of_its_own_simulation(arm_sim, tmp_path, display):
    sim, _ = arm_sim
    with sim.record(tmp_path / "run.npz"):
        sim.update(3)
    playback = ks.Playback(tmp_path / "run.npz")
    foreign, own = sim.open_window(display=display), playback.sim.open_window(display=display)
    with pytest.raises(ks.ForeignHandleError, match="another simulation"):
        playback.play(foreign, timeout=60)
    assert foreign.is_open
    # A control: a window of the playback's own simulation, until it is closed.
    own.close()
    playback.play(own, timeout=60)
    assert not own.is_open


def test_names_and_collections(arm_sim):
    sim, arm = arm_sim
    assert sim.keys() == ["arm"] == list(sim) and len(sim) == 1 and "arm" in sim and "leg" not in sim
    assert arm.uid == "arm" and arm.kind == "robot" and arm.dof == 6 == len(arm.joint_names)
    assert arm.joint_ids("arm") == [0, 1, 2, 3, 4, 5] == arm.joint_ids()
    assert "arm" in repr(sim) and "6 joints" in repr(arm)
    table = sim._repr_html_()
    assert table.count("<tr>") == len(sim) and "&lt;Robot" in table and "<Robot" not in table
    html = arm._repr_html_()
    assert html.count("<tr>") == 7 and "JOINT6" in html
    # The links are a tree: each is one level below its parent, with the joint between them.
    tree = html[html.index("<pre>") + 5 : html.index("</pre>")].splitlines()
    names = [line.strip().split(" (")[0] for line in tree]
    assert sorted(names) == sorted(arm.link_names)
    depths = [len(line) - len(line.lstrip()) for line in tree]
    assert depths[0] == 0 and "(" not in tree[0] and all(after <= before + 2 for before, after in zip(depths, depths[1:], strict=False))
    at = names.index("link3")
    assert tree[at].endswith("link3 (JOINT3)") and names[at - 1] == "link2" and depths[at] == depths[at - 1] + 2


def test_pickles(arm_sim):
    sim, arm = arm_sim
    for cfg in (ks.bundled_robot("quadruped"), ks.CameraCfg(width=5), ks.SimulationManagerCfg.legged(num_envs=3)):
        assert pickle.loads(pickle.dumps(cfg)) == cfg == copy.deepcopy(cfg)
    arm.set_qpos_target(START)
    sim.update(7)
    saved = pickle.loads(pickle.dumps(sim.snapshot()))
    sim.update(30)
    later = arm.qpos
    sim.restore(saved)
    sim.update(30)
    np.testing.assert_array_equal(arm.qpos, later)
    with pytest.raises(ks.SnapshotError):
        ks.Snapshot.from_bytes(b"not a snapshot")


def longest_update(stepped, called):
    """Longest duration of an update of one simulation during a call of another (or of the same), and that of the call
    alone [s]."""
    controls = np.zeros((called.num_envs, 20_000, 6))
    started = time.perf_counter()
    called.rollout(controls)
    alone = time.perf_counter() - started
    thread = threading.Thread(target=called.rollout, args=(controls,))
    thread.start()
    longest = 0.0
    while thread.is_alive():
        started = time.perf_counter()
        stepped.update()
        longest = max(longest, time.perf_counter() - started)
    thread.join()
    return longest, alone


def test_simulations_run_at_the_same_time():
    """No lock of the interpreter or of all simulations is held during a call. A control: a simulation has a lock."""
    first, second = (ks.SimulationManager(num_envs=2, threads=1) for _ in range(2))
    for sim in (first, second):
        sim.add_robot(ks.bundled_robot("sr5"))
    longest, alone = longest_update(first, second)
    assert longest < alone / 2
    longest, alone = longest_update(second, second)
    assert longest > alone / 2


def longest_pause(work):
    """Longest pause of this thread while another one works, and the duration of the work [s]."""
    seconds = []

    def timed():
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)

    thread = threading.Thread(target=timed)
    longest, last = 0.0, time.perf_counter()
    thread.start()
    while thread.is_alive():
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    return longest, seconds[0]


def test_other_threads_run_while_a_camera_renders():
    """The interpreter is released while a path-traced image is rendered. A control: a call of Python's own that holds it."""
    sim = ks.SimulationManager(threads=1)
    sim.add_rigid_object(uid="cube")
    look = ks.Placement.look_at(eye=[2, 0, 1], target=[0, 0, 0.3])
    cfg = ks.CameraCfg(
        width=320, height=240, extrinsics=ks.Extrinsics(placement=look), renderer=ks.CameraRenderer.ray_traced(samples=16)
    )
    camera = sim.add_sensor("camera", cfg)
    longest, seconds = longest_pause(lambda: camera["color"])
    assert seconds > 0.5 and longest < seconds / 2, (longest, seconds)
    longest, seconds = longest_pause(lambda: sum(range(30_000_000)))
    assert longest > seconds / 2, (longest, seconds)


def runnable_threads(simulations):
    """Mean number of threads that run or wait for a core, while each simulation works in a thread of its own. Waiting for a
    lock does not count, so load of other programs changes nothing."""
    controls, seconds = np.zeros((2, 20_000, 6)), []

    def used():
        computed, waited, _ = Path(f"/proc/self/task/{threading.get_native_id()}/schedstat").read_text().split()
        return (int(computed) + int(waited)) * 1e-9

    def work(sim):
        before = used()
        sim.rollout(controls)
        seconds.append(used() - before)

    threads = [threading.Thread(target=work, args=(sim,)) for sim in simulations]
    started = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sum(seconds) / (time.perf_counter() - started)


def test_threads_work_in_parallel():
    """Two simulations in two threads compute at the same time. A control: two threads of one simulation take turns."""
    first, second = (ks.SimulationManager(num_envs=2, threads=1) for _ in range(2))
    for sim in (first, second):
        sim.add_robot(ks.bundled_robot("sr5"))
    assert runnable_threads([first, second]) > 1.5
    assert runnable_threads([second, second]) < 1.2


def test_threads_give_the_same_states():
    done = []

    def work():
        sim = ks.SimulationManager(num_envs=8, threads=1)
        arm = sim.add_robot(ks.bundled_robot("sr5"))
        arm.set_qpos_target(START)
        sim.update(200)
        done.append(arm.qpos)

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(done[0], done[1])
    assert (done[0] != 0).any()


def test_threads_share_a_simulation(arm_sim):
    sim, arm = arm_sim
    errors = []

    def use():
        try:
            for _ in range(100):
                sim.update()
                assert arm.qpos.shape == (2, 6)
                arm.set_qpos_target(START)
        except Exception as error:  # noqa: BLE001
            errors.append(error)

    threads = [threading.Thread(target=use) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not errors and not any(thread.is_alive() for thread in threads)
    assert sim.time[0] == pytest.approx(4.0, abs=1e-9)


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_text_of_a_simulation_in_use(arm_sim):
    """A debugger does not wait for a call of another thread."""
    sim, arm = arm_sim
    thread = threading.Thread(target=sim.rollout, args=(np.zeros((2, 20_000, 6)),))
    thread.start()
    time.sleep(0.05)
    texts = [repr(sim), repr(arm)]
    assert thread.is_alive()
    thread.join()
    assert texts == ["<SimulationManager of a simulation that is in use>", "<Robot of a simulation that is in use>"]
    assert "2 envs" in repr(sim) and "6 joints" in repr(arm)


def camera_once(_folder):
    with ks.SimulationManager(num_envs=2, threads=2) as sim:
        sim.add_rigid_object(uid="cube", init_pose={"pos": [0, 0, 1]})
        cam = sim.add_sensor("camera", ks.CameraCfg(width=16, height=16))
        sim.update(3)
        assert cam["color"].any()


def robot_once(folder):
    """A robot with meshes, a recording of it, and a snapshot that another simulation takes over."""
    with ks.SimulationManager(num_envs=2, threads=2) as sim:
        arm = sim.add_robot(ks.RobotCfg(uid="arm", urdf=ks.asset("sr5/SR5.urdf")))
        with sim.record(folder / "run.npz", overwrite=True):
            sim.update(3)
        sim.restore(sim.snapshot())
        assert np.isfinite(arm.qpos).all()


@pytest.mark.parametrize(
    ("once", "times", "leaked_bytes"),
    # One state or image of a simulation is about 20 kB, the meshes of the robot are about 1 MB.
    [(camera_once, 500, 20_000), (robot_once, 100, 100_000)],
)
def test_created_and_destroyed_simulations_leave_no_memory(once, times, leaked_bytes, tmp_path):
    for _ in range(40):
        once(tmp_path)
    gc.collect()
    before = resident()
    for _ in range(times):
        once(tmp_path)
    gc.collect()
    assert resident() - before < 2e6
    # A control: this is such a leak.
    leaked = [bytearray(b"x" * leaked_bytes) for _ in range(times)]
    assert resident() - before > 2e6 and leaked


def test_toml_of_a_scene_is_read_back():
    scene = {
        "simulation": ks.SimulationManagerCfg(num_envs=3, ground=None, lights=[]),
        "entities": {
            "arm": ks.bundled_robot("sr5"),
            "cube": ks.RigidObjectCfg(shape=ks.ObjectShape.box(size=[0.1, 0.1, 0.1])),
            "imu": ks.ImuCfg(body="cube"),
        },
    }
    text = ks.to_toml(scene)
    sim = ks.SimulationManager.from_scene(scene)
    assert sim.keys() == ["arm", "cube", "imu"] and sim.num_envs == 3
    assert ks.to_toml(__import__("tomllib").loads(text)) == text


def test_scene_files(tmp_path):
    path = ks.asset("scenes/quadruped.toml")
    sim = ks.SimulationManager.from_file(path, num_envs=3)
    assert sim.num_envs == 3 and sim.physics_dt == 0.005
    assert sim.keys() == ["robot", "camera", "height_scanner", "contact_forces"]
    sim.update(4)
    assert sim["height_scanner"]["hits"].shape == (3, 187, 3)
    (tmp_path / "bad.toml").write_text('[entities.a]\ntype = "robot"\nurfd = "x"\n')
    with pytest.raises(ks.ConfigError, match=r"bad.toml:3.*urdf"):
        ks.SimulationManager.from_file(tmp_path / "bad.toml")
