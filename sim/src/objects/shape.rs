//! Shapes of rigid objects: what they weigh and how they turn.

use crate::mjcf::document::Shape;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The shape of a rigid object; its frame is in the middle, the axis of round shapes is z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum ObjectShape {
    /// Edge lengths \[m\].
    Box {
        /// Along x, y and z \[m\].
        size: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Length \[m\].
        length: f64,
    },
    /// A cylinder with round ends.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Length of the cylindrical part \[m\].
        length: f64,
    },
}

impl ObjectShape {
    /// A cube with edges of `size` \[m\].
    pub const fn cube(size: f64) -> Self {
        Self::Box { size: [size; 3] }
    }

    /// The sizes that must be positive.
    pub(crate) fn sizes(&self) -> Vec<f64> {
        match *self {
            Self::Box { size } => size.to_vec(),
            Self::Sphere { radius } => vec![radius],
            Self::Cylinder { radius, length } | Self::Capsule { radius, length } => vec![radius, length],
        }
    }

    /// Volume \[m³\].
    pub fn volume(&self) -> f64 {
        let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
        let tube = |r: f64, l: f64| PI * r * r * l;
        match *self {
            Self::Box { size: [x, y, z] } => x * y * z,
            Self::Sphere { radius } => ball(radius),
            Self::Cylinder { radius, length } => tube(radius, length),
            Self::Capsule { radius, length } => tube(radius, length) + ball(radius),
        }
    }

    /// Principal moments of inertia of a body of this shape, filled evenly with mass 1 kg, about its middle along x, y, z
    /// \[m²\]. Source: the textbook formulas; a capsule is a cylinder and two half balls, whose centres of mass are 3/8 of
    /// the radius from their flat sides.
    pub fn unit_moments(&self) -> Vector3<f64> {
        match *self {
            Self::Box { size: [x, y, z] } => {
                let [x, y, z] = [x * x, y * y, z * z];
                Vector3::new(y + z, x + z, x + y) / 12.0
            }
            Self::Sphere { radius } => Vector3::repeat(0.4 * radius * radius),
            Self::Cylinder { radius, length } => {
                let across = (3.0 * radius * radius + length * length) / 12.0;
                Vector3::new(across, across, 0.5 * radius * radius)
            }
            Self::Capsule { radius: r, length: l } => {
                let (tube, ball) = (PI * r * r * l, 4.0 / 3.0 * PI * r.powi(3));
                let (tube, ball) = (tube / (tube + ball), ball / (tube + ball));
                let across =
                    tube * (3.0 * r * r + l * l) / 12.0 + ball * (0.4 * r * r + l * l / 4.0 + 3.0 / 8.0 * r * l);
                Vector3::new(across, across, tube * 0.5 * r * r + ball * 0.4 * r * r)
            }
        }
    }

    /// MuJoCo's shape.
    pub(crate) fn to_mjcf(self) -> Shape {
        match self {
            Self::Box { size } => Shape::Box(size.map(|s| s / 2.0)),
            Self::Sphere { radius } => Shape::Sphere(radius),
            Self::Cylinder { radius, length } => Shape::Cylinder(radius, length / 2.0),
            Self::Capsule { radius, length } => Shape::Capsule(radius, length / 2.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mj;

    /// MuJoCo computes mass and moments of a geom by itself.
    #[test]
    fn volumes_and_moments_are_mujocos() {
        let shapes = [
            (ObjectShape::Box { size: [0.2, 0.3, 0.5] }, "type='box' size='0.1 0.15 0.25'"),
            (ObjectShape::Sphere { radius: 0.3 }, "type='sphere' size='0.3'"),
            (ObjectShape::Cylinder { radius: 0.2, length: 0.7 }, "type='cylinder' size='0.2 0.35'"),
            (ObjectShape::Capsule { radius: 0.2, length: 0.7 }, "type='capsule' size='0.2 0.35'"),
        ];
        for (shape, attributes) in shapes {
            let xml = format!(
                "<mujoco><worldbody><body><freejoint/><geom density='1000' {attributes}/></body></worldbody></mujoco>"
            );
            let model = mj::compile(&xml, &[]).expect("compiles").into_model();
            let mass = 1000.0 * shape.volume();
            assert!((model.body_mass()[1] / mass - 1.0).abs() < 1e-12, "{shape:?}");
            let mut expected: Vec<f64> = (mass * shape.unit_moments()).iter().copied().collect();
            let mut found = model.body_inertia()[3..6].to_vec();
            // MuJoCo sorts principal moments in some versions.
            expected.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            for (a, b) in expected.iter().zip(&found) {
                assert!((a / b - 1.0).abs() < 1e-9, "{shape:?}: {expected:?} {found:?}");
            }
        }
    }
}
