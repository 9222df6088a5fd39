//! Tests of the dynamics against independent references: closed forms, and d'Alembert's principle on finite differences
//! of link poses.

use super::*;
use crate::description::{Inertial, Joint, Link, Mimic};
use kinetoscope_scene::pose::from_xyz_rpy;
use kinetoscope_scene::source_location::SourceLocation;
use kinetoscope_testkit::tolerance::{Tolerance, assert_vector};
use nalgebra::{Matrix3, Unit};
use std::f64::consts::FRAC_PI_2;

const EARTH: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const NO_GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// Random numbers, vectors and poses from one seed.
struct Random(kinetoscope_scene::KeyedRng);

impl Random {
    fn new(seed: u64) -> Self {
        Self(kinetoscope_scene::KeyedRng::keyed(seed, 0, "robots"))
    }

    fn range(&mut self, low: f64, high: f64) -> f64 {
        self.0.uniform_range(low, high)
    }

    fn below(&mut self, n: usize) -> usize {
        self.range(0.0, n as f64) as usize
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.range(-1.0, 1.0))
    }

    fn velocities(&mut self, n: usize) -> DVector<f64> {
        DVector::from_fn(n, |_, _| self.range(-2.0, 2.0))
    }

    fn pose(&mut self) -> Pose {
        Pose::from_parts(Translation3::from(self.vector()), UnitQuaternion::from_scaled_axis(self.vector() * 2.0))
    }
}

type V3 = Vector3<f64>;

struct Builder(RobotDescription);

impl Builder {
    fn new(inertial: Option<Inertial>) -> Self {
        let links = vec![link("root".to_owned(), inertial, None)];
        Self(RobotDescription { name: "test".to_owned(), links, joints: Vec::new(), root: LinkId(0) })
    }

    fn add(
        &mut self,
        parent: LinkId,
        kind: JointKind,
        axis: V3,
        parent_from_joint: Pose,
        inertial: Option<Inertial>,
    ) -> LinkId {
        let (joint, child) = (JointId(self.0.joints.len()), LinkId(self.0.links.len()));
        self.0.joints.push(Joint {
            name: format!("joint{}", joint.0),
            source: source(),
            kind,
            parent,
            child,
            parent_from_joint,
            axis: Unit::new_normalize(axis),
            limit: None,
            damping: None,
            friction: None,
            mimic: None,
            defaults: None,
        });
        self.0.links[parent.0].child_joints.push(joint);
        self.0.links.push(link(format!("link{}", child.0), inertial, Some(joint)));
        child
    }
}

fn source() -> SourceLocation {
    SourceLocation::new("test.urdf", 1)
}

fn link(name: String, inertial: Option<Inertial>, parent_joint: Option<JointId>) -> Link {
    Link {
        name,
        source: source(),
        component: "arm".to_owned(),
        inertial,
        partial_inertial: None,
        visuals: Vec::new(),
        collisions: Vec::new(),
        parent_joint,
        child_joints: Vec::new(),
        is_auxiliary_frame: false,
    }
}

fn inertial(mass: f64, link_from_com: Pose, inertia: Matrix3<f64>) -> Option<Inertial> {
    Some(Inertial { source: source(), link_from_com, mass, inertia })
}

fn point_mass(mass: f64, x: f64, y: f64, z: f64) -> Option<Inertial> {
    inertial(mass, Pose::translation(x, y, z), Matrix3::zeros())
}

fn random_inertial(random: &mut Random) -> Option<Inertial> {
    if random.below(5) == 0 {
        return None;
    }
    let second = random.vector().map(f64::abs);
    let moments = second.map(|s| (second.sum() - s) * 0.2);
    let turn = UnitQuaternion::from_scaled_axis(random.vector()).to_rotation_matrix();
    let inertia = turn.matrix() * Matrix3::from_diagonal(&moments) * turn.matrix().transpose();
    inertial(random.range(0.1, 3.0), random.pose(), inertia)
}

