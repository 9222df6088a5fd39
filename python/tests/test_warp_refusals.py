"""Errors of physics on a device: each names what was wrong, and what would be right."""

import importlib.metadata
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp_scenes as scenes

from kinetoscope.errors import ArgumentError, DeviceError, KinetoscopeError, UnknownNameError
from kinetoscope.warp import UnsupportedSceneError, WarpPhysics, requirements

COMMAND = "pip install --no-deps mujoco-warp==4.0.0 warp-lang==1.19.0 absl-py etils fsspec typing_extensions zipp"


# The device, versions of installed packages, and words of the error.
@pytest.mark.parametrize(("device", "installed", "words"), [
    ("gpu", {}, 'unknown device "gpu"; expected "cuda", "cuda:N" or "warp-cpu"'),
    ("cuda:", {}, 'unknown device "cuda:"'),
    ("cuda:-1", {}, 'unknown device "cuda:-1"'),
    ("cuda", {"mujoco-warp": None}, f"mujoco-warp 4.0.0, which is not installed; install it with: {COMMAND}"),
    ("warp-cpu", {"mujoco-warp": "4.0.0", "warp-lang": None}, "warp-lang 1.19.0, which is not installed"),
    ("warp-cpu", {"mujoco-warp": "4.0.0", "warp-lang": "1.19.0", "mujoco": None},
     'needs mujoco 4.0, which is not installed; install it with: pip install "mujoco-core==4.0.*"'),
    ("cuda:1", {"mujoco-warp": "4.0.0", "warp-lang": "1.15.0"}, f"warp-lang 1.19.0, but 1.15.0 is installed; install it with: {COMMAND}"),
])
def test_packages(device, installed, words, monkeypatch):
    def version(name):
        if installed.get(name) is None:
            raise importlib.metadata.PackageNotFoundError(name)
        return installed[name]

    monkeypatch.setattr(importlib.metadata, "version", version)
    if "mujoco" in installed:
        monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DeviceError) as error:
        WarpPhysics(device)
    assert words in str(error.value) and isinstance(error.value, KinetoscopeError)


def test_without_packages(tmp_path):
    """A process that finds no other package than numpy: the module can be imported, and the device says what is missing."""
    package = Path(requirements.__file__).parents[1]
    (tmp_path / "kinetoscope").mkdir()
    (tmp_path / "kinetoscope" / "__init__.py").touch()
    for source, name in ((package / "errors.py", "errors.py"), (package / "warp", "warp")):
        os.symlink(source, tmp_path / "kinetoscope" / name)
    numpy = Path(np.__file__).parents[1]
    for folder in ("numpy", "numpy.libs"):
        os.symlink(numpy / folder, tmp_path / folder)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom kinetoscope.warp import WarpPhysics\n"
        "assert 'warp' not in sys.modules and 'mujoco' not in sys.modules\n"
        "try:\n    WarpPhysics('cuda')\nexcept Exception as error:\n    print(type(error).__name__, error)\n"
    )
    # Without the packages of the environment.
    result = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, timeout=60, check=False)
    message = f"physics on a device needs mujoco-warp 4.0.0, which is not installed; install it with: {COMMAND}"
    assert result.stdout == f"DeviceError {message}\n", result.stderr


@pytest.mark.needs_warp
def test_gpus():
    """A device beyond those of the machine."""
    with pytest.raises(DeviceError, match='device "cuda:99" (needs an NVIDIA GPU|does not exist; found cuda:0).*"warp-cpu" runs the same kernels'):
        WarpPhysics("cuda:99")


