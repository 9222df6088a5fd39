"""Images of many states."""

import mujoco
import numpy as np
import pytest

import kinetoscope_render as kr


def states(model, count):
    datas = []
    for k in range(count):
        data = mujoco.MjData(model)
        data.qpos[0] = 0.3 * k
        mujoco.mj_forward(model, data)
        datas.append(data)
    return datas


def test_equals_single_images(shapes):
    """A batch has the bits of single images, for any number of threads."""
    model, _ = shapes
    datas = states(model, 5)
    expected = {}
    with kr.Renderer(model, 48, 64) as renderer:
        for name, enable in (
            ("rgb", lambda: None), ("depth", renderer.enable_depth_rendering),
            ("segmentation", renderer.enable_segmentation_rendering),
        ):
            enable()
            expected[name] = []
            for data in datas:
                renderer.update_scene(data, "front")
                expected[name].append(renderer.render())
    assert (expected["rgb"][0] != expected["rgb"][4]).any()
    for threads in (1, 3):
        with kr.BatchRenderer(model, 48, 64, threads=threads) as batch:
            found = batch.render(datas, "front", channels=("rgb", "depth", "segmentation", "normal"))
        for name, frames in expected.items():
            np.testing.assert_array_equal(found[name], np.stack(frames))
        normal = found["normal"]
        assert (normal.shape, normal.dtype) == ((5, 48, 64, 3), np.float32)
        length = np.linalg.norm(normal, axis=-1)
        hit = found["segmentation"][..., 1] >= 0
        np.testing.assert_allclose(length[hit], 1.0, atol=1e-5)
        assert (length[~hit] == 0).all()
        # The floor faces up.
        floor = (found["segmentation"] == [0, int(mujoco.mjtObj.mjOBJ_GEOM)]).all(-1)
        np.testing.assert_allclose(normal[floor], np.broadcast_to([0.0, 0.0, 1.0], (floor.sum(), 3)), atol=1e-6)


def test_more_frames_than_a_block(shapes):
    model, _ = shapes
    datas = states(model, 70)
    with kr.BatchRenderer(model, 6, 8) as batch:
        images = batch.render(datas, "front")
        last = batch.render(datas[-1:], "front")
    assert images.shape == (70, 6, 8, 3)
    np.testing.assert_array_equal(images[-1], last[0])


def test_out_and_cameras(shapes):
    model, _ = shapes
    datas = states(model, 2)
    with kr.BatchRenderer(model, 20, 30) as batch:
        rgb = np.zeros((2, 20, 30, 3), np.uint8)
        assert batch.render(datas, ["front", "side"], out=rgb) is rgb
        for k, camera in enumerate(("front", "side")):
            np.testing.assert_array_equal(rgb[k], batch.render(datas[k : k + 1], camera)[0])
        depth = np.zeros((2, 20, 30), np.float64)
        found = batch.render(datas, "front", channels=["rgb", "depth"], out={"depth": depth})
        assert found["depth"] is depth and depth.max() > 1
        assert batch.render([], "front").shape == (0, 20, 30, 3)


def test_invalid_arguments(shapes):
    model, data = shapes
    batch = kr.BatchRenderer(model, 20, 30)
    for arguments, text in (
        (dict(channels="color"), "unknown channel 'color'; the channels are 'rgb', 'depth'"),
        (dict(channels=()), "channels is empty"),
        (dict(camera=["front", "side"]), "2 cameras are given for 1 states"),
        (dict(out=np.zeros((1, 30, 20, 3), np.uint8)), r"Expected `out\['rgb'\].shape == \(1, 20, 30, 3\)`"),
        (dict(channels=["rgb"], out={"depth": np.zeros(1)}), "array of 'depth', which is not one of the channels"),
    ):
        with pytest.raises(ValueError, match=text):
            batch.render([data], **arguments)
    batch.close()
    with pytest.raises(RuntimeError, match="after close"):
        batch.render([data])
