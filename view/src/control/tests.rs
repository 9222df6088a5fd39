#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::spring::Spring;
use super::*;
use crate::sample::{MASS, sample};
use crate::stage::Snapshot;
use scene::Pose;
use sim::{BodyMotion, ObjectId, ObjectShape, RigidObjectCfg, SimulationManagerCfg};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longer than anything here takes on a busy machine: what is not there by then does not come.
const LONG: Duration = Duration::from_secs(30);

/// A simulation that a thread steps until it is told to stop.
struct Running {
    steps: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<SimulationManager>>,
}

impl Running {
    fn start(mut sim: SimulationManager) -> Self {
        let (steps, stop) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (count, ends) = (Arc::clone(&steps), Arc::clone(&stop));
        let thread = std::thread::spawn(move || {
            while !ends.load(Ordering::SeqCst) {
                sim.update(1);
                count.fetch_add(1, Ordering::SeqCst);
            }
            sim
        });
        Self { steps, stop, thread: Some(thread) }
    }

    fn steps(&self) -> u64 {
        self.steps.load(Ordering::SeqCst)
    }

    /// Waits until it has done more than `steps` steps.
    fn goes_on_beyond(&self, steps: u64) -> bool {
        let start = Instant::now();
        while self.steps() <= steps && start.elapsed() < LONG {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.steps() > steps
    }

    /// The simulation, stopped; whoever held it has to be gone.
    fn end(mut self) -> SimulationManager {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.take().unwrap().join().unwrap()
    }
}

/// The first snapshot from now on that is as it should be.
fn wait_for(viewer: &Viewer, is: impl Fn(&Snapshot) -> bool) -> Arc<Snapshot> {
    let start = Instant::now();
    let mut after = 0;
    while start.elapsed() < LONG {
        if let Some(snapshot) = viewer.wait(after, Duration::from_millis(100)) {
            if is(&snapshot) {
                return snapshot;
            }
            after = snapshot.number;
        }
    }
    panic!("no such snapshot; the newest is {:?}", viewer.newest().map(|s| s.run.clone()));
}

/// Steps until something is so. Commands are obeyed some milliseconds later, whatever number of steps that is.
fn step_until(sim: &mut SimulationManager, is: impl Fn(&SimulationManager) -> bool) {
    let start = Instant::now();
    while !is(sim) {
        assert!(start.elapsed() < LONG, "it never comes");
        sim.update(1);
    }
}

#[test]
fn a_pause_holds_and_steps_are_counted() {
    let mut sim = sample(2).sim;
    let viewer = sim.viewer(Wants::default());
    let running = Running::start(sim);
    assert!(viewer.send(Command::Pause));
    let held = wait_for(&viewer, |s| s.run.paused).run.steps;
    // It is inside of update: the step that it holds at was done, and update has not returned.
    let done = running.steps();
    assert!(done == held || done + 1 == held, "{done} {held}");
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(running.steps(), done, "a held simulation does no step");
    assert!(viewer.send(Command::Step(7)));
    let after = wait_for(&viewer, |s| s.run.paused && s.run.steps > held);
    assert_eq!(after.run.steps, held + 7);
    // The cube's time says so too: steps of 10 ms.
    assert!((after.envs[1].look.time - (held + 7) as f64 * 0.01).abs() < 1e-9);
    assert!(viewer.send(Command::Resume));
    assert!(running.goes_on_beyond(held + 100));
    drop(viewer);
    running.end();
}

#[test]
fn the_simulation_goes_on_when_the_viewer_that_paused_it_is_gone() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(Wants::default());
    let other = viewer.another(Wants::default());
    let running = Running::start(sim);
    viewer.send(Command::SetSpeed(Speed::Times(0.5)));
    viewer.send(Command::Pause);
    wait_for(&other, |s| s.run.paused && s.run.speed == Speed::Times(0.5));
    other.send(Command::Pause);
    // Steps are of those who paused: whoever asks for one holds nothing.
    let stepper = other.another(Wants::default());
    let held = other.newest().unwrap().run.steps;
    stepper.send(Command::Step(1));
    let held = wait_for(&other, |s| s.run.paused && s.run.steps == held + 1).run.steps;
    drop(viewer);
    // The other one paused it as well: it stays held. The speed went with who had set it.
    wait_for(&other, |s| s.run.paused && s.run.speed == Speed::Free);
    std::thread::sleep(Duration::from_millis(250));
    assert!(running.steps() <= held);
    // Somebody who only watches does not keep it held.
    drop(other);
    wait_for(&stepper, |s| !s.run.paused && s.run.steps > held);
    drop(stepper);
    assert!(running.goes_on_beyond(held + 200), "nobody is there to let it go on");
    let mut sim = running.end();
    // A new viewer finds it running, at free speed, with snapshots.
    let viewer = sim.viewer(Wants::default());
    let snapshot = viewer.newest().unwrap();
    assert!(!snapshot.run.paused && snapshot.run.speed == Speed::Free);
    drop(sim);
    assert!(viewer.is_over() && !viewer.send(Command::Pause));
    assert!(viewer.wait(u64::MAX - 1, LONG).is_none(), "nobody waits for a simulation that is over");
}

