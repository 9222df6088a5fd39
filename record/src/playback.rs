//! Playback of a recording: a simulation of its scene, set to the recorded states.

use crate::error::{RecordError, Result};
use crate::read::{FieldSelector, Recording, TimeSeries};
use crate::scene_file::{self, SCENE_ARCHIVE};
use kinetoscope_sim::{MjcfId, MjcfPart, SimulationManager};
use ndarray::Array2;

/// Index of the last of `times` \[s\], in ascending order, at or before `time` \[s\], with a tolerance of 1 ns; 0 before the
/// first. For a copy of [`Playback::times`].
pub fn frame_at(times: &[f64], time: f64) -> usize {
    times.partition_point(|frame| *frame <= time + 1e-9).saturating_sub(1)
}

/// Recorded motion in its scene. [`seek`](Self::seek) sets the positions of a simulation to a recorded time, by its
/// index in [`times`](Self::times).
///
/// The motion includes joints of robots, articulations and MJCF files, floating bases, free objects and kinematic
/// objects. Sizes and colors that were changed per environment are not replayed.
#[derive(Debug)]
pub struct Playback {
    part: MjcfId,
    times: Vec<f64>,
    tracks: Vec<Track>,
    /// Positions of all joints in MuJoCo's order, shape (N, nq).
    qpos: Array2<f64>,
    mocap_bodies: Vec<MocapBody>,
    joints_without_data: Vec<String>,
}

/// One recorded number over time, and its destination.
#[derive(Debug)]
struct Track {
    env: usize,
    target: TrackTarget,
    samples: TimeSeries,
}

#[derive(Clone, Copy, Debug)]
enum TrackTarget {
    /// Column of `qpos`.
    Joint(usize),
    /// Index of a kinematic body, and column of its pose.
    MocapPose(usize, usize),
}

/// A kinematic (MuJoCo: mocap) body.
#[derive(Debug)]
struct MocapBody {
    body: String,
    /// Poses as rows x, y, z, qw, qx, qy, qz, shape (N, 7).
    poses: Array2<f64>,
    /// True if any value of it was recorded.
    has_data: bool,
}

/// Number of values of a joint in `qpos`, by MuJoCo's joint type: free, ball, slide, hinge.
const QPOS_WIDTHS: [usize; 4] = [7, 4, 1, 1];
const FREE: i32 = 0;

impl Playback {
    /// Opens a recording for playback. The scene is that of `scene`, a simulation built like the recorded one; for
    /// `None`, it is the scene in the file. Returns the playback and a new simulation that displays the motion.
    ///
    /// # Errors
    /// The recording contains no scene and none is given, the scene cannot be compiled, or no motion was recorded.
    pub fn open(recording: &Recording, scene: Option<&SimulationManager>) -> Result<(Self, SimulationManager)> {
        let malformed = |what: &str| RecordError::Malformed { path: recording.path().into(), what: what.into() };
        let packed = match scene {
            Some(sim) => scene_file::pack(sim)?.0,
            None => recording.attachment(SCENE_ARCHIVE)?.ok_or_else(|| {
                malformed("it does not contain its scene; pass a scene that is built as the recorded one was")
            })?,
        };
        let (sim, part) = scene_file::unpack(&packed, recording.path())?;
        let playback = Self::in_scene(recording, &sim, part)?;
        if playback.times.is_empty() {
            return Err(malformed("no motion of its scene was recorded; record joint states, poses or states"));
        }
        Ok((playback, sim))
    }

