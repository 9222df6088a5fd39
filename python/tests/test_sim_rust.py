"""Bit equality with Rust: the command ``kinetoscope``, another program, repeats what Python recorded.

``KINETOSCOPE_CLI`` is the path of the command, built for the same MuJoCo as the package.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import kinetoscope as ks


def command(*arguments):
    """Runs the command ``kinetoscope``."""
    program = os.environ.get("KINETOSCOPE_CLI")
    if not program or not Path(program).is_file():
        pytest.fail("set KINETOSCOPE_CLI to the command kinetoscope, built for the MuJoCo of the package")
    folder = Path(__import__("importlib.util").util.find_spec("mujoco").submodule_search_locations[0])
    environment = {**os.environ, "LD_LIBRARY_PATH": str(folder)}
    return subprocess.run([program, *arguments], capture_output=True, text=True, timeout=120, env=environment, check=False)


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
