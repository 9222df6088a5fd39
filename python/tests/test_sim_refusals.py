"""Arrays with gaps, masks of the wrong length, None, misspelt attributes, and panics: an error or the right numbers."""

import dataclasses
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import virtual_display

import kinetoscope as ks
from kinetoscope import _accepted

PACKED = np.dtype([("a", "<f8"), ("b", "i1")])
START = [0.0, 0.5, -1.5, 0.3, -0.5, 0.0]


def packed(rows, dtype=PACKED):
    """The rows as a field of a packed structured array, whose stride is no multiple of the size of an element."""
    array = np.zeros(np.shape(rows), dtype)
    array["a"] = rows
    array["b"] = 7
    return array


def test_fields_of_packed_arrays_are_read(arm_sim):
    """rust-numpy divides strides by the size of an element, so a stride of 9 bytes was read as 8."""
    _, arm = arm_sim
    rows = np.tile(START, (2, 1))
    arm.set_qpos_target(packed(rows)["a"])
    np.testing.assert_array_equal(arm.qpos_target, rows)
    # An address that is no multiple of 8.
    shifted = np.zeros(12 * 8 + 1, np.uint8)[1:].view(np.float64).reshape(2, 6)
    shifted[:] = -rows
    arm.set_qpos_target(shifted)
    np.testing.assert_array_equal(arm.qpos_target, -rows)
    arm.set_qpos_target(rows.astype(">f8"))
    np.testing.assert_array_equal(arm.qpos_target, rows)
    with pytest.raises(ks.ArgumentError):
        arm.set_qpos_target(packed(rows))


def test_images_are_not_written_over_other_fields(arm_sim):
    sim, _ = arm_sim
    camera = sim.add_sensor("camera", ks.CameraCfg(width=4, height=3, channels=["depth"]))
    target = packed(np.zeros((2, 3, 4)), np.dtype([("a", "<f4"), ("b", "i1")]))
    with pytest.raises(ks.ArgumentError, match="aligned"):
        camera.read("depth", out=target["a"])
    assert (target["b"] == 7).all() and (target["a"] == 0).all()
    whole = np.zeros((2, 3, 8), np.float32)
    camera.read("depth", out=whole[:, :, ::2])
    np.testing.assert_array_equal(whole[:, :, ::2], camera["depth"])
    assert (whole[:, :, 1::2] == 0).all()
    # Elements that share memory.
    once = np.lib.stride_tricks.as_strided(np.zeros(1, np.float32), (2, 3, 4), (0, 0, 0), writeable=True)
    with pytest.raises(ks.ArgumentError, match="aligned"):
        camera.read("depth", out=once)


def test_arrays_of_too_many_axes_are_refused(arm_sim):
    """ndarray of rust-numpy asserts at most 32 axes; NumPy 2 allows 64, NumPy 1 not more than 32."""
    _, arm = arm_sim
    axes = 40 if np.lib.NumpyVersion(np.__version__) >= "2.0.0" else 32
    with pytest.raises(ks.ArgumentError, match="axes"):
        arm.set_qpos_target(np.zeros((1,) * axes))


@pytest.mark.parametrize("mask", [[True], [True, False, True], [[True], [False]], True])
def test_masks_have_one_entry_per_item(arm_sim, mask):
    sim, arm = arm_sim
    with pytest.raises(ks.ArgumentError, match="env_ids.*2"):
        sim.reset(np.array(mask))
    with pytest.raises(ks.ArgumentError, match="joint_ids.*6"):
        arm.set_qpos_target(np.zeros(6), joint_ids=np.array(mask))


def test_masks_select(arm_sim):
    _, arm = arm_sim
    arm.set_qpos_target(np.tile(START, (2, 1)))
    arm.set_qpos_target([9.0], joint_ids=[False] * 5 + [True], env_ids=np.array([False, True]))
    assert arm.qpos_target[1, 5] != 0 and arm.qpos_target[0, 5] == 0


