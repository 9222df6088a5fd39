//! Trails of past body positions.

use super::canvas::Canvas;
use super::color;
use super::orbit_camera::project;
use super::overlay::in_overview;
use super::snapshot::{EnvSelection, Snapshot};
use embedded_graphics::mono_font::ascii::FONT_6X10;
use kinetoscope_render::View;
use std::collections::VecDeque;

/// Maximum number of positions of a trail.
const MAX_POINTS: usize = 120;
/// Maximum number of bodies with trails.
const MAX_BODIES: usize = 1024;
/// Minimum distance between two positions of a trail \[m\].
const MIN_DISTANCE: f64 = 0.01;

/// Trails of the bodies of the shown environments, environment by environment, for at most 1024 bodies. The image notes
/// if there are more bodies.
#[derive(Debug, Default)]
pub(crate) struct Trails {
    /// Positions of each body, from the bodies of environment `first_env` on, in the environment frame \[m\].
    positions: Vec<VecDeque<[f64; 3]>>,
    first_env: usize,
    /// Number of bodies per environment.
    bodies: usize,
}

impl Trails {
    /// Appends the current position of each body that moved by more than 1 cm, for at most [`MAX_BODIES`] bodies. A
    /// trail restarts when its body jumps by more than 1 m, as in most resets. All trails restart when the number of
    /// bodies changes, and when an environment without trails is shown.
    pub(crate) fn add(&mut self, snapshot: &Snapshot, shown: EnvSelection) {
        let bodies = snapshot.names.bodies.len();
        let (first_env, wanted) = match shown {
            EnvSelection::All => (0, bodies * snapshot.envs.len()),
            // The environment already has trails, so all trails are kept.
            EnvSelection::One(env) if self.bodies == bodies && self.has_trails_of(env) => {
                (self.first_env, self.positions.len())
            }
            EnvSelection::One(env) => (env, if env < snapshot.envs.len() { bodies } else { 0 }),
        };
        let count = wanted.min(MAX_BODIES);
        if (self.bodies, self.first_env, self.positions.len()) != (bodies, first_env, count) {
            (self.bodies, self.first_env, self.positions) = (bodies, first_env, vec![VecDeque::new(); count]);
        }
        let all = snapshot.envs.iter().skip(first_env).flat_map(|env| &env.snapshot.bodies);
        for (trail, pose) in self.positions.iter_mut().zip(all) {
            let now: [f64; 3] = pose.translation.vector.into();
            let distance = trail.back().map(|last| (0..3).map(|k| (now[k] - last[k]).powi(2)).sum::<f64>().sqrt());
            // A jump of more than one meter between two images is a teleport, not a motion.
            if distance.is_some_and(|distance| distance.is_nan() || distance > 1.0) {
                trail.clear();
            }
            if distance.is_none_or(|distance| distance > MIN_DISTANCE) {
                trail.push_back(now);
            }
            if trail.len() > MAX_POINTS {
                trail.pop_front();
            }
        }
    }

    /// True if every body of this environment has a trail.
    fn has_trails_of(&self, env: usize) -> bool {
        env >= self.first_env && (env - self.first_env + 1) * self.bodies <= self.positions.len()
    }

    /// Draws the trails of the shown environments; older positions are darker.
    pub(super) fn draw(&self, snapshot: &Snapshot, shown: EnvSelection, view: &View, canvas: &mut Canvas) {
        for (index, trail) in self.positions.iter().enumerate() {
            let env = self.first_env + index / self.bodies.max(1);
            let Some(stage) = snapshot.envs.get(env).filter(|_| shown.contains(env)) else { continue };
            let points = || trail.iter().map(|place| project(view, in_overview(stage, *place)));
            for (k, pair) in points().zip(points().skip(1)).enumerate() {
                let age = trail.len() - k;
                let strength = 255 - (age * 200 / MAX_POINTS).min(200);
                let shade = color::TRAIL.map(|c| (usize::from(c) * strength / 255) as u8);
                if let (Some(from), Some(to)) = pair {
                    canvas.line(from, to, shade);
                }
            }
        }
        let envs_drawn = match shown {
            EnvSelection::All => snapshot.envs.len(),
            EnvSelection::One(env) => usize::from(env < snapshot.envs.len()),
        };
        let there_are = envs_drawn * snapshot.names.bodies.len();
        if there_are > MAX_BODIES {
            let text = format!("trails of the first {MAX_BODIES} of {there_are} bodies");
            let [width, height] = canvas.dimensions().map(|n| i32::try_from(n).unwrap_or(i32::MAX));
            // At the bottom center, because the corners show other text.
            let left = (width - 6 * text.len() as i32) / 2;
            canvas.text(&text, [left.max(2), height - 14], &FONT_6X10, color::TRAIL);
        }
    }
}
