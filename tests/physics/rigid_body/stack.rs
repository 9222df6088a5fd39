//! Five boxes, each slightly smaller than the one below, so that four corners carry it. In each corner of the k-th
//! contact f = n g m/4, where n is the number of boxes above; A is 1/m on the ground and 2/m between two boxes. The
//! contacts thus sink in by ([`soft_contact`](super::soft_contact)) `depth(5 g/4)` on the ground and `depth(2 n g/4)`
//! between boxes, and the top sinks by their sum. This holds for 4.x. Between two boxes 2.2.2 sinks in exactly twice as
//! deep: for face contacts, its `mjc_BoxBox` (engine_collision_box.c) reports half of the overlap as the distance. The
//! law expects that in 2.2.2.
//!
//! Tolerance: a fixed point of arithmetic compared with the rest of the motion, e^(-t/tc) with tc below 0.1 s for five
//! boxes and t = 3 s: 1e-13 of 1 mm, and rounding of heights of 0.5 m; 1e-12 m.

use super::soft_contact::depth;
use crate::lab::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::worlds::object;

const EDGE: f64 = 0.1;

/// Heights of the centers after 3 s.
fn heights(boxes: usize) -> Vec<f64> {
    let mut lab = Lab::new(slope(0.0, 1.0));
    let ids: Vec<RigidObjectId> = (0..boxes)
        .map(|k| {
            let width = 0.3 - 0.02 * k as f64;
            let shape = ObjectShape::Box { size: [width, width, EDGE] };
            let cube = object(&format!("box {k}"), shape, [0.0, 0.0, (k as f64 + 0.5) * EDGE]);
            lab.object(RigidObjectCfg { mass: Some(1.0), ..cube })
        })
        .collect();
    lab.run(3.0);
    ids.into_iter().map(|id| lab.body(id).position.z).collect()
}

#[test]
fn holds() {
    law(module_path!(), "joint k sinks in by depth(A f) with f = m g (boxes above)/4", |m| {
        let (five, four, six) = (heights(5), heights(4), heights(6));
        let left = (1e-12, "rounding of heights");
        let joint = |z: &[f64], k: usize| if k == 0 { EDGE / 2.0 - z[0] } else { EDGE - (z[k] - z[k - 1]) };
        for k in 0..5 {
            let above = (5 - k) as f64;
            let expected = match (k, BUILD_VERSION) {
                (0, _) => depth(above * G / 4.0),
                (_, SupportedVersion::V2) => 2.0 * depth(2.0 * above * G / 4.0),
                (_, SupportedVersion::V4) => depth(2.0 * above * G / 4.0),
            };
            m.row(&format!("depth of joint {k}"), "m", expected, joint(&five, k), left);
        }
        for k in 0..4 {
            m.control(&format!("depth of joint {k}"), "with a box less", joint(&four, k));
        }
        m.control("depth of joint 4", "with a box more", joint(&six, 4));
        for k in 1..5 {
            m.versions_differ_in(
                &format!("depth of joint {k}"),
                "boxes on boxes sink in twice as deep in 2.2.2 as the depths of their contacts say",
            );
        }
    });
}
