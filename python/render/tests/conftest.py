"""Scenes of the tests. MuJoCo's own renderer, on OSMesa, is the reference of the images."""

import os

os.environ.setdefault("MUJOCO_GL", "osmesa")

import mujoco  # noqa: E402
import pytest  # noqa: E402

HEADER = """
  <visual><map fogstart=".5" fogend="3"/><headlight ambient=".2 .2 .2" diffuse=".4 .4 .4" specular=".1 .1 .1"/></visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1=".3 .5 .7" rgb2=".05 .05 .1" width="64" height="384"/>
    <texture name="grid" type="2d" builtin="checker" rgb1=".1 .2 .3" rgb2=".2 .3 .4" width="128" height="128"/>
    <material name="grid" texture="grid" texrepeat="2 2" texuniform="true" reflectance=".2"/>
    <texture name="cross" type="cube" builtin="flat" mark="cross" markrgb="1 1 1" rgb1=".8 .5 .3" rgb2=".8 .5 .3"
             width="33" height="198"/>
    <material name="cross" texture="cross"/>
    <material name="shiny" rgba=".2 .6 .3 1" specular="1" shininess=".7"/>
  </asset>
"""

SHAPES = f"""<mujoco>{HEADER}
  <worldbody>
    <light name="top" pos="0 -1 3" dir="0 .3 -1" diffuse=".6 .6 .6"/>
    <camera name="front" pos="0 -2.2 1.1" xyaxes="1 0 0 0 .4 .9"/>
    <camera name="side" pos="2.2 .4 .9" xyaxes="-.2 1 0 -.35 -.07 .93"/>
    <camera name="level" pos="0 -4 .6" xyaxes="1 0 0 0 -.05 1"/>
    <geom name="floor" type="plane" size="0 0 .1" material="grid"/>
    <geom name="ball" size=".2" pos="-.8 0 .2" material="shiny"/>
    <geom name="capsule" type="capsule" size=".1 .2" pos="-.35 0 .3" material="cross"/>
    <geom name="cylinder" type="cylinder" size=".13 .2" pos="0 .1 .2" rgba=".3 .3 .9 1"/>
    <geom name="box" type="box" size=".12 .15 .2" pos=".4 0 .2" euler="0 0 25" rgba=".8 .7 .2 1"/>
    <geom name="ellipsoid" type="ellipsoid" size=".1 .15 .25" pos=".8 .1 .25" material="cross"/>
    <body name="arm" pos="0 .6 .8"><joint name="hinge" axis="0 1 0"/><geom name="rod" type="capsule" size=".04"
        fromto="0 0 0 .5 0 0" rgba=".9 .2 .1 1"/><site name="tip" pos=".5 0 0" size=".06" rgba=".1 .9 .1 1"/></body>
  </worldbody></mujoco>"""

MESHES = f"""<mujoco>{HEADER.replace('</asset>', '''
    <mesh name="wedge" vertex="0 0 0  .4 0 0  0 .4 0  .4 .4 0  0 0 .3  0 .4 .3"/>
    <hfield name="hills" nrow="12" ncol="16" size="1.5 1.2 .25 .1"/></asset>''')}
  <worldbody>
    <light name="sun" directional="true" pos="0 0 3" dir=".3 .4 -1" diffuse=".6 .6 .6"/>
    <camera name="front" pos="0 -2.5 1.6" xyaxes="1 0 0 0 .55 .83"/>
    <geom name="terrain" type="hfield" hfield="hills" rgba=".5 .45 .3 1"/>
    <geom name="wedge" type="mesh" mesh="wedge" pos="-.2 -.3 .5" euler="20 30 40" rgba=".7 .3 .6 1"/>
    <geom name="glass" type="box" size=".15 .02 .15" pos=".6 -.4 .6" rgba=".3 .8 .9 .4"/>
  </worldbody></mujoco>"""

CLOTH = f"""<mujoco>{HEADER}
  <worldbody>
    <light name="top" pos="0 -1 3" dir="0 .3 -1" diffuse=".6 .6 .6"/>
    <camera name="front" pos="0 -2.2 1.1" xyaxes="1 0 0 0 .4 .9"/>
    <geom name="floor" type="plane" size="2 2 .1" material="grid"/>
    <body name="cloth"><flexcomp name="cloth" type="grid" count="8 8 1" spacing=".12 .12 .12" pos="0 0 .6" dim="2"
        radius=".01" rgba=".8 .3 .3 1" mass="1"><edge equality="true"/></flexcomp></body>
  </worldbody></mujoco>"""


def version() -> tuple[int, int]:
    """Major and minor version of MuJoCo."""
    major, minor = mujoco.__version__.split(".")[:2]
    return int(major), int(minor)


def load(xml: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model and its first state. Height fields get hills."""
    model = mujoco.MjModel.from_xml_string(xml)
    if model.nhfield:
        rows, columns = int(model.hfield_nrow[0]), int(model.hfield_ncol[0])
        hills = [((3 * r * r + 5 * c + r * c) % 17) / 16 for r in range(rows) for c in range(columns)]
        model.hfield_data[:] = hills
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture(name="shapes")
def shapes_fixture() -> tuple[mujoco.MjModel, mujoco.MjData]:
    return load(SHAPES)
