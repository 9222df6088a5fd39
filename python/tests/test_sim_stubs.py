"""Types: the package passes mypy in strict mode, and the stub of the extension module fits it."""

import subprocess
import sys
from pathlib import Path

import pytest

import kinetoscope

PACKAGE = Path(kinetoscope.__file__).parent


def run(*command):
    return subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, timeout=500, check=False)


@pytest.fixture
def strict(tmp_path):
    """The layers for scripts of other simulators take tensors and arrays of any kind: they are not checked."""
    file = tmp_path / "mypy.ini"
    file.write_text("[mypy]\nstrict = true\n[mypy-kinetoscope.compat.*]\nignore_errors = true\n")
    return str(file)


def test_the_stub_fits_the_module():
    result = run("mypy.stubtest", "kinetoscope._sim")
    assert result.returncode == 0, result.stdout


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
    # A control: mistakes are found.
    program.write_text(program.read_text() + "arm.qops\nks.DriveCfg(stiff=1.0)\nks.CameraCfg(width='a')\n")
    result = run("mypy", "--config-file", strict, str(program))
    assert result.stdout.count(": error:") == 3, result.stdout
