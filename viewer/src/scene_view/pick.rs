//! Selected points of objects.

use super::overlay::Overlays;
use super::snapshot::{EnvSelection, Names, Snapshot};
use kinetoscope_scene::Pose;
use nalgebra::{Point3, Vector3};

/// A selected point on an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Environment index.
    pub env: usize,
    /// `uid/link`, uid of an object, or name of a world geom.
    pub name: String,
    /// Index of the body in [`Names::bodies`](super::Names::bodies); `None` for the world.
    pub body: Option<usize>,
    /// Mask id.
    pub mask_id: i32,
    /// Selected point in the environment frame \[m\], at the time of selection.
    pub point: [f64; 3],
    /// Selected point in the body frame \[m\]; in the environment frame for the world.
    pub point_in_body: [f64; 3],
}

impl Selection {
    /// Creates the selection from the index of an instance in an environment and a hit point in the frame of the
    /// overview \[m\]; `None` if the environment or the instance does not exist.
    pub(super) fn new(snapshot: &Snapshot, env: usize, instance: usize, position: [f32; 3]) -> Option<Self> {
        let stage = snapshot.envs.get(env)?;
        let scene = snapshot.env_scene(stage)?;
        let hit = scene.instances().get(instance)?;
        let body = hit.body.and_then(|body| usize::try_from(body).ok());
        // The ground is shared by all environments, so the point is relative to the environment of its instance.
        let point = [0, 1, 2].map(|k| f64::from(position[k]) - stage.origin[k]);
        let pose = body.and_then(|body| stage.snapshot.bodies.get(body));
        let point_in_body = pose.map_or(point, |pose| pose.inverse_transform_point(&Point3::from(point)).into());
        Some(Self { env, name: hit.name.to_string(), body, mask_id: hit.mask_id, point, point_in_body })
    }

    /// Returns the current pose of the body in the environment frame, or `None` for the world and for bodies or
    /// environments that no longer exist.
    pub fn pose(&self, snapshot: &Snapshot) -> Option<Pose> {
        snapshot.envs.get(self.env)?.snapshot.bodies.get(self.body?).copied()
    }

    /// Updates the body index after entities were added to the simulation.
    pub(crate) fn update_body_index(&mut self, names: &Names) {
        let is = |body: usize| names.bodies.get(body) == Some(&self.name);
        if self.body.is_some_and(|body| !is(body)) {
            self.body = names.bodies.iter().position(|name| *name == self.name);
        }
    }

    /// Returns the number of contacts of the body and their total force on it \[N\], in the axes of the environment.
    /// Returns `None` for the world and if the snapshot has no contacts of the environment.
    pub fn contact_force(&self, snapshot: &Snapshot) -> Option<(usize, [f64; 3])> {
        let body = self.body?;
        let env = snapshot
            .envs
            .get(self.env)
            .filter(|_| snapshot.contacts_included.is_some_and(|of| of.contains(self.env)))?;
        let of = |contact: &Option<u32>| contact.is_some_and(|contact| contact as usize == body);
        let (mut count, mut sum) = (0, Vector3::zeros());
        for contact in &env.contacts {
            // The contact force acts on the second body; the first body has the opposite force.
            for (_, sign) in contact.bodies.iter().zip([-1.0, 1.0]).filter(|(body, _)| of(body)) {
                count += 1;
                sum += Vector3::from(contact.force) * sign;
            }
        }
        Some((count, sum.into()))
    }

    /// Returns the current position of the point in the environment frame \[m\]: it moves with the body.
    pub fn current_point(&self, snapshot: &Snapshot) -> [f64; 3] {
        self.pose(snapshot).map_or(self.point, |pose| (pose * Point3::from(self.point_in_body)).into())
    }
}

/// Returns the text lines about a selection: name, pose and contact force; for the world, name and point.
pub(crate) fn selection_text(picked: &Selection, snapshot: &Snapshot) -> Vec<String> {
    let mut lines = vec![format!("{}  (environment {}, mask id {})", picked.name, picked.env, picked.mask_id)];
    let Some(pose) = picked.pose(snapshot) else {
        let [x, y, z] = picked.point;
        lines.push(format!("point  {x:+.3} {y:+.3} {z:+.3} m"));
        return lines;
    };
    let (t, q) = (pose.translation.vector, pose.rotation);
    // Values that round to zero are shown without a sign.
    let tidy = |number: f64, least: f64| if number.abs() < least { 0.0 } else { number };
    let [x, y, z] = [t.x, t.y, t.z].map(|x| tidy(x, 5e-4));
    lines.push(format!("position  {x:+.3} {y:+.3} {z:+.3} m"));
    let [w, x, y, z] = [q.w, q.i, q.j, q.k].map(|x| tidy(x, 5e-4));
    lines.push(format!("quaternion w x y z  {w:+.3} {x:+.3} {y:+.3} {z:+.3}"));
    lines.extend(picked.contact_force(snapshot).map(|(count, force)| {
        let [x, y, z] = force.map(|x| tidy(x, 5e-3));
        match count {
            0 => "no contact".into(),
            1 => format!("1 contact: force on it  {x:+.2} {y:+.2} {z:+.2} N"),
            n => format!("{n} contacts: force on it  {x:+.2} {y:+.2} {z:+.2} N"),
        }
    }));
    lines
}

/// Returns the environments whose contacts are needed, for the force overlay and for the selected body; `None` if no
/// contacts are needed.
pub(crate) fn required_contacts(
    shown: EnvSelection,
    overlays: &Overlays,
    picked: Option<&Selection>,
) -> Option<EnvSelection> {
    let of_picked = picked.filter(|picked| picked.body.is_some()).map(|picked| EnvSelection::One(picked.env));
    match (overlays.contacts.then_some(shown), of_picked) {
        (Some(drawn), Some(said)) if drawn != said => Some(EnvSelection::All),
        (drawn, said) => drawn.or(said),
    }
}
