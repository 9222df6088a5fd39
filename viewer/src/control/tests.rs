#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::spring::Spring;
use super::*;
use crate::sample::{MASS, Sample, SteppingThread, sample};
use crate::scene_view::{RunState, Snapshot};
use kinetoscope_scene::Pose;
use kinetoscope_sim::{BodyMotion, ObjectShape, RigidObjectCfg, RigidObjectId, SimulationManagerCfg};
use kinetoscope_testkit::wait::TIMEOUT;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Waits for a snapshot that satisfies `is` and returns it.
#[track_caller]
fn wait_for(viewer: &Viewer, is: impl Fn(&Snapshot) -> bool) -> Arc<Snapshot> {
    let (start, mut after) = (Instant::now(), 0);
    while start.elapsed() < TIMEOUT {
        if let Some(snapshot) = viewer.wait(after, Duration::from_millis(100)) {
            if is(&snapshot) {
                return snapshot;
            }
            after = snapshot.number;
        }
    }
    panic!("no such snapshot; the newest is {:?}", run(viewer));
}

/// Steps until the condition holds. Commands run some milliseconds later, after any number of steps.
#[track_caller]
fn step_until(sim: &mut SimulationManager, is: impl Fn(&SimulationManager) -> bool) {
    let start = Instant::now();
    while !is(sim) {
        assert!(start.elapsed() < TIMEOUT, "it never comes");
        sim.update(1);
    }
}

fn run(viewer: &Viewer) -> RunState {
    viewer.newest().unwrap().run.clone()
}

#[test]
fn pause_and_steps() {
    let mut sim = sample(2).sim;
    let viewer = sim.viewer(SnapshotRequest::default());
    let running = SteppingThread::start(sim);
    assert!(viewer.send(Command::Pause));
    let held = wait_for(&viewer, |s| s.run.paused).run.steps;
    // The pause is inside `update`: the step it holds at is done, and `update` has not returned.
    let done = running.steps();
    assert!(done == held || done + 1 == held, "{done} {held}");
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(running.steps(), done, "a held simulation does no step");
    assert!(viewer.send(Command::Step(7)));
    let after = wait_for(&viewer, |s| s.run.paused && s.run.steps > held);
    assert_eq!(after.run.steps, held + 7);
    // The simulated time agrees: steps of 10 ms.
    assert!((after.envs[1].snapshot.time - (held + 7) as f64 * 0.01).abs() < 1e-9);
    assert!(viewer.send(Command::Resume));
    running.wait_for_steps_beyond(held + 100);
    drop(viewer);
    running.end();
}

#[test]
fn caller_waits() {
    let mut sim = sample(1).sim;
    assert_eq!(sim.update_without_waiting(3), (3, Duration::ZERO), "without viewers");
    let viewer = sim.viewer(SnapshotRequest::default());
    assert_eq!(sim.update_without_waiting(3), (3, Duration::ZERO));
    viewer.send(Command::Pause);
    // Commands run some milliseconds later.
    let (done, wait) = sim.update_without_waiting(1_000_000);
    assert!(done < 1_000_000 && !wait.is_zero());
    let steps = sim.observers().steps();
    assert_eq!(sim.update_without_waiting(5).0, 0);
    viewer.send(Command::Step(2));
    assert_eq!(sim.update_without_waiting(5).0, 2);
    assert_eq!(sim.observers().steps(), steps + 2);
    viewer.send(Command::Resume);
    assert_eq!(sim.update_without_waiting(5), (5, Duration::ZERO));
    // At a hundredth of real time, a step of 10 ms takes 1 s.
    viewer.send(Command::SetSpeed(Speed::Factor(0.01)));
    let (done, wait) = sim.update_without_waiting(1_000_000);
    assert!(done < 1_000_000 && !wait.is_zero());
    // `update` waits itself, as before.
    let start = Instant::now();
    viewer.send(Command::SetSpeed(Speed::Factor(0.1)));
    sim.update(3);
    assert!(start.elapsed() > Duration::from_millis(150));
    drop(viewer);
    assert_eq!(sim.update_without_waiting(5), (5, Duration::ZERO));
}

