//! Cost of recording: a simulation with a camera whose images are read, with and without a recorder.
//!
//! Both sides step the same arms and read the same images. Our side also writes them to an MCAP file: color as PNG,
//! depth uncompressed, and the states of every image. A block ends when all data are passed to the file. There are two
//! speeds: real time, where the recorder uses the idle part of the machine, and maximum speed, where simulation and
//! recorder compete.
//!
//! Another row is the number of frames that one core encodes for an MP4 file: frames per second of processor time of the
//! recorder's thread.

use crate::interleave::{Contender, MeasurementCfg, in_both_orders, measure};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use crate::thread_time::thread_seconds;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::record::{RecorderCfg, RecorderId};
use kinetoscope::sensors::camera::Camera;
use std::time::{Duration, Instant};

const ENVS: usize = 16;
const SIDE: usize = 128;
/// Steps per second, and steps between two images: 30 Hz.
const RATE: u32 = 240;
const IMAGE_EVERY: u32 = 8;
/// Target: less than 5 % slower.
const TARGET_RATIO: f64 = 0.95;
/// A recording restarts after this many steps, at some hundred megabytes.
const RESTART: u32 = 4000;
/// Width and height of videos.
const VIDEO_SIZE: [usize; 2] = [640, 480];
/// Frames before the measurement of videos: the first one is larger.
const WARM_UP_FRAMES: u32 = 10;
/// Frames of a video per second of the nominal time of a measurement: the rate that one core is meant to exceed.
const VIDEO_RATE: f64 = 200.0;
/// Name of the thread of a recorder.
const RECORDER_THREAD: &str = "recording";

struct Arms {
    sim: SimulationManager,
    camera: SensorId<Camera>,
    recorder: Option<RecorderId>,
    folder: Option<tempfile::TempDir>,
    step: u32,
}

impl Arms {
    fn new(recorded: bool) -> BenchResult<Self> {
        let dt = 1.0 / f64::from(RATE);
        let cfg = SimulationManagerCfg { num_envs: ENVS, physics_dt: dt, ..Default::default() };
        let mut sim = SimulationManager::new(cfg)?;
        let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf")?);
        sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() })?;
        let camera = sim.add_sensor(
            "camera",
            CameraCfg {
                width: SIDE,
                height: SIDE,
                intrinsics: Intrinsics::Fovy { radians: 0.9 },
                channels: Channels { color: true, depth: true, ..Channels::default() },
                update_period: f64::from(IMAGE_EVERY) * dt,
                extrinsics: Extrinsics {
                    placement: Placement::LookAt { eye: [1.5, 1.0, 1.0], target: [0.2, 0.0, 0.4], up: [0.0, 0.0, 1.0] },
                    ..Extrinsics::default()
                },
                ..CameraCfg::default()
            },
        )?;
        let folder = if recorded { Some(tempfile::tempdir()?) } else { None };
        Ok(Self { sim, camera, recorder: None, folder, step: 0 })
    }
}

impl Contender for Arms {
    fn restart(&mut self) -> BenchResult<()> {
        if let Some(recorder) = self.recorder.take() {
            self.sim.finish_recording(recorder)?;
        }
        self.sim.reset(None)?;
        self.step = 0;
        if let Some(folder) = &self.folder {
            let path = folder.path().join("run.mcap");
            let cfg = RecorderCfg { period_steps: IMAGE_EVERY.into(), overwrite: true, ..RecorderCfg::new(path) };
            self.recorder = Some(self.sim.record(cfg)?);
        }
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.sim.update(1);
            self.step += 1;
            if self.step.is_multiple_of(IMAGE_EVERY) {
                self.sim.sensor(self.camera)?.images()?;
            }
        }
        if let Some(recorder) = self.recorder {
            self.sim.observers_mut().get_mut(recorder)?.wait_until_written();
        }
        Ok(start.elapsed())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        let arm = self.sim.entities().robot_id("arm")?;
        Ok(Some(self.sim.robot(arm).qpos().into_iter().collect()))
    }
}

