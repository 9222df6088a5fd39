//! Rigid-body dynamics of a [`RobotDescription`], computed without MuJoCo.
//!
//! It is the reference for everything downstream: MuJoCo's results for the MJCF must agree with the description.
//! Nothing is repaired here: a link whose [`inertial`](crate::description::Link::inertial) is `None` has no mass,
//! whatever its shapes. Rotor inertia (armature), springs and joint couplings are not included.
//!
//! **Generalized velocities** (and forces), in this order:
//!
//! 1. with [`Configuration::floating_base`], six of the root link: velocity of its origin in world axes, then angular
//!    velocity in the axes of the link itself (MuJoCo's free joint);
//! 2. one per joint of [`RobotDescription::drivable_joints`], in that order. Mimic joints are coordinates of their own,
//!    as in MuJoCo, where the coupling is a constraint and not a reduction;
//! 3. per floating joint six, per planar joint three, in the order of the description. Floating: velocity of the child
//!    origin in the axes of the joint frame, then angular velocity in the axes of the child. Planar: along both
//!    [`planar_axes`], then about the axis.
//!
//! **Equation of motion**: `M(q) a + c(q, v) + g(q) = tau`. `tau` is the effort of the joints without their damping and
//! friction. `g` is the force that holds the robot still, the gradient of its potential energy.
//!
//! No function recurses: the depth of the tree is limited by memory only.

mod configuration;
mod spatial;
#[cfg(test)]
mod tests;

pub use configuration::{Configuration, MimicPositions, planar_axes};

use crate::description::{JointId, JointKind, LinkId, RobotDescription};
use crate::inertia::RigidInertia;
use configuration::{check_length, has_multiple_dofs};
use kinetoscope_scene::Pose;
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion, Vector3};
use spatial::{SpatialForce, SpatialInertia, SpatialMotion};
use std::ops::Range;

/// Error of a dynamics computation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// The links do not form a tree below the root.
    #[error("link {link:?} is not connected to the root by exactly one chain of joints")]
    NotATree {
        /// A link that the root does not reach, or reaches twice.
        link: String,
    },
    /// A field of the configuration has the wrong length.
    #[error("{what} has {found} entries, the robot needs {expected}")]
    WrongLength {
        /// Name of the field.
        what: &'static str,
        /// Length that fits the robot.
        expected: usize,
        /// Length of the field.
        found: usize,
    },
    /// A number of the configuration is infinite or not a number.
    #[error("{what} must not contain NaN or infinity")]
    NotFinite {
        /// Name of the field.
        what: &'static str,
    },
}

/// Velocity of a link in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkVelocity {
    /// Velocity of the link origin \[m/s\].
    pub linear: Vector3<f64>,
    /// Angular velocity \[rad/s\].
    pub angular: Vector3<f64>,
}

/// Momentum of the whole robot in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Momentum {
    /// Linear momentum \[kg m/s\].
    pub linear: Vector3<f64>,
    /// Angular momentum \[kg m²/s\] about the center of mass; about the root's origin if the robot has no mass.
    pub angular: Vector3<f64>,
}

/// Link poses and rigid-body dynamics of a robot at one [`Configuration`]: mass matrix, bias force, inverse dynamics,
/// momentum, energy. Methods take the generalized velocity and acceleration, in the order of the module documentation.
#[derive(Clone, Debug)]
pub struct Dynamics<'a> {
    description: &'a RobotDescription,
    /// Links in topological order, parents first.
    order: Vec<LinkId>,
    /// Parent of each link; `None` for the root.
    parent: Vec<Option<LinkId>>,
    world_from_link: Vec<Pose>,
    /// Inertia of each link, in world axes about `origin`.
    inertia: Vec<SpatialInertia>,
    dofs: Vec<Dof>,
    /// Range of `dofs` that moves each link relative to its parent.
    link_dofs: Vec<Range<usize>>,
    /// Range of generalized velocities of each joint.
    joint_dofs: Vec<Range<usize>>,
    /// Reference point of all spatial quantities in the world \[m\]: the origin of the root. A robot far from the world
    /// origin then loses no precision. The point is fixed in the world and does not move with the root.
    origin: Vector3<f64>,
}