#[test]
fn a_speed_ends_with_its_viewer() {
    let mut sim = sample(1).sim;
    let below = sim.viewer(Wants::default());
    let above = below.another(Wants::default());
    let running = Running::start(sim);
    below.send(Command::SetSpeed(Speed::Times(20.0)));
    wait_for(&below, |s| s.run.speed == Speed::Times(20.0));
    above.send(Command::SetSpeed(Speed::REAL));
    wait_for(&below, |s| s.run.speed == Speed::REAL);
    drop(above);
    wait_for(&below, |s| s.run.speed == Speed::Times(20.0));
    // Who sets it again has the last word, and leaves nothing else behind.
    let above = below.another(Wants::default());
    above.send(Command::SetSpeed(Speed::REAL));
    wait_for(&below, |s| s.run.speed == Speed::REAL);
    below.send(Command::SetSpeed(Speed::Times(30.0)));
    wait_for(&below, |s| s.run.speed == Speed::Times(30.0));
    drop(above);
    let gone = wait_for(&below, |_| true).run.steps;
    wait_for(&below, |s| s.run.steps > gone && s.run.speed == Speed::Times(30.0));
    drop(below);
    running.end();
}

#[test]
fn a_slider_moves_its_joint_and_a_reset_puts_it_back() {
    let sample = sample(2);
    let (mut sim, robot) = (sample.sim, sample.robot);
    let viewer = sim.viewer(Wants::default());
    let names = Arc::clone(&viewer.newest().unwrap().names);
    assert_eq!(names.joints.len(), 1);
    assert!(names.joints[0].name == "arm/turn" && names.joints[0].driven && names.joints[0].robot == robot);
    let joint = names.joints[0].joint;
    viewer.send(Command::SetTarget { robot, joint, env: Some(EnvId(1)), value: 0.8 });
    sim.update(300);
    let q = sim.robot(robot).get_qpos();
    // The drive has no load about the vertical: it ends in its target. Critically damped or slower poles of 10 s⁻¹ and
    // more leave e^-20 of the way after 3 s.
    assert!((q[(1, 0)] - 0.8).abs() < 1e-6, "{q}");
    assert_eq!(q[(0, 0)], 0.0, "the other environment was not asked");
    viewer.send(Command::Reset(Some(EnvId(1))));
    step_until(&mut sim, |sim| sim.time()[1] < 1.0);
    assert!(sim.time()[0] > 2.9, "only one was put back");
    assert!(sim.robot(robot).get_qpos()[(1, 0)].abs() < 1e-9);
}

