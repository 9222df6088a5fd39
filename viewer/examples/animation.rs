//! Renders the animated image of the README: arms with hands in four environments, beside the depth and the mask of a
//! camera in the first environment.
//!
//! ```sh
//! cargo run --release -p kinetoscope-viewer --example animation docs/pictures/batch.gif
//! ```
#![allow(clippy::unwrap_used, reason = "a program for the maintainers")]

use gif::{DisposalMethod, Encoder, Frame, Repeat};
use image::{Rgba, RgbaImage};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::colormap::{depth_color, mask_color};
use kinetoscope_viewer::{OrbitCamera, ScreenshotCfg};
use std::fs::File;

/// Size of the overview \[pixels\]; each image of the camera has about half of its width and height.
const SIZE: [u32; 2] = [352, 264];
/// Space between the images \[pixels\].
const GAP: u32 = 4;
/// Steps of 10 ms between two frames.
const STEPS: u32 = 8;
/// Frames of one motion; four motions return to the start.
const FRAMES: usize = 14;
/// Depth range of the colors \[m\].
const DEPTH: [f32; 2] = [0.4, 2.2];
/// Largest difference of a color channel, of 255, that counts as no change.
const TOLERANCE: u8 = 3;
/// A transparent color far from all others, so that the quantization keeps it apart from them.
const UNCHANGED: Rgba<u8> = Rgba([255, 0, 255, 0]);

fn main() {
    let path = std::env::args_os().nth(1).expect("a file for the animation");
    let cfg = SimulationManagerCfg { num_envs: 4, physics_dt: 0.01, arena_space: 1.6, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let robot = sim.add_robot(assets::sr5_with_hand().unwrap()).unwrap();
    for (k, (x, rgba)) in [(0.5, [0.85, 0.2, 0.15, 1.0]), (0.68, [0.15, 0.4, 0.85, 1.0])].into_iter().enumerate() {
        sim.add_rigid_object(RigidObjectCfg {
            uid: format!("cube {k}"),
            shape: ObjectShape::cube(0.12),
            init_pose: Pose::translation(x, 0.35, 0.06),
            rgba,
            ..Default::default()
        })
        .unwrap();
    }
    let placement = Placement::LookAt { eye: [1.3, -0.8, 0.9], target: [0.25, 0.05, 0.45], up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width: SIZE[0] as usize / 2,
        height: (SIZE[1] - GAP) as usize / 2,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { depth: true, mask: true, ..Channels::default() },
        ..CameraCfg::default()
    };
    let camera = sim.add_sensor("camera", camera).unwrap();

    let (arm, hand) = (sim.robot(robot).joint_ids("arm").unwrap(), sim.robot(robot).joint_ids("hand").unwrap());
    let limits = sim.robot(robot).qpos_limits();
    let fingers = |end: usize| Array2::from_shape_fn((4, hand.len()), |(_, j)| limits[(0, hand[j].0, end)]);
    let poses = [[0.0, -0.5, 0.5, -1.0, 0.5, 0.0], [0.5, 0.3, -1.3, 0.3, -0.5, 0.5]];
    let mut encoder: Option<Encoder<File>> = None;
    let mut shown: Option<RgbaImage> = None;
    for motion in 0..4 {
        // Each environment turns its arm by another angle, and closes its hand while the next pose is reached.
        let target = Array2::from_shape_fn((4, arm.len()), |(env, j)| {
            poses[motion % 2][j] + if j == 0 { 0.4 * (env as f64 - 1.5) } else { 0.0 }
        });
        sim.robot_mut(robot).set_qpos_target(&target, Some(&arm), None).unwrap();
        sim.robot_mut(robot).set_qpos_target(&fingers(usize::from(motion % 2 == 0)), Some(&hand), None).unwrap();
        for _ in 0..FRAMES {
            sim.update(STEPS);
            let image = compose(&mut sim, camera);
            let encoder = encoder.get_or_insert_with(|| {
                let file = File::create(&path).unwrap();
                let mut encoder = Encoder::new(file, image.width() as u16, image.height() as u16, &[]).unwrap();
                encoder.set_repeat(Repeat::Infinite).unwrap();
                encoder
            });
            let mut changed = changes(&image, &mut shown);
            let mut frame = Frame::from_rgba_speed(image.width() as u16, image.height() as u16, &mut changed, 1);
            (frame.delay, frame.dispose) = (STEPS as u16, DisposalMethod::Keep);
            encoder.write_frame(&frame).unwrap();
        }
    }
}

/// Renders the overview, with depth above mask on its right.
fn compose(sim: &mut SimulationManager, camera: SensorId<kinetoscope::sensors::camera::Camera>) -> RgbaImage {
    let eye = OrbitCamera::look_at([2.6, -2.4, 1.7], [0.1, 0.0, 0.35]);
    let size = SIZE.map(|side| side as usize);
    let overview = sim.render_image(&ScreenshotCfg { size, camera: eye, ..ScreenshotCfg::default() }).unwrap();
    let (depth, mask) = {
        let camera = sim.sensor(camera).unwrap();
        (camera.depth().unwrap().to_owned(), camera.mask().unwrap().to_owned())
    };
    let (_, height, width) = depth.dim();
    let mut image = RgbaImage::from_pixel(SIZE[0] + GAP + width as u32, SIZE[1], Rgba([255; 4]));
    let opaque = |[r, g, b]: [u8; 3]| Rgba([r, g, b, 255]);
    for (x, y, pixel) in image.enumerate_pixels_mut().filter(|(x, _, _)| *x < SIZE[0]) {
        *pixel = opaque(overview.pixel(x as usize, y as usize).unwrap());
    }
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        let x = SIZE[0] + GAP + column as u32;
        image.put_pixel(x, row as u32, opaque(depth_color(depth[(0, row, column)], DEPTH)));
        image.put_pixel(x, height as u32 + GAP + row as u32, opaque(mask_color(mask[(0, row, column)])));
    }
    image
}

/// Returns the image with transparent pixels where it differs from `shown` by at most [`TOLERANCE`]; they compress
/// well. Copies all other pixels to `shown`. The first image is returned as it is.
fn changes(image: &RgbaImage, shown: &mut Option<RgbaImage>) -> RgbaImage {
    let Some(shown) = shown else { return shown.insert(image.clone()).clone() };
    let mut out = image.clone();
    for (pixel, before) in out.pixels_mut().zip(shown.pixels_mut()) {
        if pixel.0.iter().zip(before.0).all(|(a, b)| a.abs_diff(b) <= TOLERANCE) {
            *pixel = UNCHANGED;
        } else {
            *before = *pixel;
        }
    }
    out
}
