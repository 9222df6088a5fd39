//! A world with every kind of state: saturated drives, contacts, raw quaternions, activations and mocap bodies.

use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::env::SimEnv;
use kinetoscope::sim::{MjcfId, RigidObjectId};
use kinetoscope_testkit::bits::bits;
pub(crate) use kinetoscope_testkit::worlds::cfg;

pub(crate) fn arm() -> RobotCfg {
    kinetoscope_testkit::worlds::sr5("arm")
}

pub(crate) fn cube(uid: &str, mass: f64, at: [f64; 3]) -> RigidObjectCfg {
    kinetoscope_testkit::worlds::cube(uid, 0.1, mass, at)
}

/// A pendulum with a filtered motor, which has an activation, and a mocap hand.
const MACHINE: &str = r#"<mujoco><worldbody>
    <body name="hand" mocap="true" pos="0 2 0.5"><geom size="0.05" contype="0" conaffinity="0"/></body>
    <body name="rod" pos="0 2 0.4"><joint name="ball" type="ball" damping="0.01"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      <body name="tip" pos="0.3 0 0"><joint name="hinge" axis="0 1 0" damping="0.01"/>
        <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0"/></body></body>
  </worldbody>
  <equality><connect body1="hand" body2="tip" anchor="0 0 0.1"/></equality>
  <actuator><general name="motor" joint="hinge" dyntype="filter" dynprm="0.2" gainprm="0.3"/></actuator></mujoco>"#;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Ids {
    pub(crate) arm: RobotId,
    pub(crate) cube: RigidObjectId,
    pub(crate) machine: MjcfId,
}

/// A world with different commands in every environment.
pub(crate) fn world(settings: SimulationManagerCfg) -> (SimulationManager, Ids) {
    let mut sim = SimulationManager::new(settings).unwrap();
    let ids = Ids {
        arm: sim.add_robot(arm()).unwrap(),
        cube: sim.add_rigid_object(cube("cube", 0.5, [0.3, 0.5, 0.4])).unwrap(),
        machine: sim.add_mjcf(MjcfPartCfg::text("machine", MACHINE)).unwrap(),
    };
    for k in 0..4 {
        sim.add_rigid_object(cube(&format!("pile{k}"), 0.2, [-1.0, 0.2 * f64::from(k), 0.06])).unwrap();
    }
    let n = sim.num_envs();
    let per_env =
        |width, scale: f64| Array2::from_shape_fn((n, width), |(e, k)| scale * (1.3 * e as f64 + k as f64).sin());
    // Targets below the ground, so that the drives saturate.
    let targets = Array2::from_shape_fn((n, 6), |(e, k)| if k == 1 { 1.7 } else { 0.2 + 0.05 * e as f64 });
    let mut arm = sim.robot_mut(ids.arm);
    arm.set_qpos_target(&targets, None, None).unwrap();
    arm.set_qvel_target(&per_env(6, 0.2), None, None).unwrap();
    arm.set_qf_target(&per_env(6, 3.0), None, None).unwrap();
    sim.rigid_object_mut(ids.cube).write_velocity(&per_env(6, 2.0), None).unwrap();
    sim.mjcf_part_mut(ids.machine).set_ctrl(&per_env(1, 1.0), None, None).unwrap();
    let hand = array![[0.05, 2.0, 0.55, 2.0, 0.1, 0.0, 0.3]];
    sim.mjcf_part_mut(ids.machine).write_mocap_pose("hand", &hand, Some(&[EnvId(n - 1)])).unwrap();
    (sim, ids)
}

