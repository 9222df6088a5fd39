"""The interface of the renderer."""

import copy
import os
import subprocess
import sys
import threading
import time

import mujoco
import numpy as np
import pytest
from conftest import SHAPES, load

import kinetoscope_render as kr


def test_shapes_and_types(shapes):
    model, data = shapes
    with kr.Renderer(model, 40, 60) as renderer:
        renderer.update_scene(data)
        assert (renderer.height, renderer.width, renderer.model) == (40, 60, model)
        rgb = renderer.render()
        assert (rgb.shape, rgb.dtype) == ((40, 60, 3), np.uint8)
        renderer.enable_depth_rendering()
        depth = renderer.render()
        assert (depth.shape, depth.dtype) == ((40, 60), np.float32)
        renderer.enable_segmentation_rendering()
        ids = renderer.render()
        assert (ids.shape, ids.dtype) == ((40, 60, 2), np.int32)
        renderer.disable_segmentation_rendering()
        np.testing.assert_array_equal(renderer.render(), rgb)


def test_depth_of_a_plane():
    """A camera that looks down from 3 m sees a plane at a depth of 3 m, and a ball of radius 0.5 at 2.5 m."""
    model, data = load("""<mujoco><worldbody><camera name="down" pos="0 0 3"/><geom type="plane" size="9 9 .1"/>
        <geom size=".5" pos="0 0 0"/></worldbody></mujoco>""")
    with kr.Renderer(model, 61, 61) as renderer:
        renderer.enable_depth_rendering()
        renderer.update_scene(data, "down")
        depth = renderer.render()
    np.testing.assert_allclose(depth[0], 3.0, rtol=1e-6)
    np.testing.assert_allclose(depth[30, 30], 2.5, rtol=1e-6)


def test_background_is_the_far_plane():
    model, data = load("<mujoco><worldbody><camera name='up' pos='0 0 3' zaxis='0 0 -1'/><geom size='.1'/></worldbody></mujoco>")
    with kr.Renderer(model, 8, 8) as renderer:
        renderer.enable_depth_rendering()
        renderer.update_scene(data, "up")
        assert np.unique(renderer.render()) == np.float32(model.vis.map.zfar * model.stat.extent)
        renderer.enable_segmentation_rendering()
        assert (renderer.render() == -1).all()


def test_out(shapes):
    """`out` is filled and returned, also if its type or memory layout differ."""
    model, data = shapes
    with kr.Renderer(model, 20, 30) as renderer:
        renderer.update_scene(data)
        expected = renderer.render()
        for out in (np.zeros((20, 30, 3), np.uint8), np.zeros((20, 30, 3), np.float64), np.zeros((20, 30, 6), np.uint8)[..., ::2]):
            assert renderer.render(out=out) is out
            np.testing.assert_array_equal(out, expected)
        read_only = np.zeros((20, 30, 3), np.uint8)
        read_only.flags.writeable = False
        for wrong, error in ((np.zeros((30, 20, 3), np.uint8), ValueError), (read_only, ValueError), ([1, 2], TypeError)):
            with pytest.raises(error):
                renderer.render(out=wrong)


def test_cameras(shapes):
    model, data = shapes
    free = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, free)
    with kr.Renderer(model, 20, 30) as renderer:
        images = []
        for camera in ("side", 1, np.int64(1), -1, free):
            renderer.update_scene(data, camera)
            images.append(renderer.render())
        for a, b in ((0, 1), (1, 2), (3, 4)):
            np.testing.assert_array_equal(images[a], images[b])
        assert (images[0] != images[3]).any()


