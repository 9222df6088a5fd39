//! A ball in a depth picture: how many pixels it covers, where their middle is
//! ([`ball_in_picture`](super::ball_in_picture)), and how near its nearest point is: D - R on the optical axis, D being
//! the distance of its centre. Elsewhere the ray (x, y, 1) of a pixel meets it at the depth (b - √(b² - a (c² -
//! R²)))/a, with a = x² + y² + 1, b = (x, y, 1)·c.
//!
//! Tolerance: pixels are counted by their centres. Along the silhouette each is off by a part of one with any sign, the
//! area by √(2 π r/12), r being 60 pixels; a dozen times that is taken, 4 √(2 π r), and of the middle 0.1 pixels.
//! Depths have single precision, and a root in them. The nearest pixel is 0.71 pixels beside the axis, where the ball
//! is (0.71/f)² D (D - R)/2R less near: 2e-5 m, five times.

use super::ball_in_picture::{FOCAL, MIDDLE, SIZE, Seen, expected, found};
use crate::lab::*;
use crate::law::law;
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use std::f64::consts::TAU;

const RADIUS: f64 = 0.3;

/// A ball of this radius at this place of the optical frame.
type Ball = ([f64; 3], f64);

/// What the rasterizer or the rays show of a ball: area and middle, nearest depth, and the largest error of a pixel's
/// depth against the closed form of the second ball, up to a metre.
fn seen((at, radius): Ball, (center, r): Ball, rays: bool) -> (Seen, f64, f64) {
    let mut lab = Lab::new(weightless());
    // The optical frame (x right, y down, z forward) looks along the world's x.
    let ball = lab.object(RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius },
        body_type: BodyType::Static,
        init_pose: Pose::translation(at[2], -at[0], -at[1]),
        ..RigidObjectCfg::default()
    });
    let id = lab.sim.rigid_object(ball).mask_id();
    let [width, height] = SIZE;
    let intrinsics = Intrinsics::Pixels { fx: FOCAL, fy: FOCAL, cx: MIDDLE[0], cy: MIDDLE[1] };
    let extrinsics = Extrinsics { convention: CameraConvention::World, ..Extrinsics::default() };
    let (mask, depth) = if rays {
        let cfg = RayCasterCameraCfg { width, height, intrinsics, extrinsics, ..RayCasterCameraCfg::default() };
        let camera = lab.sim.add_sensor("rays", cfg).unwrap();
        let camera = lab.sim.sensor(camera).unwrap();
        (camera.mask().to_owned(), camera.depth().to_owned())
    } else {
        let channels = Channels { depth: true, mask: true, ..Channels::default() };
        let cfg = CameraCfg { width, height, intrinsics, extrinsics, channels, ..CameraCfg::default() };
        let camera = lab.sim.add_sensor("camera", cfg).unwrap();
        let camera = lab.sim.sensor(camera).unwrap();
        (camera.mask().unwrap().to_owned(), camera.depth().unwrap().to_owned())
    };
    let (mut nearest, mut worst) = (f64::INFINITY, 0.0_f64);
    for ((v, u), &z) in depth.index_axis(Axis(0), 0).indexed_iter() {
        let (x, y) = ((u as f64 + 0.5 - MIDDLE[0]) / FOCAL, (v as f64 + 0.5 - MIDDLE[1]) / FOCAL);
        let (a, b) = (x * x + y * y + 1.0, x * center[0] + y * center[1] + center[2]);
        let root = b * b - a * (center.iter().map(|c| c * c).sum::<f64>() - r * r);
        // At the silhouette the depth falls off steeply: what is within a hundredth of it is left out.
        if root > 0.01 {
            worst = worst.max((f64::from(z) - (b - root.sqrt()) / a).abs().min(1.0));
        }
        nearest = nearest.min(f64::from(z));
    }
    (found(&mask.view(), id), nearest, worst)
}

#[test]
fn holds() {
    law(module_path!(), "A = π f² R² √(x² + y² + s)/s^(3/2), s = z² - R²; nearest D - R", |m| {
        for (place, at) in [("on the axis", [0.0, 0.0, 1.5]), ("off the axis", [0.4, -0.25, 1.4])] {
            for (name, rays) in [("rasterizer", false), ("rays", true)] {
                let this = (at, RADIUS);
                let (ball, nearest, worst) = seen(this, this, rays);
                let beside = ([at[0] + 0.03, at[1] + 0.03, at[2]], 1.02 * RADIUS);
                let (other, other_nearest, other_worst) = seen(beside, this, rays);
                let form = expected(at, RADIUS);
                let of = |what: &str| format!("{what} {place}, {name}");
                let edge = 4.0 * (TAU * (form.area / std::f64::consts::PI).sqrt()).sqrt();
                m.row(&of("area"), "pixels", form.area, ball.area, (edge, "pixels of the silhouette"));
                m.control(&of("area"), "of a ball 2 % larger", other.area);
                for (axis, letter) in ["u", "v"].into_iter().enumerate() {
                    let quantity = of(&format!("{letter} of the middle"));
                    m.row(
                        &quantity,
                        "pixels",
                        form.centroid[axis],
                        ball.centroid[axis],
                        (0.1, "pixels of the silhouette"),
                    );
                    m.control(&quantity, "of a ball beside it", other.centroid[axis]);
                }
                let single = (5e-6, "single precision, steep near the silhouette");
                m.row(&of("largest error of a depth"), "m", 0.0, worst, single);
                m.control(&of("largest error of a depth"), "of a ball beside it", other_worst);
                if place == "on the axis" {
                    m.row(&of("nearest"), "m", at[2] - RADIUS, nearest, (1e-4, "a pixel beside the axis"));
                    m.control(&of("nearest"), "of a ball beside it", other_nearest);
                }
            }
        }
    });
}