/// The simulation resumes when all viewers that paused it are dropped.
#[test]
fn pause_ends_with_viewer() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(SnapshotRequest::default());
    let other = viewer.add_viewer(SnapshotRequest::default());
    let running = SteppingThread::start(sim);
    viewer.send(Command::SetSpeed(Speed::Factor(0.5)));
    viewer.send(Command::Pause);
    wait_for(&other, |s| s.run.paused && s.run.speed == Speed::Factor(0.5));
    other.send(Command::Pause);
    // A viewer that requests a step does not hold the pause.
    let stepper = other.add_viewer(SnapshotRequest::default());
    let held = run(&other).steps;
    stepper.send(Command::Step(1));
    let held = wait_for(&other, |s| s.run.paused && s.run.steps == held + 1).run.steps;
    drop(viewer);
    // The other viewer paused it as well, so the pause stays. The speed ended with the viewer that set it.
    wait_for(&other, |s| s.run.paused && s.run.speed == Speed::Unlimited);
    std::thread::sleep(Duration::from_millis(250));
    assert!(running.steps() <= held);
    // A viewer that only watches does not hold the pause.
    drop(other);
    wait_for(&stepper, |s| !s.run.paused && s.run.steps > held);
    drop(stepper);
    running.wait_for_steps_beyond(held + 200);
    let mut sim = running.end();
    // A new viewer finds a running simulation, at free speed, with snapshots.
    let viewer = sim.viewer(SnapshotRequest::default());
    assert!(!run(&viewer).paused && run(&viewer).speed == Speed::Unlimited);
    drop(sim);
    assert!(viewer.has_ended() && !viewer.send(Command::Pause));
    assert!(viewer.wait(u64::MAX - 1, TIMEOUT).is_none(), "a wait ends with the simulation");
}

#[test]
fn speed_ends_with_viewer() {
    let mut sim = sample(1).sim;
    let below = sim.viewer(SnapshotRequest::default());
    let above = below.add_viewer(SnapshotRequest::default());
    let running = SteppingThread::start(sim);
    let set = |viewer: &Viewer, speed| {
        viewer.send(Command::SetSpeed(speed));
        wait_for(&below, |s| s.run.speed == speed);
    };
    set(&below, Speed::Factor(20.0));
    set(&above, Speed::REAL_TIME);
    drop(above);
    wait_for(&below, |s| s.run.speed == Speed::Factor(20.0));
    // The latest speed applies, and a dropped viewer leaves no setting behind.
    let above = below.add_viewer(SnapshotRequest::default());
    set(&above, Speed::REAL_TIME);
    set(&below, Speed::Factor(30.0));
    drop(above);
    let gone = wait_for(&below, |_| true).run.steps;
    wait_for(&below, |s| s.run.steps > gone && s.run.speed == Speed::Factor(30.0));
    drop(below);
    running.end();
}

#[test]
fn target_and_reset() {
    let Sample { mut sim, robot, .. } = sample(2);
    let viewer = sim.viewer(SnapshotRequest::default());
    let names = Arc::clone(&viewer.newest().unwrap().names);
    assert_eq!(names.joints.len(), 1);
    assert!(names.joints[0].name == "arm/turn" && names.joints[0].accepts_target && names.joints[0].robot == robot);
    let joint = names.joints[0].joint;
    viewer.send(Command::SetTarget { robot, joint, env: Some(EnvId(1)), value: 0.8 });
    sim.update(300);
    let q = sim.robot(robot).qpos();
    // The drive carries no load about the vertical, so it settles at its target. Critically damped or slower poles of
    // 10 s⁻¹ and more leave e^-20 of the distance after 3 s.
    assert!((q[(1, 0)] - 0.8).abs() < 1e-6, "{q}");
    assert_eq!(q[(0, 0)], 0.0, "the other environment was not asked");
    viewer.send(Command::Reset(Some(EnvId(1))));
    step_until(&mut sim, |sim| sim.time()[1] < 1.0);
    assert!(sim.time()[0] > 2.9, "only one was put back");
    assert!(sim.robot(robot).qpos()[(1, 0)].abs() < 1e-9);
}

