"""Rules of MuJoCo's OpenGL renderer: each image is compared with its own, and with one that breaks the rule."""

import comparison
import mujoco
import numpy as np
import pytest
from comparison import inside, psnr
from conftest import load, version

import kinetoscope_render as kr

SIZE = (120, 160)
CAMERA = '<camera name="c" pos="{pos}" xyaxes="{axes}" {more}/>'
FRONT = CAMERA.format(pos="0 -3 1.6", axes="1 0 0 0 .47 .88", more="")
BELOW = CAMERA.format(pos="0 -3 -1.4", axes="1 0 0 0 -.42 .9", more="")
WORLD = """<mujoco><statistic extent="2" center="0 0 .5"/>
  <visual><headlight ambient=".1 .1 .1" diffuse=".3 .3 .3" specular="0 0 0"/>{visual}</visual>
  <asset>{asset}</asset>
  <worldbody>{light}{camera}<geom name="floor" type="plane" size="{floor}" rgba=".6 .6 .6 1"/>
    <geom name="box" type="box" pos=".5 0 .31" size=".3 .3 .3" euler="0 0 20" {box}/>
    <geom name="ball" pos="-.5 0 .4" size=".3" rgba=".2 .5 .8 1"/>{more}</worldbody></mujoco>"""
LIGHT = '<light name="l" pos="1 -1 3" dir="-.3 .3 -1" diffuse=".6 .6 .6" specular="0 0 0" {}/>'


def world(**parts):
    """A model with a floor, a box and a ball, and its state."""
    defaults = {
        "visual": "", "asset": "", "light": LIGHT.format('castshadow="false"'), "camera": FRONT, "floor": "3 3 .1",
        "box": 'rgba=".8 .2 .1 1"', "more": "",
    }
    return load(WORLD.format(**{**defaults, **parts}))


def pair(model, data, prepare=None, camera="c"):
    """Images by MuJoCo's renderer, and by ours. `prepare` changes a scene after each update."""
    found = []
    for cls in (mujoco.Renderer, kr.Renderer):
        renderer = cls(model, *SIZE)
        if prepare is not None:
            update = renderer.update_scene

            def update_and_prepare(data, camera, update=update, renderer=renderer):
                # Twice: MuJoCo moves infinite planes below the camera of the update before.
                update(data, camera)
                update(data, camera)
                prepare(renderer.scene)

            renderer.update_scene = update_and_prepare
        found.append(comparison.images(renderer, data, camera))
        comparison.close(renderer)
    return found


def ours(model, data, prepare=None, camera="c"):
    """Our color image."""
    with kr.Renderer(model, *SIZE) as renderer:
        renderer.update_scene(data, camera)
        if prepare is not None:
            prepare(renderer.scene)
        return renderer.render()


def check(name, theirs, found, control, least):
    """Our image is `least` dB near to theirs, and at least 2 dB nearer than the one that breaks the rule."""
    good, bad = psnr(theirs, found), psnr(theirs, control)
    print(f"{name}: {good:.1f} dB, without the rule {bad:.1f} dB")
    assert good >= least and bad <= good - 2, (name, good, bad)


def orthographic(view):
    """Attributes of a camera that sees `view` meters vertically."""
    return f'projection="orthographic" fovy="{view}"' if version() >= (4, 0) else f'orthographic="true" fovy="{view}"'


def has_orthographic_cameras():
    try:
        load(f"<mujoco><worldbody><camera {orthographic(1)}/></worldbody></mujoco>")
    except ValueError:
        return False
    return True


