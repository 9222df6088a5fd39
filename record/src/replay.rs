//! Replay: recorded actions are simulated again, and the states are compared bit by bit.
//!
//! ```no_run
//! use kinetoscope_record::{Record, RecorderCfg};
//! use kinetoscope_sim::{SimulationManager, SimulationManagerCfg};
//!
//! let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
//! let recorder = sim.record(RecorderCfg::new("run.npz"))?;
//! sim.update(100);
//! sim.finish_recording(recorder)?;
//! println!("{}", kinetoscope_record::replay::verify(&mut sim, "run.npz")?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::error::{RecordError, Result};
use crate::packet::{Packet, StreamRows};
use crate::recorded_arrays::RecordedArrays;
use crate::source::StreamSource;
use kinetoscope_sim::{EnvId, SimulationManager};
use serde_json::Value;
use std::fmt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Numbers of repeated steps and of reproduced values, and the first difference, of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayResult {
    /// Number of repeated physics steps, until the end or the first difference.
    pub steps: u64,
    /// Number of recorded values that were reproduced bit by bit.
    pub values: u64,
    /// First difference, if any.
    pub difference: Option<Difference>,
}

/// First difference between a recording and its replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Physics steps since the beginning of the recording.
    pub step: u64,
    /// Index of the environment in the recorded simulation.
    pub env: usize,
    /// Name of the array, such as `arm/joint_states/positions`.
    pub array: String,
    /// Index of the value in the array's row of the environment.
    pub column: usize,
    /// Recorded value.
    pub recorded: f64,
    /// Value of the replay.
    pub replayed: f64,
    /// True if the state of the environment was written at that step. Writes are no actions and are not repeated.
    pub state_written: bool,
}

impl ReplayResult {
    /// True if all values were reproduced.
    pub fn is_identical(&self) -> bool {
        self.difference.is_none()
    }
}

impl fmt::Display for ReplayResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.difference {
            None => write!(f, "identical in {} steps: {} values, bit for bit", self.steps, self.values),
            Some(Difference { step, env, array, column, recorded, replayed, state_written }) => {
                write!(f, "first different at step {step} in environment {env}: {array}, column {column}, ")?;
                write!(f, "was {recorded:e}, now {replayed:e}")?;
                if *state_written {
                    f.write_str("; the state was written there, which is not an action")?;
                }
                Ok(())
            }
        }
    }
}

/// Streams of states, by the endings of their names.
const STATES: [(&str, SourceFn); 4] = [
    ("/joint_states", StreamSource::joint_states),
    ("/link_poses", StreamSource::link_poses),
    ("/pose", StreamSource::object_pose),
    ("/state", StreamSource::mjcf_state),
];
const TARGETS: &str = "/targets";

type SourceFn = fn(&SimulationManager, &str, &[usize]) -> Result<StreamSource>;

/// Replays a NumPy archive or an MCAP file in `sim`, which must be built as the recorded simulation was.
///
/// Restores the initial state and properties, applies the recorded actions and resets, and compares joint states, poses
/// of links and objects, and states of MJCF parts after every step, as far as they are recorded. The file must contain
/// the targets of every robot and articulation with joints, and the controls of every MJCF part with actuators, at
/// every step ([`RecorderCfg::period_steps`](crate::RecorderCfg::period_steps) 1). If a step has several rows because
/// of events, the first and the last are compared.
///
/// External wrenches, welds and gains are not recorded. Neither they nor poses written to kinematic objects are
/// replayed. If they changed the motion, the result has the first difference.
///
/// # Errors
/// The file is not a complete recording, lacks required targets, controls or steps, or is of another scene, another
/// MuJoCo version or another time step. A difference is not an error, but a [`ReplayResult`].
pub fn verify(sim: &mut SimulationManager, path: impl AsRef<Path>) -> Result<ReplayResult> {
    verify_until(&AtomicBool::new(false), sim, path)
}

