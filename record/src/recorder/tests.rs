mod events;
mod pairs;

use super::*;
use crate::npy;
use crate::packet::Values;
use crate::recover::recover;
use crate::writer::Written;
use crate::zip;
use scene::{Pose, SceneState};
use sensors::camera::{Camera, CameraCfg, Channels, Extrinsics, Intrinsics, Placement};
use sensors::ray::pattern::Grid;
use sensors::ray::{RayCasterCameraCfg, RayCasterCfg};
use sensors::{
    Channel, ImuCfg, Requires, Sampled, Sampler, SamplingCfg, Sensor, SensorCfg, SensorContext, SensorError,
};
use sim::{MjcfCfg, SensorId, SimulationManagerCfg};
use std::path::Path;
use std::sync::Mutex;

/// A ball that falls.
pub(crate) const BALL: &str = r#"<mujoco><worldbody><body name="ball" pos="0 0 1"><freejoint/>
    <geom size="0.1"/></body></worldbody></mujoco>"#;

fn falling(num_envs: usize) -> SimulationManager {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs, ..Default::default() }).unwrap();
    sim.add_mjcf(MjcfCfg::text("ball", BALL)).unwrap();
    sim
}

/// Takes its time, and keeps what it got.
struct Slow {
    heights: Arc<Mutex<Vec<f64>>>,
    pause: Duration,
}

impl Sink for Slow {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written {
        std::thread::sleep(self.pause);
        assert_eq!(streams.len(), 1);
        let Values::F64(values) = &packet.blocks[0].values else { panic!("states are f64") };
        self.heights.lock().unwrap().push(values[2]);
        Ok(())
    }

    fn flush(&mut self) -> Written {
        Ok(())
    }

    fn finish(&mut self, _streams: &[Stream]) -> Written<u64> {
        Ok(0)
    }

    fn kept(&self) -> Option<PathBuf> {
        None
    }
}

fn recorded_slowly(packets: usize, steps: u32, pause: Duration) -> (Recorded, Vec<f64>) {
    let mut sim = falling(1);
    let cfg = RecorderCfg { packets, scene: false, ..RecorderCfg::new("nowhere.mcap") };
    let cfg = cfg.with_topics([Topic::MjcfState("ball".into())]);
    let (sources, left_out) = resolve(&mut sim, &cfg, Format::Mcap).unwrap();
    let heights = Arc::new(Mutex::new(Vec::new()));
    let sink = Box::new(Slow { heights: Arc::clone(&heights), pause });
    let recorder = Recorder::begin(&mut sim, cfg, Format::Mcap, sources, left_out, sink).unwrap();
    let recorder = sim.add_observer(recorder);
    sim.update(steps);
    let recorded = sim.finish_recording(recorder).unwrap();
    let heights = heights.lock().unwrap().clone();
    (recorded, heights)
}

#[test]
fn a_simulation_waits_for_a_slow_disk_says_so_and_loses_nothing() {
    let (steps, pause) = (20, Duration::from_millis(3));
    let (recorded, heights) = recorded_slowly(2, steps, pause);
    // One row at the beginning, one after each step.
    assert_eq!((heights.len(), recorded.packets), (21, 21));
    assert!(heights.windows(2).all(|pair| pair[1] < pair[0]), "the ball falls, in order: {heights:?}");
    // Steps of one ball take microseconds. The thread has one packet, the other is made meanwhile: 21 rows with 2 packets
    // wait 19 times, some of them perhaps not where this thread was held up longer than a pause.
    assert!(recorded.waits >= 10, "{recorded}");
    assert!(recorded.waited >= pause * 10, "{recorded}");
    assert!(recorded.to_string().contains("the simulation waited for it"), "{recorded}");
    // The control: with room for all of them, nobody waits, and the same is written.
    let (roomy, same) = recorded_slowly(32, steps, pause);
    assert_eq!((roomy.waits, roomy.waited, &same), (0, Duration::ZERO, &heights));
}