@pytest.mark.skipif(not has_orthographic_cameras(), reason="this version has no orthographic cameras")
@pytest.mark.parametrize("floor", ["3 3 .1", "0 0 .1"], ids=["finite", "infinite"])
def test_orthographic_cameras(floor):
    """Depth, ids, culling and color of parallel rays; the mesh is culled by the direction of its triangles."""
    mesh = '<mesh name="m" vertex="0 0 0  .5 0 0  0 .5 0  0 0 .5"/>'
    parts = {
        "asset": mesh, "floor": floor, "light": LIGHT.format(""),
        "more": '<geom type="mesh" mesh="m" pos="0 -.6 .4"/><geom type="capsule" size=".1 .3" pos="0 .6 .6" euler="30 0 0"/>'
        '<geom type="cylinder" size=".2 .3" pos="-1 -.5 .3"/><geom type="ellipsoid" size=".1 .2 .3" pos="1 -.5 .3"/>',
    }
    camera = CAMERA.format(pos="0 -3 1.6", axes="1 0 0 0 .47 .88", more=orthographic(2.5))
    theirs, found = pair(*world(camera=camera, **parts))
    inner = inside(theirs.ids)
    same = (theirs.ids == found.ids).all(-1)
    assert same[inner].mean() >= 0.999
    hit = same & inner & (theirs.ids[..., 0] == 0)
    assert hit.mean() > 0.1
    # Rays through the pixels meet the floor at this depth. Before 4.0, depth of mujoco.Renderer is that of a pinhole.
    up = np.array([0, 0.47, 0.88]) / np.hypot(0.47, 0.88)
    forward = -np.cross([1, 0, 0], up)
    rows = (SIZE[0] / 2 - 0.5 - np.arange(SIZE[0])) * 2.5 / SIZE[0]
    expected = np.broadcast_to(((1.6 + rows * up[2]) / -forward[2])[:, None], SIZE)
    depths = [found.depth, theirs.depth] if version() >= (4, 0) else [found.depth]
    for depth in depths:
        assert np.median(np.abs(depth - expected)[hit] / expected[hit]) < 2e-6
    control = pair(*world(camera=FRONT.replace('c"', 'c" fovy="45"'), **parts))[1]
    check("orthographic", theirs.rgb, found.rgb, control.rgb, 30)
    assert (theirs.ids == control.ids).all(-1)[inner].mean() < 0.98


def test_ambient_light_has_shadows():
    """In its shadow, a light gives no ambient light either.

    Regression: ambient light of lights with shadows was that of lights without.
    """
    light = LIGHT.format('ambient=".4 .4 .4"')
    theirs, found = pair(*world(light=light))
    control = ours(*world(light=LIGHT.format("") + '<light castshadow="false" diffuse="0 0 0" ambient=".4 .4 .4"/>'))
    check("ambient", theirs.rgb, found.rgb, control, 33)


def test_no_shadow_map():
    """Regression: lights cast shadows although the model has `shadowsize="0"`."""
    light = LIGHT.format("")
    theirs, found = pair(*world(visual='<quality shadowsize="0"/>', light=light))
    check("shadowsize", theirs.rgb, found.rgb, ours(*world(light=light)), 36)


@pytest.mark.parametrize("kind", ["spot", "directional"])
def test_range_of_shadows(kind):
    """Shadows end at a fraction of a spot's angle, and beyond a square around a directional light."""
    more = 'cutoff="40"' if kind == "spot" else 'directional="true"'
    if kind == "directional" and version() >= (4, 0):
        more = 'type="directional"'
    visual = '<map shadowscale=".3" shadowclip=".4"/>'
    wide = '<map shadowscale="1" shadowclip="4"/>'
    light = LIGHT.format(more)
    theirs, found = pair(*world(visual=visual, light=light))
    check(kind, theirs.rgb, found.rgb, ours(*world(visual=wide, light=light)), 33)


def test_lights_above_casters():
    """A directional light casts shadows of what is below it only."""
    more = 'type="directional"' if version() >= (4, 0) else 'directional="true"'
    light = f'<light pos="0 0 .35" dir="-.3 .3 -1" diffuse=".6 .6 .6" specular="0 0 0" {more}/>'
    theirs, found = pair(*world(light=light))
    check("low light", theirs.rgb, found.rgb, ours(*world(light=light.replace("0 0 .35", "0 0 3"))), 30)


