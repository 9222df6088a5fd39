use super::*;
use crate::file::tests::FullDisk;
use crate::packet::Values;
use sim::{MjcfCfg, SimulationManagerCfg};
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
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> std::io::Result<()> {
        std::thread::sleep(self.pause);
        assert_eq!(streams.len(), 1);
        let Values::F64(values) = &packet.blocks[0].values else { panic!("states are f64") };
        self.heights.lock().unwrap().push(values[2]);
        Ok(())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }

    fn finish(&mut self, _streams: &[Stream]) -> std::io::Result<u64> {
        Ok(0)
    }

    fn kept(&self) -> Option<PathBuf> {
        None
    }
}

fn recorded_slowly(packets: usize, steps: u32, pause: Duration) -> (Recorded, Vec<f64>) {
    let mut sim = falling(1);
    let cfg = RecorderCfg { packets, ..RecorderCfg::new("nowhere.mcap") };
    let (sources, left_out) = resolve(&sim, &cfg, Format::Mcap).unwrap();
    let heights = Arc::new(Mutex::new(Vec::new()));
    let sink = Box::new(Slow { heights: Arc::clone(&heights), pause });
    let recorder = Recorder::begin(&sim, cfg, sources, left_out, sink).unwrap();
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
    let recorder = Recorder::start(sim, RecorderCfg::new(path), &mut |file| Box::new(FullDisk { file, left }))?;
    let recorder = sim.add_observer(recorder);
    sim.update(3000);
    sim.finish_recording(recorder)
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
