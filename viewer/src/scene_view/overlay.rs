//! Overlays that annotate the scene: contact forces, frames, joint axes, centers of mass, names.
//!
//! Frames, axes and centers of mass are usually inside of bodies, so they are also drawn on top of the image as lines
//! and dots.

use super::canvas::Canvas;
use super::color;
use super::merged_scene::shown_envs;
use super::orbit_camera::project;
use super::snapshot::{EnvSelection, Snapshot, SnapshotEnv};
use embedded_graphics::mono_font::ascii::FONT_6X10;
use kinetoscope_render::View;
use kinetoscope_scene::Contact;
use kinetoscope_scene::Marker;
use kinetoscope_sim::JointAxis;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Selection of the drawn overlays and geom groups; true is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Overlays {
    /// Debug markers of the sensors that enable them (`debug_vis`).
    pub sensors: bool,
    /// Contact forces, as arrows at the contact points. The arrow length grows with the logarithm of the force.
    pub contacts: bool,
    /// Frames of links, objects and bodies of MJCF files.
    pub frames: bool,
    /// Axes of hinge and slide joints, as arrows.
    pub joints: bool,
    /// Centers of mass of all bodies with a mass, as discs with four quarters.
    pub centers_of_mass: bool,
    /// Names of links and objects, without the uid of the robot.
    pub names: bool,
    /// Trails of past positions of bodies, in windows that record them.
    pub trails: bool,
    /// Visual shapes: geom groups 0 to 2.
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
            centers_of_mass: false,
            names: false,
            trails: false,
            visuals: true,
            collisions: false,
        }
    }
}

/// Length of frame axes \[m\].
const FRAME_AXIS_LENGTH: f32 = 0.08;
/// Length of joint axes \[m\].
const JOINT_AXIS_LENGTH: f64 = 0.16;

impl Overlays {
    /// Bit mask of the drawn geom groups: bit k is group k.
    pub fn geom_groups(&self) -> u32 {
        let (visuals, collisions) = (if self.visuals { 0b111 } else { 0 }, if self.collisions { 0b11_1000 } else { 0 });
        visuals | collisions
    }

    /// Returns the markers of the enabled overlays in the shown environments: environment index, and marker in the
    /// frame of that environment.
    pub(super) fn markers(&self, snapshot: &Snapshot, shown: EnvSelection) -> Vec<(usize, Marker)> {
        let mut markers = Vec::new();
        for (k, env) in shown_envs(snapshot, shown) {
            let mut add = |marker: Marker| markers.push((k, marker));
            if self.sensors {
                env.markers.iter().for_each(|marker| add(*marker));
            }
            if self.contacts {
                env.contacts.iter().filter_map(force_arrow).for_each(&mut add);
            }
            if self.frames {
                env.snapshot.bodies.iter().for_each(|pose| add(Marker::axes(*pose, FRAME_AXIS_LENGTH)));
            }
            if self.joints {
                env.snapshot.joints.iter().for_each(|joint| {
                    let (tail, way) = joint_arrow(joint);
                    Marker::arrow(tail.into(), way.into(), joint_color(joint)).into_iter().for_each(&mut add);
                });
            }
        }
        markers
    }

    /// Draws the enabled overlays among frames, joint axes, centers of mass and names on top of the image.
    pub(super) fn draw_on_top(&self, snapshot: &Snapshot, shown: EnvSelection, view: &View, canvas: &mut Canvas) {
        for (_, env) in shown_envs(snapshot, shown) {
            let mut line = |from: Vector3<f64>, way: Vector3<f64>, rgba: [f32; 4]| {
                let ends = [from, from + way].map(|end| project(view, in_overview(env, end.into())));
                if let [Some(from), Some(to)] = ends {
                    canvas.line(from, to, color::bytes(rgba));
                }
            };
            if self.frames {
                for pose in &env.snapshot.bodies {
                    let colors = [color::X, color::Y, color::Z];
                    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
                    for (axis, rgba) in axes.into_iter().zip(colors) {
                        line(pose.translation.vector, pose.rotation * axis * f64::from(FRAME_AXIS_LENGTH), rgba);
                    }
                }
            }
            if self.joints {
                for joint in &env.snapshot.joints {
                    let (tail, way) = joint_arrow(joint);
                    line(tail, way, joint_color(joint));
                }
            }
            if self.centers_of_mass {
                for (at, _) in env.snapshot.mass_points.iter().filter(|(_, mass)| *mass > 0.0) {
                    draw_center_of_mass(in_overview(env, *at), view, canvas);
                }
            }
        }
        self.draw_names(snapshot, shown, view, canvas);
    }