fn record_to_a_full_disk(sim: &mut SimulationManager, path: &Path, left: usize) -> Result<Recorded> {
    // Without the scene, which would fill the disk alone.
    let cfg = RecorderCfg { scene: false, ..RecorderCfg::new(path) };
    let recorder = Recorder::start(sim, cfg, &Disk::full_after(left))?;
    let recorder = sim.add_observer(recorder);
    sim.update(if sim.sensor_uids().is_empty() { 3000 } else { 60 });
    sim.finish_recording(recorder)
}

#[test]
fn an_animation_on_a_full_disk_is_an_error_and_leaves_nothing() {
    for (_, end) in Format::all().filter(|(format, _)| format.is_animation()) {
        let seen = || {
            let mut sim = falling(1);
            let camera = CameraCfg { width: 64, height: 64, ..CameraCfg::default() };
            sim.add_sensor("camera", CameraCfg { update_period: 0.05, ..camera }).unwrap();
            sim
        };
        // What is buffered is written at the end at the latest.
        for left in [0, 100, 900] {
            let folder = tempfile::tempdir().unwrap();
            let error =
                record_to_a_full_disk(&mut seen(), &folder.path().join(format!("run.{end}")), left).unwrap_err();
            assert!(error.to_string().contains("no space left"), "{end}: {error}");
            assert!(matches!(error, RecordError::File { kept: None, .. }), "{end}: {error:?}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{end}");
            record_to_a_full_disk(&mut seen(), &folder.path().join(format!("whole.{end}")), usize::MAX).unwrap();
        }
    }
}

/// All files below a folder, without the folder's name.
fn files(folder: &Path) -> Vec<String> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => found.push(path.strip_prefix(folder).unwrap().display().to_string()),
            }
        }
    }
    found.sort();
    found
}

/// Something to see and something that moves, for folders.
fn seen_and_moved() -> SimulationManager {
    let mut sim = falling(2);
    let ball = sim.mjcf_id("ball").unwrap();
    assert_eq!(sim.mjcf_part(ball).get_qpos().ncols(), 7);
    let camera = CameraCfg {
        width: 32,
        height: 24,
        channels: Channels { color: true, depth: true, ..Channels::NONE },
        ..CameraCfg::default()
    };
    sim.add_sensor("camera", CameraCfg { update_period: 0.02, ..camera }).unwrap();
    sim
}

#[test]
fn a_folder_of_pictures_on_a_full_disk_holds_whole_pictures_under_another_name() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    let bytes = record_to_a_full_disk(&mut seen_and_moved(), &whole, usize::MAX).unwrap().bytes;
    let all = files(&whole);
    assert!(all.len() > 20 && bytes > 5000, "{bytes} bytes in {}", all.len());
    for left in [0, 10, 300, 1000, bytes as usize / 2] {
        let path = folder.path().join(format!("left_{left}"));
        let error = record_to_a_full_disk(&mut seen_and_moved(), &path, left).unwrap_err();
        assert!(error.to_string().contains("no space left"), "{left}: {error}");
        assert!(!path.exists(), "{left}");
        let part = part_of(&path);
        if left < 40 {
            // Not even the head of the list found room: it was not begun.
            continue;
        }
        assert!(matches!(&error, RecordError::File { kept: Some(kept), .. } if *kept == part), "{left}: {error:?}");
        let names = files(&part);
        assert!(names.len() < all.len(), "{left}: {names:?}");
        for name in &names {
            assert!(all.contains(name), "{left}: nothing is called otherwise than in a whole one: {name}");
            let file = part.join(name);
            if name.ends_with(".png") {
                // Those that are there are those of a whole recording, to the last byte.
                assert_eq!(std::fs::read(&file).unwrap(), std::fs::read(whole.join(name)).unwrap(), "{left}: {name}");
            }
        }
        assert_eq!(names.iter().any(|name| name.ends_with(".png")), left >= 1000, "{left}: {names:?}");
    }
}

