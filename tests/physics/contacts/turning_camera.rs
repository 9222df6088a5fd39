//! A camera that looks inwards from the rim of a turntable, at r, sees a ball that stands at (X, 0, Z) on its way:
//! turned by θ = ω t it is at x = X sin(-θ), z = r - X cos θ of the camera's frame, y = z_c - Z, and in the picture
//! where [`ball_in_picture`](super::ball_in_picture) says.
//!
//! Tolerance: ω is constant to rounding. The middle of 1000 pixels is good to 0.1 pixels, its area to 4 √(2 π r) pixels
//! (law `sphere_depth`).

use super::ball_in_picture::{FOCAL, MIDDLE, SIZE, Seen, expected, found};
use crate::lab::*;
use crate::law::law;
use crate::urdf::{Joint, Link, base, urdf};
use kinetoscope::prelude::*;
use std::f64::consts::{PI, TAU};

const RIM: f64 = 1.2;
const EYE: f64 = 0.3;
const BALL: [f64; 2] = [0.35, 0.2];
const RADIUS: f64 = 0.08;
const SPIN: f64 = 2.0;

/// What the camera shows after `seconds`.
fn seen(spin: f64, seconds: f64) -> Seen {
    let mut lab = Lab::new(earth());
    let links = [base(), Link::new("table", 2.0, [0.1; 3]), Link::new("rim", 0.0, [0.0; 3])];
    let rim = Joint::fixed("screw", ["table", "rim"]).at([RIM, 0.0, EYE]);
    let robot = lab.mechanism(&urdf(&links, &[Joint::hinge("turn", ["base", "table"], [0.0, 0.0, 1.0]), rim]));
    let ball = lab.object(RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: RADIUS },
        body_type: BodyType::Static,
        init_pose: Pose::translation(BALL[0], 0.0, BALL[1]),
        ..RigidObjectCfg::default()
    });
    let [width, height] = SIZE;
    let placement = Placement::LookAt { eye: [0.0; 3], target: [-1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width,
        height,
        intrinsics: Intrinsics::Pixels { fx: FOCAL, fy: FOCAL, cx: MIDDLE[0], cy: MIDDLE[1] },
        extrinsics: Extrinsics { parent: Some("rim".into()), placement, ..Extrinsics::default() },
        channels: Channels { mask: true, ..Channels::default() },
        ..CameraCfg::default()
    };
    let camera = lab.sim.add_sensor("camera", camera).unwrap();
    lab.write_joints(robot, &[0.0], &[spin]);
    lab.run(seconds);
    let id = lab.sim.rigid_object(ball).mask_id();
    found(&lab.sim.sensor(camera).unwrap().mask().unwrap(), id)
}

#[test]
fn holds() {
    law(module_path!(), "x = -X sin ω t, z = r - X cos ω t", |m| {
        let still = seen(0.0, 0.25);
        for seconds in [0.25, 0.6, 1.1, 1.9, 2.7] {
            let (sin, cos) = (SPIN * seconds).sin_cos();
            let form = expected([-BALL[0] * sin, EYE - BALL[1], RIM - BALL[0] * cos], RADIUS);
            let ball = seen(SPIN, seconds);
            let of = |what: &str| format!("{what} after {seconds} s");
            let edge = 4.0 * (TAU * (form.area / PI).sqrt()).sqrt();
            m.row(
                &of("u of the middle"),
                "pixels",
                form.centroid[0],
                ball.centroid[0],
                (0.1, "pixels of the silhouette"),
            );
            m.row(
                &of("v of the middle"),
                "pixels",
                form.centroid[1],
                ball.centroid[1],
                (0.1, "pixels of the silhouette"),
            );
            m.row(&of("area"), "pixels", form.area, ball.area, (edge, "pixels of the silhouette"));
            m.control(&of("u of the middle"), "standing still", still.centroid[0]);
            m.control(&of("v of the middle"), "standing still", still.centroid[1]);
            m.control(&of("area"), "standing still", still.area);
        }
    });
}