/// Refusals are reported and counted; each is shown until the next successful command.
///
/// Root cause of failures on busy machines: the refusal that a spring command must not clear was that of a spring, which it
/// does clear. The test passed if the newest snapshot was older than that.
#[test]
fn refusals() {
    let Sample { mut sim, robot, .. } = sample(1);
    let other = sample(1).robot;
    let viewer = sim.viewer(SnapshotRequest { rate: 1000.0, ..SnapshotRequest::default() });
    assert_eq!((run(&viewer).last_refusal, run(&viewer).refusal_count), (None, 0));
    let drag = |env, body, target: f64| Command::Drag { env: EnvId(env), body, anchor: [0.0; 3], target: [target; 3] };
    let target = |robot, joint, env, value| Command::SetTarget { robot, joint: JointIndex(joint), env, value };
    let nonsense = [
        Command::SetSpeed(Speed::Factor(0.0)),
        Command::SetSpeed(Speed::Factor(f64::NAN)),
        Command::Reset(Some(EnvId(9))),
        target(other, 0, None, 0.0),
        target(robot, 7, None, 0.0),
        target(robot, 0, Some(EnvId(9)), 0.0),
        target(robot, 0, None, f64::NAN),
        drag(9, 0, 0.0),
        drag(0, 99, 0.0),
        drag(0, 2, f64::INFINITY),
        // No record button exists; the same command is refused twice.
        Command::Record(true),
        Command::Record(true),
    ];
    for (count, command) in (1..).zip(nonsense) {
        assert!(viewer.send(command));
        step_until(&mut sim, |_| run(&viewer).refusal_count == count);
        assert!(
            run(&viewer).last_refusal.is_some_and(|why| count < 11 || why.contains("record button")),
            "{command:?}"
        );
    }
    assert!(sim.diverged().is_empty());
    // A refused spring on another body leaves the spring in place.
    let cube = sim.entities().rigid_object_id("cube").unwrap();
    let height = |sim: &SimulationManager| sim.rigid_object(cube).pose()[(0, 2)];
    let (rest, mut count) = (height(&sim), nonsense.len() as u64);
    let index = sim.entities().body_names().iter().position(|name| name == "cube").unwrap();
    viewer.send(Command::Drag { env: EnvId(0), body: index, anchor: [0.0; 3], target: [0.0, 0.0, 5.0] });
    step_until(&mut sim, |sim| height(sim) > rest + 0.1);
    viewer.send(drag(0, 99, 0.0));
    count += 1;
    step_until(&mut sim, |_| run(&viewer).refusal_count == count);
    step_until(&mut sim, |sim| height(sim) > rest + 0.5);
    viewer.send(Command::Release);
    step_until(&mut sim, |sim| height(sim) < rest + 0.5);
    // A successful spring command does not clear the refusal of another command; another successful command does.
    viewer.send(Command::Reset(Some(EnvId(9))));
    count += 1;
    step_until(&mut sim, |_| run(&viewer).refusal_count == count);
    viewer.send(Command::Drag { env: EnvId(0), body: index, anchor: [0.0; 3], target: [0.0; 3] });
    viewer.send(Command::Release);
    let sent = run(&viewer).steps;
    step_until(&mut sim, |_| run(&viewer).steps > sent + 1);
    assert!(run(&viewer).last_refusal.is_some());
    viewer.send(Command::SetSpeed(Speed::Unlimited));
    step_until(&mut sim, |_| run(&viewer).last_refusal.is_none());
    assert_eq!(run(&viewer).refusal_count, count);
    drop(sim);
    // The longest timeout; the simulation has ended.
    assert!(viewer.wait(u64::MAX, std::time::Duration::MAX).is_none());
}

/// With steps of 10 ms, step s ends (s - s0) 10 ms after the step s0 at which the speed was set; lost time is caught up
/// or dropped. So 40 steps after s0 end 40 step times after the request, less the block without a check. That block is
/// one step in real time, and three steps at four times real time. A busy machine may take longer.
#[test]
fn real_time() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(SnapshotRequest::default());
    // The time starts before the request: afterwards the simulation may already be late and would catch up.
    let mut took = |speed: Option<Speed>, steps| {
        let start = Instant::now();
        if let Some(speed) = speed {
            viewer.send(Command::SetSpeed(speed));
            step_until(&mut sim, |_| run(&viewer).speed == speed);
        }
        sim.update(steps);
        start.elapsed()
    };
    // Control: without a speed the simulation does not wait. (40 steps of one box take some milliseconds; the best of
    // several runs counts, because the machine may be busy.)
    let free = (0..20).map(|_| took(None, 40)).min().unwrap();
    let (real, fast) = (took(Some(Speed::REAL_TIME), 40), took(Some(Speed::Factor(4.0)), 200));
    assert!(real >= Duration::from_millis(380), "{real:?}");
    assert!(fast >= Duration::from_millis(490), "{fast:?}");
    assert!(free < real, "{free:?} {real:?}");
}