/// Frames of a camera on a moving arm that one core encodes per second as a video; `None` if the system does not say how
/// much time a thread used.
fn video_frames_per_second(frames: u32) -> BenchResult<Option<f64>> {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 1, ..Default::default() })?;
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf")?);
    let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() })?;
    let [width, height] = VIDEO_SIZE;
    let camera = CameraCfg {
        width,
        height,
        channels: Channels { color: true, ..Channels::NONE },
        extrinsics: Extrinsics {
            parent: Some("ee_link".into()),
            placement: Placement::LookAt { eye: [0.0; 3], target: [0.0, 0.0, 1.0], up: [0.0, 1.0, 0.0] },
            ..Extrinsics::default()
        },
        update_period: sim.cfg().physics_dt,
        ..CameraCfg::default()
    };
    sim.add_sensor("camera", camera)?;
    let folder = tempfile::tempdir()?;
    let recorder = sim.record(RecorderCfg::new(folder.path().join("run.mp4")))?;
    let mut before = 0.0;
    for frame in 0..WARM_UP_FRAMES + frames {
        if frame == WARM_UP_FRAMES {
            sim.observers_mut().get_mut(recorder)?.wait_until_written();
            let Some(seconds) = thread_seconds(RECORDER_THREAD) else { return Ok(None) };
            before = seconds;
        }
        // A turn of half a radian in each direction, in 2 s.
        let angle = 0.5 * (std::f64::consts::TAU * f64::from(frame) / 60.0).sin();
        let targets = Array2::from_elem((1, sim.robot(arm).dof()), angle);
        sim.robot_mut(arm).set_qpos_target(&targets, None, None)?;
        sim.update(1);
    }
    sim.observers_mut().get_mut(recorder)?.wait_until_written();
    let after = thread_seconds(RECORDER_THREAD);
    sim.finish_recording(recorder)?;
    Ok(after.map(|after| f64::from(frames) / (after - before)))
}

/// Simulated seconds per second in real time: each step begins on schedule, or as soon as possible.
fn real_time_factor(recorded: bool, seconds: f64) -> BenchResult<f64> {
    let mut arms = Arms::new(recorded)?;
    arms.restart()?;
    // The first image and the first chunk of the file allocate memory.
    arms.block(2 * IMAGE_EVERY)?;
    let steps = (seconds * f64::from(RATE)) as u32;
    let start = Instant::now();
    for step in 0..steps {
        let due = Duration::from_secs_f64(f64::from(step) / f64::from(RATE));
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        arms.block(1)?;
    }
    Ok(f64::from(steps) / f64::from(RATE) / start.elapsed().as_secs_f64())
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let mut threads = 0;
    let times = in_both_orders(|order| {
        let (mut ours, mut baseline) = order.create(|| Arms::new(true), || Arms::new(false))?;
        threads = ours.sim.threads();
        let plan = MeasurementCfg { seconds: settings.seconds / 2.0, restart_after: RESTART };
        let times = measure(plan, &mut [&mut ours, &mut baseline]);
        if let Some(recorder) = ours.recorder.take() {
            eprintln!("  {}", ours.sim.finish_recording(recorder)?);
        }
        times
    })?;
    let [with, without] = [real_time_factor(true, settings.seconds)?, real_time_factor(false, settings.seconds)?];
    let case = |speed: &str| format!("{ENVS} envs, camera {SIDE} x {SIDE} RGB-D at 30 Hz, {speed}");
    let real = Row::new("record", case("in real time"), "x real time", threads, with);
    let free = Row::new("record", case("without real-time limit"), "env-steps/s", threads, times.rate(0, ENVS));
    let mut rows = vec![
        real.against("without recording", without, with / without).with_target_ratio(TARGET_RATIO),
        free.against("without recording", times.rate(1, ENVS), times.ratio(0, 1)).with_target_ratio(TARGET_RATIO),
    ];
    if let Some(rate) = video_frames_per_second((VIDEO_RATE * settings.seconds) as u32)? {
        let [width, height] = VIDEO_SIZE;
        rows.push(Row::new("record", format!("MP4 of a moving camera, {width} x {height}"), "frames/s", 1, rate));
    }
    Ok(rows)
}