/// Random tree of joints with a random configuration. `free` adds planar and floating joints.
fn random_robot(seed: u64, floating_base: bool, free: bool) -> (RobotDescription, Configuration) {
    let random = &mut Random::new(seed);
    let mut builder = Builder::new(random_inertial(random));
    use JointKind::*;
    let kinds = [Revolute, Prismatic, Continuous, Fixed, Planar, Floating];
    for k in 0..14 {
        // The first joints make sure that every kind occurs.
        let choice = if free { kinds.len() } else { 4 };
        let kind = kinds[if k < choice { k } else { random.below(choice) }];
        // Branches, and joints whose file order differs from the order of the tree.
        let parent = LinkId(builder.0.links.len() - 1 - random.below(3.min(builder.0.links.len())));
        builder.add(parent, kind, random.vector(), random.pose(), random_inertial(random));
    }
    let mut description = builder.0;
    shuffle_joints(&mut description, random);
    let mut configuration = Configuration::zero(&description);
    configuration.floating_base = floating_base;
    configuration.root_pose = random.pose();
    configuration.root_pose.translation.vector *= 50.0;
    // Integrating any velocity gives a valid configuration, planar joints included.
    let reach = random.velocities(dof_count(&description, &configuration));
    (description.clone(), configuration.integrate(&description, &reach, 1.0))
}

fn shuffle_joints(description: &mut RobotDescription, random: &mut Random) {
    for i in (1..description.joints.len()).rev() {
        description.joints.swap(i, random.below(i + 1));
    }
    for link in &mut description.links {
        link.parent_joint = None;
        link.child_joints.clear();
    }
    for (k, joint) in description.joints.iter().enumerate() {
        description.links[joint.child.0].parent_joint = Some(JointId(k));
        description.links[joint.parent.0].child_joints.push(JointId(k));
    }
}

fn dof_count(description: &RobotDescription, configuration: &Configuration) -> usize {
    Dynamics::new(description, configuration).unwrap().dof_count()
}

/// Robots of every combination of base and joint kinds, each with random velocities.
fn random_robots(salt: u64) -> impl Iterator<Item = (RobotDescription, Configuration, DVector<f64>)> {
    (0..24).map(move |seed| {
        let (robot, at) = random_robot(seed, seed % 2 == 1, seed % 4 >= 2);
        let v = Random::new(seed + salt).velocities(dof_count(&robot, &at));
        (robot, at, v)
    })
}

type Body = (Pose, f64, Matrix3<f64>);

/// Pose, mass and tensor of each body, from `link_poses` and the numbers of the file only. The pose has its origin at
/// the center of mass and the axes of the tensor.
fn bodies(description: &RobotDescription, at: &Configuration) -> Vec<Body> {
    let kinematics = Dynamics::new(description, at).unwrap();
    let of = |(link, pose): (&Link, &Pose)| link.inertial.as_ref().map(|i| (pose * i.link_from_com, i.mass, i.inertia));
    description.links.iter().zip(kinematics.link_poses()).filter_map(of).collect()
}

/// Rotation vector from `a` to `b`, in world axes.
fn turn(a: &Pose, b: &Pose) -> Vector3<f64> {
    (b.rotation * a.rotation.inverse()).scaled_axis()
}

/// Linear velocity of each center of mass and angular velocity, by central differences of poses.
fn body_velocities(
    description: &RobotDescription,
    at: &Configuration,
    velocity: &DVector<f64>,
) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    const H: f64 = 1e-5;
    let before = bodies(description, &at.integrate(description, velocity, -H));
    let after = bodies(description, &at.integrate(description, velocity, H));
    let difference = |((a, ..), (b, ..)): (&Body, &Body)| {
        ((b.translation.vector - a.translation.vector) / (2.0 * H), turn(a, b) / (2.0 * H))
    };
    before.iter().zip(&after).map(difference).collect()
}

fn unit(n: usize, k: usize) -> DVector<f64> {
    DVector::from_fn(n, |i, _| f64::from(u8::from(i == k)))
}

fn world_inertia((pose, _, inertia): &Body) -> Matrix3<f64> {
    let r = pose.rotation.to_rotation_matrix();
    r.matrix() * inertia * r.matrix().transpose()
}