/// The spring force points to the target and damps the motion.
#[test]
fn spring_force() {
    let pose = Pose::translation(1.0, 2.0, 3.0);
    let motion = BodyMotion { pose, linear: [0.0; 3], angular: [0.0; 3], carried_mass: 2.0, is_fixed: false };
    let spring = Spring { env: EnvId(0), body: 0, anchor: [0.1, 0.0, 0.0], target: [1.1, 2.0, 3.5] };
    let (point, force) = spring.force(&motion);
    // 2 kg (8 rad/s)² 0.5 m = 64 N, straight up.
    assert!((0..3).all(|k| (point[k] - [1.1, 2.0, 3.0][k]).abs() < 1e-12));
    assert!((0..3).all(|k| (force[k] - [0.0, 0.0, 64.0][k]).abs() < 1e-9), "{force:?}");
    // Turning about z at 1 rad/s, the point moves along y at 0.1 m/s: the damping force is 2 kg 2 (8 rad/s) 0.1 m/s.
    let (_, force) = spring.force(&BodyMotion { angular: [0.0, 0.0, 1.0], ..motion });
    assert!((force[1] + 3.2).abs() < 1e-9, "{force:?}");
}

/// A free cube without gravity, with edges of 0.2 m and steps of 1 ms.
fn floating_cube() -> (SimulationManager, RigidObjectId) {
    let cfg = SimulationManagerCfg { gravity: [0.0; 3].into(), physics_dt: 1e-3, ground: None, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let shape = ObjectShape::cube(0.2);
    let id = sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), shape, mass: Some(MASS), ..Default::default() });
    (sim, id.unwrap())
}

fn drag(anchor: [f64; 3], target: [f64; 3]) -> Command {
    Command::Drag { env: EnvId(0), body: 0, anchor, target }
}

/// A free body pulled at its center of mass is a critically damped oscillator: x(t) = 1 - (1 + w t) e^-wt.
#[test]
fn spring_in_closed_form() {
    let (mut sim, id) = floating_cube();
    let viewer = sim.viewer(SnapshotRequest::default());
    viewer.send(drag([0.0; 3], [1.0, 0.0, 0.0]));
    // The command runs after the first step.
    sim.update(1);
    for k in 1..=5 {
        sim.update(100);
        let wt = 8.0 * 0.1 * f64::from(k);
        let expected = 1.0 - (1.0 + wt) * (-wt).exp();
        let x = sim.rigid_object(id).pose()[(0, 0)];
        // Semi-implicit Euler with the force from the beginning of the step shifts the poles by w² h / 2 relative to w.
        // The curve is late or early by less than w h = 0.8 % of a distance of 1 m.
        assert!((x - expected).abs() < 0.008, "after {wt}: {x}, not {expected}");
    }
    let speed = |sim: &SimulationManager| sim.rigid_object(id).velocity()[(0, 0)];
    viewer.send(Command::Release);
    sim.update(1);
    let v = speed(&sim);
    sim.update(100);
    assert_eq!(v, speed(&sim), "let go, it flies on as it was");
    // A dropped viewer releases its spring too.
    viewer.send(drag([0.0; 3], [9.0, 0.0, 0.0]));
    step_until(&mut sim, |sim| speed(sim) > v);
    drop(viewer);
    // While a body is dragged, every step checks for commands.
    sim.update(2);
    let v = speed(&sim);
    sim.update(50);
    assert_eq!(v, speed(&sim));
}

