//! After the first steps, stepping and measuring allocate no memory on the calling thread.

use crate::{allocations, assert_settles};
use kinetoscope_scene::StateFields;
use kinetoscope_sensors::camera::{CameraCfg, Extrinsics, Placement};
use kinetoscope_sensors::ray::pattern::Grid;
use kinetoscope_sensors::ray::{RayCasterCameraCfg, RayCasterCfg};
use kinetoscope_sensors::{
    ActuatorStateCfg, ContactSensorCfg, FrameTransformerCfg, ImuCfg, JointStateCfg, JointWrenchCfg, MujocoSensorCfg,
    SamplingCfg, SensorCfg, TargetFrameCfg,
};
use kinetoscope_sim::{
    EnvId, MjcfPartCfg, ObjectShape, RigidObjectCfg, SimulationManager, SimulationManagerCfg, WrenchFrame,
};
use ndarray::Array2;

/// A pendulum with sensors of its own.
const PENDULUM: &str = r#"<mujoco><worldbody><body name="rod" pos="1.2 0.3 0.8"><joint name="hinge" axis="0 1 0"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0"/><site name="tip" pos="0.4 0 0"/></body></worldbody>
  <actuator><motor joint="hinge"/></actuator><sensor><accelerometer site="tip"/><gyro site="tip"/><force site="tip"/></sensor></mujoco>"#;

/// A weight that sinks on a tendon.
const STRING: &str = r#"<mujoco><worldbody><site name="hook" pos="0 0.5 0.9"/><body name="weight" pos="0 0.5 0.5">
    <joint type="slide" axis="0 0 1" damping="100"/><geom size="0.05"/><site name="eye"/></body></worldbody>
  <tendon><spatial><site site="hook"/><site site="eye"/></spatial></tendon></mujoco>"#;

/// Four environments with a resting box and a ball that touches the ground.
fn world(threads: usize) -> SimulationManager {
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { num_envs: 4, threads: Some(threads), ..Default::default() })
            .unwrap();
    let at = |x: f64, z: f64| kinetoscope_scene::Pose::translation(x, 0.0, z);
    let box_ = RigidObjectCfg { uid: "box".into(), init_pose: at(0.0, 0.05), ..Default::default() };
    let shape = ObjectShape::Sphere { radius: 0.1 };
    let ball = RigidObjectCfg { uid: "ball".into(), init_pose: at(0.5, 0.1), shape, ..Default::default() };
    sim.add_rigid_object(box_).unwrap();
    sim.add_rigid_object(ball).unwrap();
    sim
}

/// Asserts that ten steps allocate nothing after thirty steps of warm-up. Returns the number of steps.
///
/// With several threads, up to ten blocks of ten steps may be needed: the assignment of work to threads is random, and the
/// memory of the calling thread grows to the need of its largest share.
#[track_caller]
fn assert_no_allocation(sim: &mut SimulationManager, what: &str) -> u64 {
    sim.update(30);
    let blocks = if sim.threads() == 1 { 1 } else { 10 };
    let settled = (1..=blocks).find(|_| allocations(|| (0..10).for_each(|_| sim.update(1))) == 0);
    30 + 10 * settled.unwrap_or_else(|| panic!("{} threads, {what}: every block allocates", sim.threads()))
}

