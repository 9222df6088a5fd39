//! MJCF files as robots, held against MuJoCo with the same file alone and against the same robot from a URDF.

mod alone;
mod bases;
mod contacts;
mod coupled_drives;
mod couplings;
mod file_drives;
mod kinematics;
mod named;
mod newer;
mod properties;
mod quadruped;
mod refused;
mod samples;
mod scene;
mod seen;
mod twin;

use crate::mjcf::empty::empty;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::Random;

/// A robot from MJCF text.
fn robot(uid: &str, text: &str) -> RobotCfg {
    RobotCfg { uid: uid.into(), mjcf: Some(MjcfFile::text(text)), ..Default::default() }
}

/// A robot that nothing drives.
fn passive(uid: &str, text: &str) -> RobotCfg {
    RobotCfg { drive: DriveCfg { drive_type: DriveType::None, ..Default::default() }, ..robot(uid, text) }
}

/// `count` rows of positions between the limits of the robot's joints, which all have some.
fn random_qpos(sim: &SimulationManager, id: RobotId, count: usize) -> Array2<f64> {
    let limits = sim.robot(id).qpos_limits();
    let mut random = Random::keyed(7, 0, "positions");
    Array2::from_shape_fn((count, sim.robot(id).dof()), |(_, joint)| {
        let (low, high) = (limits[(0, joint, 0)], limits[(0, joint, 1)]);
        low + (high - low) * random.uniform()
    })
}

/// An arm of seven axes with everything that MJCF has and URDF has not: two joints in one body, anchors off the origin,
/// positions in which the file starts, a spring, a body that is fixed to another, sites, degrees.
const ODD: &str = r#"<mujoco model="odd">
  <compiler angle="degree" autolimits="true"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="base" pos="0.1 -0.2 0.3" euler="0 0 30">
      <geom type="cylinder" size="0.08 0.05" mass="3"/>
      <body name="shoulder" pos="0 0 0.1" euler="10 0 20">
        <joint name="pan" axis="0 0 1" range="-150 150" ref="20" pos="0.01 0.02 0"/>
        <joint name="lift" axis="0 1 0" range="-100 100" pos="0 0.05 0.02" armature="0.01"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.25 0 0.05" mass="2"/>
        <site name="shoulder_site" pos="0.1 0 0.05" euler="0 30 0"/>
        <body name="fore" pos="0.25 0 0.05" euler="0 0 -15">
          <joint name="elbow" axis="0.2 1 0" range="-130 130" ref="-10" springref="5" stiffness="1.5" damping="0.2"/>
          <geom type="capsule" size="0.025" fromto="0 0 0 0.2 0 0" mass="1.2"/>
          <body name="carriage" pos="0.2 0 0">
            <joint name="rail" type="slide" axis="1 0 0.1" range="-0.05 0.15" ref="0.02"/>
            <joint name="roll" axis="1 0 0" range="-170 170" pos="0 0.01 0.02"/>
            <geom type="box" size="0.04 0.03 0.02" mass="0.6"/>
            <body name="plate" pos="0.04 0 0.01" euler="0 0 45">
              <geom type="box" size="0.01 0.02 0.005" mass="0.1"/>
              <body name="hand" pos="0.02 0 0">
                <joint name="pitch" axis="0 1 0" range="-110 110"/>
                <joint name="yaw" axis="0 0 1" range="-110 110"/>
                <geom type="ellipsoid" size="0.06 0.03 0.02" pos="0.05 0 0" mass="0.3"/>
                <site name="tip" pos="0.1 0 0.01" euler="0 90 0"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"#;

/// Joints of [`ODD`].
const ODD_JOINTS: [&str; 7] = ["pan", "lift", "elbow", "rail", "roll", "pitch", "yaw"];
