"""Bit equality with Rust: the command ``kinetoscope``, another program, repeats what Python recorded.

``KINETOSCOPE_CLI`` is the path of the command, built for the same MuJoCo as the package.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import kinetoscope as ks


def program():
    """Path of the command ``kinetoscope``."""
    path = os.environ.get("KINETOSCOPE_CLI")
    if not path or not Path(path).is_file():
        pytest.fail("set KINETOSCOPE_CLI to the command kinetoscope, built for the MuJoCo of the package")
    return path


def environment():
    """Environment variables with which the command finds MuJoCo."""
    folder = Path(__import__("importlib.util").util.find_spec("mujoco").submodule_search_locations[0])
    return {**os.environ, "LD_LIBRARY_PATH": str(folder)}


def command(*arguments):
    """Runs the command ``kinetoscope``."""
    arguments = [program(), *arguments]
    return subprocess.run(arguments, capture_output=True, text=True, timeout=120, env=environment(), check=False)


def test_states_are_those_of_rust(tmp_path):
    """A quadruped on rough ground and an arm with a hand, four environments, 200 steps with new targets every 20."""
    scene = {
        "simulation": ks.SimulationManagerCfg.legged(num_envs=4, threads=2),
        "entities": {
            "dog": ks.bundled_robot("quadruped"),
            "arm": ks.bundled_robot("sr5_with_hand", init_pose=[2, 0, 0, 1, 0, 0, 0]),
            "cube": ks.RigidObjectCfg(init_pose=[2.5, 0.3, 0.3, 1, 0, 0, 0]),
            "hills": ks.TerrainCfg(heights=ks.TerrainGenerator.rough(ks.RoughTerrain(range=[0.0, 0.04], seed=2))),
        },
    }
    sim = ks.SimulationManager.from_scene(scene)
    (tmp_path / "scene.toml").write_text(ks.to_toml(scene))
    rng = np.random.default_rng(3)
    with sim.record(tmp_path / "run.npz", scene=False):
        for _ in range(10):
            sim["dog"].set_qpos_target(sim["dog"].default_qpos + rng.normal(size=(4, 12)) * 0.1)
            sim["arm"].set_qpos_target(rng.uniform(-0.5, 0.5, (4, 17)))
            sim.update(20)
    result = command("replay", tmp_path / "run.npz", "--verify", "--scene", tmp_path / "scene.toml")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "200 steps" in result.stdout, result.stdout
    # A control: a heavier cube is found.
    scene["entities"]["cube"].mass = 5.0
    scene["entities"]["cube"].init_pose = [2.5, 0.3, 0.31, 1, 0, 0, 0]
    (tmp_path / "other.toml").write_text(ks.to_toml(scene))
    assert command("replay", tmp_path / "run.npz", "--verify", "--scene", tmp_path / "other.toml").returncode == 1


def test_images_are_those_of_rust(tmp_path):
    """Screenshots of two states of a recording, by Python and by the command: the files are equal."""
    sim = ks.SimulationManager(num_envs=2, threads=2)
    arm = sim.add_robot(ks.bundled_robot("sr5_with_hand", uid="arm"))
    sim.add_rigid_object(uid="ball", shape=ks.ObjectShape.sphere(radius=0.1), init_pose=[0.5, 0.4, 0.8, 1, 0, 0, 0])
    path = tmp_path / "run.npz"
    with sim.record(path):
        for _ in range(4):
            arm.set_qpos_target(np.full((2, arm.dof), 0.3))
            sim.update(10)
    playback = ks.Playback(path)
    times = [playback.times[0], playback.times[-1]]
    images = []
    for number, at in enumerate(times):
        result = command("replay", path, "--out", tmp_path, "--at", f"{at:.6f}", "--width", "160", "--height", "120")
        assert result.returncode in (0, 1), result.stderr
        playback.seek(playback.frame_at(at))
        own = tmp_path / f"own_{number}.png"
        playback.sim.screenshot(own, size=[160, 120])
        images.append(own.read_bytes())
        assert images[-1] == (tmp_path / f"replay_{at:.3f}s.png").read_bytes()
    # A control: the states look different.
    assert images[0] != images[1]


def test_camera_channels_are_those_of_rust(tmp_path):
    """All channels of cameras on a moving arm and beside it, with noise, recorded by the command and by Python."""
    channels = ["color", "depth", "distance", "mask", "normal", "shading_normal", "position", "albedo", "flow"]
    side = ks.Placement.look_at(eye=[1.5, 1.5, 1.2], target=[0, 0, 0.4])
    wrist = ks.Placement.pose(pos=[0, 0.1, 0.05], rotation=[0, 1, 0, 0])
    scene = {
        "simulation": ks.SimulationManagerCfg(num_envs=2, threads=2, seed=3),
        "entities": {
            "arm": ks.bundled_robot("sr5_with_hand", init_qpos={"JOINT2": 0.7, "JOINT3": -1.2}),
            "ball": ks.RigidObjectCfg(shape=ks.ObjectShape.sphere(radius=0.15), init_pose=[0.4, 0.5, 1.0, 1, 0, 0, 0]),
            "side": ks.CameraCfg(width=48, height=36, channels=channels, extrinsics=ks.Extrinsics(placement=side), update_period=0.05),
            "wrist": ks.CameraCfg(
                width=40, height=30, channels=channels, extrinsics=ks.Extrinsics(parent="arm/ee_link", placement=wrist),
                renderer="hybrid", update_period=0.1,
            ),
        },
    }  # fmt: skip

    def recorded(name):
        """Recordings of 30 steps of the scene, by the command and by Python."""
        path = tmp_path / f"{name}.toml"
        path.write_text(ks.to_toml(scene))
        own, other = tmp_path / f"{name}_python.npz", tmp_path / f"{name}_rust.npz"
        result = command("view", path, "--serve", "127.0.0.1:0", "--steps", "30", "--speed", "10", "--record", other)
        assert result.returncode in (0, 1), result.stdout + result.stderr
        sim = ks.SimulationManager.from_file(path)
        with sim.record(own):
            sim.update(30)
        return np.load(own), np.load(other)

    own, other = recorded("scene")
    images = [f"{camera}/{channel}" for camera in ("side", "wrist") for channel in channels]
    assert set(own.files) == set(other.files) >= set(images)
    for name in images:
        assert own[name].shape[0] >= 3 and own[name].shape[1] == 2, name
        assert own[name].tobytes() == other[name].tobytes(), name
        # The images show something that changes.
        assert own[name][0].tobytes() != own[name][-1].tobytes() or name.endswith("albedo"), name
    # A control: a ball at another place changes the images.
    scene["entities"]["ball"].init_pose = [0.4, 0.6, 1.0, 1, 0, 0, 0]
    moved, _ = recorded("moved")
    assert moved["side/depth"].tobytes() != own["side/depth"].tobytes()
