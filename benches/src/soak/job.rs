//! The mixed job: 64 environments with sensors, recordings, randomization, snapshots, browser views, and simulations that
//! are created and dropped. A cycle takes about a second. It ends without recordings and viewers, so that resources at
//! the ends of cycles are comparable.

use crate::SoakResult;
use crate::clients::Client;
use kinetoscope::ndarray::{Array2, Array3};
use kinetoscope::prelude::*;
use kinetoscope::record::{RecorderCfg, RecorderId, Topic};
use kinetoscope::scene::KeyedRng;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{RayAlignment, RayCaster};
use kinetoscope::sensors::{ContactSensor, Imu};
use kinetoscope::sim::{RigidObjectId, Snapshot, WrenchFrame};
use kinetoscope::viewer::ServerHandle;
use std::fmt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const ENVS: usize = 64;
const THREADS: usize = 2;
/// Physics steps of a cycle.
const STEPS: u32 = 60;
/// Steps between two reads of all sensors.
const READ_EVERY: u32 = 5;
/// In every 16th cycle, a viewer that reads nothing stays until the server disconnects it.
const PATIENT_CYCLE: u64 = 16;
/// Longest wait for the server to disconnect a viewer, or to notice that viewers have left.
const TIMEOUT: Duration = Duration::from_secs(60);
/// Recordings beside the MCAP file, one in each cycle.
const OTHER_FORMATS: [&str; 4] = ["run.npz", "images", "run.gif", "run.mp4"];

/// Numbers of actions so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    pub(crate) cycles: u64,
    env_steps: u64,
    resets: u64,
    randomized: u64,
    restores: u64,
    recordings: u64,
    recorded_bytes: u64,
    clients: u64,
    messages: u64,
    simulations: u64,
    diverged: u64,
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} cycles, {} steps of an environment, {} resets, {} randomized, {} restored, {} diverged, {} recordings of \
             {} MB in all, {} viewers with {} messages, {} simulations created and dropped",
            self.cycles,
            self.env_steps,
            self.resets,
            self.randomized,
            self.restores,
            self.diverged,
            self.recordings,
            self.recorded_bytes / 1_000_000,
            self.clients,
            self.messages,
            self.simulations
        )
    }
}

/// A long-lived simulation that is served, and the random numbers of its cycles.
pub(crate) struct Job {
    sim: SimulationManager,
    robot: RobotId,
    boxes: Vec<RigidObjectId>,
    camera: SensorId<Camera>,
    scanner: SensorId<RayCaster>,
    contact: SensorId<ContactSensor>,
    imu: SensorId<Imu>,
    served: ServerHandle,
    random: KeyedRng,
    snapshot: Option<Snapshot>,
    counts: Counts,
}

impl Job {
    pub(crate) fn new() -> SoakResult<Self> {
        let cfg = SimulationManagerCfg { num_envs: ENVS, threads: Some(THREADS), ..SimulationManagerCfg::default() };
        let mut sim = SimulationManager::new(cfg)?;
        let robot = sim.add_robot(arm()?)?;
        let boxes = (0..3).map(|k| {
            let side = 0.12 + 0.03 * f64::from(k);
            let init_pose = Pose::translation(0.7, 0.3 * f64::from(k) - 0.3, 0.4);
            let shape = ObjectShape::cube(side);
            sim.add_rigid_object(RigidObjectCfg { uid: format!("box{k}"), shape, init_pose, ..Default::default() })
        });
        let boxes = boxes.collect::<Result<Vec<_>, _>>()?;
        let camera = sim.add_sensor("eye", camera())?;
        let scanner = RayCasterCfg {
            parent: Some("box0".into()),
            offset: Pose::translation(0.0, 0.0, 1.0),
            alignment: RayAlignment::Yaw,
            pattern: Grid { resolution: 0.1, size: [1.6, 1.0], ..Grid::default() }.into(),
            sampling: SamplingCfg::every(0.02),
            ..RayCasterCfg::default()
        };
        let scanner = sim.add_sensor("scanner", scanner)?;
        let contact = ContactSensorCfg {
            filters: vec!["ground".into(), "arm/.*".into()],
            track_air_time: true,
            track_contact_points: true,
            ..ContactSensorCfg::for_bodies("box.*")
        };
        let contact = sim.add_sensor("contact", contact)?;
        let imu = sim.add_sensor("imu", ImuCfg::on("box1"))?;
        let served = sim.serve("127.0.0.1:0")?;
        let random = KeyedRng::keyed(1, 0, "soak");
        let counts = Counts::default();
        Ok(Self { sim, robot, boxes, camera, scanner, contact, imu, served, random, snapshot: None, counts })
    }

