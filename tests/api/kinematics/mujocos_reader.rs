//! MuJoCo's own reader of URDF files is the judge: nothing of what reads the files here, or writes the scene, has a part in it.
//!
//! Both multiply the same transforms, which they read from the same decimals; MuJoCo turns roll, pitch and yaw into
//! quaternions by another formula. Positions of a metre differ by some units of 2e-16: 1e-12, as among ourselves.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_row;
use kinetoscope::sim::mj::{self, Data, ObjectKind};
use nalgebra::Vector3;
use std::path::Path;

const BOUND: f64 = 1e-12;

/// A URDF file as MuJoCo reads it, with all links as bodies; its root link is the world.
struct Judge(Data);

impl Judge {
    fn of(urdf: &Path) -> Self {
        let text = std::fs::read_to_string(urdf).unwrap();
        let element = text.find("<robot").unwrap();
        let inside = element + text[element..].find('>').unwrap() + 1;
        // Links without mass are refused otherwise; masses move nothing here.
        let settings = r#"<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6" balanceinertia="true"/></mujoco>"#;
        let text = format!("{}{settings}{}", &text[..inside], &text[inside..]);
        Self(Data::new(&mj::compile(&text, &[]).unwrap().into_model()).unwrap())
    }

    /// Puts all joints where a row says.
    fn put(&mut self, names: &[String], qpos: &[f64]) {
        for (name, &value) in names.iter().zip(qpos) {
            let model = self.0.model();
            let address = model.jnt_qposadr()[model.id(ObjectKind::Joint, name).unwrap()] as usize;
            self.0.qpos_mut()[address] = value;
        }
        self.0.forward().unwrap();
    }

    /// Body of a link; the world for the root link, which has none.
    fn body(&self, link: &str, root: &str) -> usize {
        let body = self.0.model().id(ObjectKind::Body, link);
        if link == root { body.unwrap_or(0) } else { body.unwrap() }
    }

    fn pose(&self, body: usize) -> Pose {
        let (p, q) = (&self.0.xpos()[3 * body..], &self.0.xquat()[4 * body..]);
        from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]])
    }

    /// `mj_jac` at a point, a column for each of `names`, those of followers added to what they follow.
    fn jacobian(&self, body: usize, at: [f64; 3], names: &[String], drivers: &[(JointIndex, f64, f64)]) -> Array2<f64> {
        let (model, nv) = (self.0.model(), self.0.model().nv());
        let (mut linear, mut angular) = (vec![0.0; 3 * nv], vec![0.0; 3 * nv]);
        self.0.jacobian(body, at, &mut linear, &mut angular).unwrap();
        let mut jacobian = Array2::zeros((6, names.len()));
        for (name, &(driver, ratio, _)) in names.iter().zip(drivers) {
            let dof = model.jnt_dofadr()[model.id(ObjectKind::Joint, name).unwrap()] as usize;
            for axis in 0..3 {
                jacobian[(axis, driver.0)] += ratio * linear[axis * nv + dof];
                jacobian[(3 + axis, driver.0)] += ratio * angular[axis * nv + dof];
            }
        }
        jacobian
    }
}

/// For every joint the column of what it follows, multiplier and offset (itself, 1 and 0 where it follows nothing), as the file
/// says: position = multiplier * position(joint) + offset, one after the other where a follower is followed.
fn followed(urdf: &Path, names: &[String]) -> Vec<(JointIndex, f64, f64)> {
    let text = std::fs::read_to_string(urdf).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    let mimic = |name: &str| {
        let joints = document.root_element().children().filter(|node| node.has_tag_name("joint"));
        let mut mimics = joints.filter(|node| node.attribute("name") == Some(name));
        let mimic = mimics.next()?.children().find(|node| node.has_tag_name("mimic"))?;
        let number = |of: &str, else_: f64| mimic.attribute(of).map_or(else_, |text| text.parse().unwrap());
        Some((mimic.attribute("joint").unwrap(), number("multiplier", 1.0), number("offset", 0.0)))
    };
    let of = |name: &String| {
        let (mut at, mut ratio, mut offset) = (name.as_str(), 1.0, 0.0);
        while let Some((driver, multiplier, constant)) = mimic(at) {
            (at, ratio, offset) = (driver, ratio * multiplier, ratio * constant + offset);
        }
        (JointIndex(names.iter().position(|name| name == at).unwrap()), ratio, offset)
    };
    names.iter().map(of).collect()
}

