//! An independent reference implementation: a minimal URDF reader, and the recursive Newton-Euler algorithm in world
//! axes. It shares no code with the product.
//!
//! Outward, for a joint at r from its parent's origin with axis a (world): ω' = ω + a q̇, α' = α + a q̈ + ω x a q̇,
//! p̈' = p̈ + α x r + ω x (ω x r) for a hinge; for a slide ω' = ω, α' = α, p̈' = ... + 2 ω x a q̇ + a q̈. Inward, about
//! each link's origin: f = m p̈_com + Σ f_child, n = I α + ω x I ω + c x m p̈_com + Σ (n_child + r x f_child); the
//! effort is a·n or a·f. Gravity is an acceleration of the base by -g. Source: Luh, Walker, Paul 1980.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Clone, Debug, Default)]
pub(super) struct Body {
    pub(super) mass: f64,
    pub(super) com: Vector3<f64>,
    /// Inertia about the center of mass, in the axes of the link.
    pub(super) inertia: Matrix3<f64>,
}

#[derive(Clone, Debug)]
struct Joint {
    name: String,
    kind: String,
    parent: String,
    child: String,
    parent_from_joint: Isometry3<f64>,
    axis: Vector3<f64>,
}

/// The kinematic tree of a robot's files.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    bodies: BTreeMap<String, Body>,
    joints: Vec<Joint>,
    root: String,
}

/// Motion of a link's frame, in world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) pose: Isometry3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) angular_velocity: Vector3<f64>,
    pub(super) acceleration: Vector3<f64>,
    pub(super) angular_acceleration: Vector3<f64>,
}

impl Motion {
    /// At rest at the origin, under `gravity`.
    pub(super) fn rest(gravity: Vector3<f64>) -> Self {
        let zero = Vector3::zeros();
        Self {
            pose: Isometry3::identity(),
            velocity: zero,
            angular_velocity: zero,
            acceleration: -gravity,
            angular_acceleration: zero,
        }
    }
}

/// Position, velocity and acceleration of each joint by its name; 0 for missing joints.
pub(super) type Joints = BTreeMap<String, [f64; 3]>;

/// The joint states of a robot, in its order.
pub(super) fn joints(names: &[String], q: &[f64], v: &[f64], a: &[f64]) -> Joints {
    (0..names.len()).map(|k| (names[k].clone(), [q[k], v[k], a[k]])).collect()
}

impl Tree {
    pub(super) fn read(path: &Path) -> Self {
        Self::parse(&std::fs::read_to_string(path).unwrap())
    }