def test_none_is_refused_for_fields_that_need_a_value(tmp_path):
    for make in (
        lambda: ks.SimulationManager({"physics_dt": 0.002}, physics_dt=None),
        lambda: ks.SimulationManager(physics_dt=None),
        lambda: ks.SimulationManager({"physics_dt": None}),
        lambda: ks.SimulationManager().add_robot(urdf=ks.asset("sr5/SR5.urdf"), fix_base=None),
        lambda: ks.SimulationManager().add_robot(urdf=ks.asset("sr5/SR5.urdf"), drive={"stiffness": None}),
    ):
        with pytest.raises(ks.ConfigError, match="None"):
            make()
    assert ks.SimulationManager({"threads": 1}, threads=None).physics_dt == 0.01
    # None replaces the value of a file, too.
    path = tmp_path / "two.toml"
    path.write_text("[simulation]\nthreads = 3\nnum_envs = 8\n")
    assert ks.SimulationManager.from_file(path).threads == 3
    default = ks.SimulationManager(num_envs=8).threads
    assert ks.SimulationManager.from_file(path, threads=None).threads == default != 3
    with pytest.raises(ks.ConfigError, match="None"):
        ks.SimulationManager.from_file(path, num_envs=None)
    sim = ks.SimulationManager()
    camera = {"type": "camera", "width": 8, "height": 8, "extrinsics": {"parent": None}}
    sim.add_sensor("camera", camera)


NAN, INFINITY = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda world: world["image_window"].wait(NAN), "timeout: NaN is not a time"),
        (lambda world: world["image_window"].wait(-1.0), "timeout: -1 is not a time"),
        (lambda world: world["image_window"].show(np.zeros((4, 4, 3))), "uint8.*float64"),
        (lambda world: world["image_window"].show(np.zeros((4, 4), np.uint8)), "height, width, 4"),
        (lambda world: world["image_window"].show(np.zeros((0, 4, 3), np.uint8)), "height, width, 4"),
        (lambda world: ks.ImageWindow(size=(0, 5), display=":0"), "no pixels"),
        (lambda world: world["window"].wait(NAN), "timeout: NaN is not a time"),
        (lambda world: world["playback"].play(timeout=NAN), "timeout: NaN is not a time"),
        (lambda world: world["playback"].frame_at(NAN), "nan is not a time"),
        (lambda world: world["viewer"].seek(INFINITY), "inf is not a finite time"),
        (lambda world: world["viewer"].set_speed(NAN), "NaN is not from 0.001 to 1000"),
        (lambda world: world["terrain"].height_at(NAN, 0.0), r"\(NaN, 0\) is not a point"),
        (lambda world: world["sim"].update_for(NAN), "seconds is NaN"),
        (lambda world: world["sim"].update_for(-0.01), "seconds is -0.01"),
        (lambda world: world["sim"].update_for(0.015), "seconds is 0.015; it must be a whole number of physics_dt"),
        (lambda world: world["sim"].serve(speed=NAN), "speed: NaN is not from 0.001 to 1000"),
        (lambda world: world["sim"].serve(cfg={"speed": {"factor": 0.0}}), "speed: 0 is not from 0.001 to 1000"),
        (lambda world: world["sim"].serve(max_fps=NAN), "max_fps: NaN is not a number of images per second"),
        (lambda world: world["sim"].serve(max_fps=0.0), "max_fps: 0 is not a number of images per second"),
        (lambda world: world["sim"].serve(jpeg_quality=0), "jpeg_quality: 0 is not from 1 to 100"),
        (lambda world: world["sim"].open_window(speed=NAN, display=world["display"]), "speed: NaN is not from"),
        (lambda world: world["sim"].open_window(size=(0, 4), display=world["display"]), "no pixels"),
        (lambda world: world["sim"].screenshot(eye=[NAN, 0, 0], target=[0, 0, 0]), "finite"),
        (lambda world: world["sim"].screenshot(env=1), "1"),
        (lambda world: world["sim"].record(world["folder"] / "a.npz", period_steps=0), "period_steps"),
        (lambda world: world["sim"].record(world["folder"] / "a", "overview", format="images", overview_fps=NAN), "rate is NaN"),
        (lambda world: world["sim"].env_warnings(1), "environment 1"),
        (lambda world: world["recorder"].note("a", env=1), "1"),
        (lambda world: world["camera"].pose_w("open-gl"), '"ros", "opengl" or "world"'),
        (lambda world: world["sim"].set_camera_view([0, 0, NAN], [0, 0, 0]), "finite"),
        (lambda world: world["sim"].show(width=0), "width"),
    ],
)  # fmt: skip
def test_numbers_without_a_meaning_are_refused(call, text, nan_world):
    """A time of NaN was no wait at all, and a negative one too."""
    with pytest.raises(ks.KinetoscopeError, match=text):
        call(nan_world)


