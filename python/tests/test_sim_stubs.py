"""Types: the package passes mypy in strict mode, and the stub of the extension module fits it."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import stub_docs

import kinetoscope
from kinetoscope import _sim

PACKAGE = Path(kinetoscope.__file__).parent
PROJECT = Path(__file__).parents[2]


def run(*command):
    return subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, timeout=500, check=False)


@pytest.fixture
def strict(tmp_path):
    """Libraries of reinforcement learning and of devices may be missing, and their classes have types or not."""
    file = tmp_path / "mypy.ini"
    libraries = ["stable_baselines3", "rsl_rl", "tensordict", "skrl", "torch", "torchrl", "ray", "warp", "mujoco_warp", "mujoco"]
    sections = {
        "mypy": "strict = true",
        "mypy-kinetoscope.rl.*": "disallow_subclassing_any = false\ndisallow_untyped_calls = false",
        # Kernels of Warp are functions with a decorator.
        "mypy-kinetoscope.warp.*": "disallow_untyped_decorators = false",
        ",".join(f"mypy-{name}.*" if name == libraries[0] else f"{name}.*" for name in libraries): (
            "ignore_missing_imports = true\nfollow_imports = skip\nfollow_imports_for_stubs = true"
        ),
    }
    file.write_text("\n".join(f"[{name}]\n{text}" for name, text in sections.items()))
    return str(file)


def test_the_stub_fits_the_module():
    result = run("mypy.stubtest", "kinetoscope._sim")
    assert result.returncode == 0, result.stdout


def test_the_stub_has_the_documentation_of_the_module():
    """Each public item has the documentation of the module. Texts about arrays give the shape."""
    for name in stub_docs.STUBS:
        text = (PACKAGE / name).read_text()
        assert text.count("\n") <= 800, name
        expected = stub_docs.documented(text, _sim)
        assert text == expected, f"{name}: run python python/tests/stub_docs.py"
        # A control: a changed text, and one that is missing, are found.
        line = re.search(r'^ +def \w+\(.*:\n( +"""\w.*""")$', text, re.MULTILINE).group(1)
        assert stub_docs.documented(text.replace(line, f'{line[:-4]}, in other words."""', 1), _sim) == expected
        assert stub_docs.documented(text.replace(f":\n{line}", ": ...", 1), _sim) == expected
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef) and stub_docs.is_documented(node.name) and "Array" in ast.unparse(node.returns):
                assert "shape" in ast.get_docstring(node), node.name


def test_strict_types(strict):
    result = run("mypy", "--config-file", strict, "-p", PACKAGE.name)
    assert result.returncode == 0, result.stdout


def test_types_of_a_program(strict, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        "import kinetoscope as ks\n"
        "sim = ks.SimulationManager(num_envs=2)\n"
        "arm = sim.add_robot(ks.RobotCfg(urdf='x', drive=ks.DriveCfg(stiffness=1.0)))\n"
        "arm.set_qpos_target([0.0], joint_ids='arm')\n"
        "shape: tuple[int, ...] = arm.qpos.shape\n"
        "box = ks.ObjectShape.box(size=[1, 1, 1])\n"
        "rays = ks.RayPattern.grid(ks.GridPattern(resolution=0.5))\n"
        "tile = ks.TileShare(tile=ks.TerrainTile.stairs_up(ks.StairsTile(tread=0.4)), share=2.0)\n"
        "hills = ks.TerrainGenerator.grid(ks.TerrainGrid(tiles=[tile]))\n"
        "waves = ks.TerrainGenerator.waves(ks.WavesTerrain())\n"
    )
    assert run("mypy", "--config-file", strict, str(program)).returncode == 0
    # Controls: each of these mistakes is found.
    mistakes = [
        "arm.qops",
        "ks.DriveCfg(stiff=1.0)",
        "ks.CameraCfg(width='a')",
        "ks.RobtoCfg()",
        "ks.no_such_function(1)",
        "sim.add_robot(ks.CameraCfg())",
        "sim.add_sensor('x', ks.RobotCfg())",
        "arm.set_drive_type('torque')",
        "sim.property('mss', 'arm')",
        "sim.record('run.npz', ['all'])",
        "ks.SimulationManager.from_scene(True)",
        "text: str = sim.screenshot()",
    ]
    program.write_text(program.read_text() + "\n".join(mistakes) + "\n")
    result = run("mypy", "--config-file", strict, str(program))
    assert result.stdout.count(": error:") == len(mistakes), result.stdout