/// [`verify`] that another thread can end by setting `stop`, after the step that is running. The simulation then has a
/// state of the recording.
///
/// # Errors
/// Same as [`verify`], and [`Error::Interrupted`](kinetoscope_sim::Error::Interrupted) if `stop` was set before the last
/// step.
pub fn verify_until(stop: &AtomicBool, sim: &mut SimulationManager, path: impl AsRef<Path>) -> Result<ReplayResult> {
    let archive = RecordedArrays::open(path.as_ref())?;
    let dt = sim.cfg().physics_dt;
    if archive.metadata["physics_dt"].as_f64() != Some(dt) {
        let recorded = &archive.metadata["physics_dt"];
        return Err(archive.malformed(format!("recorded with physics_dt {recorded}; this simulation has {dt}")));
    }
    sim.properties_mut().restore(&archive.start()?, None)?;
    let (mut states, mut targets) = (Vec::new(), Vec::new());
    for stream in archive.metadata["streams"].as_array().into_iter().flatten() {
        let name = stream["name"].as_str().unwrap_or_default();
        let envs = stream["env_ids"].as_array().into_iter().flatten().filter_map(Value::as_u64);
        let envs: Vec<usize> = envs.filter_map(|env| usize::try_from(env).ok()).collect();
        if let Some(env) = envs.iter().copied().find(|env| *env >= sim.num_envs()) {
            return Err(RecordError::Env { env, count: sim.num_envs() });
        }
        if let Some(uid) = name.strip_suffix(TARGETS) {
            targets.push(StreamSource::targets(sim, uid, &envs)?);
        }
        for (end, of) in STATES {
            if let Some(uid) = name.strip_suffix(end) {
                states.push(of(sim, uid, &envs)?);
            }
        }
    }
    let Some(first) = states.first() else {
        return Err(archive.malformed("it has no states to compare with".into()));
    };
    let steps = archive.steps(&first.stream.name)?.to_vec();
    if steps.first() != Some(&0.0) {
        return Err(archive.malformed("its rows do not begin at step 0".into()));
    }
    // A NaN fails this check, too.
    if !steps.windows(2).all(|pair| [0.0, 1.0].contains(&(pair[1] - pair[0]))) {
        return Err(archive.malformed("it does not contain every step: record with `period_steps: 1`".into()));
    }
    for source in states.iter().chain(&targets) {
        if archive.steps(&source.stream.name)? != steps {
            return Err(
                archive.malformed(format!("the rows of {} differ from those of the other streams", source.stream.name))
            );
        }
        archive.check(source, steps.len())?;
    }
    for uid in sim.entities().articulated_uids() {
        let moves = sim.robot(sim.entities().articulated_id(uid)?).dof() > 0;
        if moves && !targets.iter().any(|source| source.stream.name == format!("{uid}{TARGETS}")) {
            return Err(archive.malformed(format!("it has no targets of {uid}: record Topic::Targets({uid:?})")));
        }
    }
    for uid in sim.entities().mjcf_uids() {
        let moves = sim.mjcf_part(sim.entities().mjcf_id(uid)?).ctrl().ncols() > 0;
        if moves && !states.iter().any(|source| source.stream.name == format!("{uid}/state")) {
            return Err(archive.malformed(format!("it has no controls of {uid}: record Topic::MjcfState({uid:?})")));
        }
    }
    Replay { archive, states, targets, steps }.run(stop, sim)
}

/// Number of environments of the recorded simulation, also those that were not recorded, from a NumPy archive or an
/// MCAP file of a recorder.
///
/// # Errors
/// The file is not such a recording, or is incomplete.
pub fn num_envs(path: impl AsRef<Path>) -> Result<usize> {
    Ok(RecordedArrays::open(path.as_ref())?.start()?.len())
}

/// Data of a replay.
struct Replay {
    archive: RecordedArrays,
    states: Vec<StreamSource>,
    targets: Vec<StreamSource>,
    /// Physics steps of each row since the beginning of the recording.
    steps: Vec<f64>,
}