/// Every link and the Jacobian of a tool on `tip` at random positions, the robot standing somewhere and turned.
fn check(name: &str, urdf: &Path, tip: &str) {
    let base = Pose::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.4, -1.1, 0.3));
    let (sim, id) = simulation(1, RobotCfg { init_pose: base, ..arm(urdf) });
    let (robot, mut judge) = (sim.robot(id), Judge::of(urdf));
    let (links, names) = (robot.link_names(), robot.joint_names().to_vec());
    let drivers = followed(urdf, &names);
    let tcp = Pose::new(Vector3::new(0.07, -0.02, 0.11), Vector3::new(0.3, 0.2, -0.4));
    let (mut worst, mut apart_jacobian, mut elsewhere, mut moved) = ((0.0_f64, 0.0_f64), 0.0_f64, 0.0_f64, 0.0_f64);
    let start = judge.pose(judge.body(tip, links[0]));
    for row in random_qpos(&sim, id, 20, 61).rows() {
        let there: Vec<f64> = drivers.iter().map(|&(driver, ratio, offset)| ratio * row[driver.0] + offset).collect();
        judge.put(&names, &there);
        let qpos = row.to_owned().insert_axis(Axis(0));
        let ours = robot.compute_link_fk(&qpos, None).unwrap();
        for (k, link) in links.iter().enumerate() {
            let body = judge.body(link, links[0]);
            let (far, turned) = errors(&pose(ours.index_axis(Axis(1), k).row(0)), &(base * judge.pose(body)));
            worst = (worst.0.max(far), worst.1.max(turned));
        }
        let body = judge.body(tip, links[0]);
        let frame = judge.pose(body);
        moved = moved.max(errors(&frame, &start).0);
        let ours = robot.jacobian(Tip::of_link(tip).with_tcp(tcp), Some(qpos.view()), None).unwrap();
        for (tool, far) in [(tcp, &mut apart_jacobian), (Pose::identity(), &mut elsewhere)] {
            let theirs = judge.jacobian(body, (frame * tool).translation.vector.into(), &names, &drivers);
            for joint in 0..names.len() {
                for first in [0, 3] {
                    let theirs = base.rotation * Vector3::from_fn(|k, _| theirs[(first + k, joint)]);
                    let ours = Vector3::from_fn(|k, _| ours[(0, first + k, joint)]);
                    *far = far.max((ours - theirs).norm());
                }
            }
        }
    }
    println!(
        "{name}: {} links within {:.1e} m, {:.1e} rad, columns within {apart_jacobian:.1e}",
        links.len(),
        worst.0,
        worst.1
    );
    assert!(worst.0 < BOUND && worst.1 < BOUND && apart_jacobian < BOUND, "{name}: {worst:?} {apart_jacobian}");
    // The controls: the tip moves, and at another point there is another Jacobian.
    assert!(moved > 0.05 && elsewhere > 1e-3, "{name}: {moved} {elsewhere}");
}

#[test]
fn followers_are_those_of_the_file() {
    let urdf = assets::path("revo1_left/revo1_left.urdf").unwrap();
    let names = simulation(1, arm(&urdf));
    let names = names.0.robot(names.1).joint_names().to_vec();
    let follow = followed(&urdf, &names).into_iter().enumerate().filter(|(k, (driver, ..))| driver.0 != *k);
    assert_eq!(follow.map(|(_, (_, ratio, offset))| (ratio, offset)).filter(|&of| of == (1.05, 0.0)).count(), 5);
}

#[test]
fn links_and_jacobians_are_those_of_mujocos_reader() {
    let asset = |name: &str| assets::path(name).unwrap();
    for (name, urdf, tip) in [
        ("SR5", asset("sr5/SR5.urdf"), "ee_link"),
        // The one with followers: five.
        ("hand", asset("revo1_left/revo1_left.urdf"), "left_index_dist"),
        ("seven axes", file("seven_axes.urdf"), "link8"),
        ("six axes", file("six_axes.urdf"), "tool0"),
        ("quadruped", asset("quadruped/quadruped.urdf"), "LF_FOOT"),
    ] {
        check(name, &urdf, tip);
    }
}
