//! Where bodies were.

use super::canvas::Canvas;
use super::color;
use super::eye::project;
use super::overlay::in_overview;
use super::snapshot::{Shown, Snapshot};
use embedded_graphics::mono_font::ascii::FONT_6X10;
use kinetoscope_render::View;
use std::collections::VecDeque;

/// Places that are kept of each body.
const LENGTH: usize = 120;
/// Bodies whose trails are kept, at most.
const BODIES: usize = 1024;
/// A new place is kept where the body is this far from the last one \[m\].
const APART: f64 = 0.01;

/// Trails of bodies, kept by the viewer who draws them: of the environments that are shown, and of 1024 bodies at most,
/// environment by environment. Where there are more, that is written into the picture.
#[derive(Debug, Default)]
pub struct Trails {
    /// One for each body, from those of environment `first_env` on.
    places: Vec<VecDeque<[f64; 3]>>,
    first_env: usize,
    /// Bodies of an environment.
    bodies: usize,
}

impl Trails {
    /// Takes over where bodies are now. A simulation of other bodies, an environment that was put back, and one that was not
    /// among those with trails begin anew.
    pub fn add(&mut self, snapshot: &Snapshot, shown: Shown) {
        let bodies = snapshot.names.bodies.len();
        let (first_env, wanted) = match shown {
            Shown::All => (0, bodies * snapshot.envs.len()),
            // One of those that have trails anyway: all of them keep theirs.
            Shown::One(env) if self.bodies == bodies && self.has_all_of(env) => (self.first_env, self.places.len()),
            Shown::One(env) => (env, if env < snapshot.envs.len() { bodies } else { 0 }),
        };
        let count = wanted.min(BODIES);
        if (self.bodies, self.first_env, self.places.len()) != (bodies, first_env, count) {
            (self.bodies, self.first_env, self.places) = (bodies, first_env, vec![VecDeque::new(); count]);
        }
        let all = snapshot.envs.iter().skip(first_env).flat_map(|env| &env.look.bodies);
        for (trail, pose) in self.places.iter_mut().zip(all) {
            let now: [f64; 3] = pose.translation.vector.into();
            let distance = trail.back().map(|last| (0..3).map(|k| (now[k] - last[k]).powi(2)).sum::<f64>().sqrt());
            // Nothing flies a metre between two pictures: it was put somewhere else.
            if distance.is_some_and(|distance| distance.is_nan() || distance > 1.0) {
                trail.clear();
            }
            if distance.is_none_or(|distance| distance > APART) {
                trail.push_back(now);
            }
            if trail.len() > LENGTH {
                trail.pop_front();
            }
        }
    }

    /// Whether every body of this environment has a trail.
    fn has_all_of(&self, env: usize) -> bool {
        env >= self.first_env && (env - self.first_env + 1) * self.bodies <= self.places.len()
    }

    /// Forgets them.
    pub fn clear(&mut self) {
        self.places.clear();
    }

    /// Draws those of the environments that are shown, older places darker.
    pub(super) fn draw(&self, snapshot: &Snapshot, shown: Shown, view: &View, canvas: &mut Canvas) {
        for (index, trail) in self.places.iter().enumerate() {
            let env = self.first_env + index / self.bodies.max(1);
            let Some(stage) = snapshot.envs.get(env).filter(|_| shown.has(env)) else { continue };
            let points = || trail.iter().map(|place| project(view, in_overview(stage, *place)));
            for (k, pair) in points().zip(points().skip(1)).enumerate() {
                let age = trail.len() - k;
                let strength = 255 - (age * 200 / LENGTH).min(200);
                let shade = color::TRAIL.map(|c| (usize::from(c) * strength / 255) as u8);
                if let (Some(from), Some(to)) = pair {
                    canvas.line(from, to, shade);
                }
            }
        }
        let envs_drawn = match shown {
            Shown::All => snapshot.envs.len(),
            Shown::One(env) => usize::from(env < snapshot.envs.len()),
        };
        let there_are = envs_drawn * snapshot.names.bodies.len();
        if there_are > BODIES {
            let text = format!("trails of the first {BODIES} of {there_are} bodies");
            let [width, height] = canvas.dimensions().map(|n| i32::try_from(n).unwrap_or(i32::MAX));
            // In the middle below: the corners have other words.
            let left = (width - 6 * text.len() as i32) / 2;
            canvas.text(&text, [left.max(2), height - 14], &FONT_6X10, color::TRAIL);
        }
    }
}
