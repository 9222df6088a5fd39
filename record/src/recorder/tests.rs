mod events;
mod stereo;

use super::*;
use crate::packet::ValueBuffer;
use crate::recover::recover;
use crate::tests::{falling, logs, names, numbers_of, record, rows, scratch};
use crate::writer::WriteResult;
use kinetoscope_render::Intrinsics;
use kinetoscope_render::frame::Channels;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{Pose, SceneState};
use kinetoscope_sensors::camera::{Camera, CameraCfg};
use kinetoscope_sensors::ray::pattern::Grid;
use kinetoscope_sensors::ray::{RayCasterCameraCfg, RayCasterCfg};
use kinetoscope_sensors::{
    ImuCfg, SampleChannel, Sampled, Sampler, SamplingCfg, Sensor, SensorCfg, SensorContext, SensorError,
};
use kinetoscope_sim::{MjcfPartCfg, SensorId};
use std::path::Path;
use std::sync::Mutex;

/// Puts the ball somewhere at rest.
fn put(sim: &mut SimulationManager, [x, y, z]: [f64; 3], envs: Option<&[EnvId]>) {
    let ball = sim.entities().mjcf_id("ball").unwrap();
    sim.mjcf_part_mut(ball).write_qpos(&ndarray::array![[x, y, z, 1.0, 0.0, 0.0, 0.0]], envs).unwrap();
}

/// Calls a function with each packet.
struct FnWriter<F>(F);

impl<F: FnMut(&Packet) + Send> FormatWriter for FnWriter<F> {
    fn write(&mut self, _streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        (self.0)(packet);
        Ok(())
    }

    fn finish(&mut self, _streams: &[StreamSchema]) -> WriteResult<u64> {
        Ok(0)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        None
    }
}

/// Records the ball with a function as the writer, and with this number of packets.
fn record_to(
    sim: &mut SimulationManager,
    packets: usize,
    write: impl FnMut(&Packet) + Send + 'static,
) -> ObserverId<Recorder> {
    let cfg = RecorderCfg { packets, scene: false, ..RecorderCfg::new("nowhere.mcap") };
    let cfg = cfg.with_topics([Topic::MjcfState("ball".into())]);
    let (sources, left_out) = resolve(sim, &cfg, Format::Mcap).unwrap();
    let recorder =
        Recorder::start_writer(sim, cfg, Format::Mcap, sources, left_out, Box::new(FnWriter(write)), false).unwrap();
    sim.observers_mut().add(recorder)
}

/// A simulation waits for a slow disk, reports the waits, and loses no data.
#[test]
fn slow_disk() {
    let (steps, pause) = (20, Duration::from_millis(3));
    let recorded = |packets| {
        let (mut sim, heights) = (falling(1), Arc::new(Mutex::new(Vec::new())));
        let seen = Arc::clone(&heights);
        let recorder = record_to(&mut sim, packets, move |packet| {
            std::thread::sleep(pause);
            let ValueBuffer::F64(values) = &packet.streams[0].values else { panic!("states are f64") };
            seen.lock().unwrap().push(values[2]);
        });
        sim.update(steps);
        let recorded = sim.finish_recording(recorder).unwrap();
        let heights = heights.lock().unwrap().clone();
        (recorded, heights)
    };
    let (slow, heights) = recorded(2);
    // One row at the beginning, one after each step.
    assert_eq!((heights.len(), slow.packets), (21, 21));
    assert!(heights.windows(2).all(|pair| pair[1] < pair[0]), "the ball falls, in order: {heights:?}");
    // Steps of one ball take microseconds: 21 rows with 2 packets wait 19 times, less where this thread was held up.
    assert!(slow.waits >= 10 && slow.wait_time >= pause * 10, "{slow}");
    assert!(slow.to_string().contains("the simulation waited for it"), "{slow}");
    // Control: with a packet for every row there is no wait, and the same data is written.
    let (roomy, same) = recorded(32);
    assert_eq!((roomy.waits, roomy.wait_time, &same), (0, Duration::ZERO, &heights));
}

