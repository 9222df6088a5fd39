"""The interface of the renderer."""

import os
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
    """A camera 3 m above a plane that looks down sees it at a depth of 3 m everywhere; a ball of radius 0.5 at 2.5."""
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
    for keyword, text in ((dict(threads=0), "threads must be at least 1"), (dict(samples=3), "samples must be 1 or 4")):
        with pytest.raises(ValueError, match=text):
            kr.Renderer(model, 10, 10, **keyword)
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
    renderer.update_scene(data)
    renderer.scene.flags[int(mujoco.mjtRndFlag.mjRND_WIREFRAME)] = 1
    with pytest.raises(NotImplementedError, match="mjRND_WIREFRAME"):
        renderer.render()


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
