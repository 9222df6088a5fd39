"""Flags of scenes, and stereo: each image is compared with that of MuJoCo's renderer, and with one without the flag."""

import comparison
import mujoco
import numpy as np
import pytest
from comparison import inside, psnr
from conftest import MESHES, SHAPES, load, version
from test_rules import LIGHT, SIZE, check, ours, pair, world

import kinetoscope_render as kr

FLAGS = mujoco.mjtRndFlag


def with_flags(**values):
    """Sets flags of a scene."""

    def prepare(scene):
        for name, value in values.items():
            scene.flags[int(getattr(FLAGS, f"mjRND_{name}"))] = value

    return prepare


@pytest.mark.parametrize("name", ["shapes", "meshes", "round"])
def test_wireframe(name):
    """The edges of polygons are where OpenGL draws them, in their light; depth and segmentation stay filled."""
    more = '<geom type="capsule" size=".15 .3" pos="0 .4 .6" euler="30 20 0"/><geom type="cylinder" size=".2 .2" pos="1 -.5 .3"/>'
    more += '<geom type="ellipsoid" size=".1 .2 .3" pos="-1.2 -.5 .4"/>'
    model, data = {
        "shapes": lambda: load(SHAPES), "meshes": lambda: load(MESHES), "round": lambda: world(floor="2 1.5 .2", more=more),
    }[name]()
    camera = 0
    prepare = with_flags(WIREFRAME=1, SHADOW=0)
    theirs, found = pair(model, data, prepare, camera)
    check(name, theirs.plain, found.plain, ours(model, data, with_flags(SHADOW=0, REFLECTION=0), camera), 24)
    filled = pair(model, data, with_flags(SHADOW=0), camera)[1]
    np.testing.assert_array_equal(found.depth, filled.depth)
    np.testing.assert_array_equal(found.ids, filled.ids)


def test_wireframe_from_below():
    """Edges of a plane are transparent from behind, and are drawn although the plane faces away."""
    model, data = world(camera='<camera name="c" pos="0 -3 -1.4" xyaxes="1 0 0 0 -.42 .9"/>', floor="2 2 .2")
    theirs, found = pair(model, data, with_flags(WIREFRAME=1, SHADOW=0))
    check("below", theirs.plain, found.plain, ours(model, data, with_flags(SHADOW=0, REFLECTION=0)), 24)


def test_wireframe_and_back():
    """After a wireframe, images are as before."""
    model, data = load(SHAPES)
    with kr.Renderer(model, *SIZE) as renderer:
        renderer.update_scene(data, 0)
        before = renderer.render()
        with_flags(WIREFRAME=1)(renderer.scene)
        assert psnr(before, renderer.render()) < 25
        with_flags(WIREFRAME=0)(renderer.scene)
        np.testing.assert_array_equal(renderer.render(), before)


def test_additive_blending():
    """The color of transparent geoms is added once, instead of blended twice."""
    glass = '<geom type="box" size=".8 .02 .5" pos="{} {} .6" rgba=".2 .9 .3 .3"/>'
    model, data = world(light=LIGHT.format(""), more=glass.format(0, -0.9) + glass.format(0.4, -1.2))
    theirs, found = pair(model, data, with_flags(ADDITIVE=1))
    check("additive", theirs.rgb, found.rgb, ours(model, data), 31)


@pytest.mark.parametrize("culled", [0, 1])
@pytest.mark.parametrize("shape", ['type="box" size=".9 .9 .9"', 'size=".9"', 'type="mesh" mesh="m"'], ids=["box", "ball", "mesh"])
def test_culled_backs(shape, culled):
    """A camera inside of a solid looks through it, unless backs are visible.

    Regression: backs were always visible.
    """
    mesh = '<mesh name="m" vertex="-1 -1 -.5  3 -1 -.5  -1 3 -.5  0 0 3"/>'
    camera = '<camera name="c" pos="0 -2 1.2" xyaxes="1 0 0 0 .3 .95"/>'
    geom = f'<geom {shape} pos="0 -2 1.2" rgba=".9 .6 .1 1"/>'
    model, data = world(asset=mesh, camera=camera, more=geom)
    theirs, found = pair(model, data, with_flags(CULL_FACE=culled, SHADOW=0))
    control = ours(model, data, with_flags(CULL_FACE=1 - culled, SHADOW=0))
    check("culled", theirs.rgb, found.rgb, control, 30)
    assert (theirs.ids == found.ids).all(-1)[inside(theirs.ids)].mean() >= 0.999