/// d'Alembert: `tau_j = Σ (m (a - g) · ∂v/∂v_j + dL/dt · ∂ω/∂v_j)`, everything by finite differences of poses.
fn dalembert(
    description: &RobotDescription,
    at: &Configuration,
    velocity: &DVector<f64>,
    acceleration: &DVector<f64>,
    gravity: &Vector3<f64>,
) -> DVector<f64> {
    const H: f64 = 2e-4;
    let n = velocity.len();
    let moved = |sign: f64| {
        let mean = velocity + acceleration * (0.5 * sign * H);
        bodies(description, &at.integrate(description, &mean, sign * H))
    };
    let (before, now, after) = (moved(-1.0), bodies(description, at), moved(1.0));
    let mut loads = Vec::new();
    for ((a, b), c) in before.iter().zip(&now).zip(&after) {
        let linear = (c.0.translation.vector - 2.0 * b.0.translation.vector + a.0.translation.vector) / (H * H);
        let momentum = |from: &Pose, to: &Pose| {
            let turn = turn(from, to);
            let middle =
                Pose::from_parts(b.0.translation, UnitQuaternion::from_scaled_axis(turn * 0.5) * from.rotation);
            world_inertia(&(middle, b.1, b.2)) * turn / H
        };
        let moment = (momentum(&b.0, &c.0) - momentum(&a.0, &b.0)) / H;
        loads.push(((linear - gravity) * b.1, moment));
    }
    DVector::from_fn(n, |j, _| {
        let partial = body_velocities(description, at, &unit(n, j));
        loads.iter().zip(&partial).map(|((f, m), (v, w))| f.dot(v) + m.dot(w)).sum()
    })
}

/// Planar arm of two links that rotate about y, in the x-z plane. Angle 0 is along x, positive angles turn x to -z.
fn two_links(m: [f64; 2], l: f64, c: [f64; 2], i: [f64; 2]) -> RobotDescription {
    let about_y = |i| Matrix3::from_diagonal(&Vector3::new(0.0, i, 0.0));
    let mut b = Builder::new(None);
    let first = inertial(m[0], Pose::translation(c[0], 0.0, 0.0), about_y(i[0]));
    let second = inertial(m[1], Pose::translation(c[1], 0.0, 0.0), about_y(i[1]));
    let upper = b.add(LinkId(0), JointKind::Revolute, Vector3::y(), Pose::identity(), first);
    b.add(upper, JointKind::Continuous, Vector3::y(), Pose::translation(l, 0.0, 0.0), second);
    b.0
}

/// Source: Siciliano, Sciavicco, Villani, Oriolo, "Robotics", 2009, section 7.3.2 (two-link planar arm).
#[test]
fn two_link_arm() {
    let (m, l, c, i) = ([2.0, 1.5], 0.7, [0.3, 0.25], [0.05, 0.03]);
    let arm = two_links(m, l, c, i);
    for (q1, q2, v1, v2) in [(0.0, 0.0, 1.0, 1.0), (0.4, -1.1, 0.7, 2.0), (-2.0, FRAC_PI_2, -1.5, 0.3)] {
        let at = Configuration { joint_positions: vec![q1, q2], ..Configuration::zero(&arm) };
        let k = Dynamics::new(&arm, &at).unwrap();
        let m22 = m[1] * c[1] * c[1] + i[1];
        let m12 = m22 + m[1] * l * c[1] * f64::cos(q2);
        let m11 = m[0] * c[0] * c[0] + i[0] + m22 + m[1] * (l * l + 2.0 * l * c[1] * f64::cos(q2));
        let expected = DMatrix::from_row_slice(2, 2, &[m11, m12, m12, m22]);
        assert!((k.mass_matrix() - expected).amax() < 1e-14);
        // Height of a point at angle q is -x sin q: V decreases with q.
        let g2 = -9.81 * m[1] * c[1] * f64::cos(q1 + q2);
        let g1 = -9.81 * (m[0] * c[0] + m[1] * l) * f64::cos(q1) + g2;
        let limit = Tolerance::mixed(1e-14, "a dozen operations");
        assert_vector("gravity torque", &k.gravity_torque(&EARTH), &DVector::from_row_slice(&[g1, g2]), limit);
        let h = -m[1] * l * c[1] * f64::sin(q2);
        let coriolis = DVector::from_row_slice(&[h * v2 * (2.0 * v1 + v2), -h * v1 * v1]);
        let limit = Tolerance::mixed(1e-14, "a dozen operations");
        assert_vector(
            "Coriolis terms",
            &k.bias_force(&DVector::from_row_slice(&[v1, v2]), &NO_GRAVITY),
            &coriolis,
            limit,
        );
    }
}

