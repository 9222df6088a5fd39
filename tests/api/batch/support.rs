//! Robots of these tests, and the bits that decide how an environment goes on.

use kinetoscope::prelude::*;
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::drive::table::DriveTable;
use kinetoscope::sim::env::Env;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

/// A configuration with fixed threads.
pub(crate) fn cfg(num_envs: usize, threads: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, threads: Some(threads), ..Default::default() }
}

/// Writes a URDF and returns the configuration of its robot, with a base that moves.
pub(crate) fn free_robot(dir: &Path, uid: &str, urdf: &str, height: f64) -> RobotCfg {
    let path = dir.join(format!("{uid}.urdf"));
    std::fs::write(&path, urdf).unwrap();
    RobotCfg {
        uid: uid.into(),
        urdf: UrdfCfg::single(path),
        fix_base: false,
        init_pose: kinetoscope::scene::pose::from_xyz_rpy([1.0, 1.0, height], [0.3, 0.2, 0.1]),
        ..Default::default()
    }
}

/// A box on two driven legs with feet.
pub(crate) fn walker() -> String {
    let mut urdf = String::from(
        r#"<robot name="walker">
  <link name="trunk">
    <inertial><mass value="4"/><inertia ixx="0.03" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.06"/></inertial>
    <collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>
  </link>
"#,
    );
    for (name, y) in [("left", 0.12), ("right", -0.12)] {
        let _ = write!(
            urdf,
            r#"  <joint name="{name}_hip" type="revolute">
    <parent link="trunk"/><child link="{name}_leg"/><origin xyz="0 {y} -0.05"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="40" velocity="10"/><dynamics damping="0.1" friction="0.05"/>
  </joint>
  <link name="{name}_leg">
    <inertial><origin xyz="0 0 -0.1"/><mass value="0.6"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.0004"/></inertial>
    <collision><origin xyz="0 0 -0.1"/><geometry><cylinder radius="0.02" length="0.2"/></geometry></collision>
    <collision><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
"#
        );
    }
    urdf + "</robot>\n"
}

/// A plate with `n` times `n` spheres below it, and `arms` driven arms with a sphere each.
pub(crate) fn plate(n: usize, arms: usize) -> String {
    let mut urdf = String::from(
        r#"<robot name="plate">
  <link name="plate">
    <inertial><mass value="3"/><inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.09"/></inertial>
"#,
    );
    let at = |i: usize| (i as f64 - (n - 1) as f64 / 2.0) * 0.05;
    for i in 0..n {
        for j in 0..n {
            let (x, y) = (at(i), at(j));
            let _ = writeln!(
                urdf,
                r#"    <collision><origin xyz="{x} {y} 0"/><geometry><sphere radius="0.02"/></geometry></collision>"#
            );
        }
    }
    urdf += "  </link>\n";
    for k in 0..arms {
        let _ = write!(
            urdf,
            r#"  <joint name="arm{k}" type="revolute">
    <parent link="plate"/><child link="arm{k}"/><origin xyz="0 0 0.1" rpy="0 0 {k}"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="20" velocity="10"/>
  </joint>
  <link name="arm{k}">
    <inertial><origin xyz="0.2 0 0"/><mass value="0.3"/>
      <inertia ixx="0.0005" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.003"/></inertial>
    <collision><origin xyz="0.4 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
"#
        );
    }
    urdf + "</robot>\n"
}

/// A single free ball.
pub(crate) fn ball() -> String {
    r#"<robot name="ball"><link name="ball">
  <inertial><mass value="0.5"/><inertia ixx="0.0008" ixy="0" ixz="0" iyy="0.0008" iyz="0" izz="0.0008"/></inertial>
  <collision><geometry><sphere radius="0.06"/></geometry></collision>
</link></robot>
"#
    .into()
}

/// A wheel on a fixed post: a continuous joint, which `write_qpos` does not clamp.
pub(crate) fn wheel(dir: &Path) -> RobotCfg {
    let urdf = r#"<robot name="wheel">
  <link name="post"/>
  <joint name="spin" type="continuous"><parent link="post"/><child link="disc"/><axis xyz="0 1 0"/></joint>
  <link name="disc">
    <inertial><origin xyz="0.1 0 0"/><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  </link>
</robot>
"#;
    let robot = free_robot(dir, "wheel", urdf, 1.0);
    RobotCfg { fix_base: true, init_qpos: vec![("spin".into(), 0.7)], ..robot }
}

/// The bundled arm with the bundled hand.
pub(crate) fn arm_and_hand() -> RobotCfg {
    RobotCfg {
        uid: "sr5".into(),
        urdf: UrdfCfg {
            components: vec![
                ComponentCfg::new("arm", assets::path("sr5/SR5.urdf").unwrap()),
                ComponentCfg::new("hand", assets::path("revo1_left/revo1_left.urdf").unwrap()),
            ],
            ..Default::default()
        },
        ..Default::default()
    }
}

/// Bits of everything that decides the next step, of the efforts, and the number of contacts.
pub(crate) fn bits_of(env: &Env) -> Vec<u64> {
    let data = env.data();
    [&[data.time()], data.qpos(), data.qvel(), data.qacc_warmstart(), &env.drives.position, &env.drives.effort]
        .into_iter()
        .flatten()
        .map(|x| x.to_bits())
        .chain([data.contact().len() as u64])
        .collect()
}

/// The bits of each environment.
pub(crate) fn all_bits(batch: &Batch) -> Vec<Vec<u64>> {
    let mut bits = Vec::new();
    batch.for_each(|_, env| bits.push(bits_of(env)));
    bits
}

/// The largest number of contacts of any environment.
pub(crate) fn most_contacts(batch: &Batch) -> usize {
    let mut most = 0;
    batch.for_each(|_, env| most = most.max(env.data().contact().len()));
    most
}

/// The drives of a manager's model.
pub(crate) fn drives(sim: &SimulationManager) -> Arc<DriveTable> {
    sim.batch().read(0, |env| Arc::clone(env.drives.table()))
}

/// An environment of `model` in the state and with the targets of `other`.
pub(crate) fn copy_of(model: &kinetoscope::sim::mj::Model, other: &Env) -> Env {
    let mut env = Env::new(model, other.drives.table()).unwrap();
    env.reset(|data, drives| {
        data.qpos_mut().copy_from_slice(other.data().qpos());
        data.qvel_mut().copy_from_slice(other.data().qvel());
        drives.position.copy_from_slice(&other.drives.position);
    });
    env
}
