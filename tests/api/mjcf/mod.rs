//! MJCF files as parts of a scene, held against MuJoCo with the same file alone.

mod carry_over;
mod dump;
pub(crate) mod empty;
mod frames;
mod handle;
mod meshes;
mod mujoco_sensors;
mod refused;
mod samples;
mod state;
mod twins;
mod visible;
mod wrench;

use empty::empty;
use kinetoscope::sim::mj::{self, Model};

/// A text alone, as MuJoCo compiles it.
fn alone(text: &str) -> Model {
    mj::compile(text, &[]).unwrap().into_model()
}

/// Every kind of thing that both lines know, in one small file with degrees, classes and frames at odd angles.
const MACHINE: &str = r#"<mujoco model="machine">
  <compiler angle="degree" autolimits="true"/>
  <option timestep="0.002"/>
  <default>
    <geom friction="0.7 0.01 0.0002" rgba="0.2 0.4 0.6 1"/>
    <default class="bar"><geom type="capsule" size="0.02" density="700"/></default>
  </default>
  <worldbody>
    <geom name="table" type="plane" size="2 2 0.1"/>
    <site name="hook" pos="0.1 -0.2 0.9" euler="10 20 30"/>
    <camera name="eye" pos="0 -1 1" xyaxes="1 0 0 0 0.6 0.8"/>
    <body name="base" pos="0 0 0.8" euler="0 15 40">
      <geom class="bar" fromto="0 0 0 0 0 0.1"/>
      <body name="arm" pos="0 0 0.1">
        <joint name="shoulder" axis="0 1 0.2" range="-120 100" damping="0.05" ref="10" springref="20" stiffness="0.3"/>
        <geom class="bar" fromto="0 0 0 0.3 0 0.05"/>
        <site name="elbow" pos="0.3 0 0.05" euler="5 -15 25"/>
        <body name="plate" pos="0.1 0.05 0.02" euler="30 0 0">
          <geom type="box" size="0.03 0.02 0.01" mass="0.1"/>
          <site name="plate" pos="0 0 0.01"/>
        </body>
        <body name="hand" pos="0.3 0 0.05" euler="0 0 -20">
          <joint name="wrist" type="ball" damping="0.01"/>
          <geom type="ellipsoid" size="0.05 0.03 0.02" pos="0.06 0 0" fluidshape="ellipsoid"/>
          <site name="palm" pos="0.1 0.01 0"/>
        </body>
      </body>
    </body>
    <body name="cart" pos="-0.4 0 0.3">
      <joint name="rail" type="slide" axis="1 0 0" frictionloss="0.4" armature="0.1" solreffriction="0.01 1"/>
      <geom type="cylinder" size="0.06 0.04" mass="1.5" condim="4"/>
      <site name="axle" pos="0.05 0 0.03"/>
    </body>
    <body name="ball" pos="0.5 0.3 0.3"><freejoint name="free"/><geom type="sphere" size="0.05" solref="0.01 0.9"/>
      <site name="inside" type="sphere" size="0.06"/></body>
    <body name="target" mocap="true" pos="1 1 1"/>
    <body pos="0 1 0.5"><joint name="follower" axis="0 0 1"/><geom class="bar" fromto="0 0 0 0.2 0 0"/></body>
  </worldbody>
  <contact>
    <pair geom1="table" geom2="lump" condim="3" friction="0.5 0.5 0.01 0.001 0.001"/>
    <exclude body1="base" body2="hand"/>
  </contact>
  <equality>
    <joint joint1="follower" joint2="shoulder" polycoef="0.1 0.5 0 0 0"/>
    <connect body1="cart" body2="link" anchor="0 0 0.04"/>
  </equality>
  <tendon>
    <spatial name="string" stiffness="20" damping="0.5" springlength="0.3">
      <site site="hook"/><site site="elbow"/>
    </spatial>
    <fixed name="sum"><joint joint="shoulder" coef="0.7"/><joint joint="rail" coef="-2"/></fixed>
  </tendon>
  <actuator>
    <position name="servo" joint="shoulder" kp="3" ctrlrange="-1 1"/>
    <motor name="pull" tendon="sum" gear="0.5"/>
    <general name="push" joint="rail" dyntype="filter" dynprm="0.05" gainprm="4" biastype="affine" biasprm="0 -1 -0.2"/>
  </actuator>
  <sensor>
    <accelerometer name="acc" site="palm"/><gyro name="gyro" site="palm"/><velocimeter name="vel" site="elbow"/>
    <force name="force" site="elbow"/><torque name="torque" site="elbow"/><touch name="touch" site="inside"/>
    <jointpos name="angle" joint="shoulder"/><jointvel name="speed" joint="rail"/><ballquat name="turn" joint="wrist"/>
    <tendonpos name="length" tendon="string"/><actuatorfrc name="effort" actuator="push"/>
    <framepos name="seen" objtype="site" objname="palm" reftype="site" refname="hook"/>
    <framepos name="origin" objtype="xbody" objname="world"/><framequat objtype="body" objname="hand"/><framelinacc name="lift" objtype="xbody" objname="ball"/>
    <subtreecom name="com" body="arm"/><clock name="clock" cutoff="0.1"/>
    <rangefinder name="range" site="axle"/><jointlimitpos name="limit" joint="shoulder"/>
  </sensor>
  <keyframe><key name="home" time="1"/></keyframe>
</mujoco>"#;

/// [`MACHINE`] with the bodies that its couplings name.
fn machine() -> String {
    let extra = r#"<body name="link" pos="-0.4 0 0.34"><joint axis="0 1 0" damping="0.02"/>
        <geom name="lump" class="bar" fromto="0 0 0 0.1 0 0.1"/></body></worldbody>"#;
    MACHINE.replace("</worldbody>", extra)
}