#[test]
fn pendulum() {
    let mut b = Builder::new(point_mass(5.0, 0.0, 0.0, 0.0));
    let (joint, bob) = (Pose::translation(0.0, 0.0, 1.0), point_mass(2.0, 0.0, 0.0, -0.5));
    b.add(LinkId(0), JointKind::Continuous, Vector3::y(), joint, bob);
    for q in [-1.0, 0.0, 0.3, 3.0] {
        let at = Configuration { joint_positions: vec![q], ..Configuration::zero(&b.0) };
        let k = Dynamics::new(&b.0, &at).unwrap();
        assert!((k.gravity_torque(&EARTH)[0] - 2.0 * 9.81 * 0.5 * f64::sin(q)).abs() < 1e-14);
        assert!((k.mass_matrix()[(0, 0)] - 2.0 * 0.25).abs() < 1e-15);
        let height = 2.0 * (1.0 - 0.5 * f64::cos(q));
        assert!((k.potential_energy(&EARTH) - 9.81 * height).abs() < 1e-13);
    }
}

#[test]
fn lift() {
    let mut b = Builder::new(None);
    let cart = b.add(LinkId(0), JointKind::Prismatic, Vector3::z(), Pose::identity(), point_mass(3.0, 0.1, 0.0, 0.0));
    let tilted = from_xyz_rpy([0.0, 0.0, 0.2], [0.0, FRAC_PI_2, 0.0]);
    b.add(cart, JointKind::Prismatic, Vector3::z(), tilted, point_mass(1.0, 0.0, 0.0, 0.0));
    let at = Configuration { joint_positions: vec![0.5, 0.25], ..Configuration::zero(&b.0) };
    let k = Dynamics::new(&b.0, &at).unwrap();
    let limit = Tolerance::mixed(1e-15, "a handful of operations");
    assert_vector("gravity torque", &k.gravity_torque(&EARTH), &DVector::from_row_slice(&[4.0 * 9.81, 0.0]), limit);
    let expected = DMatrix::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 1.0]);
    assert!((k.mass_matrix() - expected).amax() < 1e-15);
    assert!((k.link_pose(LinkId(2)).translation.vector - Vector3::new(0.25, 0.0, 0.7)).amax() < 1e-15);
}

#[test]
fn gravity() {
    const H: f64 = 1e-5;
    for (robot, at, _) in random_robots(0) {
        let k = Dynamics::new(&robot, &at).unwrap();
        let gravity = Vector3::new(1.0, -2.0, -9.81);
        // From the poses and the file's masses alone, relative to the root, so that 50 m do not cost digits.
        let energy = |at: &Configuration| -> f64 {
            let origin = k.link_pose(robot.root).translation.vector;
            bodies(&robot, at).iter().map(|(p, m, _)| -m * gravity.dot(&(p.translation.vector - origin))).sum()
        };
        let n = k.dof_count();
        let gradient = DVector::from_fn(n, |j, _| {
            let unit = unit(n, j);
            (energy(&at.integrate(&robot, &unit, H)) - energy(&at.integrate(&robot, &unit, -H))) / (2.0 * H)
        });
        let limit = Tolerance::mixed(
            1e-7,
            "differences of energies: 1e-16 / h, and h² of third derivatives; measured, not derived",
        );
        assert_vector("gradient of the energy", &k.gravity_torque(&gravity), &gradient, limit);
    }
}

#[test]
fn mass_matrix() {
    for (robot, at, v) in random_robots(100) {
        let k = Dynamics::new(&robot, &at).unwrap();
        let (n, m) = (k.dof_count(), k.mass_matrix());
        assert_eq!(m, m.transpose());
        // Columns by the Newton-Euler algorithm.
        for j in 0..n {
            let column = k.inverse_dynamics(&DVector::zeros(n), &unit(n, j), &NO_GRAVITY);
            let limit = Tolerance::mixed(1e-13, "rounding of recursive Newton-Euler against sums of inertias");
            assert_vector("column of the mass matrix", &column, m.column(j), limit);
        }
        let energy: f64 = bodies(&robot, &at)
            .iter()
            .zip(body_velocities(&robot, &at, &v))
            .map(|(b, (linear, w))| 0.5 * b.1 * linear.norm_squared() + 0.5 * w.dot(&(world_inertia(b) * w)))
            .sum();
        let from_matrix = 0.5 * (v.transpose() * &m * &v)[0];
        assert!((from_matrix - energy).abs() < 1e-7 * energy, "{from_matrix} {energy}");
        assert!((k.kinetic_energy(&v) - from_matrix).abs() < 1e-12 * energy);
        assert!(m.symmetric_eigenvalues().min() > -1e-10 * m.amax(), "semidefinite: massless tips are allowed");
    }
}

