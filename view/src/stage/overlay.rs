//! What is drawn over the scene to explain it: contact forces, frames, axes, centres of mass, names.

use super::assembly::chosen;
use super::canvas::Canvas;
use super::color;
use super::eye::project;
use super::snapshot::{EnvStage, Shown, Snapshot};
use embedded_graphics::mono_font::ascii::FONT_6X10;
use nalgebra::Vector3;
use scene::Marker;
use scene::state::Contact;
use sensors::visibility::View;

/// What is drawn over the scene, and which of its shapes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlays {
    /// What sensors show of their measurements.
    pub sensors: bool,
    /// Contact forces, as arrows in the points of contact; the length grows with the logarithm of the force.
    pub contacts: bool,
    /// Frames of links and objects.
    pub frames: bool,
    /// Axes of joints.
    pub joints: bool,
    /// Centres of mass, as balls of the volume that the mass has at the density of water.
    pub masses: bool,
    /// Names of links and objects.
    pub names: bool,
    /// Where bodies were.
    pub trails: bool,
    /// What is there to be looked at: geom groups 0 to 2.
    pub visuals: bool,
    /// Collision shapes: geom groups 3 to 5.
    pub collisions: bool,
}

impl Default for Overlays {
    fn default() -> Self {
        Self {
            sensors: true,
            contacts: false,
            frames: false,
            joints: false,
            masses: false,
            names: false,
            trails: false,
            visuals: true,
            collisions: false,
        }
    }
}

/// Length of the axes of frames \[m\].
const FRAME: f32 = 0.08;
/// Length of the axes of joints \[m\].
const AXIS: f64 = 0.16;

impl Overlays {
    /// Geom groups that are drawn: bit k is group k.
    pub fn groups(&self) -> u32 {
        let (visuals, collisions) = (if self.visuals { 0b111 } else { 0 }, if self.collisions { 0b11_1000 } else { 0 });
        visuals | collisions
    }

    /// The markers of the environments that are shown.
    pub(super) fn markers(&self, snapshot: &Snapshot, shown: Shown) -> Vec<(usize, Marker)> {
        let mut markers = Vec::new();
        for (k, env) in chosen(snapshot, shown) {
            let mut add = |marker: Marker| markers.push((k, marker));
            if self.sensors {
                env.markers.iter().for_each(|marker| add(*marker));
            }
            if self.contacts {
                env.contacts.iter().filter_map(force_arrow).for_each(&mut add);
            }
            if self.frames {
                env.look.bodies.iter().for_each(|pose| add(Marker::axes(*pose, FRAME)));
            }
            if self.joints {
                env.look.joints.iter().for_each(|joint| {
                    let (axis, rgba) =
                        (Vector3::from(joint.axis), if joint.slides { color::SLIDE } else { color::HINGE });
                    let tail = Vector3::from(joint.anchor) - axis * (0.5 * AXIS);
                    Marker::arrow(tail.into(), (axis * AXIS).into(), rgba).into_iter().for_each(&mut add);
                });
            }
            if self.masses {
                env.look.masses.iter().for_each(|&(at, mass)| add(Marker::sphere(at, mass_radius(mass), color::MASS)));
            }
        }
        markers
    }

    /// Names of links and objects, where they are in the picture.
    pub(super) fn write_names(&self, snapshot: &Snapshot, shown: Shown, view: &View, canvas: &mut Canvas) {
        if !self.names {
            return;
        }
        for (_, env) in chosen(snapshot, shown) {
            for (name, pose) in snapshot.names.bodies.iter().zip(&env.look.bodies) {
                let at = in_overview(env, pose.translation.vector.into());
                let Some([x, y]) = project(view, at) else { continue };
                let inside = (0.0..view.width as f32).contains(&x) && (0.0..view.height as f32).contains(&y);
                if inside {
                    let short = name.rsplit('/').next().unwrap_or(name);
                    canvas.text(short, [x as i32 + 3, y as i32 - 5], &FONT_6X10, color::NAME);
                }
            }
        }
    }
}

/// A point of an environment in the overview.
pub(super) fn in_overview(env: &EnvStage, point: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| point[k] + env.origin[k])
}

/// The force on the second body, from the point of contact. Its length is `0.05 m log2(1 + F / 1 N)`: 5 cm for 1 N, a third
/// of a metre for 100 N, half a metre for 1000 N.
fn force_arrow(contact: &Contact) -> Option<Marker> {
    let force = Vector3::from(contact.force);
    let size = force.norm();
    let length = 0.05 * (1.0 + size).log2();
    Marker::arrow(contact.point, (force / size.max(1e-9) * length).into(), color::FORCE).filter(|_| length > 1e-4)
}

/// Radius of a ball of water of a mass \[m\].
fn mass_radius(mass: f64) -> f32 {
    (mass / 1000.0 * 0.75 / std::f64::consts::PI).cbrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::MarkerKind;

    fn contact(force: [f64; 3]) -> Contact {
        let (point, normal) = ([1.0, 2.0, 0.0], [0.0, 0.0, 1.0]);
        Contact { bodies: [None, Some(0)], point, normal, distance: 0.0, force, normal_force: force[2] }
    }

    #[test]
    fn force_arrows_start_in_the_contact_and_point_along_the_force() {
        let marker = force_arrow(&contact([0.0, 0.0, 3.0]));
        let Some(Marker { kind: MarkerKind::Arrow { length, .. }, pose, .. }) = marker else { panic!("{marker:?}") };
        // log2(4) = 2.
        assert!((length - 0.1).abs() < 1e-6, "{length}");
        assert_eq!(pose.translation.vector, Vector3::new(1.0, 2.0, 0.0));
        assert!((pose.rotation * Vector3::z() - Vector3::z()).norm() < 1e-12);
        assert_eq!(force_arrow(&contact([0.0; 3])), None, "what only touches has no arrow");
        assert_eq!(force_arrow(&contact([f64::NAN; 3])), None);
    }

    #[test]
    fn a_ball_of_a_mass_has_its_volume() {
        let r = f64::from(mass_radius(4.18879));
        // 4.18879 litres of water are 4/3 pi decimetres cubed: a radius of a decimetre.
        assert!((r - 0.1).abs() < 1e-6, "{r}");
    }

    #[test]
    fn groups_are_those_of_the_shapes() {
        let all = Overlays { collisions: true, ..Overlays::default() };
        let shapes = Overlays { visuals: false, ..all };
        assert_eq!([Overlays::default(), all, shapes].map(|o| o.groups()), [0b111, 0b11_1111, 0b11_1000]);
    }
}