@pytest.fixture(scope="module")
def nan_world(tmp_path_factory):
    with virtual_display() as display:
        folder = tmp_path_factory.mktemp("nan")
        sim = ks.SimulationManager(threads=1)
        camera = sim.add_sensor("camera", ks.CameraCfg(width=4, height=3))
        terrain = sim.add_terrain(heights=[[0, 1], [1, 2]])
        sim.add_rigid_object(uid="cube")
        with sim.record(folder / "recorded.npz"):
            sim.update(2)
        yield {
            "sim": sim, "display": display, "folder": folder, "camera": camera, "terrain": terrain, "viewer": sim.viewer(),
            "window": sim.open_window(display=display, speed=None), "image_window": ks.ImageWindow(display=display),
            "playback": ks.Playback(folder / "recorded.npz", sim), "recorder": sim.record(folder / "b.npz"),
        }  # fmt: skip
        sim.destroy()


def test_misspelt_attributes_are_refused():
    for cfg in (ks.RobotCfg(), ks.SimulationManagerCfg(), ks.CameraCfg()):
        with pytest.raises(AttributeError, match="drvie"):
            cfg.drvie = 3


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda sim: sim.add_rigid_object(ks.TerrainCfg()), ("TerrainCfg", "RigidObjectCfg", "add_terrain()")),
        (lambda sim: sim.add_robot(ks.ArticulationCfg(urdf="a")), ("ArticulationCfg", "RobotCfg", "add_articulation()")),
        (lambda sim: sim.add_terrain(ks.CameraCfg()), ("CameraCfg", "TerrainCfg", "add_sensor()")),
        (lambda sim: sim.add_robot(ks.SimulationManagerCfg()), ("SimulationManagerCfg", "RobotCfg", "SimulationManager()")),
        (lambda sim: sim.add_robot({"type": "terrain"}), ("'terrain'", "RobotCfg", "add_terrain()")),
        (lambda sim: sim.add_sensor("x", ks.RobotCfg()), ("RobotCfg", "sensor", "add_robot()")),
        (lambda sim: sim.add_sensor("x", {"type": "weld"}), ("WeldCfg", "sensor", "add_weld()")),
        (lambda sim: ks.SimulationManager(ks.RobotCfg()), ("RobotCfg", "SimulationManagerCfg", "add_robot()")),
        (lambda sim: ks.SimulationManager.from_scene({"simulation": ks.WeldCfg()}), ("WeldCfg", "SimulationManagerCfg")),
        (lambda sim: ks.SimulationManager.from_scene({"entities": {"a": ks.RobotCfg(drive=ks.WeldCfg())}}), ("drive", "WeldCfg", "DriveCfg")),
        (lambda sim: sim.add("x", ks.RigidObjectGroupCfg(objects=[ks.TerrainCfg()])), ("objects", "TerrainCfg", "RigidObjectCfg")),
        (lambda sim: sim.add_robot(urdf="a", drive=ks.CameraCfg()), ("drive", "CameraCfg", "DriveCfg")),
        (lambda sim: sim.add_robot(ks.RobotCfg(drive=ks.CameraCfg())), ("drive", "CameraCfg", "DriveCfg")),
        (lambda sim: sim.randomize(ks.IkCfg()), ("IkCfg", "Randomization")),
        (lambda sim: ks.Task(sim, ks.IkCfg()), ("IkCfg", "TaskCfg")),
            (lambda sim: sim.record(ks.ServeCfg()), ("ServeCfg", "RecorderCfg")),
            (lambda sim: sim.screenshot(cfg=ks.WindowCfg()), ("WindowCfg", "ScreenshotCfg")),
    ],
)  # fmt: skip
def test_configurations_of_another_class_are_refused(call, names):
    """Only changed fields travel to Rust: a TerrainCfg without changes added a default cube."""
    sim = ks.SimulationManager()
    with pytest.raises(ks.ConfigError) as caught:
        call(sim)
    assert all(name in str(caught.value) for name in names), caught.value
    assert len(sim) == 0