#[test]
fn inverse_dynamics() {
    for (seed, (robot, at, v)) in random_robots(200).enumerate() {
        let k = Dynamics::new(&robot, &at).unwrap();
        let a = Random::new(seed as u64 + 700).velocities(v.len());
        let expected = dalembert(&robot, &at, &v, &a, &EARTH);
        let limit = Tolerance::mixed(
            2e-6,
            "second differences of poses: 1e-16 / h², and h² of fourth derivatives; measured, not derived",
        );
        assert_vector("d'Alembert", &k.inverse_dynamics(&v, &a, &EARTH), &expected, limit);
        // Control: without the velocity terms the two must disagree.
        let without = k.inverse_dynamics(&DVector::zeros(v.len()), &a, &EARTH);
        assert!((without - &expected).amax() > 1e-3 * expected.amax());
    }
}

/// Euler-Lagrange: `c_i = Σ_jk (∂M_ij/∂q_k - ∂M_jk/∂q_i / 2) v_j v_k`; and `M' - 2 C` is skew with this C.
#[test]
fn velocity_terms() {
    const H: f64 = 1e-5;
    for seed in 0..8 {
        let (robot, at) = random_robot(2 * seed, false, false);
        let k = Dynamics::new(&robot, &at).unwrap();
        let n = k.dof_count();
        let mass = |at: &Configuration| Dynamics::new(&robot, at).unwrap().mass_matrix();
        let derivative: Vec<DMatrix<f64>> = (0..n)
            .map(|j| {
                let unit = unit(n, j);
                (mass(&at.integrate(&robot, &unit, H)) - mass(&at.integrate(&robot, &unit, -H))) / (2.0 * H)
            })
            .collect();
        let v = Random::new(seed + 300).velocities(n);
        let c = DMatrix::from_fn(n, n, |i, j| {
            (0..n).map(|l| 0.5 * (derivative[l][(i, j)] + derivative[j][(i, l)] - derivative[i][(j, l)]) * v[l]).sum()
        });
        let limit = Tolerance::mixed(1e-6, "differences of mass matrices: 1e-16 / h, and h²; measured, not derived");
        assert_vector("Christoffel symbols", &k.bias_force(&v, &NO_GRAVITY), &(&c * &v), limit);
        let rate = (0..n).fold(DMatrix::zeros(n, n), |sum, l| sum + &derivative[l] * v[l]);
        let skew = rate - &c * 2.0;
        assert!((&skew + skew.transpose()).amax() < 1e-9 * c.amax());
    }
}

#[test]
fn energy_balance() {
    const H: f64 = 1e-5;
    for (robot, at, v) in random_robots(400) {
        let k = Dynamics::new(&robot, &at).unwrap();
        let energy = |t: f64| Dynamics::new(&robot, &at.integrate(&robot, &v, t)).unwrap().kinetic_energy(&v);
        let power = v.dot(&k.bias_force(&v, &NO_GRAVITY));
        let rate = (energy(H) - energy(-H)) / (2.0 * H);
        assert!((power - rate).abs() < 1e-6 * (1.0 + rate.abs()), "{power} {rate}");
    }
}

#[test]
fn floating_base() {
    const H: f64 = 1e-5;
    for seed in [1, 3, 5, 7] {
        let (robot, at) = random_robot(seed, true, seed > 3);
        let k = Dynamics::new(&robot, &at).unwrap();
        let m = k.mass_matrix();
        let total = robot.total_mass();
        assert!((m.view((0, 0), (3, 3)).into_owned() - DMatrix::identity(3, 3) * total).amax() < 1e-13 * total);

        let v = Random::new(seed + 500).velocities(k.dof_count());
        let momentum = k.momentum(&v);
        let com = |t: f64| {
            let moved = Dynamics::new(&robot, &at.integrate(&robot, &v, t)).unwrap();
            moved.center_of_mass().unwrap()
        };
        assert!((momentum.linear - (com(H) - com(-H)) * (total / (2.0 * H))).amax() < 1e-6 * momentum.linear.amax());
        assert!(((&m * &v).rows(0, 3) - momentum.linear).amax() < 1e-12 * momentum.linear.amax());
        let spin: Vector3<f64> = bodies(&robot, &at)
            .iter()
            .zip(body_velocities(&robot, &at, &v))
            .map(|(b, (linear, w))| (b.0.translation.vector - com(0.0)).cross(&(linear * b.1)) + world_inertia(b) * w)
            .sum();
        assert!((momentum.angular - spin).amax() < 1e-6 * spin.amax());

        // Held in the air, the base carries the weight.
        let hold = k.gravity_torque(&EARTH);
        assert!((hold.rows(0, 3) + EARTH * total).amax() < 1e-12 * total);
        // Free fall needs no effort: the whole robot accelerates with gravity.
        let mut fall = DVector::zeros(k.dof_count());
        fall.rows_mut(0, 3).copy_from(&EARTH);
        assert!(k.inverse_dynamics(&DVector::zeros(k.dof_count()), &fall, &EARTH).amax() < 1e-12 * total * 9.81);
    }
}