#[test]
fn a_dataset_on_a_full_disk_has_neither_its_name_nor_what_makes_it_one() {
    let folder = tempfile::tempdir().unwrap();
    let actuated = || {
        let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
        let text = r#"<mujoco><worldbody><body name="b" pos="0 0 1"><joint name="j" type="slide"/><geom size="0.1"/></body></worldbody>
            <actuator><motor joint="j"/></actuator></mujoco>"#;
        sim.add_mjcf(MjcfCfg::text("ball", text)).unwrap();
        sim
    };
    let whole = folder.path().join("whole.lerobot");
    let bytes = record_to_a_full_disk(&mut actuated(), &whole, usize::MAX).unwrap().bytes as usize;
    assert!(whole.join("meta/info.json").is_file() && bytes > 10_000, "{bytes}");
    // Nothing; in the rows; in the tables at the end; in the last file. Places of frames are written twice.
    for left in [0, 1000, bytes / 2, bytes - 100] {
        let path = folder.path().join(format!("left_{left}.lerobot"));
        let error = record_to_a_full_disk(&mut actuated(), &path, left).unwrap_err();
        assert!(error.to_string().contains("no space left"), "{left}: {error}");
        assert!(!path.exists(), "{left}");
        let part = part_of(&path);
        assert!(matches!(&error, RecordError::File { kept: Some(kept), .. } if *kept == part), "{left}: {error:?}");
        // A folder is a dataset when it says so.
        assert!(!part.join("meta/info.json").exists(), "{left}: {:?}", files(&part));
    }
}

#[test]
fn a_full_disk_is_an_error_and_nothing_half_looks_whole() {
    for (name, left, keeps) in [("run.mcap", 3000, true), ("run.npz", 3000, false), ("run.npz", 0, false)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut sim = falling(2);
        let error = record_to_a_full_disk(&mut sim, &path, left).unwrap_err();
        assert!(error.to_string().contains("no space left"), "{error}");
        let RecordError::File { kept, .. } = error else { panic!("{error:?}") };
        let part = folder.path().join(format!("{name}.part"));
        assert_eq!(kept, keeps.then(|| part.clone()), "{name}");
        let names: Vec<PathBuf> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
        assert_eq!(names, if keeps { vec![part] } else { vec![] }, "{name}");
        // The control: the same recording on a disk with room.
        let path = folder.path().join(format!("whole.{name}"));
        record_to_a_full_disk(&mut falling(2), &path, usize::MAX).unwrap();
        assert!(path.exists());
    }
}

/// A sensor that says which channels it has for some measurements only.
#[derive(Clone, Copy)]
struct FlakyCfg {
    channel: &'static str,
    good_for: u64,
}

#[derive(Debug)]
struct Flaky {
    sampler: Sampler,
    good_for: u64,
}

impl SensorCfg for FlakyCfg {
    type Sensor = Flaky;

    fn requires(&self) -> Requires {
        Requires::NONE
    }

    fn build(&self, context: &SensorContext) -> std::result::Result<Flaky, SensorError> {
        let channels = [Channel::new(self.channel, 1)];
        let sampler = Sampler::new("flaky", self.requires(), context, &SamplingCfg::default(), &channels)?;
        Ok(Flaky { sampler, good_for: self.good_for })
    }
}

impl Sensor for Flaky {
    fn update(&mut self, state: &SceneState) -> std::result::Result<(), SensorError> {
        self.sampler.update(state, |_, _| ())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> std::result::Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |_, _| ())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> std::result::Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |_, _| ())
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        (self.sample_counts()[0] <= self.good_for).then_some(self as &dyn Sampled)
    }
}

impl Sampled for Flaky {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }
}