def test_subclasses_of_configurations_are_accepted():
    class RedCube(ks.RigidObjectCfg):
        pass

    sim = ks.SimulationManager()
    assert sim.add_rigid_object(RedCube(uid="red", mass=3.0)).nominal_mass == 3.0
    assert sim.add("second", RedCube()).uid == "second"


def test_fields_of_every_class_accept_their_defaults():
    """The check of classes inside configurations has no wrong finding."""
    for kind, cls in _accepted._classes().items():
        required = {field.name: [] for field in dataclasses.fields(cls) if is_required(field)}
        assert _accepted.mistake(kind, cls(**required)) is None, kind


def is_required(field):
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def test_default_names_are_those_of_the_classes():
    """The name of an entity without a name is the default of its class, in Python and in Rust."""
    sim = ks.SimulationManager()
    assert sim.add_rigid_object(ks.RigidObjectCfg()).uid == ks.RigidObjectCfg().uid == "object"
    assert sim["object"].uid == "object"
    with ks.SimulationManager() as other:
        assert other.add_rigid_object(ks.RigidObjectCfg(uid="object")).uid == "object"
        group = ks.RigidObjectGroupCfg(objects=[ks.RigidObjectCfg(uid="a")])
        assert other.add_rigid_object_group(group).uid == ks.RigidObjectGroupCfg().uid
        arm = ks.bundled_robot("sr5", uid=ks.RobotCfg().uid)
        assert other.add_robot(arm).uid == ks.RobotCfg().uid


def test_properties_are_set_without_effect_on_draws():
    """Setting a property neither counts as a randomization nor drops rows."""

    def drawn(set_first):
        sim = ks.SimulationManager(num_envs=2)
        sim.add_rigid_object(uid="cube")
        sim.add_rigid_object(uid="d")
        if set_first:
            sim.set_property("mass", "d", [[2.0], [3.0]])
            np.testing.assert_array_equal(sim.property("mass", "d"), [[2.0], [3.0]])
        sim.randomize([ks.RandomizationTerm(property="mass", pattern="cube", draw={"scale": [1, 2]})])
        return sim, sim.property("mass", "cube")

    sim, plain = drawn(False)
    np.testing.assert_array_equal(drawn(True)[1], plain)
    for wrong in ([[2.0], [3.0], [4.0]], [[2.0, 3.0]], [[[2.0]]]):
        with pytest.raises(ks.ArgumentError, match="shape"):
            sim.set_property("mass", "d", wrong)
    with pytest.raises(ks.KinetoscopeError, match="repeat|twice"):
        sim.set_property("mass", "d", [[2.0], [3.0]], env_ids=[0, 0])
    with pytest.raises(ks.OutOfRangeError):
        sim.set_property("mass", "d", [[2.0]], env_ids=[2])
    assert (sim.property("mass", "d") == sim.property("mass", "d")[0]).all()
    sim.set_property("mass", "d", [5.0], env_ids=[1])
    assert sim.property("mass", "d")[1, 0] == 5.0


def test_recorders_end_once(tmp_path, arm_sim):
    sim, _ = arm_sim
    with sim.record(tmp_path / "a.npz") as recorder:
        sim.update(3)
        assert recorder.finish().packets > 0
    with pytest.raises(ZeroDivisionError), sim.record(tmp_path / "b.npz") as recorder:
        recorder.finish()
        1 / 0
    with pytest.raises(ks.KinetoscopeError):
        recorder.finish()


def test_no_message_has_the_path_of_the_source_tree():
    """Assets come from the package; the path of the checkout that built the extension is not searched."""
    script = (
        "import kinetoscope as ks\n"
        "print(ks.bundled_robot('sr5').urdf)\nprint(ks.asset('sr5/SR5.urdf'))\n"
        "try:\n    ks.asset('no/such')\nexcept ks.FileError as error:\n    print(error)\n"
    )
    package = str(Path(ks.__file__).parent / "assets")
    for variable in (None, "/nowhere"):
        environment = {key: value for key, value in os.environ.items() if key != "KINETOSCOPE_ASSETS"}
        environment |= {} if variable is None else {"KINETOSCOPE_ASSETS": variable}
        result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True)
        robot, file, message = result.stdout.strip().split("\n")
        assert package in robot and file.startswith(package)
        tried = re.search("tried (.*);", message)[1].split(", ")
        expected = [f"{package}/no/such"]
        assert tried == (expected if variable is None else [f"{variable}/no/such", *expected])