/// Two springs on one body add up. At its center, toward x and y: `x'' = w² (1 - 2 x) - 4 w x'`, so it comes to rest
/// halfway between the targets. At opposite points, toward opposite sides: a couple.
#[test]
fn two_springs() {
    let (mut sim, id) = floating_cube();
    let (first, second) = (sim.viewer(SnapshotRequest::default()), sim.viewer(SnapshotRequest::default()));
    first.send(drag([0.0; 3], [1.0, 0.0, 0.0]));
    second.send(drag([0.0; 3], [0.0, 1.0, 0.0]));
    // The slower pole is (2 - √2) w = 4.7 s⁻¹: e^-14 of the distance is left after 3 s.
    sim.update(3000);
    let pose = sim.rigid_object(id).pose();
    assert!((pose[(0, 0)] - 0.5).abs() < 1e-5 && (pose[(0, 1)] - 0.5).abs() < 1e-5, "{pose}");
    // After one release, the other spring acts alone. Its double pole is w = 8 s⁻¹: (1 + 24) e^-24 of the distance is
    // left.
    first.send(Command::Release);
    sim.update(3000);
    let pose = sim.rigid_object(id).pose();
    assert!(pose[(0, 0)].abs() < 1e-6 && (pose[(0, 1)] - 1.0).abs() < 1e-6, "{pose}");

    let (mut sim, id) = floating_cube();
    let (first, second) = (sim.viewer(SnapshotRequest::default()), sim.viewer(SnapshotRequest::default()));
    first.send(drag([0.0, 0.1, 0.0], [1.0, 0.1, 0.0]));
    second.send(drag([0.0, -0.1, 0.0], [-1.0, -0.1, 0.0]));
    // The command runs after the first step; the second step is the first with a force.
    sim.update(2);
    let v = sim.rigid_object(id).velocity();
    // 2 kg (8 rad/s)² 1 m = 128 N, each 0.1 m from the center, on the inertia m a² / 6, for one millisecond.
    let spin = -2.0 * 0.1 * 128.0 / (MASS * 0.04 / 6.0) * 1e-3;
    assert!((v[(0, 5)] - spin).abs() < 1e-6 * spin.abs(), "{v} instead of {spin}");
    assert!((0..3).all(|k| v[(0, k)].abs() < 1e-9), "the forces cancel: {v}");
}

/// Watching changes no bit, even if the viewers never release a snapshot.
#[test]
fn watching_changes_nothing() {
    let bits = |watch: bool| {
        let mut sim = sample(3).sim;
        let wants = SnapshotRequest { rate: 1000.0, contacts: Some(EnvSelection::All), ..SnapshotRequest::default() };
        let mut held = Vec::new();
        let viewers: Vec<Viewer> = (0..3).filter(|_| watch).map(|_| sim.viewer(wants)).collect();
        for k in 0..50 {
            sim.update(4);
            // The viewers keep every snapshot, more than the pool has.
            held.extend(viewers.iter().filter_map(Viewer::newest));
            if k == 20 {
                sim.reset(Some(&[EnvId(1)])).unwrap();
            }
        }
        let mut numbers: Vec<u64> = held.iter().map(|snapshot| snapshot.number).collect();
        numbers.dedup();
        assert!(!watch || (2..=5).contains(&numbers.len()), "a pool of 5 for 3 viewers: {numbers:?}");
        let mut bits = Vec::new();
        sim.batch().for_each(|_, env| {
            let data = env.data();
            let numbers = data.qpos().iter().chain(data.qvel()).chain(data.qacc_warmstart());
            bits.extend(numbers.map(|x| x.to_bits()));
        });
        bits
    };
    assert_eq!(bits(true), bits(false));
}

#[test]
fn later_objects() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(SnapshotRequest::default());
    let before = viewer.newest().unwrap();
    let init_pose = Pose::translation(0.0, 1.0, 0.5);
    sim.add_rigid_object(RigidObjectCfg { uid: "late".into(), init_pose, ..Default::default() }).unwrap();
    let after = viewer.newest().unwrap();
    assert!(after.number > before.number);
    assert!(after.names.bodies.iter().any(|name| name == "late"));
    assert_eq!(before.names.bodies.len() + 1, after.names.bodies.len(), "a snapshot never changes");
    assert_eq!(after.envs[0].snapshot.bodies.len(), after.names.bodies.len());
}

/// A recording that counts its starts and stops.
#[derive(Debug, Default)]
struct Counter {
    on: bool,
    begun: u32,
    ended: u32,
}

impl RecordControl for Counter {
    fn set(&mut self, _: &mut SimulationManager, on: bool) -> Result<(), String> {
        self.begun += u32::from(on && !self.on);
        self.ended += u32::from(self.on && !on);
        self.on = on;
        Ok(())
    }

    fn state(&self, sim: &SimulationManager) -> RecordingState {
        RecordingState { on: self.on, text: format!("step {}", sim.observers().steps()) }
    }
}

/// Returns a button and its counts.
fn counter() -> (Arc<Mutex<Counter>>, RecordButton, impl Fn() -> (bool, u32, u32)) {
    let counter = Arc::new(Mutex::new(Counter::default()));
    let counted = Arc::clone(&counter);
    let counts = move || {
        let counter = counted.lock().unwrap();
        (counter.on, counter.begun, counter.ended)
    };
    (Arc::clone(&counter), RecordButton::shared(counter), counts)
}