#[test]
fn steps() {
    for threads in [1, 3] {
        let mut sim = world(threads);
        assert_no_allocation(&mut sim, "no sensors");
        // A wrench in link axes is another one in every step.
        let (force, torque) = (Array2::from_elem((1, 3), 0.01), Array2::from_elem((1, 3), 0.001));
        let ball = sim.entities().rigid_object_id("ball").unwrap();
        sim.rigid_object_mut(ball).set_external_wrench(&force, &torque, WrenchFrame::Link, Some(&[EnvId(1)])).unwrap();
        assert_no_allocation(&mut sim, "a wrench in link axes");
        let contact = ContactSensorCfg {
            filters: vec!["ground".into()],
            track_air_time: true,
            ..ContactSensorCfg::for_bodies("box")
        };
        sim.add_sensor("contact", contact).unwrap();
        let sampling = SamplingCfg { latency_steps: 2, history_length: 3, ..SamplingCfg::default() };
        sim.add_sensor("imu", ImuCfg { sampling, ..ImuCfg::on("ball") }).unwrap();
        assert_no_allocation(&mut sim, "sensors of numbers");
        // 10201 rays per environment, and a camera with 3072: enough work for all threads.
        let grid = Grid { resolution: 0.02, size: [2.0; 2], ..Grid::default() };
        let offset = kinetoscope_scene::Pose::translation(0.0, 0.0, 2.0);
        let scanner = RayCasterCfg { offset, pattern: grid.into(), ..RayCasterCfg::default() };
        assert!(scanner.requires().contains(StateFields::INSTANCES));
        sim.add_sensor("scanner", scanner).unwrap();
        sim.add_sensor("eye", RayCasterCameraCfg { width: 64, height: 48, ..RayCasterCameraCfg::default() }).unwrap();
        assert_no_allocation(&mut sim, "rays");
        // MuJoCo's own sensors and joint wrenches, of an attached MJCF file; a camera that captures the visible state.
        sim.add_mjcf(MjcfPartCfg::text("m", PENDULUM)).unwrap();
        let sampling = || SamplingCfg { latency_steps: 2, history_length: 3, ..SamplingCfg::default() };
        sim.add_sensor("own", MujocoSensorCfg { sensors: None, sampling: sampling() }).unwrap();
        let frames = vec!["m/tip".into()];
        let wrench = JointWrenchCfg { links: vec!["m/rod".into()], frames, sampling: sampling(), debug_vis: true };
        sim.add_sensor("wrench", wrench).unwrap();
        sim.add_sensor("joints", JointStateCfg { joints: None, sampling: sampling() }).unwrap();
        sim.add_sensor("actuators", ActuatorStateCfg { actuators: None, sampling: sampling() }).unwrap();
        let targets = vec![TargetFrameCfg::for_bodies(".*")];
        let frames = FrameTransformerCfg { sampling: sampling(), ..FrameTransformerCfg::new("m/tip", targets) };
        sim.add_sensor("frames", frames).unwrap();
        let camera = CameraCfg {
            width: 64,
            height: 48,
            extrinsics: Extrinsics { parent: Some("m/rod".into()), ..Extrinsics::default() },
            ..CameraCfg::default()
        };
        let delayed = CameraCfg { latency_steps: 2, history_length: 3, dropout: 0.1, ..camera.clone() };
        sim.add_sensor("late", delayed).unwrap();
        let camera = sim.add_sensor("camera", camera).unwrap();
        let steps = assert_no_allocation(&mut sim, "every kind of sensor");
        let captured = sim.sensor(camera).unwrap();
        assert_eq!(
            (captured.frame_counts()[0], captured.render_count()),
            (steps, 0),
            "every frame is captured and no frame is rendered yet"
        );
    }
}

/// Images rendered at every step: one thread per environment, or all threads on one image.
#[test]
fn images() {
    for (threads, width, height) in [(1, 64, 48), (3, 64, 48), (3, 320, 240)] {
        let mut sim = world(threads);
        // The tendon changes its shape in every step, and with it the scene that cameras see.
        sim.add_mjcf(MjcfPartCfg::text("string", STRING)).unwrap();
        let base = CameraCfg { width, height, lazy: false, ..CameraCfg::default() };
        let extrinsics = |x: f64| {
            let placement = Placement::LookAt { eye: [x, -1.0, 0.8], target: [0.2, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
            Extrinsics { placement, ..Extrinsics::default() }
        };
        let all = sim.add_sensor("all", CameraCfg { extrinsics: extrinsics(1.0), ..base.clone() }).unwrap();
        let some = CameraCfg { extrinsics: extrinsics(-0.5), env_ids: Some(vec![2, 0, 3]), ..base };
        let some = sim.add_sensor("some", some).unwrap();
        assert_settles(&format!("{threads} threads, {width} x {height}"), || allocations(|| sim.update(1)));
        let (all, some) = (sim.sensor(all).unwrap(), sim.sensor(some).unwrap());
        // One more for the reset at the start.
        let frames = 1 + all.frame_counts()[0];
        assert_eq!(
            (all.render_count(), some.render_count()),
            (4 * frames, 3 * frames),
            "frames are rendered when they are due"
        );
    }
}

#[test]
fn actuator_models() {
    let (mut urdf, mut actuators) = (String::from("<link name=\"base\"/>"), Vec::new());
    for (i, model) in kinetoscope_sim::ActuatorModel::examples().into_iter().enumerate() {
        let (link, joint) = (format!("l{i}"), format!("j{i}"));
        urdf += &kinetoscope_testkit::urdf::link(&link, 1.0, 0.1, [0.0; 3], "");
        urdf += &kinetoscope_testkit::urdf::joint(&joint, "continuous", ["base", &link], [0.0; 3], "0 1 0", "");
        let model = match model {
            kinetoscope_sim::ActuatorModel::DelayedPd(_) => {
                kinetoscope_sim::DelayedPd { delay: 3, max_delay: 0 }.into()
            }
            other => other,
        };
        actuators.push((joint, model));
    }
    let files = kinetoscope_testkit::urdf::TempFiles::default();
    let path = files.write("robot.urdf", kinetoscope_testkit::urdf::robot("r", &urdf));
    let drive = kinetoscope_sim::DriveCfg {
        actuators,
        stiffness: 10.0.into(),
        damping: 1.0.into(),
        max_effort: Some(50.0.into()),
        max_velocity: Some(5.0.into()),
        ..Default::default()
    };
    let mut sim = world(1);
    sim.add_robot(kinetoscope_sim::RobotCfg {
        urdf: kinetoscope_robot::urdf::UrdfCfg::single(&path),
        drive,
        ..Default::default()
    })
    .unwrap();
    assert_no_allocation(&mut sim, "a scene that changes its shape");
}