def test_types_of_programs_for_other_simulators(strict, tmp_path):
    """Configurations of the layers have the types of dataclasses, and handles those of this package."""
    program = tmp_path / "program.py"
    program.write_text(
        "from kinetoscope.compat.configclass import configclass\n"
        "from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg\n"
        "from kinetoscope.compat.embodichain.lab.sim.cfg import JointDrivePropertiesCfg, RobotCfg\n"
        "from kinetoscope.compat.embodichain.lab.sim.sensors import Camera, CameraCfg\n"
        "from kinetoscope.compat.isaaclab import sensors\n"
        "from kinetoscope.compat.isaaclab.app import AppLauncher\n"
        "from kinetoscope.compat.isaaclab.scene import InteractiveScene, InteractiveSceneCfg\n"
        "sim = SimulationManager(SimulationManagerCfg(num_envs=2, sim_device='cpu'))\n"
        "robot = sim.add_robot(RobotCfg(fpath='x', drive_pros=JointDrivePropertiesCfg(stiffness=1.0)))\n"
        "names: list[str] = robot.joint_names\n"
        "dof: int = robot.native.dof\n"
        "camera: Camera = sim.add_sensor(CameraCfg(width=8, extrinsics=CameraCfg.ExtrinsicsCfg(pos=(1, 2, 3))))\n"
        "@configclass\n"
        "class Cfg(InteractiveSceneCfg):\n"
        "    camera = sensors.CameraCfg(offset=sensors.CameraCfg.OffsetCfg(convention='ros'))\n"
        "scene = InteractiveScene(Cfg(num_envs=2, env_spacing=1.0))\n"
        "app = AppLauncher(headless=True).app\n"
    )
    result = run("mypy", "--config-file", strict, str(program))
    assert result.returncode == 0, result.stdout
    # Controls: each of these mistakes is found.
    mistakes = [
        "RobotCfg(fix_bsae=True)",
        "SimulationManagerCfg(num_envs='2')",
        "CameraCfg.ExtrinsicsCfg(position=(1, 2, 3))",
        "sim.add_robot(CameraCfg())",
        "sim.update(stpes=3)",
        "robot.native.qops",
        "robot.set_joint_drive(drive_type='torque')",
        "sensors.CameraCfg.OffsetCfg(convention='rso')",
        "Cfg(num_env=2)",
        "AppLauncher(3)",
        "app.running()",
        "text: str = robot.joint_names",
    ]
    program.write_text(program.read_text() + "\n".join(mistakes) + "\n")
    result = run("mypy", "--config-file", strict, str(program))
    assert result.stdout.count(": error:") == len(mistakes), result.stdout


def test_types_of_the_page_and_the_examples(strict, tmp_path):
    """The Python blocks of docs/python.md, one program, and the example scripts."""
    blocks = re.findall(r"```python\n(.*?)```", (PROJECT / "docs" / "python.md").read_text(), re.DOTALL)
    assert len(blocks) > 4
    program = tmp_path / "page.py"
    program.write_text("\n".join(["import numpy as np", "actions = np.zeros((64, 12))", *blocks]))
    for path in (program, *sorted((PROJECT / "python" / "examples").glob("*.py"))):
        result = run("mypy", "--config-file", strict, str(path))
        assert result.returncode == 0, result.stdout
    # The blocks of docs/learning.md are programs of their own.
    blocks = re.findall(r"```python\n(.*?)```", (PROJECT / "docs" / "learning.md").read_text(), re.DOTALL)
    files = [tmp_path / f"block_{number}.py" for number in range(len(blocks))]
    for file, block in zip(files, blocks, strict=True):
        file.write_text(block.replace("(weights, observations, noise):", "(weights: Any, observations: Any, noise: Any) -> Any:"))
        file.write_text("from typing import Any\n" + file.read_text())
    result = run("mypy", "--config-file", strict, *map(str, files))
    assert len(files) == 6 and result.returncode == 0, result.stdout
    # A control: a mistake in a block is found.
    program.write_text(program.read_text().replace("sim.update(500)", "sim.update('500')", 1))
    assert run("mypy", "--config-file", strict, str(program)).returncode == 1
