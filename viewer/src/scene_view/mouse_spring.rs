//! Mouse spring on a body.

use super::pick::Selection;
use super::scene_renderer::{SceneRenderer, ViewOptions};
use super::snapshot::{Names, Snapshot};
use crate::control::Command;
use kinetoscope_render::View;
use kinetoscope_sim::EnvId;

/// A mouse spring: a held point of a body, and a target in the plane through that point parallel to the image.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MouseSpring {
    picked: Selection,
    /// Distance of that plane from the camera along the optical axis \[m\].
    depth: f64,
    /// Target point in the environment frame \[m\].
    target: [f64; 3],
}

impl MouseSpring {
    /// Grabs the body at a pixel; `None` if the pixel shows no body.
    pub(crate) fn grab(
        renderer: &mut SceneRenderer,
        snapshot: &Snapshot,
        view: &View,
        look: &ViewOptions<'_>,
        pixel: [f64; 2],
    ) -> Option<Self> {
        let picked = renderer.pick(snapshot, view, look, pixel)?;
        picked.body?;
        let origin = snapshot.envs.get(picked.env)?.origin;
        let in_overview = [0, 1, 2].map(|k| (picked.point[k] + origin[k]) as f32);
        let depth = f64::from(view.world_from_camera.apply_inverse(in_overview)[2]);
        let target = picked.point;
        Some(Self { picked, depth, target })
    }

    /// The held point.
    pub(crate) fn selection(&self) -> &Selection {
        &self.picked
    }

    /// Moves the target to a pixel.
    pub(crate) fn move_to(&mut self, snapshot: &Snapshot, view: &View, [x, y]: [f64; 2]) {
        let origin = snapshot.envs.get(self.picked.env).map_or([0.0; 3], |env| env.origin);
        let ray = [(x as f32 - view.cx) / view.fx, (y as f32 - view.cy) / view.fy, 1.0];
        let place = view.world_from_camera.apply(ray.map(|n| n * self.depth as f32));
        self.target = [0, 1, 2].map(|k| f64::from(place[k]) - origin[k]);
    }

    /// Updates the body index after entities were added to the simulation.
    pub(crate) fn update_body_index(&mut self, names: &Names) {
        self.picked.update_body_index(names);
    }

    /// Returns the drag command, or `None` if the body no longer exists.
    pub(crate) fn command(&self) -> Option<Command> {
        let Selection { env, body, point_in_body, .. } = self.picked;
        Some(Command::Drag { env: EnvId(env), body: body?, anchor: point_in_body, target: self.target })
    }

    /// Returns the drawn spring: its environment and its two ends in the environment frame \[m\].
    pub(crate) fn ends(&self, snapshot: &Snapshot) -> (usize, [[f64; 3]; 2]) {
        (self.picked.env, [self.picked.current_point(snapshot), self.target])
    }
}