ARM, BOX = scenes.arm_xml(), scenes.box_xml()
CYLINDER = '<geom type="cylinder" size="0.1 0.1" contype="2"/>'
# The scene, a change of its numbers or their text, the error and its words.
SCENES = {
    "RK4": (scenes.arm_xml(integrator="RK4"), {}, UnsupportedSceneError, "integrator RK4 .* expected Euler or implicitfast"),
    "implicit": (scenes.arm_xml(integrator="implicit"), {}, UnsupportedSceneError, "integrator IMPLICIT "),
    "PGS": (scenes.arm_xml(solver="PGS"), {}, UnsupportedSceneError, "solver PGS .* expected Newton or CG"),
    "sleep": (ARM.replace('solver="Newton"/>', 'solver="Newton"><flag sleep="enable"/></option>'), {}, UnsupportedSceneError, "sleeping"),
    "flags": (ARM.replace('solver="Newton"/>', 'solver="Newton"><flag frictionloss="disable"/></option>'), {}, UnsupportedSceneError,
              "drives need the flags constraint and frictionloss"),
    "no degree of freedom": ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", {}, UnsupportedSceneError, "no degree of freedom"),
    "warp": (ARM.replace('solver="Newton"/>', 'solver="Newton"><flag fwdinv="enable"/></option>'), {}, UnsupportedSceneError,
             "MuJoCo Warp does not support the scene: .*FWDINV"),
    "xml": ("<mujoco><worldbody><geom/></worldbody></mujoco>", {}, DeviceError, r"does not compile .*scene\.xml"),
    "version": (ARM, {"version": 2}, DeviceError, "version 2; expected 1"),
    "sizes": (ARM, {"sizes": {"nv": 11}}, DeviceError, "compiles differently in MuJoCo 4: nv is 10; expected 11"),
    "numbers": (ARM, {"model": {"body_mass": [1.0]}}, DeviceError, "compiles differently in MuJoCo 4: body_mass has 11 numbers; expected 1"),
    "array": (ARM, {"model": {"body_pos": [1.0]}}, DeviceError, '"body_pos" of the model; expected one of body_mass, '),
    "drive": (ARM, {"drives": [{"name": "d", "dof": 10, "qpos": 0, "ctrl": 0, "stiffness": 1, "damping": 1, "max_effort": None}]}, DeviceError,
              'drive "d": index 10 of dof does not exist; the model has 10'),
    "twice": (ARM, {"drives": [{"name": n, "dof": 3, "qpos": 0, "ctrl": 0, "stiffness": 1, "damping": 1, "max_effort": 1} for n in "ab"]},
              DeviceError, 'drives "a" and "b" have the same degree of freedom 3'),
    "damping": (ARM, {"damped": [[-1, 1.0]]}, DeviceError, "damping: index -1 of dof"),
    "field": (ARM, {"drives": None}, DeviceError, "have no field drives; expected timestep, "),
    "no JSON": (ARM, "nan,", DeviceError, "are not JSON: "),
    "list": (ARM, "[]", DeviceError, "have version None; expected 1"),
}


@pytest.mark.needs_warp
@pytest.mark.parametrize("name", SCENES)
def test_scenes(name, tmp_path):
    xml, change, error, words = SCENES[name]
    physics = WarpPhysics("warp-cpu")
    _, text = scenes.write_scene(tmp_path, ARM if name == "xml" else xml)
    (tmp_path / "scene.xml").write_text(xml)
    if isinstance(change, dict):
        numbers = json.loads(text) | change
        change = json.dumps({key: value for key, value in numbers.items() if value is not None})
    with pytest.raises(error, match=words):
        physics.load(str(tmp_path), change, 2)
    with pytest.raises(DeviceError, match="no scene is loaded"):
        physics.step(1)


# A call, its error and the words of it.
CALLS = [
    (("load", ".", "{}", 0), ArgumentError, "num_envs is 0; expected 1 or more"),
    (("write", "qposs", None, np.zeros((2, 10))), UnknownNameError, '"qposs" cannot be written; expected one of qpos'),
    (("write", "contacts", None, np.zeros((2, 10))), UnknownNameError, '"contacts" cannot be written'),
    (("write", "qpos", None, np.zeros((3, 10))), ArgumentError, r"qpos: got an array of shape \(3, 10\); expected \(2, "),
    (("write", "qpos", None, np.zeros(10)), ArgumentError, r"qpos: got an array of shape \(10,\)"),
    (("write", "qpos", None, np.zeros((2, 9))), ArgumentError, "qpos: got 9 numbers for each environment; expected 10"),
    (("write", "qpos", [0, 2], np.zeros((2, 10))), ArgumentError, r"environments from 0 to 1; got \[0, 2\]"),
    (("write", "qpos", [-1], np.zeros((1, 10))), ArgumentError, r"environments from 0 to 1; got \[-1\]"),
    (("write", "eq_data", None, np.zeros((2, 23))), ArgumentError, "eq_data: got 23 numbers for each environment; expected 24"),
    (("read", "effrt"), UnknownNameError, '"effrt" cannot be read; expected one of effort'),
    (("read", "contacts"), ArgumentError, '"contacts" was not captured; expected a step or solve with the capture "contacts"'),
    (("read", "cvel"), ArgumentError, 'capture "motion"'),
    (("read", "cfrc_int"), ArgumentError, 'capture "wrenches"'),
    (("step", -1), ArgumentError, "steps is -1; expected 0 or more"),
    (("step", 1, ["contact"]), UnknownNameError, '"contact" cannot be captured; expected one of contacts'),
    (("solve", ["xpos"]), UnknownNameError, '"xpos" cannot be captured; expected one of contacts, motion, wrenches'),
    (("tensor", "effort"), UnknownNameError, '"effort" cannot be shared; expected one of qpos'),
]


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    _, text = scenes.write_scene(folder, ARM)
    physics = WarpPhysics("warp-cpu")
    physics.load(str(folder), text, 2)
    return physics


@pytest.mark.needs_warp
@pytest.mark.parametrize(("arguments", "error", "words"), CALLS)
def test_calls(arguments, error, words, arm):
    """The environments keep working after an error."""
    with pytest.raises(error, match=words):
        getattr(arm, arguments[0])(*arguments[1:])
    assert json.loads(arm.step(0)) == {"diverged": [], "grown": [], "warnings": {}}