fn record_to_a_full_disk(sim: &mut SimulationManager, path: &Path, left: usize) -> Result<RecordingSummary> {
    // Records no scene, which alone would fill the disk.
    let cfg = RecorderCfg { scene: false, ..RecorderCfg::new(path) };
    let recorder = Recorder::start(sim, cfg, &StorageFactory::full_after(left))?;
    let recorder = sim.observers_mut().add(recorder);
    sim.update(if sim.entities().sensor_uids().is_empty() { 3000 } else { 60 });
    sim.finish_recording(recorder)
}

/// Asserts that a disk with this room is too small for a recording. `part` is the expected partial file, if any.
#[track_caller]
fn assert_too_small(sim: &mut SimulationManager, path: &Path, left: usize, part: Option<&Path>) {
    let error = record_to_a_full_disk(sim, path, left).unwrap_err();
    assert!(error.to_string().contains("no space left"), "{left}: {error}");
    let RecordError::File { partial_file, .. } = error else { panic!("{left}: {error:?}") };
    assert_eq!((partial_file.as_deref(), path.exists()), (part, false), "{left}");
}

/// On a full disk, the partial folder of images contains complete images only.
#[test]
fn full_disk_images() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = || {
        let mut sim = falling(2);
        let channels = Channels { color: true, depth: true, ..Channels::NONE };
        let camera = CameraCfg { width: 32, height: 24, channels, update_period: 0.02, ..CameraCfg::default() };
        sim.add_sensor("camera", camera).unwrap();
        sim
    };
    let images = |folder: &Path| kinetoscope_testkit::test_resources::files_below(folder, "png");
    let whole = folder.path().join("whole");
    let bytes = record_to_a_full_disk(&mut simulation(), &whole, usize::MAX).unwrap().bytes;
    assert!(images(&whole).len() > 20 && bytes > 5000, "{bytes} bytes in {}", images(&whole).len());
    for left in [0, 10] {
        // There is no room for the header of the list, so that recording does not begin.
        let path = folder.path().join(format!("left_{left}"));
        let error = record_to_a_full_disk(&mut simulation(), &path, left).unwrap_err();
        assert!(error.to_string().contains("no space left") && !path.exists(), "{left}: {error}");
    }
    for left in [300, 1000, bytes as usize / 2] {
        let path = folder.path().join(format!("left_{left}"));
        let part = partial_path_of(&path);
        assert_too_small(&mut simulation(), &path, left, Some(&part));
        let found = images(&part);
        assert_eq!(!found.is_empty(), left >= 1000, "{left}: {found:?}");
        assert!(found.len() < images(&whole).len(), "{left}: {found:?}");
        for image in found {
            let same = whole.join(image.strip_prefix(&part).unwrap());
            assert_eq!(std::fs::read(&image).unwrap(), std::fs::read(same).unwrap(), "{left}: {}", image.display());
        }
    }
}

/// A simulation with an actuator, as datasets need.
fn actuated(num_envs: usize) -> SimulationManager {
    let mut sim = crate::tests::simulation(num_envs);
    let text = r#"<mujoco><worldbody><body name="b" pos="0 0 1"><joint name="j" type="slide"/><geom size="0.1"/></body></worldbody>
        <actuator><motor joint="j"/></actuator></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("ball", text)).unwrap();
    sim
}

/// On a full disk, a dataset has neither its final name nor the file that makes it a dataset.
#[test]
#[cfg_attr(not(feature = "lerobot"), ignore = "needs the feature lerobot")]
fn full_disk_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.lerobot");
    let bytes = record_to_a_full_disk(&mut actuated(2), &whole, usize::MAX).unwrap().bytes as usize;
    assert!(whole.join("meta/info.json").is_file() && bytes > 10_000, "{bytes}");
    // No room; full in the rows; in the tables at the end; in the last file.
    for left in [0, 1000, bytes / 2, bytes - 100] {
        let path = folder.path().join(format!("left_{left}.lerobot"));
        let part = partial_path_of(&path);
        assert_too_small(&mut actuated(2), &path, left, Some(&part));
        assert!(!part.join("meta/info.json").exists(), "{left}");
    }
}

