"""Kernels of a step, compiled for a GPU on a machine without one."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import warp_scenes as scenes

import kinetoscope.warp

pytestmark = pytest.mark.needs_warp

# Compiles the modules that the CPU device has loaded, for compute capability 9.0.
COMPILE = """
import sys
import warp as wp
from pathlib import Path
from warp._src.context import user_modules
from kinetoscope.warp import WarpPhysics

folder = Path(sys.argv[1])
physics = WarpPhysics("warp-cpu")
physics.load(str(folder), (folder / "scene.json").read_text(), 2)
physics.step(1, ["contacts", "motion", "wrenches"])
physics.write("body_pos", [0], [physics._worlds.model.body_pos.numpy()[0].ravel()])
physics.write("eq_active", [0], [[1.0, 1.0]])
physics.solve(["contacts"])
for module in [module for module in user_modules.values() if module.execs]:
    (path,) = wp.compile_aot_module(module, arch=90, module_dir=folder / "ptx", use_ptx=True)
    print(path)
"""


def test_modules_compile_to_ptx(tmp_path):
    _, text = scenes.write_scene(tmp_path, scenes.arm_xml())
    (tmp_path / "scene.json").write_text(text)
    result = subprocess.run([sys.executable, "-c", COMPILE, str(tmp_path)], capture_output=True, text=True, timeout=500, check=False)
    assert result.returncode == 0, result.stderr
    paths = [Path(line) for line in result.stdout.splitlines() if line.endswith(".ptx")]
    # Modules of mujoco_warp, and the one of this package.
    assert len(paths) > 30
    texts = {path.name: path.read_text() for path in paths}
    assert all(".target sm_90" in content for content in texts.values())
    (own,) = [content for name, content in texts.items() if "kinetoscope.warp.kernels" in name]
    entries = set(re.findall(r"\.entry (\w+?)_[0-9a-f]{8}_cuda_kernel_forward", own))
    source = Path(kinetoscope.warp.__file__).with_name("kernels.py").read_text()
    assert entries == set(re.findall(r"@wp\.kernel\(.*\)\ndef (\w+)\(", source))
