"""A panic of Rust is an ``InternalError`` in every call, never a ``PanicException``, which ``except Exception`` does not catch."""

import inspect

import numpy as np
import pytest
from test_sim_tasks import cart_sim, task_cfg

import kinetoscope as ks
from kinetoscope import _sim

# Values of parameters without a default, by name. They only have to be converted: the panic comes before they are checked.
VALUES = {
    "actions": [[0.0]], "body": "cube", "camera": lambda world: world["Sensor"], "channel": "depth", "controls": [[[0.0]]],
    "drive_type": "force", "entity": "cube", "env": 0, "eye": [1.0, 0, 0], "field": "x", "folder": lambda world: world["folder"],
    "force": [0.0] * 3, "forces": [0.0] * 3, "frame": 0, "group": "policy", "image": np.zeros((2, 2, 3), np.uint8),
    "intrinsics": [[1.0] * 4], "joint": 0, "left": [[1.0] * 4], "link": "cart", "mask": np.zeros((1, 2, 2), np.int32), "name": "cube", "on": True,
    "one": "cube", "other": "cart", "path": lambda world: world["folder"] / "x.npz", "patterns": ".*", "poses": [[0.0] * 7],
    "positions": [[0.0]], "property": "mass", "qacc": [[0.0]], "qpos": [[0.0]], "randomization": [],
    "record_button": lambda world: world["FileRecording"], "robot": lambda world: world["Robot"], "right": [[1.0] * 4], "seconds": 0.01,
    "sensor": lambda world: world["Sensor"], "shown": True, "site": "x", "snapshot": lambda world: world["Snapshot"], "speed": 1.0,
    "target": [0.0] * 3, "targets": [[0.0] * 7], "text": "a note", "time": 0.5, "tip": "cart", "topic": "x", "torque": [0.0] * 3,
    "torques": [0.0] * 3, "uid": "cube", "value": 0.0, "values": [0.0], "velocities": [[0.0]], "x": 0.0, "y": 0.0,
}  # fmt: skip
# Parameters with another value in one method.
OWN = {
    "SimulationManager.add.cfg": ks.RigidObjectCfg(),
    "SimulationManager.add_sensor.cfg": ks.ImuCfg(body="cube"),
}
# Calls that only return a value that the Python object has, or end or begin a block.
PLAIN = {
    "FoxgloveServer": "clients url __repr__",
    "ImageWindow": "close frame_count is_open __enter__ __exit__ __repr__",
    "KinematicChain": "base diagnostics dof joint_names link_names qpos_limits reach tip __repr__",
    "Playback": "joints_without_data sim times __len__ __repr__",
    "Recorder": "path __repr__ __enter__",
    "RenderProgress": "cancel fraction is_canceled rays resume samples total __repr__",
    "Robot": "kind",
    "Segmentation": "__repr__",
    "Sensor": "uid",
    "Server": "url viewers __repr__",
    "SimulationManager": "keys __contains__ __iter__ __len__ __enter__",
    "Snapshot": "__len__ __repr__",
    "Task": "dtype num_envs sim",
    "Viewer": "__enter__ __repr__",
    "Window": "close frame_count is_open __repr__",
}
SPECIAL = ("__len__", "__iter__", "__contains__", "__getitem__", "__enter__", "__exit__", "__repr__", "__reduce__")


def world_of(folder, display):
    """A simulation with one object of each class."""
    sim, cart = cart_sim(num_envs=1)
    cube = sim.add_rigid_object(uid="cube")
    group = sim.add_rigid_object_group(uid="group", objects=[ks.RigidObjectCfg(uid="a")])
    terrain = sim.add_terrain(uid="ground_2")
    part = sim.add_mjcf(uid="part", text="<mujoco><worldbody><body><geom size='.1'/><joint/></body></worldbody></mujoco>")
    weld = sim.add_weld(uid="weld", first="cube", second="group.a")
    camera = sim.add_sensor("eye", ks.CameraCfg(width=4, height=3, channels=["depth", "mask"]))
    path = folder / "recorded.npz"
    with sim.record(path):
        sim.update(2)
    world = {
        "folder": folder, "SimulationManager": sim, "Robot": cart, "RigidObject": cube, "RigidObjectGroup": group, "Terrain": terrain,
        "MjcfPart": part, "Sensor": camera, "RenderProgress": camera.progress, "Segmentation": sim.segmentation(), "Snapshot": sim.snapshot(),
        "Recorder": sim.record(folder / "new.npz", overwrite=True), "FileRecording": sim.file_recording(folder / "files.npz"), "FoxgloveServer": sim.stream_to_foxglove("127.0.0.1:0"),
        "Server": sim.serve(), "Viewer": sim.viewer(), "Window": sim.open_window(display=display),
        "ImageWindow": ks.ImageWindow(display=display), "KinematicChain": ks.KinematicChain(ks.asset("cabinet/cabinet.urdf"), "drawer"), "Playback": ks.Playback(path, sim), "Weld": weld,
    }  # fmt: skip
    world["Task"] = ks.Task(sim, task_cfg())
    return world


def arguments_of(world, owner, name, method):
    """Arguments for the parameters without a default."""
    given = []
    for parameter in inspect.signature(method).parameters.values():
        if parameter.default is parameter.empty and parameter.kind in (parameter.POSITIONAL_ONLY, parameter.POSITIONAL_OR_KEYWORD):
            value = OWN.get(f"{owner}.{name}.{parameter.name}", VALUES.get(parameter.name))
            assert value is not None, f"{owner}.{name} needs a value of {parameter.name}"
            given.append(value(world) if callable(value) else value)
    return given