impl Replay {
    fn run(mut self, stop: &AtomicBool, sim: &mut SimulationManager) -> Result<ReplayResult> {
        let mut verdict = ReplayResult { steps: 0, values: 0, difference: None };
        let mut row = 0;
        while row < self.steps.len() {
            if stop.load(Ordering::Relaxed) {
                return Err(kinetoscope_sim::Error::Interrupted.into());
            }
            let step = self.steps[row];
            if step > verdict.steps as f64 {
                self.apply_actions(sim, row)?;
                sim.update(1);
                verdict.steps += 1;
            }
            // Events at a step have rows of their own after the row of the step.
            let last = row + self.steps[row..].iter().take_while(|other| **other == step).count() - 1;
            if !self.compare(sim, row, &[], &mut verdict)? {
                return Ok(verdict);
            }
            if last > row {
                let (reset, written) = self.archive.state_changes_at(step)?;
                if !reset.is_empty() {
                    sim.reset(Some(&reset))?;
                }
                if !self.compare(sim, last, &written, &mut verdict)? {
                    return Ok(verdict);
                }
            }
            row = last + 1;
        }
        Ok(verdict)
    }

    /// Applies the actions of a row.
    fn apply_actions(&self, sim: &mut SimulationManager, row: usize) -> Result<()> {
        let Self { archive, states, targets, .. } = self;
        for source in targets {
            let Some(uid) = source.stream.name.strip_suffix(TARGETS) else { continue };
            let id = sim.entities().articulated_id(uid)?;
            let envs: Vec<EnvId> = source.stream.env_ids.iter().copied().map(EnvId).collect();
            let of = |part: &str| archive.rows(&format!("{}/{part}", source.stream.name), row);
            let (positions, velocities, efforts) = (of("positions")?, of("velocities")?, of("efforts")?);
            sim.robot_mut(id).set_qpos_target(positions, None, Some(&envs))?;
            sim.robot_mut(id).set_qvel_target(velocities, None, Some(&envs))?;
            sim.robot_mut(id).set_qf_target(efforts, None, Some(&envs))?;
        }
        for source in states {
            let Some(uid) = source.stream.name.strip_suffix("/state") else { continue };
            let id = sim.entities().mjcf_id(uid)?;
            let envs: Vec<EnvId> = source.stream.env_ids.iter().copied().map(EnvId).collect();
            let controls = archive.rows(&format!("{}/controls", source.stream.name), row)?;
            sim.mjcf_part_mut(id).set_ctrl(controls, None, Some(&envs))?;
        }
        Ok(())
    }

    /// Compares all states with a row; returns true if they are equal.
    fn compare(
        &mut self,
        sim: &mut SimulationManager,
        row: usize,
        written: &[EnvId],
        verdict: &mut ReplayResult,
    ) -> Result<bool> {
        let times = sim.time();
        for source in &mut self.states {
            let mut packet = Packet::new(std::slice::from_ref(&source.stream));
            let Some(block) = packet.streams.first_mut() else { continue };
            source.read(sim, &times, &[], true, None, block)?;
            if let Some(difference) = difference(&self.archive, source, block, row, written)? {
                verdict.difference = Some(Difference { step: verdict.steps, ..difference });
                return Ok(false);
            }
            verdict.values += block.values.len() as u64;
        }
        Ok(true)
    }
}

/// First value of a stream whose bits differ from the archive; `None` if all are equal.
fn difference(
    archive: &RecordedArrays,
    source: &StreamSource,
    block: &StreamRows,
    row: usize,
    written: &[EnvId],
) -> Result<Option<Difference>> {
    let stream = &source.stream;
    let width = stream.width();
    let mut first = 0;
    for part in &stream.fields {
        let array = crate::npz::array_name(stream, &part.name);
        let recorded = archive.rows(&array, row)?;
        for (k, &env) in stream.env_ids.iter().enumerate() {
            for column in 0..part.width() {
                let replayed = block.values.as_f64s().get(k * width + first + column).copied().unwrap_or(f64::NAN);
                let recorded = recorded[(k, column)];
                if recorded.to_bits() != replayed.to_bits() {
                    let state_written = written.contains(&EnvId(env));
                    return Ok(Some(Difference { step: 0, env, array, column, recorded, replayed, state_written }));
                }
            }
        }
        first += part.width();
    }
    Ok(None)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
