"""Replacement of the renderers of other libraries."""

import importlib
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from conftest import SHAPES, load

import kinetoscope_render as kr


@pytest.fixture(autouse=True)
def patched():
    original = mujoco.Renderer
    names = kr.patch_mujoco()
    assert kr.patch_mujoco() == names, "a second call changes nothing"
    yield
    kr.unpatch_mujoco()
    assert mujoco.Renderer is original
    assert mujoco.MjrContext.__module__ != "kinetoscope_render.software_context"


def test_renderer_class():
    assert mujoco.Renderer is kr.Renderer
    assert mujoco.MjrContext.__module__ == "kinetoscope_render.software_context"


def read_pixels(model, data, flags=()):
    """Color and depth by MuJoCo's rendering functions, as libraries call them."""
    context = mujoco.GLContext(80, 60)
    context.make_current()
    scene = mujoco.MjvScene(model, 100)
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = int(mujoco.mjtCamera.mjCAMERA_FIXED), 0
    con = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, con)
    # Twice: MuJoCo moves infinite planes below the camera of the update before.
    for _ in range(2):
        mujoco.mjv_updateScene(
            model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), camera, int(mujoco.mjtCatBit.mjCAT_ALL), scene
        )
    for flag in flags:
        scene.flags[int(flag)] = 1
    rect = mujoco.MjrRect(0, 0, 80, 60)
    mujoco.mjr_render(rect, scene, con)
    rgb, depth = np.zeros(3 * 80 * 60, np.uint8), np.zeros((60, 80), np.float32)
    mujoco.mjr_readPixels(rgb, depth, rect, con)
    con.free()
    context.free()
    return rgb.reshape(60, 80, 3)[::-1], depth[::-1], scene


def test_rendering_functions(shapes):
    """They give the images of the renderer, from the lowest row, with OpenGL's depth."""
    model, data = shapes
    rgb, depth, _ = read_pixels(model, data)
    with kr.Renderer(model, 60, 80) as renderer:
        renderer.update_scene(data, 0)
        np.testing.assert_array_equal(rgb, renderer.render())
        renderer.enable_depth_rendering()
        metric = renderer.render()
    near, far = (float(x * model.stat.extent) for x in (model.vis.map.znear, model.vis.map.zfar))
    # OpenGL's depth of single precision has steps of 6e-8, which are z² / near of the metric depth.
    found = near / (1 - depth.astype(np.float64) * (1 - near / far))
    hit = metric < 5
    assert hit.mean() > 0.3
    assert (np.abs(found - metric)[hit] < 1e-6 + 2e-7 * metric[hit] ** 2 / near).all()


def test_segmentation_colors(shapes):
    model, data = shapes
    flags = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)
    rgb, _, scene = read_pixels(model, data, flags)
    ids = rgb.astype(int) @ [1, 256, 65536]
    table = {scene.geoms[k].segid + 1: (scene.geoms[k].objid, scene.geoms[k].objtype) for k in range(scene.ngeom)}
    with kr.Renderer(model, 60, 80) as renderer:
        renderer.update_scene(data, 0)
        renderer.enable_segmentation_rendering()
        expected = renderer.render()
    found = np.array([[table.get(k, (-1, -1)) for k in row] for row in ids])
    np.testing.assert_array_equal(found, expected)
    # Random colors: as many as ids.
    colors = read_pixels(model, data, flags[:1])[0].reshape(-1, 3)
    assert len(np.unique(colors, axis=0)) == len(np.unique(ids))