def test_invalid_arguments(shapes):
    model, data = shapes
    for arguments, error, text in (
        ((model, 0, 10), ValueError, "height must be between 1 and 8192 pixels, not 0"),
        ((model, 10, 9000), ValueError, "width must be between 1 and 8192 pixels, not 9000"),
        ((model, 10, 1.5), TypeError, "width must be an integer, not float"),
        ((model, 10, 10, 0), ValueError, "max_geom must be at least 1"),
        (("model.xml", 10, 10), TypeError, "model must be a mujoco.MjModel, not str"),
    ):
        with pytest.raises(error, match=text):
            kr.Renderer(*arguments)
    for keyword, text in (
        (dict(threads=0), "threads must be between 1 and 1024, not 0"),
        (dict(threads=10**9), "threads must be between 1 and 1024, not 1000000000"),
        (dict(threads=10**18), "threads must be between 1 and 1024"),
        (dict(samples=3), "samples must be 1 or 4"),
    ):
        with pytest.raises(ValueError, match=text):
            kr.Renderer(model, 10, 10, **keyword)
    with pytest.raises(TypeError, match="threads must be an integer, not str"):
        kr.Renderer(model, 10, 10, threads="4")
    renderer = kr.Renderer(model, 10, 10)
    small, other = load("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    del small
    for arguments, error, text in (
        ((data, "frnt"), ValueError, "\"frnt\" does not exist. Candidates: 'front'"),
        ((data, 3), ValueError, r"The camera id 3 is out of range \[-1, 3\)"),
        ((data, -2), ValueError, "The camera id -2"),
        ((data, 1.0), TypeError, "camera must be a name, an id"),
        ((other,), ValueError, "data belongs to another model: qpos has 0 rows"),
        ((model,), TypeError, "data must be a mujoco.MjData"),
    ):
        with pytest.raises(error, match=text):
            renderer.update_scene(*arguments)
    for kind, field in (("mjCAMERA_FIXED", "fixedcamid"), ("mjCAMERA_TRACKING", "trackbodyid")):
        camera = mujoco.MjvCamera()
        camera.type = int(getattr(mujoco.mjtCamera, kind))
        setattr(camera, field, 50)
        with pytest.raises(ValueError, match=f"camera.{field} = 50 is out of range"):
            renderer.update_scene(data, camera)


def test_states_of_other_models():
    """A state of a model with fewer lights, tendons or joints has shorter arrays than the visualizer reads."""
    xml = """<mujoco><worldbody>{}<body>{}<geom size=".1"/><site name="s"/></body><body pos="1 0 0"><geom size=".1"/>
        <site name="t"/></body></worldbody>{}</mujoco>"""
    light, joint = "<light/>", "<joint type='slide'/>"
    tendon = "<tendon><spatial><site site='s'/><site site='t'/></spatial></tendon>"
    plain = load(xml.format("", "", ""))[1]
    for full in ((60 * light, "", ""), ("", joint, ""), ("", "", tendon)):
        model, data = load(xml.format(*full))
        with kr.Renderer(model, 10, 10) as renderer:
            renderer.update_scene(data)
            with pytest.raises(ValueError, match="data belongs to another model"):
                renderer.update_scene(plain)
            # A model of the same description, and a copy of the state, are the same.
            renderer.update_scene(load(xml.format(*full))[1])
            renderer.update_scene(copy.copy(data))


def test_poses_that_are_not_rigid(shapes):
    """A geom with such a pose is left out by name; the rest of the scene is rendered."""
    model, data = shapes
    with kr.Renderer(model, 30, 40) as renderer:
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, "front")
        expected = renderer.render()
        scene = renderer.scene
        for matrix in (2 * np.eye(3), np.zeros((3, 3)), np.full((3, 3), np.nan)):
            renderer.update_scene(data, "front")
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(
                geom, int(mujoco.mjtGeom.mjGEOM_BOX), np.full(3, 0.2), np.array([0, 0, 1.0]), np.eye(3).ravel(),
                np.ones(4, np.float32),
            )
            geom.mat[:], geom.segid = matrix, scene.ngeom
            scene.ngeom += 1
            np.testing.assert_array_equal(renderer.render(), expected)
        assert any("a pose is not a rotation" in text for text in renderer.omitted()), renderer.omitted()


def test_one_thread_at_a_time(shapes):
    """A second thread is refused while the first one renders."""
    model, data = shapes
    renderer = kr.Renderer(model, 1500, 2000, threads=1)
    renderer.update_scene(data, "front")
    thread = threading.Thread(target=renderer.render)
    thread.start()
    messages = []
    while thread.is_alive():
        for call in (renderer.render, lambda: renderer.update_scene(data, "front")):
            try:
                if renderer._capture._lock.locked():
                    call()
            except RuntimeError as error:
                messages.append(str(error))
        time.sleep(0.005)
    thread.join()
    assert messages and set(messages) == {"another thread uses this renderer; each thread needs a renderer of its own"}
    renderer.update_scene(data, "front")