    /// Draws the names of links and objects at their projected positions.
    fn draw_names(&self, snapshot: &Snapshot, shown: EnvSelection, view: &View, canvas: &mut Canvas) {
        if !self.names {
            return;
        }
        for (_, env) in shown_envs(snapshot, shown) {
            for (name, pose) in snapshot.names.bodies.iter().zip(&env.snapshot.bodies) {
                let at = in_overview(env, pose.translation.vector.into());
                let Some([x, y]) = project(view, at) else { continue };
                let inside = (0.0..view.width as f32).contains(&x) && (0.0..view.height as f32).contains(&y);
                if inside {
                    let short = name.rsplit('/').next().unwrap_or(name);
                    canvas.text(short, [x as i32 + 3, y as i32 - 5], &FONT_6X10, color::TEXT);
                }
            }
        }
    }
}

/// Transforms a point from its environment to the overview.
pub(super) fn in_overview(env: &SnapshotEnv, point: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| point[k] + env.origin[k])
}

/// Arrow of the force on the second body, starting at the contact point. Its length is `0.05 m log2(1 + F / 1 N)`: 5 cm
/// for 1 N, a third of a meter for 100 N, half a meter for 1000 N. `None` for (almost) no force.
fn force_arrow(contact: &Contact) -> Option<Marker> {
    let force = Vector3::from(contact.force);
    let size = force.norm();
    let length = 0.05 * (1.0 + size).log2();
    Marker::arrow(contact.point, (force / size.max(1e-9) * length).into(), color::FORCE).filter(|_| length > 1e-4)
}

/// Returns the tail and the vector of the arrow along a joint axis \[m\], in the environment frame. The middle of the
/// arrow is the anchor of the joint.
fn joint_arrow(joint: &JointAxis) -> (Vector3<f64>, Vector3<f64>) {
    let axis = Vector3::from(joint.axis);
    (Vector3::from(joint.anchor) - axis * (0.5 * JOINT_AXIS_LENGTH), axis * JOINT_AXIS_LENGTH)
}

fn joint_color(joint: &JointAxis) -> [f32; 4] {
    if joint.is_slide { color::SLIDE } else { color::HINGE }
}