#[test]
fn after_an_error_nobody_waits_for_ever_and_what_was_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sim = falling(1);
    sim.add_sensor("flaky", FlakyCfg { channel: "a", good_for: 5 }).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(5);
    assert!(!sim.observer(recorder).unwrap().has_failed());
    sim.update(5);
    let observer = sim.observer_mut(recorder).unwrap();
    assert!(observer.has_failed());
    // This returns.
    observer.catch_up();
    let error = sim.finish_recording(recorder).unwrap_err();
    let RecordError::BrokenOff { error, also, kept } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::Changed { stream, .. } if stream == "flaky"), "{error}");
    assert!(also.is_none() && !path.exists());
    assert_eq!(kept, Some(part_of(&path)));
    // Six rows of the ball with three quantities and its pose, five of the sensor, the place of the environment and its look.
    assert_eq!(recover(&path).unwrap().messages, 31);
}

#[test]
fn only_what_is_finished_has_its_name() {
    let folder = tempfile::tempdir().unwrap();
    for (name, stays) in [("run.mcap", true), ("run.npz", false)] {
        let path = folder.path().join(name);
        let mut sim = falling(1);
        sim.record(RecorderCfg::new(&path)).unwrap();
        sim.update(5);
        drop(sim);
        assert!(!path.exists(), "{name}");
        assert_eq!(part_of(&path).exists(), stays, "{name}");
    }
    assert_eq!(recover(folder.path().join("run.mcap")).unwrap().messages, 26);
}

/// Panics at the third packet.
struct Panics(u32);

impl Sink for Panics {
    fn write(&mut self, _streams: &[Stream], _packet: &Packet) -> Written {
        self.0 += 1;
        assert!(self.0 < 3, "a test of panics");
        Ok(())
    }

    fn flush(&mut self) -> Written {
        Ok(())
    }

    fn finish(&mut self, _streams: &[Stream]) -> Written<u64> {
        Ok(0)
    }

    fn kept(&self) -> Option<PathBuf> {
        None
    }
}

#[test]
fn a_thread_that_panics_is_noticed() {
    let mut sim = falling(1);
    let cfg = RecorderCfg { packets: 2, ..RecorderCfg::new("nowhere.mcap") };
    let (sources, left_out) = resolve(&mut sim, &cfg, Format::Mcap).unwrap();
    let recorder = Recorder::begin(&mut sim, cfg, Format::Mcap, sources, left_out, Box::new(Panics(0))).unwrap();
    let recorder = sim.add_observer(recorder);
    sim.update(20);
    sim.observer_mut(recorder).unwrap().catch_up();
    let error = sim.finish_recording(recorder).unwrap_err().to_string();
    assert!(error.contains("panicked"), "{error}");
}

/// An array of an archive.
fn array(path: &Path, name: &str) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    let members = zip::parse(&bytes).unwrap();
    let (_, data) = members.iter().find(|(known, _)| *known == format!("{name}.npy")).unwrap();
    let (descr, _, data) = npy::parse(data).unwrap();
    assert_eq!(descr, "<f8");
    data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
}