/// Bits of everything that determines the next step, and of the efforts of the drives.
pub(crate) fn bits_of(env: &SimEnv) -> Vec<u64> {
    let (data, drives) = (env.data(), &env.drives);
    let state = [&[data.time()], data.qpos(), data.qvel(), data.act(), data.qacc_warmstart()];
    let inputs = [data.ctrl(), data.xfrc_applied(), data.mocap_pos(), data.mocap_quat()];
    let driven = [&drives.position[..], &drives.velocity, &drives.feedforward, &drives.effort, &drives.applied];
    let gains = drives.gains.iter().flat_map(|g| [g.kp, g.kd, g.max_effort]);
    let numbers = state.into_iter().chain(inputs).chain(driven).flatten().copied().chain(gains);
    numbers.map(f64::to_bits).chain([env.steps(), data.contact().len() as u64]).collect()
}

pub(crate) fn all_bits(sim: &SimulationManager) -> Vec<Vec<u64>> {
    let mut bits = Vec::new();
    sim.batch().for_each(|_, env| bits.push(bits_of(env)));
    bits
}

/// All environments.
pub(crate) const ALL: Option<&[EnvId]> = None;

/// Sets properties of single environments.
pub(crate) fn set(sim: &mut SimulationManager, values: &[(usize, Property, &str, &[f64])]) {
    for &(env, property, name, value) in values {
        sim.properties_mut()
            .randomize_with(Some(&[EnvId(env)]), |_, _, properties| properties.set(property, name, value))
            .unwrap();
    }
}

pub(crate) fn get(sim: &SimulationManager, env: usize, property: Property, name: &str) -> Vec<f64> {
    sim.properties().of(EnvId(env)).unwrap().get(property, name).unwrap().to_vec()
}

/// The smallest number of contacts of any environment.
pub(crate) fn fewest_contacts(sim: &SimulationManager) -> usize {
    let mut fewest = usize::MAX;
    sim.batch().for_each(|_, env| fewest = fewest.min(env.data().contact().len()));
    fewest
}

/// A randomization of every property that can differ between environments.
pub(crate) fn all_properties() -> Randomization {
    Randomization::new()
        .with(Property::Mass, "arm/.*|cube|machine/.*", RandomizationOp::Scale([0.8, 1.2]))
        .with(Property::CenterOfMass, "arm/link[1-6]|machine/tip", RandomizationOp::Add([-0.01, 0.01]))
        .with(Property::Inertia, "arm/.*", RandomizationOp::Scale([0.9, 1.1]))
        .with(Property::Friction, "cube|pile.|ground", RandomizationOp::Set([0.4, 1.1]))
        .with(Property::JointDamping, "arm/.*|machine/hinge", RandomizationOp::Set([0.1, 2.0]))
        .with(Property::DryFriction, "machine/hinge", RandomizationOp::Set([0.01, 0.05]))
        .with(Property::Armature, "arm/.*", RandomizationOp::Set([0.0, 0.1]))
        .with(Property::Gravity, "gravity", RandomizationOp::Add([-0.2, 0.2]))
        .with(Property::Stiffness, "arm/JOINT[1-3]", RandomizationOp::Scale([0.7, 1.3]))
        .with(Property::MaxEffort, "arm/JOINT4", RandomizationOp::Scale([0.5, 1.0]))
        .with(Property::Size, "pile.", RandomizationOp::Scale([0.8, 1.0]))
        .with(Property::Color, "cube", RandomizationOp::Set([0.1, 0.9]))
}

/// Names and bits of all properties of an environment.
pub(crate) fn values(sim: &SimulationManager, env: usize) -> Vec<(Property, String, Vec<u64>)> {
    let properties = sim.properties().of(EnvId(env)).unwrap();
    let bits = |property, name| bits(properties.get(property, name).unwrap());
    let named = |property| properties.names(property).into_iter().map(move |name| (property, name));
    let all = Property::ALL.into_iter().flat_map(named);
    let mut all: Vec<_> = all.map(|(property, name)| (property, name.to_string(), bits(property, name))).collect();
    all.sort();
    all
}

/// [`values`] of all environments.
pub(crate) fn all_values(sim: &SimulationManager) -> Vec<Vec<(Property, String, Vec<u64>)>> {
    (0..sim.num_envs()).map(|env| values(sim, env)).collect()
}