    pub(crate) fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Runs one cycle.
    ///
    /// # Errors
    /// A call that should succeed failed, or a viewer was not served.
    pub(crate) fn cycle(&mut self) -> SoakResult<()> {
        let folder = tempfile::tempdir()?;
        let recorders = self.record(folder.path())?;
        let address = self.served.address();
        let (stop, stop_silent) = (AtomicBool::new(false), AtomicBool::new(false));
        let is_patient = self.counts.cycles % PATIENT_CYCLE == PATIENT_CYCLE - 1;
        let messages = std::thread::scope(|scope| -> SoakResult<u64> {
            let silent = scope.spawn(|| Client::NeverReads.run(address, &stop_silent));
            let stop_flag = &stop;
            let others = [Client::Reads, Client::Disconnects, Client::Requests];
            let others = others.map(|client| scope.spawn(move || client.run(address, stop_flag)));
            let mut result = (0..STEPS).try_for_each(|step| self.step(step));
            stop.store(true, Ordering::Relaxed);
            let mut messages = 0;
            for client in others {
                match client.join().unwrap_or_else(|_| Err("a client panicked".into())) {
                    Ok(more) => messages += more,
                    Err(error) => result = result.and(Err(error.into())),
                }
            }
            if is_patient && result.is_ok() {
                result = self.step_until("a viewer that reads nothing is disconnected", |served| served.viewers() == 0);
            }
            stop_silent.store(true, Ordering::Relaxed);
            let silent = silent.join().unwrap_or_else(|_| Err("a client panicked".into()));
            result.and(silent.map_err(Into::into)).map(|_| messages)
        })?;
        for recorder in recorders {
            self.counts.recorded_bytes += self.sim.finish_recording(recorder)?.bytes;
            self.counts.recordings += 1;
        }
        folder.close()?;
        self.step_until("viewers that have left are counted", |served| served.viewers() == 0)?;
        self.short_life()?;
        self.counts.cycles += 1;
        self.counts.clients += 4;
        self.counts.messages += messages;
        Ok(())
    }

    /// Starts two recordings in a folder: an MCAP file, and another format.
    fn record(&mut self, folder: &Path) -> SoakResult<[RecorderId; 2]> {
        let envs = Some(vec![EnvId(0), EnvId(ENVS / 2), EnvId(ENVS - 1)]);
        let mcap = RecorderCfg { envs: envs.clone(), ..RecorderCfg::new(folder.join("run.mcap")) };
        let name = OTHER_FORMATS[self.counts.cycles as usize % OTHER_FORMATS.len()];
        let other = RecorderCfg::new(folder.join(name));
        let other = match name {
            "run.npz" => RecorderCfg { envs, ..other },
            "images" => RecorderCfg { envs, ..other.with_topics(["color", "depth"].map(|c| Topic::channel("eye", c))) },
            _ => RecorderCfg { envs: Some(vec![EnvId(1)]), ..other.with_topics([Topic::channel("eye", "color")]) },
        };
        Ok([self.sim.record(mcap)?, self.sim.record(other)?])
    }

    /// A random share of the environments, at least one.
    fn some_envs(&mut self) -> Vec<EnvId> {
        let first = (self.random.uniform() * ENVS as f64) as usize;
        let count = 1 + (self.random.uniform() * 7.0) as usize;
        (first..(first + count).min(ENVS)).map(EnvId).collect()
    }

    fn step(&mut self, step: u32) -> SoakResult<()> {
        let dof = self.sim.robot(self.robot).dof();
        let random = &mut self.random;
        if step.is_multiple_of(10) {
            let targets = Array2::from_shape_simple_fn((ENVS, dof), || random.uniform_range(-0.8, 0.8));
            self.sim.robot_mut(self.robot).set_qpos_target(&targets, None, None)?;
        }
        if step % 10 == 3 {
            self.push()?;
        }
        if self.random.uniform() < 0.2 {
            let envs = self.some_envs();
            self.counts.resets += envs.len() as u64;
            self.sim.reset(Some(&envs))?;
        }
        if self.random.uniform() < 0.1 {
            let envs = self.some_envs();
            self.counts.randomized += envs.len() as u64;
            self.sim.properties_mut().randomize(&randomization(), Some(&envs))?;
        }
        if step == STEPS / 3 {
            let envs = self.some_envs();
            let snapshot = self.sim.snapshot(Some(&envs))?;
            self.snapshot = Some(Snapshot::from_bytes(&snapshot.to_bytes())?);
        }
        if step == 2 * STEPS / 3
            && let Some(snapshot) = &self.snapshot
        {
            self.counts.restores += snapshot.len() as u64;
            self.sim.restore(snapshot, None)?;
        }
        self.advance()?;
        if step % READ_EVERY == READ_EVERY - 1 {
            self.read()?;
        }
        Ok(())
    }