#[test]
fn a_late_sensor_is_recorded_as_it_measured_whatever_is_shown_meanwhile() {
    const LATENCY: usize = 4;
    const STEPS: usize = 20;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut sim = falling(1);
    let late = SamplingCfg { latency_steps: LATENCY as u32, ..SamplingCfg::default() };
    sim.add_sensor("late", ImuCfg { sampling: late, ..ImuCfg::on("ball/ball") }).unwrap();
    sim.add_sensor("prompt", ImuCfg::on("ball/ball")).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(6);
    let ball = sim.mjcf_id("ball").unwrap();
    sim.mjcf_part_mut(ball).write_qpos(&ndarray::array![[0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
    sim.update((STEPS - 6) as u32);
    sim.finish_recording(recorder).unwrap();
    // The judge is a sensor that is not late: every row of the late one is one of its rows, once and in order.
    for (channel, width) in [("time", 1), ("pos_w", 3), ("lin_vel_b", 3)] {
        let [late, prompt] = ["late", "prompt"].map(|sensor| array(&path, &format!("{sensor}/{channel}")));
        assert_eq!(prompt.len(), STEPS * width, "{channel}");
        assert_eq!(late, prompt[..(STEPS - LATENCY) * width], "{channel}");
    }
    let heights: Vec<f64> = array(&path, "late/pos_w").chunks(3).map(|p| p[2]).collect();
    assert!(heights[5] < 1.5 && heights[6] > 8.0, "what was on its way, then what was written: {heights:?}");
    let steps = array(&path, "late/step");
    assert!(steps.iter().copied().eq((LATENCY..STEPS).map(|step| (step + 1) as f64)), "{steps:?}");
}

/// Root cause: what arrives was counted, and what is shown was copied. They differ where somebody writes to the state while
/// pictures are on their way: then a camera was recorded again and again as the state was after the write, and rows of ray
/// casters were lost.
#[test]
fn late_pictures_and_points_are_recorded_as_they_were_taken_whatever_is_shown_meanwhile() {
    const LATENCY: u32 = 4;
    const STEPS: usize = 20;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut sim = falling(2);
    let placement = Placement::LookAt { eye: [1.0, 0.5, 1.2], target: [0.0, 0.0, 0.8], up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width: 16,
        height: 12,
        intrinsics: Intrinsics::Fovy { radians: 1.2 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { color: true, depth: true, mask: true, ..Channels::default() },
        ..CameraCfg::default()
    };
    let rays = RayCasterCfg {
        offset: Pose::translation(0.0, 0.0, 2.0),
        pattern: Grid { resolution: 0.1, size: [0.4, 0.4], ..Grid::default() }.into(),
        ..RayCasterCfg::default()
    };
    let eyes = RayCasterCameraCfg {
        width: 8,
        height: 6,
        extrinsics: camera.extrinsics.clone(),
        ..RayCasterCameraCfg::default()
    };
    for (name, latency) in [("prompt", 0), ("late", LATENCY)] {
        let sampling = SamplingCfg { latency_steps: latency, ..SamplingCfg::default() };
        sim.add_sensor(format!("{name}_camera"), CameraCfg { latency_steps: latency, ..camera.clone() }).unwrap();
        sim.add_sensor(format!("{name}_rays"), RayCasterCfg { sampling: sampling.clone(), ..rays.clone() }).unwrap();
        sim.add_sensor(format!("{name}_eyes"), RayCasterCameraCfg { sampling, ..eyes.clone() }).unwrap();
    }
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    let ball = sim.mjcf_id("ball").unwrap();
    let put = |sim: &mut SimulationManager, x: f64, env: usize| {
        let row = ndarray::array![[x, 0.1, 1.1, 1.0, 0.0, 0.0, 0.0]];
        sim.mjcf_part_mut(ball).write_qpos(&row, Some(&[EnvId(env)])).unwrap();
    };
    sim.update(6);
    put(&mut sim, 0.3, 0);
    sim.update(2);
    // Again, while what was seen in between is on its way, and in the other environment too.
    put(&mut sim, -0.2, 0);
    put(&mut sim, 0.2, 1);
    sim.update(1);
    // Somebody looks at what is shown in between.
    let late: SensorId<Camera> = sim.sensor_ids().into_iter().find(|(name, _)| name == "late_camera").unwrap().1;
    assert_eq!(sim.sensor(late).unwrap().frame_counts().to_vec(), [5, 5]);
    assert!(sim.sensor(late).unwrap().depth().unwrap().iter().any(|depth| depth.is_finite()));
    sim.update((STEPS - 9) as u32);
    sim.finish_recording(recorder).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let members = zip::parse(&bytes).unwrap();
    let rows = |name: &str| -> (usize, Vec<u8>) {
        let data = &members.iter().find(|(known, _)| known == &format!("{name}.npy")).unwrap().1;
        let (_, shape, data) = npy::parse(data).unwrap();
        (shape[0], data.to_vec())
    };
    let camera = [
        "camera/color",
        "camera/depth",
        "camera/mask",
        "camera/lens/pose",
        "camera/lens/intrinsics",
        "camera/depth/time",
    ];
    let rays = ["rays/hits", "rays/distances", "rays/time"];
    let eyes = ["eyes/depth", "eyes/distance", "eyes/normal", "eyes/mask", "eyes/lens/pose", "eyes/lens/intrinsics"];
    for array in camera.iter().chain(&rays).chain(&eyes) {
        // The judge is a sensor that is not late: every row of the late one is one of its rows, once and in order.
        let [(late, of_late), (prompt, of_prompt)] = ["late", "prompt"].map(|of| rows(&format!("{of}_{array}")));
        assert_eq!((prompt, late), (STEPS, STEPS - LATENCY as usize), "{array}");
        assert!(of_late == of_prompt[..of_prompt.len() / prompt * late], "{array}");
    }
    // The control: what was written is seen, in the environments where it was.
    let depths = rows("late_camera/depth").1;
    let picture = |row: usize, env: usize| &depths[(2 * row + env) * 4 * 16 * 12..][..4 * 16 * 12];
    assert_ne!(picture(5, 0), picture(6, 0));
    assert_ne!(picture(7, 1), picture(8, 1));
}

#[test]
fn an_event_is_a_row_of_its_environment_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sim = falling(2);
    let dt = sim.cfg().physics_dt;
    let recorder = sim.record(RecorderCfg { every: 10, ..RecorderCfg::new(&path) }).unwrap();
    sim.update(5);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    sim.update(15);
    sim.finish_recording(recorder).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let steps = |env: usize| -> Vec<u64> {
        let topic = format!("/env_{env}/ball/state/positions");
        let all = mcap::MessageStream::new(&bytes).unwrap().map(std::result::Result::unwrap);
        let of_topic = all.filter(|message| message.channel.topic == topic);
        of_topic.map(|message| (message.log_time as f64 / 1e9 / dt).round() as u64).collect()
    };
    assert_eq!((steps(0), steps(1)), (vec![0, 10, 20], vec![0, 5, 10, 20]));
}

#[test]
fn what_is_written_after_the_last_step_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut sim = falling(1);
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(3);
    let ball = sim.mjcf_id("ball").unwrap();
    sim.mjcf_part_mut(ball).write_qpos(&ndarray::array![[0.0, 0.0, 7.0, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
    sim.finish_recording(recorder).unwrap();
    let heights: Vec<f64> = array(&path, "ball/state/positions").chunks(7).map(|q| q[2]).collect();
    assert_eq!((heights.len(), heights[4]), (5, 7.0), "{heights:?}");
    assert_eq!(array(&path, "events/step"), [3.0]);
}

#[test]
fn absurd_numbers_are_errors_or_mean_what_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut sim = falling(1);
    let error = sim.record(RecorderCfg { packets: usize::MAX, ..RecorderCfg::new(&path) }).unwrap_err();
    assert!(matches!(error, RecordError::TooLarge { packets: usize::MAX, .. }), "{error}");
    let recorder = sim.record(RecorderCfg { every: u64::MAX, ..RecorderCfg::new(&path) }).unwrap();
    sim.update(5);
    assert_eq!(sim.finish_recording(recorder).unwrap().packets, 1);
    assert_eq!(array(&path, "ball/state/step"), [0.0]);
}

#[test]
fn two_arrays_of_one_name_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (channel, taken) in [("time", true), ("step", true), ("times", false)] {
        let mut sim = falling(1);
        sim.add_sensor("own", FlakyCfg { channel, good_for: u64::MAX }).unwrap();
        let result = sim.record(RecorderCfg::new(folder.path().join(format!("{channel}.npz"))));
        let refused = matches!(&result, Err(RecordError::SameName { name, .. }) if *name == format!("own/{channel}"));
        assert_eq!((refused, result.is_err()), (taken, taken), "{result:?}");
    }
}

/// Where the chunks of an MCAP file are: records are a byte of their kind, eight of their length, and their data.
fn chunks(file: &[u8]) -> Vec<std::ops::Range<usize>> {
    let (mut at, mut chunks) = (mcap::MAGIC.len(), Vec::new());
    while let Some((kind, rest)) = file[at..].split_first().filter(|(_, rest)| rest.len() >= 8) {
        let end = at + 9 + u64::from_le_bytes(*rest.first_chunk().unwrap()) as usize;
        if *kind == mcap::records::op::CHUNK {
            chunks.push(at..end);
        }
        if end >= file.len() {
            break;
        }
        at = end;
    }
    chunks
}

#[test]
fn damage_in_the_middle_is_told_and_the_rest_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sim = falling(16);
    sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(3000);
    drop(sim);
    let part = part_of(&path);
    let whole = std::fs::read(&part).unwrap();
    let chunks = chunks(&whole);
    assert!(chunks.len() > 2, "{chunks:?}");
    // The end is torn in the last chunk: no damage.
    std::fs::write(&part, &whole[..chunks[chunks.len() - 1].end - 100]).unwrap();
    let torn = recover(&path).unwrap();
    assert!(torn.damage.is_none() && torn.messages > 0 && !part.exists(), "{torn:?}");
    std::fs::remove_file(&path).unwrap();
    // The second chunk is damaged: what is before is read, the file stays.
    let mut damaged = whole.clone();
    let middle = chunks[1].start.midpoint(chunks[1].end);
    damaged[middle..middle + 64].iter_mut().for_each(|byte| *byte ^= 0x55);
    std::fs::write(&part, &damaged).unwrap();
    let recovered = recover(&path).unwrap();
    assert!(recovered.damage.is_some() && recovered.messages > 0, "{recovered:?}");
    assert!(recovered.messages < torn.messages, "{recovered:?} {torn:?}");
    assert_eq!(std::fs::read(&part).unwrap(), damaged);
    std::fs::remove_file(&path).unwrap();
    // Not one whole message.
    std::fs::write(&part, &whole[..200]).unwrap();
    let error = recover(&path).unwrap_err().to_string();
    assert!(error.contains("nothing of it can be read"), "{error}");
    let left: Vec<PathBuf> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(left, [part]);
}

/// Resets the first environment at some steps; added before a recorder, it is told of every step first.
#[derive(Debug)]
struct Resets(&'static [u64]);

impl Observer for Resets {
    fn due_in(&self, _sim: &SimulationManager) -> u64 {
        1
    }

    fn observe(&mut self, sim: &mut SimulationManager, moment: &Moment) {
        if matches!(moment, Moment::Stepped) && self.0.contains(&sim.steps()) {
            sim.reset(Some(&[EnvId(0)])).unwrap();
        }
    }
}

/// Root cause: what sensors had measured was counted again in all environments when something happened to one, so that a
/// measurement that the recorder had not been told of yet was lost in the others.
#[test]
fn what_one_environment_measures_is_not_lost_by_the_reset_of_another() {
    const STEPS: u32 = 20;
    let folder = tempfile::tempdir().unwrap();
    let rows = |resets: &'static [u64]| {
        let path = folder.path().join(format!("{}.npz", resets.len()));
        let mut sim = falling(2);
        sim.add_observer(Resets(resets));
        sim.add_sensor("imu", ImuCfg::on("ball/ball")).unwrap();
        let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
        sim.update(STEPS);
        sim.finish_recording(recorder).unwrap();
        // Rows of two environments: those of the second, each once.
        let heights = array(&path, "imu/pos_w").chunks(6).map(|row| row[5]).collect::<Vec<f64>>();
        let mut heights: Vec<f64> = heights;
        heights.dedup();
        heights
    };
    let undisturbed = rows(&[]);
    assert_eq!(undisturbed.len(), STEPS as usize);
    assert_eq!(rows(&[7, 13]), undisturbed);
}