    pub(super) fn parse(text: &str) -> Self {
        let document = roxmltree::Document::parse(text).unwrap();
        let child = |node: roxmltree::Node<'_, '_>, tag: &str| {
            node.children().find(|child| child.has_tag_name(tag)).map(|child| child.id())
        };
        let get = |id: Option<roxmltree::NodeId>| id.and_then(|id| document.get_node(id));
        let numbers = |node: Option<roxmltree::Node<'_, '_>>, name: &str| -> Option<Vector3<f64>> {
            let words: Vec<f64> = node?.attribute(name)?.split_whitespace().map(|word| word.parse().unwrap()).collect();
            Some(Vector3::new(words[0], words[1], words[2]))
        };
        let pose = |origin: Option<roxmltree::Node<'_, '_>>| {
            let xyz = numbers(origin, "xyz").unwrap_or_default();
            let rpy = numbers(origin, "rpy").unwrap_or_default();
            // Rotations about the fixed x, then y, then z axis.
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), rpy.z)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), rpy.y)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), rpy.x);
            Isometry3::from_parts(Translation3::from(xyz), UnitQuaternion::from_rotation_matrix(&turn))
        };
        let mut tree = Self::default();
        for node in document.root_element().children().filter(roxmltree::Node::is_element) {
            let name = node.attribute("name").unwrap_or_default().to_string();
            if node.has_tag_name("link") {
                let mut body = Body::default();
                if let Some(inertial) = get(child(node, "inertial")) {
                    let link_from_com = pose(get(child(inertial, "origin")));
                    let number = |tag: &str, name: &str| -> f64 {
                        get(child(inertial, tag)).unwrap().attribute(name).unwrap().parse().unwrap()
                    };
                    let i = |name| number("inertia", name);
                    let (xy, xz, yz) = (i("ixy"), i("ixz"), i("iyz"));
                    let inertia = Matrix3::new(i("ixx"), xy, xz, xy, i("iyy"), yz, xz, yz, i("izz"));
                    let turn = link_from_com.rotation.to_rotation_matrix();
                    body.mass = number("mass", "value");
                    body.com = link_from_com.translation.vector;
                    body.inertia = turn.matrix() * inertia * turn.matrix().transpose();
                }
                tree.bodies.insert(name, body);
            } else if node.has_tag_name("joint") {
                let link = |tag| get(child(node, tag)).unwrap().attribute("link").unwrap().to_string();
                let axis = numbers(get(child(node, "axis")), "xyz").unwrap_or_else(Vector3::x);
                tree.joints.push(Joint {
                    name,
                    kind: node.attribute("type").unwrap().to_string(),
                    parent: link("parent"),
                    child: link("child"),
                    parent_from_joint: pose(get(child(node, "origin"))),
                    axis: axis.normalize(),
                });
            }
        }
        tree.find_root();
        tree
    }

    fn find_root(&mut self) {
        let is_child = |name: &String| self.joints.iter().any(|joint| &joint.child == name);
        self.root = self.bodies.keys().find(|name| !is_child(name)).unwrap().clone();
    }

    /// Adds the tree `other`, fixed to `link` at `link_from_root`. Link names must differ.
    pub(super) fn with(mut self, other: Self, link: &str, link_from_root: Isometry3<f64>) -> Self {
        self.joints.push(Joint {
            name: "mount".into(),
            kind: "fixed".into(),
            parent: link.into(),
            child: other.root.clone(),
            parent_from_joint: link_from_root,
            axis: Vector3::x(),
        });
        self.joints.extend(other.joints);
        self.bodies.extend(other.bodies);
        self
    }

    fn below<'t>(&'t self, link: &'t str) -> impl Iterator<Item = &'t Joint> {
        self.joints.iter().filter(move |joint| joint.parent == link)
    }

    fn outward(joint: &Joint, parent: &Motion, [q, v, a]: [f64; 3]) -> Motion {
        let mut pose = parent.pose * joint.parent_from_joint;
        let axis = pose.rotation * joint.axis;
        let (hinge, slide) = match joint.kind.as_str() {
            "revolute" | "continuous" => (1.0, 0.0),
            "prismatic" => (0.0, 1.0),
            _ => (0.0, 0.0),
        };
        pose.translation.vector += slide * q * axis;
        pose.rotation *= UnitQuaternion::from_axis_angle(&Unit::new_normalize(joint.axis), hinge * q);
        let r = pose.translation.vector - parent.pose.translation.vector;
        let w = parent.angular_velocity;
        Motion {
            pose,
            velocity: parent.velocity + w.cross(&r) + slide * v * axis,
            angular_velocity: w + hinge * v * axis,
            acceleration: parent.acceleration
                + parent.angular_acceleration.cross(&r)
                + w.cross(&w.cross(&r))
                + slide * (2.0 * v * w.cross(&axis) + a * axis),
            angular_acceleration: parent.angular_acceleration + hinge * (a * axis + w.cross(&(v * axis))),
        }
    }

    /// Joint efforts by joint name.
    pub(super) fn efforts(&self, joints: &Joints, root: Motion) -> BTreeMap<String, f64> {
        let mut efforts = BTreeMap::new();
        self.inward(&self.root, &root, joints, &mut efforts);
        efforts
    }

    /// Force on a link and its subtree, and the moment about the link's origin.
    fn inward(
        &self,
        link: &str,
        motion: &Motion,
        joints: &Joints,
        efforts: &mut BTreeMap<String, f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let body = &self.bodies[link];
        let turn = motion.pose.rotation.to_rotation_matrix();
        let (c, w) = (turn * body.com, motion.angular_velocity);
        let inertia = turn.matrix() * body.inertia * turn.matrix().transpose();
        let of_com = motion.acceleration + motion.angular_acceleration.cross(&c) + w.cross(&w.cross(&c));
        let mut force = body.mass * of_com;
        let mut moment = inertia * motion.angular_acceleration + w.cross(&(inertia * w)) + c.cross(&force);
        for joint in self.below(link) {
            let state = joints.get(&joint.name).copied().unwrap_or_default();
            let child = Self::outward(joint, motion, state);
            let (f, n) = self.inward(&joint.child, &child, joints, efforts);
            let axis = motion.pose * joint.parent_from_joint * joint.axis;
            let effort = if joint.kind == "prismatic" { axis.dot(&f) } else { axis.dot(&n) };
            efforts.insert(joint.name.clone(), effort);
            force += f;
            moment += n + (child.pose.translation.vector - motion.pose.translation.vector).cross(&f);
        }
        (force, moment)
    }

    /// The motion of every link.
    pub(super) fn motions(&self, joints: &Joints, root: Motion) -> Vec<(&Body, Motion)> {
        let mut found = Vec::new();
        let mut open = vec![(self.root.as_str(), root)];
        while let Some((link, motion)) = open.pop() {
            found.push((&self.bodies[link], motion));
            for joint in self.below(link) {
                let state = joints.get(&joint.name).copied().unwrap_or_default();
                open.push((&joint.child, Self::outward(joint, &motion, state)));
            }
        }
        found
    }

    /// Linear momentum, and angular momentum about the world's origin.
    pub(super) fn momentum(&self, joints: &Joints, root: Motion) -> (Vector3<f64>, Vector3<f64>) {
        let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
        for (body, motion) in self.motions(joints, root) {
            let (place, velocity, turned) = com_state(body, &motion);
            linear += body.mass * velocity;
            angular += body.mass * place.cross(&velocity) + turned * motion.angular_velocity;
        }
        (linear, angular)
    }

    /// Kinetic plus potential energy \[J\].
    pub(super) fn energy(&self, joints: &Joints, root: Motion, gravity: Vector3<f64>) -> f64 {
        let of_body = |(body, motion): (&Body, Motion)| {
            let (place, velocity, turned) = com_state(body, &motion);
            let kinetic = 0.5 * body.mass * velocity.norm_squared()
                + 0.5 * motion.angular_velocity.dot(&(turned * motion.angular_velocity));
            kinetic - body.mass * gravity.dot(&place)
        };
        self.motions(joints, root).into_iter().map(of_body).sum()
    }
}

/// Position and velocity of a center of mass, and the inertia in world axes.
fn com_state(body: &Body, motion: &Motion) -> (Vector3<f64>, Vector3<f64>, Matrix3<f64>) {
    let turn = motion.pose.rotation.to_rotation_matrix();
    let c = turn * body.com;
    let place = motion.pose.translation.vector + c;
    (
        place,
        motion.velocity + motion.angular_velocity.cross(&c),
        turn.matrix() * body.inertia * turn.matrix().transpose(),
    )
}