def test_objects_from_before():
    """Contexts and renderers that exist already keep MuJoCo's own functions; renderers from between stay usable."""
    kr.unpatch_mujoco()
    model, data = load(SHAPES)
    old = mujoco.Renderer(model, 60, 80)
    old.update_scene(data, 0)
    expected = old.render().copy()
    context = mujoco.GLContext(80, 60)
    context.make_current()
    con, scene = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150), old.scene
    rect, native = mujoco.MjrRect(0, 0, 80, 60), mujoco.mjr_render
    kr.patch_mujoco()
    assert mujoco.mjr_render is not native
    np.testing.assert_array_equal(old.render(), expected)
    context.make_current()
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, con)
    rgb = np.zeros((60, 80, 3), np.uint8)
    mujoco.mjr_render(rect, scene, con)
    mujoco.mjr_readPixels(rgb, None, rect, con)
    np.testing.assert_array_equal(rgb[::-1], expected)
    con.free()
    context.free()
    ours, ours_con = mujoco.Renderer(model, 60, 80), mujoco.MjrContext(model, 1)
    assert isinstance(ours, kr.Renderer)
    kr.unpatch_mujoco()
    ours.update_scene(data, 0)
    assert ours.render().std() > 5
    # MuJoCo's own functions refuse the contexts from between.
    with pytest.raises(TypeError):
        mujoco.mjr_render(rect, scene, ours_con)


def test_uploads_have_the_names_of_mujoco(shapes):
    model, _ = shapes
    con = mujoco.MjrContext(model, 1)
    mujoco.mjr_uploadTexture(m=model, con=con, texid=0)
    mujoco.mjr_uploadMesh(m=model, con=con, meshid=0)
    mujoco.mjr_uploadHField(m=model, con=con, hfieldid=0)


def fake_dm_control(folder, monkeypatch):
    """A package with the interface of dm_control that the replacement uses."""
    package = folder / "dm_control" / "_render"
    package.mkdir(parents=True)
    (folder / "dm_control" / "__init__.py").write_text("")
    (package / "__init__.py").write_text("Renderer = 'original'")
    (package / "executor.py").write_text("class PassthroughRenderExecutor: pass")
    (package / "base.py").write_text("""class ContextBase:
    def __init__(self, width, height, executor): self.made = (width, height, executor.__name__)""")
    for name in [name for name in sys.modules if name.partition(".")[0] == "dm_control"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(folder)


def test_dm_control_when_imported(tmp_path, monkeypatch):
    """Libraries are not imported by the replacement, which takes place when the program imports them."""
    kr.unpatch_mujoco()
    fake_dm_control(tmp_path, monkeypatch)
    finders = list(sys.meta_path)
    kr.patch_mujoco()
    assert "dm_control" not in sys.modules
    render = importlib.import_module("dm_control._render")
    assert render.Renderer(3, 4).made == (3, 4, "PassthroughRenderExecutor")
    assert "dm_control._render.Renderer" in kr.patch_mujoco()
    kr.unpatch_mujoco()
    assert (render.Renderer, sys.meta_path) == ("original", finders)
    # A library that is imported already is changed at once.
    kr.patch_mujoco()
    assert render.Renderer != "original"


def test_all_or_nothing(tmp_path, monkeypatch):
    """If a library cannot be changed, nothing is."""
    kr.unpatch_mujoco()
    before = dict(vars(mujoco)), dict(sys.modules)
    fake_dm_control(tmp_path, monkeypatch)
    (tmp_path / "dm_control" / "_render" / "base.py").write_text("")
    importlib.import_module("dm_control._render")
    with pytest.raises(AttributeError, match="ContextBase"):
        kr.patch_mujoco()
    assert dict(vars(mujoco)) == before[0]
    assert sys.modules.get("mujoco.osmesa") is before[1].get("mujoco.osmesa")


def test_doctor():
    run = subprocess.run(
        [sys.executable, "-m", "kinetoscope_render", "doctor"], capture_output=True, text=True, check=False, timeout=120
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert f"mujoco      {mujoco.__version__}" in run.stdout
    assert "mujoco.Renderer" in run.stdout


def test_import_needs_no_opengl():
    """Neither the import nor a frame loads OpenGL."""
    program = """
import sys, mujoco, kinetoscope_render as kr
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = kr.Renderer(model)
renderer.update_scene(data)
renderer.render()
assert "OpenGL" not in sys.modules and "mujoco.osmesa" not in sys.modules, sorted(sys.modules)
"""
    environment = {"MUJOCO_GL": "disable", "PATH": "/usr/bin"}
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env=environment, timeout=120
    )
    assert run.returncode == 0, run.stderr
