"""Types: the stub of the extension module fits it, and the package passes mypy in strict mode."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kinetoscope_render

PACKAGE = Path(kinetoscope_render.__file__).parent


def run(*command):
    return subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, timeout=500, check=False)


@pytest.fixture(name="strict")
def strict_fixture(tmp_path):
    """Settings of mypy. Types of mujoco differ between its versions: they are not checked."""
    file = tmp_path / "mypy.ini"
    file.write_text(
        f"[mypy]\nstrict = true\ncache_dir = {tmp_path / 'cache'}\nwarn_unused_ignores = false\n"
        "[mypy-mujoco.*]\nfollow_imports = skip\nignore_missing_imports = true\n"
    )
    return str(file)


def test_the_stub_fits_the_module(strict):
    result = run("mypy.stubtest", "--mypy-config-file", strict, "kinetoscope_render._render")
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.skipif(np.__version__.startswith("1."), reason="in the types of NumPy 1, arrays need type arguments")
def test_strict_types(strict):
    result = run("mypy", "--config-file", strict, "-p", PACKAGE.name)
    assert result.returncode == 0, result.stdout + result.stderr


def test_types_of_a_program(strict, tmp_path):
    """A program that uses the package as documented has no errors, and mistakes are found."""
    program = tmp_path / "program.py"
    program.write_text(
        "import mujoco\nimport kinetoscope_render as kr\n"
        "model = mujoco.MjModel.from_xml_string('<mujoco/>')\n"
        "with kr.Renderer(model, 48, 64, threads=2) as renderer:\n"
        "    renderer.update_scene(mujoco.MjData(model), camera='side')\n"
        "    height: int = renderer.render().shape[0]\n"
        "    names: list[str] = renderer.omitted()\n"
    )
    result = run("mypy", "--config-file", strict, str(program))
    assert result.returncode == 0, result.stdout + result.stderr
    program.write_text(program.read_text() + "renderer.rendr()\nkr.Renderer(model, width='64')\nkr.BatchRenderer()\nkr.Rendrer\n")
    result = run("mypy", "--config-file", strict, str(program))
    assert result.stdout.count(": error:") == 4, result.stdout