#[test]
fn what_cannot_be_done_is_said_and_nothing_panics() {
    let mut one = sample(1);
    let other = sample(1);
    let viewer = one.sim.viewer(Wants::default());
    let nonsense = [
        Command::SetSpeed(Speed::Times(0.0)),
        Command::SetSpeed(Speed::Times(f64::NAN)),
        Command::Reset(Some(EnvId(9))),
        Command::SetTarget { robot: other.robot, joint: JointIndex(0), env: None, value: 0.0 },
        Command::SetTarget { robot: one.robot, joint: JointIndex(7), env: None, value: 0.0 },
        Command::SetTarget { robot: one.robot, joint: JointIndex(0), env: Some(EnvId(9)), value: 0.0 },
        Command::SetTarget { robot: one.robot, joint: JointIndex(0), env: None, value: f64::NAN },
        Command::Drag { env: EnvId(9), body: 0, hold: [0.0; 3], target: [0.0; 3] },
        Command::Drag { env: EnvId(0), body: 99, hold: [0.0; 3], target: [0.0; 3] },
        Command::Drag { env: EnvId(0), body: 2, hold: [0.0; 3], target: [f64::INFINITY; 3] },
    ];
    for command in nonsense {
        let before = viewer.newest().unwrap().number;
        assert!(viewer.send(command));
        one.sim.update(1);
        let start = Instant::now();
        let mut newest = viewer.newest().unwrap();
        while (newest.number == before || newest.run.refused.is_none()) && start.elapsed() < LONG {
            one.sim.update(1);
            newest = viewer.newest().unwrap();
        }
        assert!(newest.run.refused.is_some(), "{command:?}");
    }
    assert!(one.sim.diverged().is_empty());
}

/// Steps of 10 ms: at step s it is waited until (s - s0) 10 ms after the step s0 that the speed was set at, and what was
/// lost is caught up with or given up. So 40 steps after s0 end 40 steps' time after it was asked for, less the block that
/// is not looked into (one step in real time, three at four times that). A busy machine may take longer.
#[test]
fn real_time_is_not_overtaken() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(Wants::default());
    // The best of some, where the machine is busy.
    let mut free = Duration::MAX;
    for _ in 0..20 {
        let start = Instant::now();
        sim.update(40);
        free = free.min(start.elapsed());
    }
    let set = |sim: &mut SimulationManager, speed| {
        viewer.send(Command::SetSpeed(speed));
        step_until(sim, |_| viewer.newest().is_some_and(|snapshot| snapshot.run.speed == speed));
    };
    // From before it is asked for: afterwards it may already be late, and would catch up.
    let start = Instant::now();
    set(&mut sim, Speed::REAL);
    sim.update(40);
    let real = start.elapsed();
    assert!(real >= Duration::from_millis(380), "{real:?}");
    let start = Instant::now();
    set(&mut sim, Speed::Times(4.0));
    sim.update(200);
    let fast = start.elapsed();
    assert!(fast >= Duration::from_millis(490), "{fast:?}");
    // The control: without a speed nothing is waited for. (40 steps of one box take some milliseconds.)
    assert!(free < real, "{free:?} {real:?}");
}

#[test]
fn the_force_of_a_spring_points_to_its_end_and_slows_what_moves() {
    let motion = BodyMotion {
        pose: Pose::translation(1.0, 2.0, 3.0),
        linear: [0.0; 3],
        angular: [0.0; 3],
        carried_mass: 2.0,
        is_fixed: false,
    };
    let spring = Spring { env: EnvId(0), body: 0, hold: [0.1, 0.0, 0.0], target: [1.1, 2.0, 3.5] };
    let (point, force) = spring.force(&motion);
    // 2 kg (8 rad/s)² 0.5 m = 64 N, straight up.
    assert!((0..3).all(|k| (point[k] - [1.1, 2.0, 3.0][k]).abs() < 1e-12));
    assert!((0..3).all(|k| (force[k] - [0.0, 0.0, 64.0][k]).abs() < 1e-9), "{force:?}");
    // Turning about z with 1 rad/s, the point moves along y with 0.1 m/s: 2 kg 2 (8 rad/s) 0.1 m/s against it.
    let (_, force) = spring.force(&BodyMotion { angular: [0.0, 0.0, 1.0], ..motion });
    assert!((force[1] + 3.2).abs() < 1e-9, "{force:?}");
}