MEMORY = """
import resource, sys
import mujoco, numpy as np
import kinetoscope_render as kr
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
small = kr.BatchRenderer(model, 16, 16, threads=1, samples=1)
small.render([data])
def used():
    return int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
# The images of 64 frames, 3 bytes per pixel, and little more: not their copies in RGBA.
count, side = 64, 512
out = np.zeros((count, side, side, 3), np.uint8)
batch = kr.BatchRenderer(model, side, side, threads=1, samples=1)
batch.render([data], out=out[:1])
before = used()
resource.setrlimit(resource.RLIMIT_AS, (before + (48 << 20) + (64 << 20) * int(sys.argv[1]), -1))
try:
    batch.render([data] * count, out=out)
    print("rendered")
except MemoryError as error:
    print("MemoryError:", error)
"""


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="needs Linux")
def test_memory():
    """Scratch memory is limited, whatever the number of frames; without it, MemoryError."""
    for blocks, expected in ((1, "rendered"), (0, "MemoryError: no memory for images of 64 MiB")):
        run = subprocess.run(
            [sys.executable, "-c", MEMORY, str(blocks)], capture_output=True, text=True, check=False, timeout=120
        )
        assert (run.returncode, run.stdout.strip()) == (0, expected), run.stderr


FORK = """
import os, sys, mujoco, kinetoscope_render as kr
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
closed, dropped, reloaded, kept = [kr.Renderer(model, 300, 400, threads=3) for _ in range(4)]
for renderer in (closed, dropped, reloaded, kept):
    renderer.update_scene(data)
    renderer.render()
child = os.fork()
if child == 0:
    closed.close()
    del dropped
    reloaded._capture.reload(model)
    sys.exit(0)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_end_of_forked_process():
    """A forked process closes, frees and reloads renderers of its parent, and ends, without a word."""
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FORK], capture_output=True, text=True, check=False, timeout=60
    )
    assert (run.returncode, run.stderr) == (0, "")


def test_closed(shapes):
    renderer = kr.Renderer(shapes[0], 10, 10)
    renderer.update_scene(shapes[1])
    renderer.close()
    renderer.close()
    with pytest.raises(RuntimeError, match="render cannot be called after close"):
        renderer.render()


def test_invalid_camera_frustum(shapes):
    """A camera whose axes are parallel is an error, not a crash."""
    with kr.Renderer(shapes[0], 10, 10) as renderer:
        renderer.update_scene(shapes[1])
        for camera in renderer.scene.camera:
            camera.up[:] = camera.forward
        with pytest.raises(ValueError, match="no valid frustum or axes"):
            renderer.render()


def test_threads_do_not_change_bits(shapes):
    images = []
    for threads in (1, 3):
        with kr.Renderer(shapes[0], 200, 300, threads=threads) as renderer:
            renderer.update_scene(shapes[1], "front")
            images.append(renderer.render())
    np.testing.assert_array_equal(*images)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_fork(shapes):
    """A forked process has none of the parent's threads, and renders nevertheless."""
    renderer = kr.Renderer(shapes[0], 300, 400, threads=3)
    renderer.update_scene(shapes[1], "front")
    expected = renderer.render()
    child = os.fork()
    if child == 0:
        os._exit(0 if (renderer.render() == expected).all() else 1)
    limit = time.monotonic() + 20
    while time.monotonic() < limit:
        finished, status = os.waitpid(child, os.WNOHANG)
        if finished:
            break
        time.sleep(0.02)
    else:
        os.kill(child, 9)
        os.waitpid(child, 0)
        pytest.fail("the child process hangs")
    assert status == 0


def test_gil_is_released():
    """Another thread runs while a large image is rendered."""
    model, data = load(SHAPES)
    renderer = kr.Renderer(model, 1500, 2000, threads=1)
    renderer.update_scene(data, "front")
    renderer.render()
    ticks: list[float] = []
    done = threading.Event()

    def count():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    renderer.render()
    end = time.perf_counter()
    done.set()
    thread.join()
    during = sum(start < tick < end for tick in ticks)
    assert during > 5, f"{during} steps of the other thread in {end - start:.2f} s"