@pytest.mark.parametrize("floor", ["3 3 .1", "0 0 .1"], ids=["finite", "infinite"])
def test_planes_from_below(floor):
    """Planes are transparent from behind, and have their ids.

    Regression: finite planes were opaque, and infinite ones invisible.
    """
    theirs, found = pair(*world(camera=BELOW, floor=floor))
    assert (theirs.ids == found.ids).all(-1)[inside(theirs.ids)].mean() >= 0.999
    assert (theirs.ids[..., 0] == 0).mean() > 0.2
    control = pair(*world(camera=BELOW, floor=floor, more='<geom type="box" size="3 3 .001" rgba=".6 .6 .6 1"/>'))[1]
    check("below", theirs.rgb, found.rgb, control.rgb, 26)


@pytest.mark.parametrize("shape", ['type="box" size=".4 .3 .3"', 'type="ellipsoid" size=".4 .3 .2"'], ids=["box", "ellipsoid"])
def test_uniform_cube_textures(shape):
    """With `texuniform`, a cube texture has the size of the world, not that of the shape."""
    asset = """<texture name="t" type="cube" builtin="checker" rgb1="1 1 1" rgb2="0 0 .5" mark="edge" markrgb="1 0 0"
        width="64" height="384"/><material name="m" texture="t" {}/>"""
    geom = f'<geom {shape} pos="0 -.8 .5" material="m"/>'
    theirs, found = pair(*world(asset=asset.format('texuniform="true"'), more=geom))
    check("texuniform", theirs.rgb, found.rgb, ours(*world(asset=asset.format(""), more=geom)), 33)


@pytest.mark.parametrize("is_later", [True, False], ids=["later", "earlier"])
def test_textured_boxes_at_one_place(is_later):
    """Of two boxes at one place, the later one is visible everywhere, whether it has a texture or not.

    Regression: boxes with a texture were meshes, through which the other box shone in some pixels.
    """
    asset = """<texture name="t" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 .5" mark="edge" markrgb="1 0 0"
        width="64" height="64"/><material name="t" texture="t" texrepeat="2 1"/>"""
    place = 'type="box" size=".4 .3 .2" pos=".1 -.7 .63" euler="13 31 47"'
    painted, plain = f'<geom {place} material="t"/>', f'<geom {place} rgba=".1 .7 .2 1"/>'
    boxes = [plain, painted] if is_later else [painted, plain]
    theirs, found = pair(*world(asset=asset, more="".join(boxes)))
    assert (theirs.ids == found.ids).all(-1)[inside(theirs.ids)].mean() >= 0.999
    check("boxes", theirs.rgb, found.rgb, ours(*world(asset=asset, more="".join(boxes[::-1]))), 33)


def test_number_of_lights():
    """OpenGL draws eight lights, the headlight included."""
    spots = [
        f'<light pos="{x} {y} 1.5" dir="0 0 -1" cutoff="30" castshadow="false" diffuse=".5 .5 .5" specular="0 0 0"/>'
        for x in (-1, -0.5, 0, 0.5) for y in (-1, 0, 1)
    ]
    model, data = world(light="".join(spots))
    theirs, found = pair(model, data)
    with kr.Renderer(model, *SIZE) as renderer:
        renderer.update_scene(data, "c")
        renderer.render()
        assert any("lights after the first 8" in text for text in renderer.omitted()), renderer.omitted()
    check("lights", theirs.rgb, found.rgb, ours(*world(light="".join(spots[::-1]))), 33)


def test_transparent_geoms():
    """Transparent geoms are drawn twice, and have no shadows on them."""
    light = LIGHT.format("")
    glass = '<geom type="box" size=".8 .02 .5" pos="0 -.9 .6" rgba=".2 .9 .3 .3"/>'
    theirs, found = pair(*world(light=light, more=glass))
    control = ours(*world(light=light, more=glass.replace(" .3\"", " .1634\"")))  # drawn once: 1 - sqrt(1 - .3)
    check("glass", theirs.rgb, found.rgb, control, 31)