/// One degree of freedom.
#[derive(Clone, Copy, Debug)]
struct Dof {
    /// Index of its generalized velocity.
    dof_index: usize,
    axis: SpatialMotion,
    /// True if the axis is fixed in the parent, false if it is fixed in the child. For a joint with one degree of
    /// freedom both give the same result.
    fixed_in_parent: bool,
}

impl<'a> Dynamics<'a> {
    /// Computes link poses and joint axes of the robot at `configuration`, which stays fixed for this value.
    ///
    /// # Errors
    ///
    /// The description is not a tree, or the configuration has the wrong length or numbers that are not finite.
    pub fn new(description: &'a RobotDescription, configuration: &Configuration) -> Result<Self, DynamicsError> {
        let positions = configuration.resolved_positions(description)?;
        let free_count = description.joints.iter().filter(|j| has_multiple_dofs(j.kind)).count();
        check_length("free_joint_poses", free_count, configuration.free_joint_poses.len())?;
        if !positions.iter().all(|q| q.is_finite()) {
            return Err(DynamicsError::NotFinite { what: "joint_positions" });
        }
        if !is_finite(&configuration.root_pose) {
            return Err(DynamicsError::NotFinite { what: "root_pose" });
        }
        if !configuration.free_joint_poses.iter().all(is_finite) {
            return Err(DynamicsError::NotFinite { what: "free_joint_poses" });
        }

        let (order, parent) = parents_first(description)?;
        let n = description.links.len();
        let mut this = Self {
            description,
            order,
            parent,
            world_from_link: vec![Pose::identity(); n],
            inertia: vec![SpatialInertia::zero(); n],
            dofs: Vec::new(),
            link_dofs: vec![0..0; n],
            joint_dofs: joint_columns(description, configuration.floating_base),
            origin: configuration.root_pose.translation.vector,
        };
        this.place_links(configuration, &positions);
        for (i, link) in description.links.iter().enumerate() {
            if let Some(inertial) = &link.inertial {
                let world_from_link = &this.world_from_link[i];
                let origin_from_link = Pose::from_parts(
                    Translation3::from(world_from_link.translation.vector - this.origin),
                    world_from_link.rotation,
                );
                this.inertia[i] =
                    SpatialInertia::new(&RigidInertia::from_inertial(inertial).transformed(&origin_from_link));
            }
        }
        Ok(this)
    }