    /// Steps all environments, and resets those that diverged.
    fn advance(&mut self) -> SoakResult<()> {
        self.sim.update(1);
        self.counts.env_steps += ENVS as u64;
        let diverged: Vec<EnvId> = self.sim.diverged().iter().map(|diverged| diverged.env).collect();
        if !diverged.is_empty() {
            self.counts.diverged += diverged.len() as u64;
            self.sim.reset(Some(&diverged))?;
        }
        Ok(())
    }

    /// Sets new wrenches on a link of the arm and on a box.
    fn push(&mut self) -> SoakResult<()> {
        let random = &mut self.random;
        let link = self.sim.robot(self.robot).link_id("link4")?;
        let forces = Array3::from_shape_simple_fn((ENVS, 1, 3), || random.uniform_range(-5.0, 5.0));
        let none = Array3::zeros((1, 1, 3));
        self.sim.robot_mut(self.robot).set_external_wrench(&forces, &none, WrenchFrame::World, Some(&[link]), None)?;
        let envs = self.some_envs();
        let random = &mut self.random;
        let forces = Array2::from_shape_simple_fn((envs.len(), 3), || random.uniform_range(-5.0, 5.0));
        let none = Array2::zeros((1, 3));
        let object = self.boxes[(self.random.uniform() * self.boxes.len() as f64) as usize];
        Ok(self.sim.rigid_object_mut(object).set_external_wrench(&forces, &none, WrenchFrame::World, Some(&envs))?)
    }

    /// Reads all sensors. Running environments have finite values.
    fn read(&self) -> SoakResult<()> {
        let color = self.sim.sensor(self.camera)?.color()?;
        let lightest = color.iter().copied().max().unwrap_or(0);
        let distances = self.sim.sensor(self.scanner)?.distances();
        let forces = self.sim.sensor(self.contact)?.net_forces_w();
        let accelerations = self.sim.sensor(self.imu)?.lin_acc_b();
        if lightest == 0 || distances.iter().all(|x| !x.is_finite()) || !forces.iter().all(|x| x.is_finite()) {
            return Err("a sensor has no values".into());
        }
        match accelerations.iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err("the IMU has values that are not finite".into()),
        }
    }

    /// Steps until a condition of the served view holds.
    fn step_until(&mut self, what: &str, holds: impl Fn(&ServerHandle) -> bool) -> SoakResult<()> {
        let start = Instant::now();
        while !holds(&self.served) {
            if start.elapsed() > TIMEOUT {
                return Err(format!("waited for {} s: {what}", TIMEOUT.as_secs()).into());
            }
            self.advance()?;
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    /// Creates a served simulation with a robot and a camera, records without an end, and drops everything.
    fn short_life(&mut self) -> SoakResult<()> {
        let folder = tempfile::tempdir()?;
        let (mut sim, camera) = small_simulation(4, THREADS)?;
        let served = sim.serve("127.0.0.1:0")?;
        sim.record(RecorderCfg::new(folder.path().join("run.mcap")))?;
        let stop = AtomicBool::new(true);
        Client::Disconnects.run(served.address(), &stop)?;
        Client::Requests.run(served.address(), &stop)?;
        sim.update(6);
        sim.sensor(camera)?.color()?;
        let snapshot = sim.snapshot(None)?;
        sim.restore(&snapshot, None)?;
        sim.update(1);
        drop(sim);
        folder.close()?;
        self.counts.simulations += 1;
        Ok(())
    }
}

/// The bundled arm.
fn arm() -> SoakResult<RobotCfg> {
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf")?);
    Ok(RobotCfg { uid: "arm".into(), urdf, ..RobotCfg::default() })
}

/// A small camera beside the arm.
fn camera() -> CameraCfg {
    let placement = Placement::LookAt { eye: [1.5, 1.0, 1.0], target: [0.2, 0.0, 0.4], up: [0.0, 0.0, 1.0] };
    CameraCfg {
        width: 32,
        height: 24,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        channels: Channels { color: true, depth: true, ..Channels::NONE },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        update_period: 0.05,
        ..CameraCfg::default()
    }
}

fn randomization() -> Randomization {
    Randomization::new()
        .with(Property::Mass, ".*", RandomizationOp::Scale([0.7, 1.4]))
        .with(Property::Friction, ".*", RandomizationOp::Scale([0.5, 1.5]))
        .with(Property::Stiffness, ".*", RandomizationOp::Scale([0.8, 1.2]))
        .with(Property::DriveDamping, ".*", RandomizationOp::Scale([0.8, 1.2]))
}

/// A simulation of the arm with a camera.
pub(crate) fn small_simulation(num_envs: usize, threads: usize) -> SoakResult<(SimulationManager, SensorId<Camera>)> {
    let cfg = SimulationManagerCfg { num_envs, threads: Some(threads), ..SimulationManagerCfg::default() };
    let mut sim = SimulationManager::new(cfg)?;
    sim.add_robot(arm()?)?;
    let camera = sim.add_sensor("eye", camera())?;
    Ok((sim, camera))
}
