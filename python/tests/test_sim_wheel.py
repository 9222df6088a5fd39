"""The search for traces of the build machine in a wheel, and the requirements of the installed one."""

import importlib.metadata
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import wheel_paths

import kinetoscope as ks


def wheel(path, **contents):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return path


def test_paths_of_the_build_machine_are_found(tmp_path):
    clean = b"\0/rustc/59807616/library/core/src/option.rs\0python/sim/src/lib.rs\0https://example.org/home\0"
    assert wheel_paths.found(wheel(tmp_path / "clean.whl", a=clean), [str(tmp_path)]) == {}
    cargo = b"\0/opt/" + b".cargo/registry/src/index/pyo3-1.0.0/src/lib.rs\0"
    own = str(tmp_path).encode() + b"/sim/src/lib.rs"
    named = wheel(tmp_path / "named.whl", a=clean, b=clean + own + cargo)
    assert wheel_paths.found(named, [str(tmp_path)]) == {
        "b": sorted([own.decode(), "/opt/" + ".cargo/registry/src/index/pyo3-1.0.0/src/lib.rs"])
    }
    command = [sys.executable, Path(wheel_paths.__file__)]
    for path, code in ((tmp_path / "clean.whl", 0), (named, 1)):
        assert subprocess.run([*command, path], capture_output=True, check=False).returncode == code


def test_symbols_of_a_newer_glibc_are_found(tmp_path):
    table = b"\0libc.so.6\0GLIBC_2.2.5\0GLIBC_2.28\0hypot\0"
    old = wheel(tmp_path / "old.whl", a=table)
    new = wheel(tmp_path / "new.whl", a=table, b=table + b"GLIBC_2.34\0GLIBC_2.35\0GLIBC_2.4\0")
    assert wheel_paths.newer_symbols(old, "2.28") == {}
    assert wheel_paths.newer_symbols(new, "2.28") == {"b": ["2.34", "2.35"]}
    command = [sys.executable, Path(wheel_paths.__file__)]
    for path, glibc, code in ((old, "2.28", 0), (new, "2.28", 1), (new, "2.35", 0)):
        assert subprocess.run([*command, path, "--glibc", glibc], capture_output=True, check=False).returncode == code


def test_requirements_of_the_wheel():
    """The library that is loaded and the renderer have exactly the versions that pip installs."""
    required = importlib.metadata.requires("kinetoscope")
    assert f"mujoco-core=={ks.mujoco_version()}" in required
    assert f"kinetoscope-render=={ks.__version__}" in required
    assert importlib.metadata.version("kinetoscope-render") == ks.__version__ == importlib.metadata.version("kinetoscope")


def test_the_renderer_of_the_package_kinetoscope_render():
    """An image of a model of ``mujoco``, which is loaded from the same library: half of it is a red box."""
    import mujoco

    text = (
        '<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0"/></visual><worldbody>'
        '<geom type="box" size="1 1 1" pos="-1 0 0" rgba="1 0 0 1"/>'
        '<camera name="above" pos="0 0 4" fovy="20"/></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with ks.Renderer(model, 20, 40) as renderer:
        renderer.update_scene(data, camera="above")
        image = renderer.render()
    assert (image[:, :19, 0] > 200).all() and (image[:, 21:, 0] < 50).all() and image.shape == (20, 40, 3)
    assert {"Renderer", "BatchRenderer", "patch_mujoco"} <= set(dir(ks)) and "Renderer" in ks.__all__
    with pytest.raises(AttributeError, match="no attribute 'Rendrer'"):
        ks.Rendrer  # noqa: B018