/// A free body in its centre of mass on the spring is a critically damped oscillator: x(t) = 1 - (1 + w t) e^-wt.
#[test]
fn a_dragged_body_follows_as_the_closed_form_says() {
    let cfg = SimulationManagerCfg { gravity: [0.0; 3].into(), physics_dt: 1e-3, ground: None, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let cube = RigidObjectCfg { uid: "cube".into(), mass: Some(MASS), ..Default::default() };
    let id = sim.add_rigid_object(cube).unwrap();
    let viewer = sim.viewer(Wants::default());
    viewer.send(Command::Drag { env: EnvId(0), body: 0, hold: [0.0; 3], target: [1.0, 0.0, 0.0] });
    // The command is obeyed after the first step.
    sim.update(1);
    for k in 1..=5 {
        sim.update(100);
        let wt = 8.0 * 0.1 * f64::from(k);
        let expected = 1.0 - (1.0 + wt) * (-wt).exp();
        let x = sim.rigid_object(id).get_pose()[(0, 0)];
        // Semi-implicit Euler with the force of the beginning of the step moves the poles by w² h / 2 relative to w: the
        // curve is late or early by less than w h = 0.8 %, of a way of 1 m.
        assert!((x - expected).abs() < 0.008, "after {wt}: {x}, not {expected}");
    }
    viewer.send(Command::Release);
    sim.update(1);
    let v = sim.rigid_object(id).get_velocity()[(0, 0)];
    sim.update(100);
    let after = sim.rigid_object(id).get_velocity()[(0, 0)];
    assert_eq!(v, after, "let go, it flies on as it was");
    // A viewer that goes lets go as well.
    viewer.send(Command::Drag { env: EnvId(0), body: 0, hold: [0.0; 3], target: [9.0, 0.0, 0.0] });
    let speed = |sim: &SimulationManager| sim.rigid_object(id).get_velocity()[(0, 0)];
    step_until(&mut sim, |sim| speed(sim) > after);
    drop(viewer);
    // While it is pulled it is looked after every step.
    sim.update(2);
    let v = speed(&sim);
    sim.update(50);
    assert_eq!(v, speed(&sim));
}

/// A free cube without gravity, edges of 0.2 m, steps of 1 ms.
fn floating_cube() -> (SimulationManager, ObjectId) {
    let cfg = SimulationManagerCfg { gravity: [0.0; 3].into(), physics_dt: 1e-3, ground: None, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let shape = ObjectShape::cube(0.2);
    let id = sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), shape, mass: Some(MASS), ..Default::default() });
    (sim, id.unwrap())
}

/// Two springs at one body act together. At its centre, to x and to y: `x'' = w² (1 - 2 x) - 4 w x'`, so it comes to rest half
/// way to either. At points of its own, to either side: a couple.
#[test]
fn springs_of_two_viewers_at_one_body_add_up() {
    let (mut sim, id) = floating_cube();
    let (first, second) = (sim.viewer(Wants::default()), sim.viewer(Wants::default()));
    let drag = |hold, target| Command::Drag { env: EnvId(0), body: 0, hold, target };
    first.send(drag([0.0; 3], [1.0, 0.0, 0.0]));
    second.send(drag([0.0; 3], [0.0, 1.0, 0.0]));
    // The slower pole is (2 - √2) w = 4.7 s⁻¹: e^-14 of the way is left after 3 s.
    sim.update(3000);
    let pose = sim.rigid_object(id).get_pose();
    assert!((pose[(0, 0)] - 0.5).abs() < 1e-5 && (pose[(0, 1)] - 0.5).abs() < 1e-5, "{pose}");
    // One lets go: the other has it alone. Its pole is w = 8 s⁻¹, twice: (1 + 24) e^-24 is left.
    first.send(Command::Release);
    sim.update(3000);
    let pose = sim.rigid_object(id).get_pose();
    assert!(pose[(0, 0)].abs() < 1e-6 && (pose[(0, 1)] - 1.0).abs() < 1e-6, "{pose}");
    drop((first, second));

    let (mut sim, id) = floating_cube();
    let (first, second) = (sim.viewer(Wants::default()), sim.viewer(Wants::default()));
    first.send(drag([0.0, 0.1, 0.0], [1.0, 0.1, 0.0]));
    second.send(drag([0.0, -0.1, 0.0], [-1.0, -0.1, 0.0]));
    // Obeyed after the first step; the second is the first that is pulled.
    sim.update(2);
    let v = sim.rigid_object(id).get_velocity();
    // 2 kg (8 rad/s)² 1 m = 128 N, each 0.1 m beside the centre, against m a² / 6, for a millisecond.
    let spin = -2.0 * 0.1 * 128.0 / (MASS * 0.04 / 6.0) * 1e-3;
    assert!((v[(0, 5)] - spin).abs() < 1e-6 * spin.abs(), "{v} instead of {spin}");
    assert!((0..3).all(|k| v[(0, k)].abs() < 1e-9), "the forces cancel: {v}");
}

