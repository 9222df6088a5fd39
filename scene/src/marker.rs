//! Markers: visualizations of sensor measurements. Markers are drawn in viewers, and in the color of cameras with
//! `draw_markers`. No other channel or sensor measures them.

use crate::material::Material;
use crate::mesh::TriMesh;
use crate::render_scene::Instance;
use crate::shape::{self, Mesh, RenderMesh, Sphere};
use crate::{Pose, PoseF32};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// A visualization marker in an environment: a sphere, an arrow or the axes of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marker {
    /// Kind and size.
    pub kind: MarkerKind,
    /// Pose in the environment frame.
    pub pose: Pose,
    /// Color (sRGB) and opacity, 0..=1. Ignored for axes, which are red, green, blue and opaque.
    pub rgba: [f32; 4],
}

/// Kinds of markers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MarkerKind {
    /// A sphere around the position of the pose.
    Sphere {
        /// Radius \[m\].
        radius: f32,
    },
    /// An arrow from the pose along its z axis.
    Arrow {
        /// Length, head included \[m\].
        length: f32,
        /// Radius of the shaft \[m\].
        radius: f32,
    },
    /// The axes of the pose: x red, y green, z blue.
    Axes {
        /// Length of each \[m\].
        length: f32,
    },
}

impl Marker {
    /// Mask id of the instances that draw markers. The mask channel of cameras omits markers.
    pub const MASK_ID: i32 = -1;
    /// Geom group of markers in camera images, which separates them from other instances: MuJoCo's groups are 0 to 5.
    /// [`instances`](Self::instances) returns group 0, and cameras change it.
    pub const GROUP: u8 = 31;

    /// A sphere at `center` in the environment frame \[m\], with a radius \[m\].
    pub fn sphere(center: [f64; 3], radius: f32, rgba: [f32; 4]) -> Self {
        let [x, y, z] = center;
        Self { kind: MarkerKind::Sphere { radius }, pose: Pose::translation(x, y, z), rgba }
    }

    /// An arrow from `tail` with the direction and length of `vector`, in the environment frame \[m\]; the diameter of
    /// its shaft is 1/20 of its length.
    ///
    /// Returns `None` for a vector that is shorter than 1e-9 m or not finite.
    pub fn arrow(tail: [f64; 3], vector: [f64; 3], rgba: [f32; 4]) -> Option<Self> {
        let vector = Vector3::from(vector);
        let length = vector.norm();
        if !(length.is_finite() && length > 1e-9) {
            return None;
        }
        let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &vector)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        let kind = MarkerKind::Arrow { length: length as f32, radius: length as f32 / 40.0 };
        Some(Self { kind, pose: Pose::from_parts(Translation3::from(Vector3::from(tail)), rotation), rgba })
    }

    /// The axes of a frame, each of `length` \[m\].
    pub fn axes(pose: Pose, length: f32) -> Self {
        Self { kind: MarkerKind::Axes { length }, pose, rgba: [1.0; 4] }
    }

    /// Instances that draw the marker, with their poses in the environment frame. Instances with invalid sizes or poses
    /// are left out.
    pub fn instances(&self) -> Vec<(Instance, PoseF32)> {
        let drawn = match self.kind {
            MarkerKind::Sphere { radius } => vec![(shape::Shape::from(Sphere { radius }), Pose::identity(), self.rgba)],
            MarkerKind::Arrow { length, radius } => vec![(arrow(length, radius), Pose::identity(), self.rgba)],
            MarkerKind::Axes { length } => {
                let quarter = std::f64::consts::FRAC_PI_2;
                [
                    (Vector3::y() * quarter, [0.85, 0.1, 0.1, 1.0]),
                    (Vector3::x() * -quarter, [0.1, 0.65, 0.1, 1.0]),
                    (Vector3::zeros(), [0.1, 0.25, 0.9, 1.0]),
                ]
                .map(|(turn, rgba)| (arrow(length, length / 30.0), Pose::rotation(turn), rgba))
                .to_vec()
            }
        };
        let place = |(shape, local, rgba): (shape::Shape, Pose, [f32; 4])| {
            // Emission keeps markers bright in shadow.
            let material = Material { emission: 0.4, specular: 0.1, ..Material::from_rgba(rgba) };
            (Instance::new(shape, material, Self::MASK_ID), PoseF32::from(&(self.pose * local)))
        };
        let drawable = |(instance, pose): &(Instance, PoseF32)| instance.validate().is_ok() && pose.is_rigid();
        drawn.into_iter().map(place).filter(drawable).collect()
    }
}

/// Mesh of an arrow from the origin along z, with 12 sides: a shaft of `radius` \[m\], and a cone with a base of 2.5
/// `radius` over the last quarter of `length` \[m\].
fn arrow(length: f32, radius: f32) -> shape::Shape {
    let (r, head) = (f64::from(radius), f64::from(length) * 0.25);
    let (neck, tip) = (f64::from(length) - head, f64::from(length));
    let mesh: TriMesh = shape::revolve(&[[0.0, 0.0], [r, 0.0], [r, neck], [2.5 * r, neck], [0.0, tip]], 12);
    Mesh { mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)) }.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bounding box of the marker's instances in the environment.
    fn extent(marker: &Marker) -> [[f32; 3]; 2] {
        let (mut lo, mut hi) = ([f32::MAX; 3], [f32::MIN; 3]);
        for (instance, pose) in marker.instances() {
            for p in instance.shape.tessellate(64).positions {
                let p = pose.apply(p);
                for k in 0..3 {
                    (lo[k], hi[k]) = (lo[k].min(p[k]), hi[k].max(p[k]));
                }
            }
        }
        [lo, hi]
    }

    #[test]
    fn arrows() {
        for vector in [[0.0, 0.0, 2.0], [0.0, 0.0, -2.0], [3.0, 0.0, 0.0]] {
            let marker = Marker::arrow([1.0, 2.0, 3.0], vector, [1.0; 4]).expect("a direction");
            let [lo, hi] = extent(&marker);
            let axis = if vector[0] == 0.0 { 2 } else { 0 };
            let (from, to): (f32, f32) = ([1.0, 2.0, 3.0][axis], [1.0, 2.0, 3.0][axis] + vector[axis] as f32);
            assert!((lo[axis] - from.min(to)).abs() < 1e-5 && (hi[axis] - from.max(to)).abs() < 1e-5, "{lo:?} {hi:?}");
        }
        assert_eq!(Marker::arrow([0.0; 3], [0.0; 3], [1.0; 4]), None);
        assert_eq!(Marker::arrow([0.0; 3], [f64::NAN, 0.0, 1.0], [1.0; 4]), None);
    }

    #[test]
    fn axes() {
        let [lo, hi] = extent(&Marker::axes(Pose::identity(), 0.5));
        for k in 0..3 {
            assert!((hi[k] - 0.5).abs() < 1e-5 && lo[k] > -0.06, "{lo:?} {hi:?}");
        }
        assert!(Marker::sphere([0.0; 3], f32::NAN, [1.0; 4]).instances().is_empty());
        assert!(Marker::sphere([f64::INFINITY, 0.0, 0.0], 0.1, [1.0; 4]).instances().is_empty());
        assert_eq!(Marker::sphere([0.0; 3], 0.1, [1.0; 4]).instances().len(), 1);
    }
}