    fn place_links(&mut self, configuration: &Configuration, positions: &[f64]) {
        let root = self.description.root.0;
        self.world_from_link[root] = configuration.root_pose;
        if configuration.floating_base {
            self.push_free_dofs(0, &UnitQuaternion::identity(), &configuration.root_pose);
            self.link_dofs[root] = 0..6;
        }
        let mut position_of = vec![0.0; self.description.joints.len()];
        for ((id, _), q) in self.description.drivable_joints().zip(positions) {
            position_of[id.0] = *q;
        }
        let mut pose_of = vec![None; self.description.joints.len()];
        let free = (0..pose_of.len()).filter(|&i| has_multiple_dofs(self.description.joints[i].kind));
        for (i, pose) in free.zip(&configuration.free_joint_poses) {
            pose_of[i] = Some(*pose);
        }

        for k in 0..self.order.len() {
            let child = self.order[k];
            let (Some(parent), Some(id)) = (self.parent[child.0], self.description.link(child).parent_joint) else {
                continue;
            };
            let joint = self.description.joint(id);
            let world_from_joint = self.world_from_link[parent.0] * joint.parent_from_joint;
            let joint_from_child = match joint.kind {
                JointKind::Revolute | JointKind::Continuous => Pose::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_axis_angle(&joint.axis, position_of[id.0]),
                ),
                JointKind::Prismatic => Pose::translation(
                    joint.axis.x * position_of[id.0],
                    joint.axis.y * position_of[id.0],
                    joint.axis.z * position_of[id.0],
                ),
                JointKind::Fixed => Pose::identity(),
                JointKind::Floating | JointKind::Planar => pose_of[id.0].unwrap_or_else(Pose::identity),
            };
            let mut world_from_child = world_from_joint * joint_from_child;
            // Without this, rounding errors would add up along very long chains.
            world_from_child.rotation.renormalize();
            self.world_from_link[child.0] = world_from_child;

            let first = self.dofs.len();
            let column = self.joint_dofs[id.0].start;
            let axis = world_from_joint.rotation * joint.axis.into_inner();
            let through_child = SpatialMotion::rotation(axis, world_from_child.translation.vector - self.origin);
            let mut push = |offset: usize, axis: SpatialMotion, fixed_in_parent: bool| {
                self.dofs.push(Dof { dof_index: column + offset, axis, fixed_in_parent });
            };
            match joint.kind {
                JointKind::Fixed => {}
                JointKind::Revolute | JointKind::Continuous => push(0, through_child, false),
                JointKind::Prismatic => push(0, SpatialMotion::translation(axis), false),
                JointKind::Planar => {
                    let [x, y] = planar_axes(&joint.axis);
                    push(0, SpatialMotion::translation(world_from_joint.rotation * x.into_inner()), true);
                    push(1, SpatialMotion::translation(world_from_joint.rotation * y.into_inner()), true);
                    push(2, through_child, false);
                }
                JointKind::Floating => self.push_free_dofs(column, &world_from_joint.rotation, &world_from_child),
            }
            self.link_dofs[child.0] = first..self.dofs.len();
        }
    }

    /// Adds six degrees of freedom: translations in the axes of the parent, rotations in the axes of the child.
    fn push_free_dofs(&mut self, column: usize, world_from_parent: &UnitQuaternion<f64>, world_from_child: &Pose) {
        let point = world_from_child.translation.vector - self.origin;
        for (k, e) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
            let axis = SpatialMotion::translation(world_from_parent * e);
            self.dofs.push(Dof { dof_index: column + k, axis, fixed_in_parent: true });
        }
        for (k, e) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
            let axis = SpatialMotion::rotation(world_from_child.rotation * e, point);
            self.dofs.push(Dof { dof_index: column + 3 + k, axis, fixed_in_parent: false });
        }
    }

    /// Number of generalized velocities, the six of a floating base included.
    pub fn dof_count(&self) -> usize {
        self.dofs.len()
    }

    /// Range of generalized velocities of a joint; empty for a fixed joint.
    ///
    /// # Panics
    ///
    /// If there is no such joint.
    pub fn dof_range(&self, joint: JointId) -> Range<usize> {
        self.joint_dofs[joint.0].clone()
    }

    /// Pose `world_from_link` of every link, indexed by [`LinkId`].
    pub fn link_poses(&self) -> &[Pose] {
        &self.world_from_link
    }

    /// Pose `world_from_link` of a link. Panics if there is no such link.
    pub fn link_pose(&self, link: LinkId) -> Pose {
        self.world_from_link[link.0]
    }

    /// Sum of the link masses \[kg\]. Links without mass properties count as 0.
    pub fn total_mass(&self) -> f64 {
        self.description.total_mass()
    }

    /// Center of mass of the robot in the world \[m\]; `None` if the robot has no mass.
    pub fn center_of_mass(&self) -> Option<Vector3<f64>> {
        let whole = self.total_inertia();
        (whole.mass != 0.0).then(|| self.origin + whole.first_moment / whole.mass)
    }

    /// Potential energy \[J\] under `gravity` \[m/s²\] (z = -9.81 on earth), zero at the origin of the world.
    pub fn potential_energy(&self, gravity: &Vector3<f64>) -> f64 {
        let whole = self.total_inertia();
        -gravity.dot(&(whole.first_moment + self.origin * whole.mass))
    }

    /// Kinetic energy \[J\] of the links at the generalized velocity `velocity`.
    ///
    /// # Panics
    ///
    /// If `velocity` is not [`dof_count`](Self::dof_count) long.
    #[track_caller]
    pub fn kinetic_energy(&self, velocity: &DVector<f64>) -> f64 {
        let velocities = self.spatial_velocities(velocity);
        velocities.iter().zip(&self.inertia).map(|(v, i)| 0.5 * v.dot(&(*i * *v))).sum()
    }

    /// Velocity of every link at the generalized velocity `velocity`, indexed by [`LinkId`].
    ///
    /// # Panics
    ///
    /// If `velocity` is not [`dof_count`](Self::dof_count) long.
    #[track_caller]
    pub fn link_velocities(&self, velocity: &DVector<f64>) -> Vec<LinkVelocity> {
        let at_link = |(v, pose): (&SpatialMotion, &Pose)| LinkVelocity {
            linear: v.at(&(pose.translation.vector - self.origin)),
            angular: v.angular,
        };
        self.spatial_velocities(velocity).iter().zip(&self.world_from_link).map(at_link).collect()
    }

    /// Momentum of the robot at the generalized velocity `velocity`.
    ///
    /// # Panics
    ///
    /// If `velocity` is not [`dof_count`](Self::dof_count) long.
    #[track_caller]
    pub fn momentum(&self, velocity: &DVector<f64>) -> Momentum {
        let velocities = self.spatial_velocities(velocity);
        let mut sum = SpatialForce::zero();
        for (v, i) in velocities.iter().zip(&self.inertia) {
            sum += *i * *v;
        }
        let com = self.center_of_mass().map_or_else(Vector3::zeros, |c| c - self.origin);
        Momentum { linear: sum.force, angular: sum.moment - com.cross(&sum.force) }
    }

    /// Mass matrix M, shape \[dof_count, dof_count\], symmetric, without rotor inertia (armature). The module
    /// documentation gives the order of rows and columns.
    ///
    /// Source: composite-rigid-body algorithm, Featherstone 2008, table 6.2.
    pub fn mass_matrix(&self) -> DMatrix<f64> {
        let mut composite = self.inertia.clone();
        for &link in self.order.iter().rev() {
            if let Some(parent) = self.parent[link.0] {
                let of_link = composite[link.0];
                composite[parent.0] += of_link;
            }
        }
        let mut m = DMatrix::zeros(self.dof_count(), self.dof_count());
        for &link in &self.order {
            for dof in &self.dofs[self.link_dofs[link.0].clone()] {
                let force = composite[link.0] * dof.axis;
                let mut carrier = Some(link);
                while let Some(at) = carrier {
                    for other in &self.dofs[self.link_dofs[at.0].clone()] {
                        let value = other.axis.dot(&force);
                        m[(dof.dof_index, other.dof_index)] = value;
                        m[(other.dof_index, dof.dof_index)] = value;
                    }
                    carrier = self.parent[at.0];
                }
            }
        }
        m
    }

    /// Generalized force g(q) \[N m or N\], one number for each degree of freedom, that holds the robot still under
    /// `gravity`, in world axes \[m/s²\] (z = -9.81 on earth): the gradient of
    /// [`potential_energy`](Self::potential_energy). Gravity itself exerts the negative of it.
    pub fn gravity_torque(&self, gravity: &Vector3<f64>) -> DVector<f64> {
        let zero = DVector::zeros(self.dof_count());
        self.inverse_dynamics(&zero, &zero, gravity)
    }

    /// Bias force c(q, v) + g(q): the generalized force at zero acceleration (`qfrc_bias` of MuJoCo), under `gravity`
    /// in world axes \[m/s²\] (z = -9.81 on earth).
    ///
    /// # Panics
    ///
    /// If `velocity` is not [`dof_count`](Self::dof_count) long.
    #[track_caller]
    pub fn bias_force(&self, velocity: &DVector<f64>, gravity: &Vector3<f64>) -> DVector<f64> {
        self.inverse_dynamics(velocity, &DVector::zeros(self.dof_count()), gravity)
    }

    /// Inverse dynamics `tau = M a + c + g`: the generalized force that produces `acceleration`, the rate of change of
    /// `velocity`, under `gravity` in world axes \[m/s²\] (z = -9.81 on earth).
    ///
    /// Source: recursive Newton-Euler algorithm, Featherstone 2008, table 5.1, in world axes (section 5.3's transforms
    /// become identities). An axis S that is fixed in a body of velocity v changes at the rate v × S.
    ///
    /// # Panics
    ///
    /// If `velocity` or `acceleration` is not [`dof_count`](Self::dof_count) long.
    #[track_caller]
    pub fn inverse_dynamics(
        &self,
        velocity: &DVector<f64>,
        acceleration: &DVector<f64>,
        gravity: &Vector3<f64>,
    ) -> DVector<f64> {
        assert_eq!(acceleration.len(), self.dof_count(), "one acceleration per degree of freedom");
        let velocities = self.spatial_velocities(velocity);
        // Gravity enters as an upward acceleration of the ground.
        let ground = SpatialMotion { angular: Vector3::zeros(), linear: -gravity };
        let mut accelerations = vec![ground; self.order.len()];
        let mut forces = vec![SpatialForce::zero(); self.order.len()];
        for &link in &self.order {
            let parent = self.parent[link.0];
            let mut a = parent.map_or(ground, |p| accelerations[p.0]);
            for dof in &self.dofs[self.link_dofs[link.0].clone()] {
                let carrier = if dof.fixed_in_parent {
                    parent.map_or_else(SpatialMotion::zero, |p| velocities[p.0])
                } else {
                    velocities[link.0]
                };
                a += dof.axis * acceleration[dof.dof_index] + carrier.cross(&dof.axis) * velocity[dof.dof_index];
            }
            accelerations[link.0] = a;
            let (inertia, v) = (self.inertia[link.0], velocities[link.0]);
            forces[link.0] = inertia * a + v.cross_force(&(inertia * v));
        }
        let mut tau = DVector::zeros(self.dof_count());
        for &link in self.order.iter().rev() {
            let force = forces[link.0];
            for dof in &self.dofs[self.link_dofs[link.0].clone()] {
                tau[dof.dof_index] = dof.axis.dot(&force);
            }
            if let Some(parent) = self.parent[link.0] {
                forces[parent.0] += force;
            }
        }
        tau
    }

    #[track_caller]
    fn spatial_velocities(&self, velocity: &DVector<f64>) -> Vec<SpatialMotion> {
        assert_eq!(velocity.len(), self.dof_count(), "one velocity per degree of freedom");
        let mut velocities = vec![SpatialMotion::zero(); self.order.len()];
        for &link in &self.order {
            let mut v = self.parent[link.0].map_or_else(SpatialMotion::zero, |p| velocities[p.0]);
            for dof in &self.dofs[self.link_dofs[link.0].clone()] {
                v += dof.axis * velocity[dof.dof_index];
            }
            velocities[link.0] = v;
        }
        velocities
    }

    fn total_inertia(&self) -> SpatialInertia {
        let mut sum = SpatialInertia::zero();
        for i in &self.inertia {
            sum += *i;
        }
        sum
    }
}