#[test]
fn link_velocities() {
    const H: f64 = 1e-5;
    for (robot, at, v) in random_robots(600) {
        let k = Dynamics::new(&robot, &at).unwrap();
        let poses = |t: f64| Dynamics::new(&robot, &at.integrate(&robot, &v, t)).unwrap().link_poses().to_vec();
        let (before, after) = (poses(-H), poses(H));
        for ((a, b), found) in before.iter().zip(&after).zip(k.link_velocities(&v)) {
            let linear = (b.translation.vector - a.translation.vector) / (2.0 * H);
            assert!((found.linear - linear).amax() < 1e-7 * (1.0 + linear.amax()));
            assert!((found.angular - turn(a, b) / (2.0 * H)).amax() < 1e-7);
        }
    }
}

#[test]
fn fixed_joints() {
    let turn = from_xyz_rpy([0.4, -0.1, 0.2], [0.3, 0.5, -0.7]);
    let random = &mut Random::new(9);
    let (a, b) = loop {
        if let (Some(a), Some(b)) = (random_inertial(random), random_inertial(random)) {
            break (a, b);
        }
    };
    let whole = RigidInertia::from_inertial(&a).combine(&RigidInertia::from_inertial(&b).transformed(&turn));

    let mut apart = Builder::new(None);
    let arm = apart.add(LinkId(0), JointKind::Floating, Vector3::x(), Pose::identity(), Some(a));
    let arm = apart.add(arm, JointKind::Fixed, Vector3::x(), turn, Some(b));
    apart.add(arm, JointKind::Fixed, Vector3::x(), turn, None);
    let mut fused = Builder::new(None);
    let com = Pose::from_parts(Translation3::from(whole.com), UnitQuaternion::identity());
    fused.add(LinkId(0), JointKind::Floating, Vector3::x(), Pose::identity(), inertial(whole.mass, com, whole.inertia));

    let mut at = Configuration::zero(&apart.0);
    at.free_joint_poses = vec![random.pose()];
    let (apart, fused) = (Dynamics::new(&apart.0, &at).unwrap(), Dynamics::new(&fused.0, &at).unwrap());
    assert!((apart.mass_matrix() - fused.mass_matrix()).amax() < 1e-14);
    let (v, w) = (random.velocities(6), random.velocities(6));
    let limit = Tolerance::mixed(1e-13, "rounding of two orders of the same sums");
    assert_vector("fused", &apart.inverse_dynamics(&v, &w, &EARTH), &fused.inverse_dynamics(&v, &w, &EARTH), limit);
    assert_eq!(apart.dof_count(), 6);
}

#[test]
fn far_away() {
    let (robot, mut at) = random_robot(4, false, false);
    at.root_pose.translation = Translation3::identity();
    let near = Dynamics::new(&robot, &at).unwrap().mass_matrix();
    at.root_pose.translation = Translation3::new(1e6, -1e6, 0.0);
    let far = Dynamics::new(&robot, &at).unwrap().mass_matrix();
    // The remaining difference is the rounding of the poses themselves, 1e6 * 2^-53.
    assert!((near - &far).amax() < 1e-8 * far.amax());
}