#[test]
fn a_refusal_is_told_until_something_else_is_done_and_told_again() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(Wants { rate: 1000.0, ..Wants::default() });
    let run = || viewer.newest().unwrap().run.clone();
    assert_eq!((run().refused, run().refusals), (None, 0));
    for count in 1..=2 {
        viewer.send(Command::Record(true));
        step_until(&mut sim, |_| run().refusals == count);
        assert!(run().refused.is_some_and(|reason| reason.contains("record button")), "{count}");
    }
    // A spring says nothing about it, and what is done does.
    viewer.send(Command::Drag { env: EnvId(0), body: 0, hold: [0.0; 3], target: [0.0; 3] });
    viewer.send(Command::Release);
    sim.update(100);
    assert!(run().refused.is_some());
    viewer.send(Command::SetSpeed(Speed::Free));
    step_until(&mut sim, |_| run().refused.is_none());
    assert_eq!(run().refusals, 2);
}

/// Watching, with everything that can be wanted, changes no bit; nor does a viewer that never looks and lets nothing go.
#[test]
fn watching_changes_nothing_and_waits_for_nobody() {
    let run = |watch: bool| {
        let mut sample = sample(3);
        let wants = Wants { rate: 1000.0, contacts: Some(Shown::All), ..Wants::default() };
        let mut held = Vec::new();
        let viewers: Vec<Viewer> = (0..3).filter(|_| watch).map(|_| sample.sim.viewer(wants)).collect();
        for k in 0..50 {
            sample.sim.update(4);
            // It keeps every snapshot it gets: more than there are.
            held.extend(viewers.iter().filter_map(Viewer::newest));
            if k == 20 {
                sample.sim.reset(Some(&[EnvId(1)])).unwrap();
            }
        }
        if watch {
            let mut numbers: Vec<u64> = held.iter().map(|snapshot| snapshot.number).collect();
            numbers.dedup();
            assert!(numbers.len() > 1, "there were snapshots: {numbers:?}");
            assert!(numbers.len() <= 5, "a pool of 5 for 3 viewers: {numbers:?}");
        }
        let mut bits = Vec::new();
        sample.sim.batch().for_each(|_, env| {
            let data = env.data();
            let numbers = data.qpos().iter().chain(data.qvel()).chain(data.qacc_warmstart());
            bits.extend(numbers.map(|x| x.to_bits()));
        });
        bits
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn a_viewer_sees_what_was_added_later() {
    let mut sample = sample(1);
    let viewer = sample.sim.viewer(Wants::default());
    let before = viewer.newest().unwrap();
    let cfg = RigidObjectCfg { uid: "late".into(), init_pose: Pose::translation(0.0, 1.0, 0.5), ..Default::default() };
    sample.sim.add_rigid_object(cfg).unwrap();
    let after = viewer.newest().unwrap();
    assert!(after.number > before.number);
    assert!(after.names.bodies.iter().any(|name| name == "late"));
    assert_eq!(before.names.bodies.len() + 1, after.names.bodies.len(), "a snapshot never changes");
    assert_eq!(after.envs[0].look.bodies.len(), after.names.bodies.len());
}

/// Counts how often a recording was begun and ended.
#[derive(Debug, Default)]
struct Counter {
    on: bool,
    begun: u32,
    ended: u32,
}

impl Recording for Counter {
    fn set(&mut self, _: &mut SimulationManager, on: bool) -> Result<(), String> {
        self.begun += u32::from(on && !self.on);
        self.ended += u32::from(self.on && !on);
        self.on = on;
        Ok(())
    }

    fn state(&self, sim: &SimulationManager) -> RecordingState {
        RecordingState { on: self.on, text: format!("step {}", sim.steps()) }
    }
}

#[test]
fn the_record_button_is_pressed_between_steps_and_its_state_is_seen() {
    let mut sim = sample(1).sim;
    let viewer = sim.viewer(Wants { rate: 1000.0, ..Wants::default() });
    let newest = |viewer: &Viewer| viewer.newest().unwrap().run.clone();
    assert_eq!(newest(&viewer).recording, None);
    viewer.send(Command::Record(true));
    step_until(&mut sim, |_| newest(&viewer).refused.is_some_and(|reason| reason.contains("record button")));
    let counter = Arc::new(Mutex::new(Counter::default()));
    let counted = || {
        let counter = counter.lock().unwrap();
        (counter.on, counter.begun, counter.ended)
    };
    let button = RecordButton::shared(Arc::clone(&counter));
    sim.record_button(button.clone());
    assert!(newest(&viewer).recording.is_some_and(|recording| !recording.on));
    viewer.send(Command::Record(true));
    step_until(&mut sim, |_| counted() == (true, 1, 0));
    // What it says is of the very step that is shown.
    step_until(&mut sim, |_| {
        let run = newest(&viewer);
        run.recording.is_some_and(|recording| recording.on && recording.text == format!("step {}", run.steps))
    });
    // Who comes later may end it.
    let other = viewer.another(Wants::default());
    other.send(Command::Record(false));
    step_until(&mut sim, |_| counted() == (false, 1, 1));
    // While its lock is held it is refused, and nothing waits.
    let held = counter.lock().unwrap();
    viewer.send(Command::Record(true));
    step_until(&mut sim, |_| newest(&viewer).refused.is_some_and(|reason| reason.contains("busy")));
    assert!(newest(&viewer).recording.is_some(), "what was known of it stays");
    drop(held);
    assert_eq!(counted(), (false, 1, 1));
    // Paused, it is pressed too.
    viewer.send(Command::Pause);
    viewer.send(Command::Record(true));
    let running = Running::start(sim);
    let paused = wait_for(&viewer, |s| s.run.paused && s.run.recording.as_ref().is_some_and(|r| r.on)).run.steps;
    assert_eq!(counted(), (true, 2, 1));
    viewer.send(Command::Resume);
    assert!(running.goes_on_beyond(paused + 2));
    drop((viewer, other));
    running.end();
}

#[test]
fn a_recording_ends_with_the_viewer_that_began_it_and_with_nobody_else() {
    let mut sim = sample(1).sim;
    let (first, second) = (sim.viewer(Wants::default()), sim.viewer(Wants::default()));
    let counter = Arc::new(Mutex::new(Counter::default()));
    let counted = || {
        let counter = counter.lock().unwrap();
        (counter.on, counter.begun, counter.ended)
    };
    sim.record_button(RecordButton::shared(Arc::clone(&counter)));
    first.send(Command::Record(true));
    step_until(&mut sim, |_| counted() == (true, 1, 0));
    // Pressed again it is not somebody else's.
    second.send(Command::Record(true));
    sim.update(200);
    drop(second);
    sim.update(200);
    assert_eq!(counted(), (true, 1, 0));
    drop(first);
    step_until(&mut sim, |_| counted() == (false, 1, 1));
    // What the program began is the program's.
    counter.lock().unwrap().set(&mut sim, true).unwrap();
    let viewer = sim.viewer(Wants::default());
    viewer.send(Command::Record(true));
    sim.update(200);
    drop(viewer);
    sim.update(200);
    assert_eq!(counted(), (true, 2, 1));
    // The same button once more changes nothing; another one ends what the first was doing.
    sim.record_button(RecordButton::shared(Arc::clone(&counter)));
    assert_eq!(counted(), (true, 2, 1));
    sim.record_button(RecordButton::new(Counter::default()));
    assert_eq!(counted(), (false, 2, 2));
}