/// Draws the center-of-mass symbol, a disc with dark and bright quarters, at a point in the frame of the overview
/// \[m\]. It is as large as a ball of radius 2 cm there; its radius is limited to 1.5 to 7 pixels.
fn draw_center_of_mass(at: [f64; 3], view: &View, canvas: &mut Canvas) {
    let Some([x, y]) = project(view, at) else { return };
    let z = view.world_from_camera.apply_inverse(at.map(|p| p as f32))[2];
    let radius = (view.fx * 0.02 / z).clamp(1.5, 7.0);
    if !((-radius..view.width as f32 + radius).contains(&x) && (-radius..view.height as f32 + radius).contains(&y)) {
        return;
    }
    let reach = radius.ceil() as i32;
    for (dx, dy) in (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| (dx, dy))) {
        if ((dx * dx + dy * dy) as f32) <= radius * radius {
            let bright = (dx < 0) == (dy < 0);
            canvas.set(x as i32 + dx, y as i32 + dy, if bright { color::bytes(color::MASS) } else { color::MASS_DARK });
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::{SnapshotRequest, ViewerExt};
    use crate::scene_view::OrbitCamera;
    use kinetoscope_scene::MarkerKind;

    #[test]
    fn force_arrows() {
        let contact = |force: [f64; 3]| {
            let (point, normal) = ([1.0, 2.0, 0.0], [0.0, 0.0, 1.0]);
            Contact { bodies: [None, Some(0)], point, normal, distance: 0.0, force, normal_force: force[2] }
        };
        // The arrow starts at the contact point and points along the force.
        let marker = force_arrow(&contact([0.0, 0.0, 3.0]));
        let Some(Marker { kind: MarkerKind::Arrow { length, .. }, pose, .. }) = marker else { panic!("{marker:?}") };
        // log2(4) = 2.
        assert!((length - 0.1).abs() < 1e-6, "{length}");
        assert_eq!(pose.translation.vector, Vector3::new(1.0, 2.0, 0.0));
        assert!((pose.rotation * Vector3::z() - Vector3::z()).norm() < 1e-12);
        assert_eq!([[0.0; 3], [f64::NAN; 3]].map(|force| force_arrow(&contact(force))), [None, None]);
    }

    /// A point two meters ahead is at the image center; its disc has `pi r^2` pixels, half of them bright.
    #[test]
    fn center_of_mass() {
        let view = OrbitCamera::look_at([-2.0, 0.0, 0.0], [0.0; 3]).unwrap().view(201, 201);
        let disc = |at: [f64; 3]| {
            let mut canvas = Canvas::new(201, 201);
            draw_center_of_mass(at, &view, &mut canvas);
            let all = (0..201).flat_map(|y| (0..201).map(move |x| [x, y]));
            [color::bytes(color::MASS), color::MASS_DARK]
                .map(|wanted| all.clone().filter(|[x, y]| canvas.pixel(*x, *y) == Some(wanted)).collect::<Vec<_>>())
        };
        let [bright, dark] = disc([0.0; 3]);
        let radius = (view.fx * 0.02 / 2.0).clamp(1.5, 7.0);
        let area = std::f32::consts::PI * radius * radius;
        // Pixels count by their centers, so the area is off by less than twice the circumference.
        let off = (bright.len() + dark.len()) as f32 - area;
        assert!(off.abs() < 2.0 * std::f32::consts::PI * radius && bright.len() > 1, "{off} of {area}");
        let middle = [0, 1].map(|k| bright.iter().map(|at| at[k] as f32).sum::<f32>() / bright.len() as f32);
        assert!(middle.iter().all(|at| (at - 100.0).abs() < 1.0), "{middle:?}");
        assert!(disc([-5.0, 0.0, 0.0])[0].is_empty(), "behind the camera");
        assert!(disc([f64::NAN; 3])[0].is_empty());
    }

    /// Each axis of a frame, from its end to its origin, has its own color; so does a joint axis from end to end.
    #[test]
    fn axes() {
        let mut sample = crate::sample::sample(2);
        let snapshot = sample.sim.viewer(SnapshotRequest::default()).newest().unwrap();
        // From nearby, so that axes from one origin are apart after a third of their length.
        let target = in_overview(&snapshot.envs[1], [0.5, 0.0, 0.3]);
        let eye = [target[0] + 0.7, target[1] + 1.3, target[2] + 0.9];
        let view = OrbitCamera::look_at(eye, target).unwrap().view(1600, 1200);
        let colors_at = |overlays: Overlays, from: Vector3<f64>, to: Vector3<f64>, rgba: [f32; 4]| {
            let mut canvas = Canvas::new(1600, 1200);
            overlays.draw_on_top(&snapshot, EnvSelection::One(1), &view, &mut canvas);
            let at = |part: f64| project(&view, in_overview(&snapshot.envs[1], (from + (to - from) * part).into()));
            // To one pixel: lines are rounded to whole pixels.
            (4..10).all(|k| {
                let Some([x, y]) = at(f64::from(k) / 10.0) else { return false };
                (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))).any(|(dx, dy)| {
                    let [x, y] = [x as i32 + dx, y as i32 + dy].map(|n| n.max(0) as usize);
                    canvas.pixel(x, y) == Some(color::bytes(rgba))
                })
            })
        };
        let none = Overlays { sensors: false, ..Overlays::default() };
        let look = &snapshot.envs[1].snapshot;
        let frames = Overlays { frames: true, ..none };
        let axes = [(Vector3::x(), color::X), (Vector3::y(), color::Y), (Vector3::z(), color::Z)];
        let pose = look.bodies[snapshot.names.bodies.iter().position(|name| name.contains("cube")).unwrap()];
        let origin = pose.translation.vector;
        for (k, (axis, rgba)) in axes.iter().enumerate() {
            let end = origin + pose.rotation * axis * f64::from(FRAME_AXIS_LENGTH);
            assert!(colors_at(frames, origin, end, *rgba), "axis {k}");
            assert!(!colors_at(frames, origin, end, axes[(k + 1) % 3].1), "axis {k} has another color");
            assert!(!colors_at(none, origin, end, *rgba));
        }
        let joints = Overlays { joints: true, ..none };
        assert!(!look.joints.is_empty());
        for joint in &look.joints {
            let (anchor, half) = (Vector3::from(joint.anchor), Vector3::from(joint.axis) * (0.5 * JOINT_AXIS_LENGTH));
            let rgba = if joint.is_slide { color::SLIDE } else { color::HINGE };
            assert!(colors_at(joints, anchor - half, anchor + half, rgba), "{joint:?}");
            assert!(!colors_at(none, anchor - half, anchor + half, rgba));
        }
    }

    #[test]
    fn groups() {
        let all = Overlays { collisions: true, ..Overlays::default() };
        let shapes = Overlays { visuals: false, ..all };
        assert_eq!([Overlays::default(), all, shapes].map(|o| o.geom_groups()), [0b111, 0b11_1111, 0b11_1000]);
    }
}