@pytest.mark.parametrize("angle", [12, 40])
def test_places_of_samples(angle):
    """Edges are mixed from samples at the places of OpenGL. A plate that leans to the other side, upside down, has the same
    edges, but the usual places, which are OpenGL's upside down.
    """
    plate = """<mujoco><visual><headlight active="0"/></visual><asset><material name="m" emission="1" rgba="1 1 1 1"/></asset>
      <worldbody><camera name="c" pos="0 -3 0" xyaxes="1 0 0 0 0 1"/>
        <geom type="box" size=".8 .01 .6" euler="0 {} 0" material="m"/></worldbody></mujoco>"""
    theirs, found = pair(*load(plate.format(angle)))
    control = np.flipud(ours(*load(plate.format(-angle))))
    edge = (theirs.rgb > 0) & (theirs.rgb < 255)
    assert edge.sum() > 300
    check("samples", theirs.rgb, found.rgb, control, 40)


def test_fog():
    """Fog increases linearly."""
    visual = '<map fogstart=".5" fogend="2.5"/><rgba fog=".9 .8 .7 1"/>'

    def prepare(scene):
        scene.flags[int(mujoco.mjtRndFlag.mjRND_FOG)] = 1

    theirs, found = pair(*world(visual=visual), prepare=prepare)
    other = ours(*world(visual=visual.replace("2.5", "2.7")), prepare=prepare)
    check("fog", theirs.rgb, found.rgb, other, 36)


def append(scene, kind, size, position, matrix, color):
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom, int(kind), np.array(size, float), np.array(position, float), np.array(matrix, float).ravel(),
        np.array(color, np.float32),
    )
    geom.segid, geom.objtype, geom.objid = scene.ngeom, 5, 100 + scene.ngeom
    geom.category = int(mujoco.mjtCatBit.mjCAT_DECOR)
    scene.ngeom += 1


TURNED = [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]


@pytest.mark.parametrize("kind", ["ARROW", "ARROW1", "ARROW2", "LINE", "LINEBOX"])
def test_decoration(kind):
    """Arrows, lines and edges of boxes are where MuJoCo draws them, with their ids, and cast no shadows."""
    model, data = world(light=LIGHT.format(""))
    geom_type = getattr(mujoco.mjtGeom, f"mjGEOM_{kind}", None)
    if geom_type is None:
        assert version() < (3, 0) and kind == "LINEBOX"
        return
    size = {"LINE": (4, 4, 1.2), "LINEBOX": (0.5, 0.3, 0.4)}.get(kind, (0.06, 0.06, 1.6))

    def prepare(scene):
        append(scene, geom_type, size, (-0.6, -0.9, 0.7), TURNED, (0.9, 0.8, 0.1, 1))

    (theirs, found), control = pair(model, data, prepare), ours(model, data)
    seen = [image.ids[..., 0] >= 100 for image in (theirs, found)]
    common = (seen[0] & seen[1]).sum() / (seen[0] | seen[1]).sum()
    # Lines are a few pixels wide: their borders are a large part of them.
    least = 0.6 if kind.startswith("LINE") else 0.9
    assert seen[0].sum() > 100 and common > least, (seen[0].sum(), common)
    check(kind, theirs.rgb, found.rgb, control, 27)
    with kr.Renderer(model, *SIZE) as renderer:
        renderer.update_scene(data, "c")
        prepare(renderer.scene)
        renderer.render()
        assert not renderer.omitted()


def test_markers_cast_no_shadows():
    """Decoration casts no shadow, from 3.0 on.

    Regression: they did.
    """
    model, data = world(light=LIGHT.format(""))

    def prepare(scene):
        append(scene, mujoco.mjtGeom.mjGEOM_SPHERE, (0.2, 0.2, 0.2), (0, -0.6, 1), np.eye(3), (1, 0, 1, 1))

    def with_shadow(scene):
        prepare(scene)
        scene.geoms[scene.ngeom - 1].category = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)

    if version() < (3, 0):
        theirs, found = pair(model, data, prepare)
        assert psnr(theirs.rgb, found.rgb) > 35
        return

    theirs, found = pair(model, data, prepare)
    check("marker", theirs.rgb, found.rgb, ours(model, data, with_shadow), 30)
