//! A stereo camera that looks at an arm and objects on the ground: left, right and disparity images, and a colored
//! point cloud. The point cloud is computed from the disparity, as with a real stereo camera.
//!
//! ```text
//! cargo run --release --example stereo -- --headless --steps 100 --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use image::{Rgb, RgbImage};
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_row;
use kinetoscope::sensors::camera::colormap::depth_color;
use kinetoscope::sensors::camera::{Camera, CameraConvention, StereoCamera, StereoCameraCfg};
use launcher::{Launcher, MainLoop, PathFlags, cloud, image_file};
use nalgebra::Point3;
use serde_json::json;
use std::process::ExitCode;

/// Looks at an arm and objects on the ground with a stereo camera.
#[derive(Debug, Parser)]
#[command(name = "stereo")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Environment whose images are written
    #[arg(long, alias = "camera_id", default_value_t = 0)]
    camera_id: usize,
    /// Width of the images, in pixels
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Height of the images, in pixels
    #[arg(long, default_value_t = 480)]
    height: usize,
    /// Distance between the two cameras, in meters
    #[arg(long, default_value_t = 0.12)]
    baseline: f64,
    /// Rotation of the right camera toward the left one, in degrees; cameras that are not parallel have no disparity
    #[arg(long, alias = "toe_in_deg", default_value_t = 0.0)]
    toe_in_deg: f64,
    #[command(flatten)]
    paths: PathFlags,
}

fn main() -> ExitCode {
    launcher::run("stereo", || run(&Args::parse()))
}

fn run(args: &Args) -> launcher::Result {
    let renderer = args.launcher.renderer.for_cameras(args.paths)?;
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        physics_dt: 1.0 / 100.0,
        arena_space: args.launcher.arena_space.unwrap_or(3.0),
        ..args.launcher.simulation_for_any_renderer()
    })?;
    launcher::check_camera_id(args.camera_id, &sim)?;
    sim.add_robot(assets::sr5_with_hand()?)?;
    let things = [
        ("cube", ObjectShape::cube(0.12), [0.55, -0.25, 0.3], [0.85, 0.2, 0.15, 1.0]),
        ("ball", ObjectShape::Sphere { radius: 0.09 }, [0.45, 0.3, 0.3], [0.2, 0.45, 0.85, 1.0]),
        ("can", ObjectShape::Cylinder { radius: 0.06, length: 0.16 }, [0.8, 0.1, 0.3], [0.25, 0.65, 0.3, 1.0]),
    ];
    for (uid, shape, [x, y, z], rgba) in things {
        let init_pose = Pose::translation(x, y, z);
        sim.add_rigid_object(RigidObjectCfg { uid: uid.into(), shape, init_pose, rgba, ..Default::default() })?;
    }
    let id = sim.add_sensor("stereo", stereo_cfg(args, renderer))?;
    args.launcher.write_dump(&sim)?;
    println!("{}", sim.sensor(id)?);
    let out = args.launcher.out_folder(true)?;

    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, 200);
    let mut step = 0;
    while !progress.should_stop(step) {
        let end = progress.end_of_block(step, 20);
        sim.update((end - step) as u32);
        step = end;
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    recording.finish(&mut sim)?;

    let stereo = sim.sensor(id)?;
    let pair = StereoFrame::from_camera(stereo, args.camera_id)?;
    let size = [args.width, args.height];
    let files = ["stereo_left.png", "stereo_right.png", "stereo_disparity.png", "stereo_points.ply"];
    let images = [
        image_file::color_image(size, &pair.left),
        image_file::color_image(size, &pair.right),
        pair.disparity_image(size),
    ];
    for (file, image) in files.iter().zip(&images) {
        image_file::write_png(&out.join(file), image)?;
    }
    let points = pair.points(args.width);
    if points.is_empty() {
        return Err("the cameras see nothing: no pixel has a disparity".into());
    }
    cloud::write_ply(&out.join(files[3]), &points)?;
    let (compared, error) = pair.disparity_error(args.width);
    let range = image_file::finite_range(pair.disparity.iter().copied().filter(|d| *d > 0.0));
    let [low, high] = range.unwrap_or([0.0; 2]);
    println!("\nDisparities from {low:.2} to {high:.2} pixels; {} points", points.len());
    println!(
        "{compared} points are visible to both cameras. The right camera's depth is that of a disparity {error:.1e} pixels"
    );
    println!("from the left one's, for 9 of 10 points at most");
    println!("Written to {}: {}", out.display(), files.join(", "));
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": step,
        "threads": sim.threads(),
        "width": args.width,
        "height": args.height,
        "camera_id": args.camera_id,
        "time": stereo.left().stamps()[args.camera_id],
        "baseline": args.baseline,
        "disparity_min": low,
        "disparity_max": high,
        "points": points.len(),
        "points_compared": compared,
        "disagreement_pixels": error,
        "files": files,
        "renderer": renderer,
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))
}