    fn in_scene(recording: &Recording, sim: &SimulationManager, part: MjcfId) -> Result<Self> {
        let view = sim.mjcf_part(part);
        let qpos = view.qpos();
        let envs: Vec<usize> = recording.env_ids().into_iter().filter(|env| *env < sim.num_envs()).collect();
        let by_hand = mocap_body_names(&view);
        let start =
            |body: &String| view.body_pose(body).map(|poses| MocapBody { body: body.clone(), poses, has_data: false });
        let mut mocap_bodies: Vec<MocapBody> = by_hand.iter().map(start).collect::<kinetoscope_sim::Result<_>>()?;
        let (mut wanted, mut places, mut joints_without_data) = (Vec::new(), Vec::new(), Vec::new());
        let mut want = |topic: String, field: String, env: usize, column: TrackTarget| {
            let known = recording.topics().iter().find(|known| known.name == topic);
            let there = known.is_some_and(|topic| topic.fields.contains(&field));
            if there {
                wanted.push(FieldSelector { topic, field });
                places.push((env, column));
            }
            there
        };
        for &env in &envs {
            for (k, hand) in mocap_bodies.iter_mut().enumerate() {
                for (number, (topic, field)) in pose_fields(recording, env, &hand.body).into_iter().enumerate() {
                    hand.has_data |= want(topic, field, env, TrackTarget::MocapPose(k, number));
                }
            }
            for joint in joints(&view) {
                let mut there = false;
                for (topic, field, column) in joint.qpos_fields(recording, env, &view) {
                    there |= want(topic, field, env, TrackTarget::Joint(column));
                }
                if !there && !joints_without_data.contains(&joint.name) {
                    joints_without_data.push(joint.name);
                }
            }
        }
        let samples = recording.time_series(&wanted)?;
        let mut times: Vec<f64> = samples.iter().flat_map(|samples| samples.times.iter().copied()).collect();
        // Times of a diverged environment may be NaN.
        times.retain(|time| time.is_finite());
        times.sort_by(f64::total_cmp);
        // One of the formats rounds times to nanoseconds.
        times.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let track = |(samples, (env, target))| Track { env, target, samples };
        let tracks = samples.into_iter().zip(places).map(track).collect();
        Ok(Self { part, times, tracks, qpos, mocap_bodies, joints_without_data })
    }

    /// Times with recorded values \[s\], in ascending order, on the clock of the recording.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Joints (`uid/joint`) without recorded values in at least one recorded environment. There they stay in their
    /// initial state.
    pub fn joints_without_data(&self) -> &[String] {
        &self.joints_without_data
    }

    /// Index of the last recorded time at or before `time` \[s\], with a tolerance of 1 ns; 0 before the first.
    pub fn frame_at(&self, time: f64) -> usize {
        frame_at(&self.times, time)
    }

    /// Sets the simulation to the time with index `frame` in [`times`](Self::times); a larger index is the last one.
    /// Each number has its last value recorded until then, or its first value before that. Numbers that are not finite
    /// are skipped. Velocities and the simulation time are not set.
    ///
    /// # Errors
    /// A recorded quaternion has length zero.
    pub fn seek(&mut self, sim: &mut SimulationManager, frame: usize) -> Result<()> {
        let Some(&time) = self.times.get(frame.min(self.times.len().saturating_sub(1))) else { return Ok(()) };
        for Track { env, target, samples } in &self.tracks {
            // Before its first time, a number has its first value.
            let last = samples.times.partition_point(|sample| *sample <= time + 1e-9).saturating_sub(1);
            // A diverged number keeps its last finite value, also after a jump to a later time.
            let until = samples.values.get(..=last);
            let value = until.and_then(|until| until.iter().rev().find(|value| value.is_finite()));
            let Some(&value) = value else { continue };
            match *target {
                TrackTarget::Joint(column) => self.qpos[(*env, column)] = value,
                TrackTarget::MocapPose(hand, number) => self.mocap_bodies[hand].poses[(*env, number)] = value,
            }
        }
        let mut part = sim.mjcf_part_mut(self.part);
        for hand in self.mocap_bodies.iter().filter(|hand| hand.has_data) {
            part.write_mocap_pose(&hand.body, &hand.poses, None)?;
        }
        if self.qpos.ncols() > 0 {
            part.write_qpos(&self.qpos, None)?;
        }
        Ok(())
    }
}

