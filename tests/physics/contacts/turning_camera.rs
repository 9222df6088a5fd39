//! A camera at the rim of a turntable, at radius r, looks inward at a static ball at (X, 0, Z). After a rotation by θ =
//! ω t the ball is at x = X sin(-θ), z = r - X cos θ of the camera's frame, y = z_c - Z; its image follows from
//! [`ball_image`](super::ball_image). A static camera at the rim and a ball on the turntable give the
//! mirrored motion: x = X sin θ.
//!
//! Tolerance: ω is constant to rounding. The centroid of 1000 pixels is accurate to 0.1 pixels, the area to 4 √(2 π r)
//! pixels (law `sphere_depth`).

use super::ball_image::{FOCAL, ImageMoments, PRINCIPAL_POINT, SIZE, expected_moments, measured_moments};
use crate::lab::*;
use kinetoscope::sim::MaskId;
use kinetoscope_testkit::worlds::{fixed, object};
use std::f64::consts::{PI, TAU};

const RIM: f64 = 1.2;
const EYE: f64 = 0.3;
const BALL: [f64; 2] = [0.35, 0.2];
const RADIUS: f64 = 0.08;
const SPIN: f64 = 2.0;

/// The rotating object; the other object is static.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Turns {
    Camera,
    Ball,
}

/// Moments of the ball in the camera's image after `seconds`.
fn ball_moments(turns: Turns, spin: f64, seconds: f64) -> ImageMoments {
    let mut lab = Lab::new(earth());
    let turn = Joint::hinge("turn", ["base", "table"], [0.0, 0.0, 1.0]);
    let table = Link::new("table", 2.0, [0.1; 3]);
    let (text, parent, eye) = match turns {
        Turns::Camera => {
            let rim = Joint::fixed("screw", ["table", "rim"]).at([RIM, 0.0, EYE]);
            (urdf(&[base(), table, Link::new("rim", 0.0, [0.0; 3])], &[turn, rim]), Some("rim".into()), [0.0; 3])
        }
        Turns::Ball => {
            let screw = Joint::fixed("screw", ["table", "ball"]).at([BALL[0], 0.0, BALL[1]]);
            let text = urdf(&[base(), table, Link::ball("ball", 0.1, RADIUS)], &[turn, screw]);
            // Visible, but without collisions.
            (text.replace("collision>", "visual>"), None, [RIM, 0.0, EYE])
        }
    };
    let robot = lab.mechanism(&text);
    if turns == Turns::Camera {
        lab.object(fixed(object("ball", ObjectShape::Sphere { radius: RADIUS }, [BALL[0], 0.0, BALL[1]])));
    }
    let [width, height] = SIZE;
    let target = [eye[0] - 1.0, eye[1], eye[2]];
    let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width,
        height,
        intrinsics: Intrinsics::Pixels { fx: FOCAL, fy: FOCAL, cx: PRINCIPAL_POINT[0], cy: PRINCIPAL_POINT[1] },
        extrinsics: Extrinsics { parent, placement, ..Extrinsics::default() },
        channels: Channels { mask: true, ..Channels::default() },
        ..CameraCfg::default()
    };
    let camera = lab.sim.add_sensor("camera", camera).unwrap();
    lab.write_joints(robot, &[0.0], &[spin]);
    lab.run(seconds);
    let is_ball = |id: &&MaskId| id.object == "ball" || id.link.as_deref() == Some("ball");
    let id = lab.sim.scene().mask_ids().iter().find(is_ball).unwrap().id;
    measured_moments(&lab.sim.sensor(camera).unwrap().mask().unwrap(), id)
}

#[test]
fn holds() {
    law(module_path!(), "x = ∓X sin ω t, z = r - X cos ω t", |m| {
        let cases = [(Turns::Camera, 1.0, "the camera turns"), (Turns::Ball, -1.0, "the ball goes round")];
        for ((turns, way, name), seconds) in
            cases.into_iter().flat_map(|case| [0.25, 0.6, 1.1, 1.9, 2.7].map(|seconds| (case, seconds)))
        {
            let still = ball_moments(turns, 0.0, 0.25);
            let (sin, cos) = (SPIN * seconds).sin_cos();
            let form = expected_moments([-way * BALL[0] * sin, EYE - BALL[1], RIM - BALL[0] * cos], RADIUS);
            let ball = ball_moments(turns, SPIN, seconds);
            let of = |what: &str| format!("{what} after {seconds} s, {name}");
            let edge = 4.0 * (TAU * (form.area / PI).sqrt()).sqrt();
            let within = (0.1, "pixels of the silhouette");
            m.row(&of("u of the middle"), "pixels", form.centroid[0], ball.centroid[0], within);
            m.row(&of("v of the middle"), "pixels", form.centroid[1], ball.centroid[1], within);
            m.row(&of("area"), "pixels", form.area, ball.area, (edge, "pixels of the silhouette"));
            m.control(&of("u of the middle"), "standing still", still.centroid[0]);
            m.control(&of("v of the middle"), "standing still", still.centroid[1]);
            m.control(&of("area"), "standing still", still.area);
        }
    });
}
