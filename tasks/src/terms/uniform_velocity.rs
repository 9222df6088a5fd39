//! Velocity commands of walking robots.

use super::check_range;
use crate::command::CommandTerm;
use crate::error::{EnvError, Result, TermKind};
use kinetoscope_scene::file_format::or_false;
use kinetoscope_sim::RobotId;
use ndarray::Array2;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::f64::consts::{PI, TAU};

/// Ranges of a velocity command, \[low, high\] each, uniformly distributed, with Isaac Lab's meaning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UniformVelocityCfg {
    /// Velocity along the x axis of the root link \[m/s\].
    pub lin_vel_x: [f64; 2],
    /// Velocity along the y axis of the root link \[m/s\].
    pub lin_vel_y: [f64; 2],
    /// Turning rate about the z axis of the root link \[rad/s\]. It also bounds the turning rate toward a heading.
    pub ang_vel_z: [f64; 2],
    /// Target headings \[rad\], the angle about the world's z of the root link's x axis; `None` for drawn turning rates.
    pub heading: Option<[f64; 2]>,
    /// Share of commands that have a heading if [`heading`](Self::heading) is set; the others have a drawn turning
    /// rate.
    pub rel_heading_envs: f64,
    /// Turning rate per heading error \[1/s\].
    pub heading_stiffness: f64,
    /// Share of commands that are 0, so that the robot has to stand still.
    pub rel_standing_envs: f64,
    /// Range of the time after which the command is drawn again \[s\]; `None` (`false` in files) for one command per
    /// episode.
    #[serde(serialize_with = "or_false::serialize", deserialize_with = "range_or_false")]
    pub resampling_time: Option<[f64; 2]>,
}

impl Default for UniformVelocityCfg {
    /// Up to 1 m/s in both directions and 1 rad/s, without headings, all environments moving, drawn every 10 s.
    fn default() -> Self {
        Self {
            lin_vel_x: [-1.0, 1.0],
            lin_vel_y: [-1.0, 1.0],
            ang_vel_z: [-1.0, 1.0],
            heading: None,
            rel_heading_envs: 1.0,
            heading_stiffness: 1.0,
            rel_standing_envs: 0.0,
            resampling_time: Some([10.0, 10.0]),
        }
    }
}

/// Reads a range, or `false` as `None`.
fn range_or_false<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<[f64; 2]>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum RangeOrFlag {
        Range([f64; 2]),
        Flag(bool),
    }

    match RangeOrFlag::deserialize(deserializer) {
        Ok(RangeOrFlag::Range(range)) => Ok(Some(range)),
        Ok(RangeOrFlag::Flag(false)) => Ok(None),
        Ok(RangeOrFlag::Flag(true)) | Err(_) => Err(D::Error::custom("expected a range [low, high], or false")),
    }
}

impl UniformVelocityCfg {
    fn check(&self, name: &str) -> Result<()> {
        let wrong = |field: &str, value: String, expected| {
            let field = format!("{field} of the command term {name:?}");
            Err(EnvError::Config { field, value, expected })
        };
        let ranges = [
            ("lin_vel_x", Some(self.lin_vel_x)),
            ("lin_vel_y", Some(self.lin_vel_y)),
            ("ang_vel_z", Some(self.ang_vel_z)),
            ("heading", self.heading),
        ];
        for (field, range) in ranges {
            check_range(TermKind::Command, name, field, range.unwrap_or_default())?;
        }
        for (field, share) in
            [("rel_heading_envs", self.rel_heading_envs), ("rel_standing_envs", self.rel_standing_envs)]
        {
            if !(0.0..=1.0).contains(&share) {
                return wrong(field, share.to_string(), "it must be 0 to 1");
            }
        }
        if !(self.heading_stiffness.is_finite() && self.heading_stiffness >= 0.0) {
            return wrong("heading_stiffness", self.heading_stiffness.to_string(), "it must be at least 0");
        }
        Ok(())
    }
}

/// Creates a command with the columns `lin_vel_x`, `lin_vel_y` \[m/s\] and `ang_vel_z` \[rad/s\], in the axes of the
/// root link: a target velocity. With [`UniformVelocityCfg::heading`], the turning rate is that toward a drawn heading:
/// the stiffness times the heading error, from -π to π, within the range of turning rates.
///
/// # Errors
/// A number is out of range.
pub fn uniform_velocity(name: &str, robot: RobotId, cfg: UniformVelocityCfg) -> Result<CommandTerm> {
    cfg.check(name)?;
    let sample = move |rng: &mut crate::EpisodeRng| {
        let mut drawn = |[low, high]: [f64; 2]| rng.uniform_range(low, high);
        let velocity = [drawn(cfg.lin_vel_x), drawn(cfg.lin_vel_y), drawn(cfg.ang_vel_z)];
        let heading = drawn(cfg.heading.unwrap_or_default());
        let has_heading = cfg.heading.is_some() && rng.uniform() < cfg.rel_heading_envs;
        let stands = rng.uniform() < cfg.rel_standing_envs;
        let flag = |is: bool| f64::from(u8::from(is));
        [velocity[0], velocity[1], velocity[2], heading, flag(has_heading), flag(stands)]
    };
    let columns = ["lin_vel_x", "lin_vel_y", "ang_vel_z"];
    let term = CommandTerm::derived(name, columns, sample, move |now, drawn| {
        let headings = cfg.heading.map(|_| now.robot(robot).root_heading());
        Ok(Array2::from_shape_fn((drawn.nrows(), 3), |(env, k)| {
            let row = drawn.row(env);
            match &headings {
                _ if row[5] > 0.5 => 0.0,
                Some(headings) if k == 2 && row[4] > 0.5 => {
                    let [low, high] = cfg.ang_vel_z;
                    (cfg.heading_stiffness * wrap_to_pi(row[3] - headings[env])).clamp(low, high)
                }
                _ => row[k],
            }
        }))
    });
    Ok(match cfg.resampling_time {
        Some(seconds) => term.resampled_every(seconds),
        None => term,
    })
}

/// The same angle from -π (excluded) to π.
fn wrap_to_pi(angle: f64) -> f64 {
    let wrapped = angle.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}