/// The record button is pressed between steps, and its state belongs to the published step.
#[test]
fn record_button() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(SnapshotRequest { rate: 1000.0, ..SnapshotRequest::default() });
    assert_eq!(run(&viewer).recording, None);
    let (counter, button, counted) = counter();
    sim.set_record_button(button);
    assert!(run(&viewer).recording.is_some_and(|recording| !recording.on));
    viewer.send(Command::Record(true));
    step_until(&mut sim, |_| counted() == (true, 1, 0));
    step_until(&mut sim, |_| {
        let run = run(&viewer);
        run.recording.is_some_and(|recording| recording.on && recording.text == format!("step {}", run.steps))
    });
    // Another viewer may stop the recording.
    let other = viewer.add_viewer(SnapshotRequest::default());
    other.send(Command::Record(false));
    step_until(&mut sim, |_| counted() == (false, 1, 1));
    // While its lock is held, the button refuses, and the simulation does not wait.
    let held = counter.lock().unwrap();
    viewer.send(Command::Record(true));
    step_until(&mut sim, |_| run(&viewer).last_refusal.is_some_and(|reason| reason.contains("busy")));
    assert!(run(&viewer).recording.is_some(), "its last known state stays");
    drop(held);
    assert_eq!(counted(), (false, 1, 1));
    // The button also works while paused.
    viewer.send(Command::Pause);
    viewer.send(Command::Record(true));
    let running = SteppingThread::start(sim);
    let paused = wait_for(&viewer, |s| s.run.paused && s.run.recording.as_ref().is_some_and(|r| r.on)).run.steps;
    assert_eq!(counted(), (true, 2, 1));
    viewer.send(Command::Resume);
    running.wait_for_steps_beyond(paused + 2);
    drop((viewer, other));
    running.end();
}

/// A recording stops with the viewer that started it, and with no other viewer.
#[test]
fn recording_ends_with_viewer() {
    let mut sim = sample(1).sim;
    let (first, second) = (sim.viewer(SnapshotRequest::default()), sim.viewer(SnapshotRequest::default()));
    let (counter, button, counted) = counter();
    sim.set_record_button(button.clone());
    first.send(Command::Record(true));
    step_until(&mut sim, |_| counted() == (true, 1, 0));
    // Pressed again by the second viewer, it still belongs to the first.
    second.send(Command::Record(true));
    sim.update(200);
    drop(second);
    sim.update(200);
    assert_eq!(counted(), (true, 1, 0));
    drop(first);
    step_until(&mut sim, |_| counted() == (false, 1, 1));
    // A recording that the program started belongs to the program.
    counter.lock().unwrap().set(&mut sim, true).unwrap();
    let viewer = sim.viewer(SnapshotRequest::default());
    viewer.send(Command::Record(true));
    sim.update(200);
    drop(viewer);
    sim.update(200);
    assert_eq!(counted(), (true, 2, 1));
    // So does the one that it starts after it stopped a viewer's recording: the viewer stayed its owner.
    counter.lock().unwrap().set(&mut sim, false).unwrap();
    let viewer = sim.viewer(SnapshotRequest { rate: 1000.0, ..SnapshotRequest::default() });
    viewer.send(Command::Record(true));
    step_until(&mut sim, |_| run(&viewer).recording.is_some_and(|recording| recording.on));
    assert_eq!(counted(), (true, 3, 2));
    counter.lock().unwrap().set(&mut sim, false).unwrap();
    step_until(&mut sim, |_| run(&viewer).recording.is_some_and(|recording| !recording.on));
    counter.lock().unwrap().set(&mut sim, true).unwrap();
    viewer.send(Command::Record(false));
    step_until(&mut sim, |_| run(&viewer).last_refusal.is_some_and(|reason| reason.contains("only the program")));
    drop(viewer);
    sim.update(200);
    assert_eq!(counted(), (true, 4, 3));
    // Setting the same button again changes nothing; another button stops the recording of the first.
    sim.set_record_button(button);
    assert_eq!(counted(), (true, 4, 3));
    sim.set_record_button(RecordButton::new(Counter::default()));
    assert_eq!(counted(), (false, 4, 4));
}
