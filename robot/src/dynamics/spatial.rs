//! Spatial vectors in Plücker coordinates: angular part first, all about one fixed point in world axes.
//!
//! Source: R. Featherstone, "Rigid Body Dynamics Algorithms", Springer 2008, chapter 2. With one frame for all bodies
//! no transform appears between them: velocities and inertias are simply added.

use crate::inertia::RigidInertia;
use nalgebra::{Matrix3, Vector3};
use std::ops::{Add, AddAssign, Mul};

/// Motion vector: a velocity, an acceleration, or an axis of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpatialMotion {
    pub(super) angular: Vector3<f64>,
    /// Velocity of the body point that coincides with the origin, in world axes \[m/s\].
    pub(super) linear: Vector3<f64>,
}

/// Force vector: a force or a momentum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpatialForce {
    /// Moment about the origin, in world axes \[N m\].
    pub(super) moment: Vector3<f64>,
    pub(super) force: Vector3<f64>,
}

/// Spatial inertia of one or several bodies about the origin. Source: equation 2.63.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpatialInertia {
    pub(super) mass: f64,
    /// Mass times center of mass, in world axes \[kg m\].
    pub(super) first_moment: Vector3<f64>,
    /// Rotational inertia about the origin, in world axes \[kg m²\].
    pub(super) inertia: Matrix3<f64>,
}

impl SpatialMotion {
    pub(super) fn zero() -> Self {
        Self { angular: Vector3::zeros(), linear: Vector3::zeros() }
    }

    /// Rotation of 1 rad/s about the unit `axis` through `point`.
    pub(super) fn rotation(axis: Vector3<f64>, point: Vector3<f64>) -> Self {
        Self { angular: axis, linear: point.cross(&axis) }
    }

    /// Translation of 1 m/s along the unit `axis`.
    pub(super) fn translation(axis: Vector3<f64>) -> Self {
        Self { angular: Vector3::zeros(), linear: axis }
    }

    /// `self × other`: rate of change of the motion vector `other` when it moves with velocity `self`. Source: equation
    /// 2.31.
    pub(super) fn cross(&self, other: &Self) -> Self {
        Self {
            angular: self.angular.cross(&other.angular),
            linear: self.angular.cross(&other.linear) + self.linear.cross(&other.angular),
        }
    }

    /// `self ×* other`: rate of change of the force vector `other` when it moves with velocity `self`. Source: equation
    /// 2.32.
    pub(super) fn cross_force(&self, other: &SpatialForce) -> SpatialForce {
        SpatialForce {
            moment: self.angular.cross(&other.moment) + self.linear.cross(&other.force),
            force: self.angular.cross(&other.force),
        }
    }

    /// Scalar product: power, or the component of a force along an axis of motion.
    pub(super) fn dot(&self, other: &SpatialForce) -> f64 {
        self.angular.dot(&other.moment) + self.linear.dot(&other.force)
    }

    /// Velocity of the body point at `point`, which is relative to the origin.
    pub(super) fn at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(point)
    }
}

impl SpatialForce {
    pub(super) fn zero() -> Self {
        Self { moment: Vector3::zeros(), force: Vector3::zeros() }
    }
}

impl SpatialInertia {
    pub(super) fn zero() -> Self {
        Self { mass: 0.0, first_moment: Vector3::zeros(), inertia: Matrix3::zeros() }
    }

    /// Computes the spatial inertia from mass properties in axes parallel to the world, relative to the origin.
    pub(super) fn new(body: &RigidInertia) -> Self {
        let (m, c) = (body.mass, body.com);
        let parallel_axis = Matrix3::from_diagonal_element(c.norm_squared()) - c * c.transpose();
        Self { mass: m, first_moment: c * m, inertia: body.inertia + parallel_axis * m }
    }
}

impl Add for SpatialMotion {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }
}

impl AddAssign for SpatialMotion {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f64> for SpatialMotion {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { angular: self.angular * factor, linear: self.linear * factor }
    }
}

impl Add for SpatialForce {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { moment: self.moment + other.moment, force: self.force + other.force }
    }
}

impl AddAssign for SpatialForce {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl AddAssign for SpatialInertia {
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.first_moment += other.first_moment;
        self.inertia += other.inertia;
    }
}

impl Mul<SpatialMotion> for SpatialInertia {
    type Output = SpatialForce;

    fn mul(self, v: SpatialMotion) -> SpatialForce {
        SpatialForce {
            moment: self.inertia * v.angular + self.first_moment.cross(&v.linear),
            force: v.linear * self.mass - self.first_moment.cross(&v.angular),
        }
    }
}
