//! Where bodies were.

use super::canvas::Canvas;
use super::color;
use super::eye::project;
use super::overlay::in_overview;
use super::snapshot::{Shown, Snapshot};
use embedded_graphics::mono_font::ascii::FONT_6X10;
use sensors::visibility::View;
use std::collections::VecDeque;

/// Places that are kept of each body.
const LENGTH: usize = 120;
/// Bodies whose trails are kept, at most: those of the first environments.
const BODIES: usize = 1024;
/// A new place is kept where the body is this far from the last one \[m\].
const APART: f64 = 0.01;

/// Trails of bodies, kept by the viewer who draws them: of the first 1024 bodies, environment by environment. Where there are
/// more, that is written into the picture.
#[derive(Debug, Default)]
pub struct Trails {
    /// One for each body of each environment.
    places: Vec<VecDeque<[f64; 3]>>,
    bodies: usize,
    /// Bodies of all environments, those without a trail too.
    there_are: usize,
}

impl Trails {
    /// Takes over where bodies are now. A simulation of other bodies, or an environment that was put back, begins anew.
    pub fn add(&mut self, snapshot: &Snapshot) {
        let bodies = snapshot.names.bodies.len();
        self.there_are = bodies * snapshot.envs.len();
        let count = self.there_are.min(BODIES);
        if self.bodies != bodies || self.places.len() != count {
            (self.bodies, self.places) = (bodies, vec![VecDeque::new(); count]);
        }
        let all = snapshot.envs.iter().flat_map(|env| &env.look.bodies);
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

    /// Forgets them.
    pub fn clear(&mut self) {
        self.places.clear();
    }

    /// Draws those of the environments that are shown, older places darker.
    pub(super) fn draw(&self, snapshot: &Snapshot, shown: Shown, view: &View, canvas: &mut Canvas) {
        for (index, trail) in self.places.iter().enumerate() {
            let env = index / self.bodies.max(1);
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
        if self.there_are > self.places.len() {
            let text = format!("trails of the first {} of {} bodies", self.places.len(), self.there_are);
            let [width, height] = canvas.dimensions().map(|n| i32::try_from(n).unwrap_or(i32::MAX));
            // In the middle below: the corners have other words.
            let left = (width - 6 * text.len() as i32) / 2;
            canvas.text(&text, [left.max(2), height - 14], &FONT_6X10, color::TRAIL);
        }
    }
}