#[test]
fn mimic_joints() {
    let mut robot = two_links([1.0, 1.0], 1.0, [0.5, 0.5], [0.1, 0.1]);
    robot.joints[1].mimic = Some(Mimic { source: source(), joint: JointId(0), multiplier: -2.0, offset: 0.1 });
    let mut at = Configuration { joint_positions: vec![0.3, 99.0], ..Configuration::zero(&robot) };
    assert_eq!(at.resolved_positions(&robot).unwrap(), [0.3, -0.5]);
    let follow = Dynamics::new(&robot, &at).unwrap().mass_matrix();
    assert_eq!(follow.nrows(), 2, "a mimic joint is a coordinate");
    at.mimic = MimicPositions::AsGiven;
    at.joint_positions[1] = -0.5;
    assert_eq!(Dynamics::new(&robot, &at).unwrap().mass_matrix(), follow);
    at.joint_positions[1] = 1.5;
    assert_eq!(at.resolved_positions(&robot).unwrap(), [0.3, 1.5]);
}

#[test]
fn columns() {
    let (robot, mut at) = random_robot(2, false, true);
    at.floating_base = true;
    let k = Dynamics::new(&robot, &at).unwrap();
    let mut next = 6;
    for (id, _) in robot.drivable_joints() {
        assert_eq!(k.dof_range(id), next..next + 1);
        next += 1;
    }
    let free: usize = (0..robot.joints.len())
        .filter(|&i| has_multiple_dofs(robot.joints[i].kind))
        .map(|i| k.dof_range(JointId(i)).len())
        .sum();
    assert_eq!(next + free, k.dof_count());
    let mut columns: Vec<_> = k.dofs.iter().map(|d| d.dof_index).collect();
    columns.sort_unstable();
    assert!(columns.into_iter().eq(0..k.dof_count()));
}

#[test]
fn planar_directions() {
    let [x, y] = planar_axes(&Vector3::z_axis());
    assert_eq!((x, y), (Vector3::x_axis(), Vector3::y_axis()));
    for axis in [-Vector3::z(), Vector3::x(), Vector3::new(0.1, -2.0, 0.3), Vector3::new(1e-9, 0.0, -1.0)] {
        let axis = Unit::new_normalize(axis);
        let [x, y] = planar_axes(&axis);
        assert!((x.cross(&y) - axis.into_inner()).amax() < 1e-8, "{axis:?}");
    }
}

#[test]
fn long_chain() {
    const N: usize = 200_000;
    let mut b = Builder::new(None);
    let mut tip = LinkId(0);
    for _ in 0..N {
        let next = Pose::translation(1e-3, 0.0, 0.0);
        tip = b.add(tip, JointKind::Revolute, Vector3::y(), next, point_mass(1e-3, 0.0, 0.0, 0.0));
    }
    let k = Dynamics::new(&b.0, &Configuration::zero(&b.0)).unwrap();
    assert!((k.link_pose(tip).translation.x - 200.0).abs() < 1e-6);
    // Hinges along x every millimeter: the first one holds Σ m g d k for k = 0..N, turning x towards -z.
    let expected = -1e-3 * 9.81 * 1e-3 * (N * (N - 1) / 2) as f64;
    assert!((k.gravity_torque(&EARTH)[0] / expected - 1.0).abs() < 1e-9);
}

#[test]
fn refusals() {
    let arm = two_links([1.0, 1.0], 1.0, [0.5, 0.5], [0.1, 0.1]);
    let zero = Configuration::zero(&arm);
    let wrong = |what, expected, found| DynamicsError::WrongLength { what, expected, found };
    let positions = |joint_positions| Configuration { joint_positions, ..zero.clone() };
    let extra = Configuration { free_joint_poses: vec![Pose::identity()], ..zero.clone() };
    for (at, error) in [
        (positions(vec![0.0]), wrong("joint_positions", 2, 1)),
        (positions(vec![0.0, f64::NAN]), DynamicsError::NotFinite { what: "joint_positions" }),
        (extra, wrong("free_joint_poses", 0, 1)),
    ] {
        assert_eq!(Dynamics::new(&arm, &at).unwrap_err(), error);
    }
    let mut cyclic = arm.clone();
    cyclic.joints[1].parent = LinkId(2);
    assert!(matches!(Dynamics::new(&cyclic, &zero), Err(DynamicsError::NotATree { .. })));
    let mut loose = arm.clone();
    loose.links[1].child_joints.clear();
    assert_eq!(Dynamics::new(&loose, &zero).unwrap_err(), DynamicsError::NotATree { link: "link2".to_owned() });
    let massless = Builder::new(None).0;
    assert_eq!(Dynamics::new(&massless, &Configuration::zero(&massless)).unwrap().center_of_mass(), None);
}