/// On a full disk, MCAP is the only file format that leaves a partial file.
#[test]
fn full_disk_files() {
    let camera = CameraCfg { width: 64, height: 64, update_period: 0.05, ..CameraCfg::default() };
    let animations = Format::all().filter(|(format, _)| format.is_animation());
    // Buffered data is written at the end at the latest.
    let animations = animations.flat_map(|(_, end)| [0, 100, 900].map(|left| (format!("run.{end}"), left, true)));
    let files = [("run.mcap", 3000), ("run.npz", 3000), ("run.npz", 0)].map(|(name, left)| (name.into(), left, false));
    for (name, left, is_animation) in animations.chain(files) {
        let simulation = || {
            let mut sim = falling(if is_animation { 1 } else { 2 });
            if is_animation {
                sim.add_sensor("camera", camera.clone()).unwrap();
            }
            sim
        };
        let (folder, path) = scratch(&name);
        let part = (name == "run.mcap").then(|| partial_path_of(&path));
        assert_too_small(&mut simulation(), &path, left, part.as_deref());
        assert_eq!(names(&folder), if part.is_some() { vec!["run.mcap.part"] } else { vec![] }, "{name}");
        // Control: the same recording on a disk with room.
        record_to_a_full_disk(&mut simulation(), &folder.path().join(format!("whole.{name}")), usize::MAX).unwrap();
    }
}

/// Writes of a recording fail from any of them on, as on a full or read-only disk: the error is reported, and no file has
/// its final name. What remains of an MCAP file can be recovered, or the error says that it holds no message.
#[test]
fn every_write() {
    let simulation = |name: &str| {
        if name == "run.lerobot" {
            return actuated(1);
        }
        let mut sim = falling(1);
        sim.add_sensor("imu", ImuCfg::on("ball/ball")).unwrap();
        let channels = Channels { color: true, ..Channels::NONE };
        let camera = CameraCfg { width: 32, height: 24, channels, update_period: 0.02, ..CameraCfg::default() };
        sim.add_sensor("camera", camera).unwrap();
        sim
    };
    let record = |path: &Path, first_failure: usize, kind: io::ErrorKind| {
        let mut sim = simulation(path.file_name().unwrap().to_str().unwrap());
        let (disk, writes) = StorageFactory::failing_after(first_failure, kind);
        let begin = |sim: &mut SimulationManager| {
            let recorder = Recorder::start(sim, RecorderCfg::new(path), &disk)?;
            let recorder = sim.observers_mut().add(recorder);
            sim.update(12);
            sim.finish_recording(recorder)
        };
        let result = begin(&mut sim);
        // The simulation goes on.
        let before = sim.observers().steps();
        sim.update(1);
        assert_eq!(sim.observers().steps(), before + 1);
        let writes = *writes.lock().unwrap();
        (result, writes)
    };
    let mut failures = 0;
    for (format, end) in Format::all().filter(|(format, _)| format.is_built()) {
        let name = if end.is_empty() { "images".to_string() } else { format!("run.{end}") };
        let (folder, path) = scratch(&name);
        // Control: nothing fails, and the writes are counted.
        let (result, count) = record(&path, usize::MAX, io::ErrorKind::Other);
        result.unwrap();
        assert!(count > 0 && path.exists(), "{name}: {count} writes");
        println!("{name}: {count} writes");
        drop(folder);
        // At most 40 of the writes, spread evenly, with the first and the last one.
        for first in (0..count).step_by(count.div_ceil(39)).chain([count - 1]) {
            let kind = [io::ErrorKind::StorageFull, io::ErrorKind::ReadOnlyFilesystem][first % 2];
            let (folder, path) = scratch(&name);
            let (result, made) = record(&path, first, kind);
            if made <= first {
                // A slow machine flushes at other times, so the number of writes differs.
                result.unwrap();
                continue;
            }
            let Err(error) = result else { panic!("{name}: the failure of write {first} of {count} was lost") };
            let text = error.to_string();
            assert!(text.contains("a failure on purpose") && text.contains(&name), "{name}, {first}: {text}");
            assert!(!path.exists(), "{name}, {first}");
            let keeps = matches!(format, Format::Mcap | Format::Images | Format::LeRobot);
            assert!(keeps || names(&folder).is_empty(), "{name}, {first}: {:?}", names(&folder));
            let part = partial_path_of(&path);
            if format == Format::Mcap && part.exists() {
                match recover(&path) {
                    Ok(recovered) => assert!(recovered.messages > 0 && path.exists() && !part.exists()),
                    Err(error) => assert!(error.to_string().contains("run.mcap.part"), "{first}: {error}"),
                }
            }
            failures += 1;
        }
    }
    assert!(failures > 20, "{failures}");
}