/// A stereo camera in front of the robot, above the objects.
fn stereo_cfg(args: &Args, renderer: kinetoscope::render::Renderer) -> StereoCameraCfg {
    let f = 500.0 * args.width as f64 / 640.0;
    let placement = Placement::LookAt { eye: [1.9, 0.25, 0.95], target: [0.35, 0.0, 0.25], up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width: args.width,
        height: args.height,
        intrinsics: Intrinsics::Pixels { fx: f, fy: f, cx: args.width as f64 / 2.0, cy: args.height as f64 / 2.0 },
        near: 0.05,
        far: 10.0,
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { color: true, depth: true, mask: true, ..Default::default() },
        update_period: 0.1,
        renderer,
        ..Default::default()
    };
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, -args.toe_in_deg.to_radians(), 0.0);
    StereoCameraCfg {
        camera,
        left_to_right_pos: [args.baseline, 0.0, 0.0],
        left_to_right_rot: turn,
        ..Default::default()
    }
}

/// Images of one environment's stereo camera, with the calibration that a stereo matcher needs.
struct StereoFrame {
    left: Vec<u8>,
    right: Vec<u8>,
    disparity: Vec<f32>,
    /// fx, fy, cx, cy of the left camera \[pixels\].
    intrinsics: [f64; 4],
    baseline: f64,
    world_from_left: Pose,
    /// Depth measured by the right camera itself \[m\].
    right_depth: Vec<f32>,
    left_mask: Vec<i32>,
    right_mask: Vec<i32>,
}

impl StereoFrame {
    fn from_camera(stereo: &StereoCamera, env: usize) -> launcher::Result<Self> {
        let k = stereo.left().intrinsic_matrices();
        let pose = |eye: &Camera| from_row(&std::array::from_fn(|i| eye.pose_w(CameraConvention::Ros)[(env, i)]));
        let color = |eye: &Camera| -> launcher::Result<Vec<u8>> {
            Ok(eye.color()?.index_axis(Axis(0), env).iter().copied().collect())
        };
        let mask = |eye: &Camera| -> launcher::Result<Vec<i32>> {
            Ok(eye.mask()?.index_axis(Axis(0), env).iter().copied().collect())
        };
        Ok(Self {
            left: color(stereo.left())?,
            right: color(stereo.right())?,
            disparity: stereo.disparity()?.index_axis(Axis(0), env).iter().copied().collect(),
            intrinsics: [k[(env, 0, 0)], k[(env, 1, 1)], k[(env, 0, 2)], k[(env, 1, 2)]],
            baseline: stereo.left_from_right().translation.x,
            world_from_left: pose(stereo.left()),
            right_depth: stereo.right().depth()?.index_axis(Axis(0), env).iter().copied().collect(),
            left_mask: mask(stereo.left())?,
            right_mask: mask(stereo.right())?,
        })
    }

    /// Points in the environment \[m\] with the colors of the left camera, from the disparity alone: z = fx b / d.
    fn points(&self, width: usize) -> Vec<([f32; 3], [u8; 3])> {
        let [fx, fy, cx, cy] = self.intrinsics;
        let point = |(k, &d): (usize, &f32)| {
            let (u, v, z) = ((k % width) as f64 + 0.5, (k / width) as f64 + 0.5, fx * self.baseline / f64::from(d));
            let at = self.world_from_left * Point3::new((u - cx) / fx * z, (v - cy) / fy * z, z);
            (at.coords.map(|x| x as f32).into(), [self.left[4 * k], self.left[4 * k + 1], self.left[4 * k + 2]])
        };
        self.disparity.iter().enumerate().filter(|(_, d)| **d > 0.0).map(point).collect()
    }

    /// Number of compared points, and the 90th percentile of the disparity error \[pixels\].
    ///
    /// A left pixel with disparity d corresponds to (u - d, v) in the right image. The right camera's own depth there
    /// gives a second disparity, which is compared with d. Depth is measured at pixel centers and interpolated between
    /// two of them: 1 / z is linear in the image of a plane. One point of ten is ignored, for edges within an object,
    /// self-occlusion and silhouettes.
    fn disparity_error(&self, width: usize) -> (usize, f64) {
        let scale = self.intrinsics[0] * self.baseline;
        let mut off: Vec<f64> = Vec::new();
        for (k, &d) in self.disparity.iter().enumerate().filter(|(_, d)| **d > 0.0) {
            let (u, row) = ((k % width) as f64 - f64::from(d), k / width * width);
            if u < 0.0 || u.floor() as usize + 1 >= width {
                continue;
            }
            let (first, share) = (row + u.floor() as usize, u.fract());
            if [first, first + 1].iter().any(|&at| self.right_mask[at] != self.left_mask[k]) {
                continue;
            }
            let [a, b] = [first, first + 1].map(|at| scale / f64::from(self.right_depth[at]));
            off.push((a + share * (b - a) - f64::from(d)).abs());
        }
        off.sort_unstable_by(f64::total_cmp);
        // Without compared points the error counts as infinite.
        (off.len(), off.get(off.len() * 9 / 10).copied().unwrap_or(f64::MAX))
    }

    /// Disparity image: near (large disparity) is red, far blue, no disparity black.
    fn disparity_image(&self, [width, height]: [usize; 2]) -> RgbImage {
        let seen = self.disparity.iter().copied().filter(|d| *d > 0.0);
        let range = image_file::finite_range(seen).unwrap_or([0.0, 1.0]);
        RgbImage::from_fn(width as u32, height as u32, |x, y| {
            let d = self.disparity[y as usize * width + x as usize];
            Rgb(if d > 0.0 { depth_color(d, range) } else { [0; 3] })
        })
    }
}