fn mocap_body_names(view: &MjcfPart<'_>) -> Vec<String> {
    // The first body is the world.
    let by_hand = view.model().body_mocapid().iter().skip(1);
    view.body_names().iter().zip(by_hand).filter(|(_, mocap)| **mocap >= 0).map(|(name, _)| name.clone()).collect()
}

/// A joint of the scene.
struct Joint {
    /// `uid/joint`.
    name: String,
    /// The body that it moves: `uid/link`, or the uid of an object.
    body: String,
    kind: i32,
    /// Index of its first number in `qpos`.
    first: usize,
}

fn joints(view: &MjcfPart<'_>) -> Vec<Joint> {
    let model = view.model();
    let all = view.joint_names().iter().zip(model.jnt_type()).zip(model.jnt_qposadr()).zip(model.jnt_bodyid());
    let body = |index: i32| {
        let place = usize::try_from(index).ok().and_then(|index| index.checked_sub(1));
        place.and_then(|place| view.body_names().get(place)).cloned().unwrap_or_default()
    };
    all.map(|(((name, kind), first), of)| Joint {
        name: name.clone(),
        body: body(*of),
        kind: *kind,
        first: usize::try_from(*first).unwrap_or(0),
    })
    .collect()
}

/// Topics and fields of the seven numbers of a pose in a recording, in the order x, y, z, qw, qx, qy, qz.
fn pose_fields(recording: &Recording, env: usize, frame: &str) -> [(String, String); 7] {
    if recording.is_archive() {
        // The stream of an object, whose name may contain a slash, or the link poses of a robot.
        let object = format!("{frame}/pose");
        let is_object = recording.topics().iter().any(|topic| topic.name == format!("/env_{env}/{object}"));
        // The body poses of an MJCF part.
        let part = frame.split_once('/').map(|(uid, _)| format!("{uid}/body_poses"));
        let part =
            part.filter(|part| recording.topics().iter().any(|topic| topic.name == format!("/env_{env}/{part}")));
        let links = part.or_else(|| frame.split_once('/').map(|(uid, _)| format!("{uid}/link_poses")));
        let stream = links.filter(|_| !is_object).unwrap_or(object);
        return ["x", "y", "z", "qw", "qx", "qy", "qz"]
            .map(|number| (format!("/env_{env}/{stream}"), format!("pose[{frame}].{number}")));
    }
    let parts =
        ["translation.x", "translation.y", "translation.z", "rotation.w", "rotation.x", "rotation.y", "rotation.z"];
    parts.map(|part| (format!("/env_{env}/tf"), format!("transforms[env_{env}/{frame}].transform.{part}")))
}

impl Joint {
    /// Topics, fields and `qpos` columns of its numbers in a recording. A number has several entries if several topics
    /// may contain it.
    fn qpos_fields(&self, recording: &Recording, env: usize, view: &MjcfPart<'_>) -> Vec<(String, String, usize)> {
        let mut places = Vec::new();
        let width = usize::try_from(self.kind).ok().and_then(|kind| QPOS_WIDTHS.get(kind)).copied().unwrap_or(0);
        let Some((uid, own)) = self.name.split_once('/') else { return places };
        if self.kind == FREE {
            let columns = (0..width).map(|k| self.first + k);
            let numbers = pose_fields(recording, env, &self.body).into_iter().zip(columns);
            places.extend(numbers.map(|((topic, field), column)| (topic, field, column)));
        } else if width == 1 {
            places.push((format!("/env_{env}/{uid}/joint_states"), format!("position[{own}]"), self.first));
        }
        // The state of an MJCF part has the part's own positions, in the order of its joints.
        let start = joints(view)
            .iter()
            .filter(|joint| joint.name.starts_with(&format!("{uid}/")))
            .map(|joint| joint.first)
            .min();
        let (topic, array) = if recording.is_archive() { ("state", "position") } else { ("state/positions", "data") };
        for k in 0..width {
            let place = self.first + k - start.unwrap_or(self.first);
            places.push((format!("/env_{env}/{uid}/{topic}"), format!("{array}[{place}]"), self.first + k));
        }
        places
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