/// A sensor with one channel of any name.
#[derive(Clone, Copy)]
struct OwnCfg(&'static str);

#[derive(Debug)]
struct Own(Sampler);

impl SensorCfg for OwnCfg {
    type Sensor = Own;

    fn requires(&self) -> StateFields {
        StateFields::NONE
    }

    fn build(&self, context: &SensorContext) -> std::result::Result<Own, SensorError> {
        let channels = [SampleChannel::new(self.0, 1)];
        Ok(Own(Sampler::new("own", self.requires(), context, &SamplingCfg::default(), &channels)?))
    }
}

impl Sensor for Own {
    fn update(&mut self, state: &SceneState) -> std::result::Result<(), SensorError> {
        self.0.update(state, |_, _| ())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> std::result::Result<(), SensorError> {
        self.0.reset(env_ids, state, |_, _| ())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> std::result::Result<(), SensorError> {
        self.0.refresh(env_ids, state, |_, _| ())
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }
}

impl Sampled for Own {
    fn sampler(&self) -> &Sampler {
        &self.0
    }
}

#[test]
fn dropped_recorder() {
    for (name, stays) in [("run.mcap", true), ("run.npz", false)] {
        let (_folder, path) = scratch(name);
        let mut sim = falling(1);
        sim.record(RecorderCfg::new(&path)).unwrap();
        sim.update(5);
        drop(sim);
        assert_eq!((path.exists(), partial_path_of(&path).exists()), (false, stays), "{name}");
        if stays {
            assert_eq!(recover(&path).unwrap().messages, 26);
        }
    }
}

#[test]
fn panic_of_the_thread() {
    let (mut sim, mut packets) = (falling(1), 0);
    let recorder = record_to(&mut sim, 2, move |_| {
        packets += 1;
        assert!(packets < 3, "a test of panics");
    });
    sim.update(20);
    sim.observers_mut().get_mut(recorder).unwrap().wait_until_written();
    kinetoscope_testkit::error_tables::assert_error(sim.finish_recording(recorder), "", &["panicked"]);
}

/// Root cause: arrivals were counted, but the shown values were copied. They differ if the state is written while
/// measurements are pending. Cameras were recorded as after the write, and rows of ray casters were lost.
#[test]
fn late_sensors() {
    const LATENCY: u32 = 4;
    const STEPS: usize = 20;
    let (_folder, path) = scratch("run.npz");
    let mut sim = falling(2);
    let channels = Channels { color: true, depth: true, mask: true, ..Channels::default() };
    let camera = CameraCfg {
        intrinsics: Intrinsics::Fovy { radians: 1.2 },
        ..kinetoscope_testkit::worlds::camera([16, 12], [1.0, 0.5, 1.2], [0.0, 0.0, 0.8], channels)
    };
    let rays = RayCasterCfg {
        offset: Pose::translation(0.0, 0.0, 2.0),
        pattern: Grid { resolution: 0.1, size: [0.4, 0.4], ..Grid::default() }.into(),
        ..RayCasterCfg::default()
    };
    let extrinsics = camera.extrinsics.clone();
    let eyes = RayCasterCameraCfg { width: 8, height: 6, extrinsics, ..RayCasterCameraCfg::default() };
    for (name, latency) in [("prompt", 0), ("late", LATENCY)] {
        let sampling = SamplingCfg { latency_steps: latency, ..SamplingCfg::default() };
        sim.add_sensor(format!("{name}_camera"), CameraCfg { latency_steps: latency, ..camera.clone() }).unwrap();
        sim.add_sensor(format!("{name}_rays"), RayCasterCfg { sampling: sampling.clone(), ..rays.clone() }).unwrap();
        let imu = ImuCfg { sampling: sampling.clone(), ..ImuCfg::on("ball/ball") };
        sim.add_sensor(format!("{name}_imu"), imu).unwrap();
        sim.add_sensor(format!("{name}_eyes"), RayCasterCameraCfg { sampling, ..eyes.clone() }).unwrap();
    }
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(6);
    put(&mut sim, [0.3, 0.1, 1.1], Some(&[EnvId(0)]));
    sim.update(2);
    // A second write, while earlier measurements are pending, and in the other environment too.
    put(&mut sim, [-0.2, 0.1, 1.1], Some(&[EnvId(0)]));
    put(&mut sim, [0.2, 0.1, 1.1], Some(&[EnvId(1)]));
    sim.update(1);
    // The images shown in between are read.
    let late: SensorId<Camera> =
        sim.entities().sensor_ids().into_iter().find(|(name, _)| name == "late_camera").unwrap().1;
    assert_eq!(sim.sensor(late).unwrap().frame_counts().to_vec(), [5, 5]);
    assert!(sim.sensor(late).unwrap().depth().unwrap().iter().any(|depth| depth.is_finite()));
    sim.update((STEPS - 9) as u32);
    sim.finish_recording(recorder).unwrap();
    let arrays: [(&str, &[&str]); 4] = [
        ("camera", &["color", "depth", "mask", "lens/pose", "lens/intrinsics", "depth/time"]),
        ("rays", &["hits", "distances", "time"]),
        ("eyes", &["depth", "distance", "normal", "mask", "lens/pose", "lens/intrinsics"]),
        ("imu", &["time", "pos_w", "lin_vel_b"]),
    ];
    for (sensor, array) in arrays.into_iter().flat_map(|(sensor, all)| all.iter().map(move |array| (sensor, array))) {
        // Reference: a sensor without latency. Every row of the late sensor is one of its rows, once and in order.
        let of = |name| rows(&path, &format!("{name}_{sensor}/{array}"));
        let ((_, late, of_late), (_, prompt, of_prompt)) = (of("late"), of("prompt"));
        assert_eq!((prompt, late), (STEPS, STEPS - LATENCY as usize), "{sensor}/{array}");
        assert!(of_late == of_prompt[..of_prompt.len() / prompt * late], "{sensor}/{array}");
    }
    let steps = numbers_of(&path, "late_imu/step");
    assert!(steps.iter().copied().eq((LATENCY as usize..STEPS).map(|step| (step + 1) as f64)), "{steps:?}");
    // Control: the writes are seen, in their environments.
    let depths = rows(&path, "late_camera/depth").2;
    let image = |row: usize, env: usize| &depths[(2 * row + env) * 4 * 16 * 12..][..4 * 16 * 12];
    assert_ne!(image(5, 0), image(6, 0));
    assert_ne!(image(7, 1), image(8, 1));
}

#[test]
fn write_after_the_last_step() {
    let (_folder, path) = scratch("run.npz");
    record(&mut falling(1), RecorderCfg::new(&path), |sim| {
        sim.update(3);
        put(sim, [0.0, 0.0, 7.0], None);
    });
    let heights: Vec<f64> = numbers_of(&path, "ball/state/positions").chunks(7).map(|q| q[2]).collect();
    assert_eq!((heights.len(), heights[4]), (5, 7.0), "{heights:?}");
    assert_eq!(numbers_of(&path, "events/step"), [3.0]);
}

#[test]
fn absurd_numbers() {
    let (_folder, path) = scratch("run.npz");
    let mut sim = falling(1);
    let refused = sim.record(RecorderCfg { packets: usize::MAX, ..RecorderCfg::new(&path) });
    kinetoscope_testkit::error_tables::assert_error(refused, &format!("PoolTooLarge {{ packets: {}", usize::MAX), &[]);
    let cfg = RecorderCfg { period_steps: u64::MAX, ..RecorderCfg::new(&path) };
    assert_eq!(record(&mut sim, cfg, |sim| sim.update(5)).packets, 1);
    assert_eq!(numbers_of(&path, "ball/state/step"), [0.0]);
}

#[test]
fn arrays_of_one_name() {
    let folder = tempfile::tempdir().unwrap();
    for (channel, taken) in [("time", true), ("step", true), ("times", false)] {
        let mut sim = falling(1);
        sim.add_sensor("own", OwnCfg(channel)).unwrap();
        let result = sim.record(RecorderCfg::new(folder.path().join(format!("{channel}.npz"))));
        let refused =
            matches!(&result, Err(RecordError::DuplicateName { name, .. }) if *name == format!("own/{channel}"));
        assert_eq!((refused, result.is_err()), (taken, taken), "{result:?}");
    }
}

/// Byte ranges of the chunks of an MCAP file. A record has one byte for its type, eight for its length, and its data.
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
fn damage() {
    let (folder, path) = scratch("run.mcap");
    assert!(recover(&path).unwrap_err().to_string().contains("run.mcap.part"));
    let mut sim = falling(16);
    sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(3000);
    drop(sim);
    let part = partial_path_of(&path);
    let whole = std::fs::read(&part).unwrap();
    let chunks = chunks(&whole);
    assert!(chunks.len() > 2, "{chunks:?}");
    // A truncated last chunk is no damage.
    std::fs::write(&part, &whole[..chunks[chunks.len() - 1].end - 100]).unwrap();
    let torn = recover(&path).unwrap();
    assert!(torn.damage.is_none() && torn.messages > 0 && !part.exists(), "{torn:?}");
    std::fs::remove_file(&path).unwrap();
    // The second chunk is damaged: the messages before it are recovered, and the partial file is kept.
    let mut damaged = whole.clone();
    let middle = chunks[1].start.midpoint(chunks[1].end);
    damaged[middle..middle + 64].iter_mut().for_each(|byte| *byte ^= 0x55);
    std::fs::write(&part, &damaged).unwrap();
    let recovered = recover(&path).unwrap();
    assert!(recovered.damage.is_some() && recovered.messages > 0, "{recovered:?}");
    assert!(recovered.messages < torn.messages, "{recovered:?} {torn:?}");
    assert_eq!(std::fs::read(&part).unwrap(), damaged);
    std::fs::remove_file(&path).unwrap();
    // No complete message.
    std::fs::write(&part, &whole[..200]).unwrap();
    let error = recover(&path).unwrap_err().to_string();
    assert!(error.contains("it cannot be recovered"), "{error}");
    assert_eq!(names(&folder), ["run.mcap.part"]);
}

/// Resets the first environment at some steps. It is added before a recorder, so that it is notified of every step
/// first.
#[derive(Debug)]
struct Resets(&'static [u64]);

impl Observer for Resets {
    fn due_in(&self, _sim: &SimulationManager) -> u64 {
        1
    }

    fn on_event(&mut self, sim: &mut SimulationManager, moment: &SimEvent) {
        if matches!(moment, SimEvent::Stepped) && self.0.contains(&sim.observers().steps()) {
            sim.reset(Some(&[EnvId(0)])).unwrap();
        }
    }
}

/// Root cause: the measurement counts of all environments were updated when one was reset. A measurement that was not
/// recorded yet was lost in the other environments.
#[test]
fn resets_of_another_environment() {
    const STEPS: u32 = 20;
    let heights = |resets: &'static [u64]| {
        let (_folder, path) = scratch("run.npz");
        let mut sim = falling(2);
        sim.observers_mut().add(Resets(resets));
        sim.add_sensor("imu", ImuCfg::on("ball/ball")).unwrap();
        record(&mut sim, RecorderCfg::new(&path), |sim| sim.update(STEPS));
        // Rows of two environments: selects those of the second, each once.
        let mut heights: Vec<f64> = numbers_of(&path, "imu/pos_w").chunks(6).map(|row| row[5]).collect();
        heights.dedup();
        heights
    };
    let undisturbed = heights(&[]);
    assert_eq!(undisturbed.len(), STEPS as usize);
    assert_eq!(heights(&[7, 13]), undisturbed);
}