@pytest.mark.parametrize("names", [("SEGMENT",), ("SEGMENT", "IDCOLOR"), ("IDCOLOR",)], ids="-".join)
def test_segmentation_as_colors(names):
    """Colors of segmentation ids, random ones and those that contain the id. Without segmentation, ids change nothing."""
    model, data = load(SHAPES)
    theirs, found = pair(model, data, with_flags(**{name: 1 for name in names}), 0)
    if names == ("IDCOLOR",):
        np.testing.assert_array_equal(found.rgb, ours(model, data, camera=0))
        assert psnr(theirs.rgb, found.rgb) > 30
        return
    inner = inside(theirs.ids)
    same = (np.abs(theirs.rgb.astype(int) - found.rgb) <= 1).all(-1)
    assert same[inner].mean() >= 0.999 and len(np.unique(found.rgb.reshape(-1, 3), axis=0)) > 6
    assert psnr(ours(model, data, camera=0), found.rgb) < 20


@pytest.mark.skipif(not hasattr(FLAGS, "mjRND_DEPTH"), reason="this version has no such flag")
def test_depth_as_colors():
    """Depth as gray. MuJoCo's renderer cannot read the depth of images with several samples."""
    visual = '<visual><quality offsamples="0"/><map znear=".3"'
    model, data = load(SHAPES.replace("<visual><map", visual))
    images = []
    for cls in (mujoco.Renderer, kr.Renderer):
        with cls(model, *SIZE) as renderer:
            renderer.update_scene(data, 0)
            with_flags(DEPTH=1)(renderer.scene)
            images.append(renderer.render())
    theirs, found = images
    inner = inside(pair(model, data, camera=0)[0].ids)
    off = np.abs(theirs.astype(int) - found).max(-1)
    assert (off[inner] <= 1).mean() >= 0.999, off[inner].max()
    assert found.max() > 50 and (found[..., 0] == found[..., 2]).all()


@pytest.mark.parametrize("width", [160, 161])
def test_stereo(width):
    """Two cameras side by side, in all channels. An odd width leaves a column of background."""
    model, data = load(SHAPES)
    images = []
    for cls in (mujoco.Renderer, kr.Renderer):
        renderer = cls(model, 120, width)
        update = renderer.update_scene

        def update_and_prepare(data, camera, update=update, renderer=renderer):
            update(data, camera)
            renderer.scene.stereo = int(mujoco.mjtStereo.mjSTEREO_SIDEBYSIDE)
            # Farther apart than eyes.
            renderer.scene.camera[1].pos[0] += 0.3

        renderer.update_scene = update_and_prepare
        images.append(comparison.images(renderer, data, 0))
        comparison.close(renderer)
    theirs, found = images
    inner = inside(theirs.ids)
    assert (theirs.ids == found.ids).all(-1)[inner].mean() >= 0.998
    hit = inner & (theirs.ids[..., 0] >= 0)
    off = np.abs(theirs.depth - found.depth)[hit] / theirs.depth[hit]
    assert np.median(off) < (1e-5 if version() >= (3, 0) else 1e-2)
    assert psnr(theirs.rgb, found.rgb) > 30
    half = width // 2
    assert psnr(found.rgb[:, :half], found.rgb[:, half : 2 * half]) < 25
    if width % 2:
        assert (found.rgb[:, -1] == 0).all() and (found.ids[:, -1] == -1).all()
        assert (found.depth[:, -1] == np.float32(model.vis.map.zfar * model.stat.extent)).all()


def test_stereo_of_a_batch():
    """Images of a batch are those of single images."""
    model, data = load(SHAPES)
    with kr.BatchRenderer(model, 30, 41) as batch, kr.Renderer(model, 30, 41) as renderer:
        for scene in (batch.scene, renderer.scene):
            scene.stereo = int(mujoco.mjtStereo.mjSTEREO_SIDEBYSIDE)
        found = batch.render([data, data], camera=[0, 1], channels=("rgb", "depth"))
        for k in (0, 1):
            renderer.update_scene(data, k)
            np.testing.assert_array_equal(found["rgb"][k], renderer.render())