fn is_finite(pose: &Pose) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|x| x.is_finite())
}

fn joint_columns(description: &RobotDescription, floating_base: bool) -> Vec<Range<usize>> {
    let mut columns = vec![0..0; description.joints.len()];
    let mut next = if floating_base { 6 } else { 0 };
    for one_dof in [true, false] {
        for (joint, range) in description.joints.iter().zip(&mut columns) {
            if joint.kind.is_drivable() == one_dof {
                let count = match joint.kind {
                    JointKind::Fixed => 0,
                    JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => 1,
                    JointKind::Planar => 3,
                    JointKind::Floating => 6,
                };
                *range = next..next + count;
                next += count;
            }
        }
    }
    columns
}

/// Orders the links so that parents come first, and finds the parent of each link.
fn parents_first(description: &RobotDescription) -> Result<(Vec<LinkId>, Vec<Option<LinkId>>), DynamicsError> {
    let n = description.links.len();
    let not_a_tree = |link: usize| DynamicsError::NotATree {
        link: description.links.get(link).map_or_else(|| format!("#{link}"), |l| l.name.clone()),
    };
    let mut parent = vec![None; n];
    let mut reached = vec![false; n];
    let root = description.root;
    *reached.get_mut(root.0).ok_or_else(|| not_a_tree(root.0))? = true;
    if description.link(root).parent_joint.is_some() {
        return Err(not_a_tree(root.0));
    }
    let mut order = vec![root];
    let mut next = 0;
    while let Some(&link) = order.get(next) {
        next += 1;
        for &id in &description.link(link).child_joints {
            let joint = description.joints.get(id.0).ok_or_else(|| not_a_tree(link.0))?;
            let child = joint.child;
            let fits =
                joint.parent == link && description.links.get(child.0).is_some_and(|l| l.parent_joint == Some(id));
            if !fits || std::mem::replace(&mut reached[child.0], true) {
                return Err(not_a_tree(child.0));
            }
            parent[child.0] = Some(link);
            order.push(child);
        }
    }
    match reached.iter().position(|r| !r) {
        Some(link) => Err(not_a_tree(link)),
        None => Ok((order, parent)),
    }
}