def calls_of(world, owner):
    """A call for each property and method of a class."""
    obj = world[owner]
    for name, member in vars(type(obj)).items():
        # Constructors are among the functions below.
        is_constructor = type(member).__name__ == "classmethod_descriptor"
        if is_constructor or (name.startswith("_") and name not in SPECIAL):
            continue
        if inspect.isgetsetdescriptor(member):
            yield name, lambda name=name: getattr(obj, name)
        elif name == "__contains__":
            yield name, lambda: "depth" in obj
        elif name == "__getitem__":
            yield name, lambda: obj["depth" if owner == "Sensor" else "cart"]
        else:
            method = getattr(obj, name)
            yield name, lambda name=name, method=method: method(*arguments_of(world, owner, name, method))


def panicked(call):
    """True if the call reached Rust code that panicked, and reported it as it should."""
    _sim._panic_next(True)
    try:
        call()
    except ks.InternalError as error:
        assert "requested by a test" in str(error), error
    finally:
        is_pending = _sim._panic_next(False)
    return not is_pending


CLASSES = sorted(name for name in _sim.__all__ if isinstance(getattr(_sim, name), type) and name not in ("IkResult", "RecordingSummary", "Topic"))


@pytest.mark.parametrize("owner", CLASSES)
def test_a_panic_in_any_method_is_an_exception(owner, tmp_path, display):
    """Each property and method of each class. A panic while the simulation changes makes it unusable: the next call has another."""
    plain, worlds = [], []
    for name in [name for name, _ in calls_of(new_world(tmp_path, display, worlds), owner)]:
        world = worlds[-1] if is_usable(worlds[-1]) else new_world(tmp_path, display, worlds)
        if not panicked(dict(calls_of(world, owner))[name]):
            plain.append(name)
    for world in worlds:
        world["Window"].close()
        world["ImageWindow"].close()
    assert sorted(plain) == sorted(PLAIN.get(owner, "").split())


def new_world(folder, display, worlds):
    """Another world, in a folder of its own."""
    folder = folder / str(len(worlds))
    folder.mkdir()
    worlds.append(world_of(folder, display))
    return worlds[-1]


def is_usable(world):
    """True if no simulation of the world is destroyed or in an unknown state."""
    try:
        return all(sim.num_envs == 1 for sim in (world["SimulationManager"], world["Playback"].sim))
    except (ks.InternalError, ks.DestroyedError):
        return False


FUNCTIONS = {
    "asset_path": lambda folder: _sim.asset_path("sr5/SR5.urdf"),
    "assemble_urdf": lambda folder: ks.assemble_urdf(ks.asset("sr5/SR5.urdf")),
    "bundled_robot": lambda folder: _sim.bundled_robot("sr5"),
    "inspect": lambda folder: ks.inspect(mjcf={"text": "<mujoco/>"}),
    "json_schema": lambda folder: ks.json_schema(),
    "read_calibration": lambda folder: ks.read_calibration(folder / "x.yaml"),
    "read_series": lambda folder: ks.read_series(folder / "x.npz", "a", "b"),
    "recording_topics": lambda folder: ks.recording_topics(folder / "x.npz"),
    "recover": lambda folder: ks.recover(folder / "x.mcap"),
    "to_toml": lambda folder: ks.to_toml({}),
    "SimulationManager": lambda folder: ks.SimulationManager(),
    "SimulationManager.from_file": lambda folder: ks.SimulationManager.from_file(folder / "x.toml"),
    "SimulationManager.from_scene": lambda folder: ks.SimulationManager.from_scene({}),
    "Snapshot.from_bytes": lambda folder: ks.Snapshot.from_bytes(b""),
    "Snapshot.load": lambda folder: ks.Snapshot.load(folder / "x"),
    "KinematicChain": lambda folder: ks.KinematicChain(ks.asset("sr5/SR5.urdf"), "base_link"),
    "Playback": lambda folder: ks.Playback(folder / "x.npz"),
    "Task": lambda folder: ks.Task(cart_sim()[0], task_cfg()),
    "ImageWindow": lambda folder: ks.ImageWindow(),
    "Topic.value": lambda folder: ks.Topic.events().value,
}
# Functions that return a constant or store a value.
PLAIN_FUNCTIONS = {"mujoco_version"}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_panic_in_a_function_or_constructor_is_an_exception(name, tmp_path):
    assert panicked(lambda: FUNCTIONS[name](tmp_path))


def test_every_function_has_a_row():
    functions = {name for name in _sim.__all__ if inspect.isbuiltin(getattr(_sim, name)) and not name.startswith("_")}
    assert functions == {name for name in FUNCTIONS if name[0].islower()} | PLAIN_FUNCTIONS


def test_a_simulation_after_a_panic(arm_sim):
    """A read that panics changes nothing; after a change that panicked, the state is unknown. Other simulations work."""
    sim, arm = arm_sim
    assert panicked(lambda: arm.qpos) and panicked(lambda: repr(arm))
    assert arm.qpos.shape == (2, 6)
    task = ks.Task(sim, {"actions": {"push": {"type": "joint_positions", "robot": "arm", "joints": [".*"]}}, "observations": {"policy": {"place": {"type": "joint_pos_rel"}}}, "rewards": {"alive": {"type": "is_alive", "weight": 1.0}}})  # fmt: skip
    assert panicked(task.reset)
    with pytest.raises(ks.InternalError, match="create a new simulation"):
        arm.qpos  # noqa: B018
    sim.destroy()
    with ks.SimulationManager() as other:
        assert panicked(other.update)
        with pytest.raises(ks.InternalError, match="create a new simulation"):
            other.update()
