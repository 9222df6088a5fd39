//! Materials and lights: glass, water, metals from polished to matte, paint and an emissive object, under a spotlight
//! with a size.
//!
//! ```text
//! cargo run --release --example surfaces -- --headless --renderer rt --rt-samples 256 --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::sim::{LightKindCfg, SurfaceCfg};
use launcher::{Launcher, MainLoop, PathFlags, image_file};
use serde_json::json;
use std::process::ExitCode;

/// Renders balls of many materials.
#[derive(Debug, Parser)]
#[command(name = "surfaces")]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Width of the image, in pixels
    #[arg(long, default_value_t = 640)]
    width: usize,
    /// Height of the image, in pixels
    #[arg(long, default_value_t = 360)]
    height: usize,
    /// Radius of the light, in meters: a larger light has softer shadows
    #[arg(long, alias = "lamp_radius", default_value_t = 0.2)]
    lamp_radius: f64,
    #[command(flatten)]
    paths: PathFlags,
}

fn main() -> ExitCode {
    launcher::run("surfaces", || run(&Args::parse()))
}

/// The materials: name, color and further properties.
fn materials() -> [(&'static str, [f64; 4], SurfaceCfg); 8] {
    let white = [1.0; 4];
    let gold = [1.0, 0.77, 0.34, 1.0];
    let paint = SurfaceCfg { roughness: Some(0.15), specular: Some(0.5), ..SurfaceCfg::default() };
    let water = SurfaceCfg { refractive_index: Some(1.33), ..SurfaceCfg::glass() };
    [
        ("glass", white, SurfaceCfg::glass()),
        ("water", [0.85, 0.95, 1.0, 1.0], water),
        ("mirror", [0.95, 0.95, 0.95, 1.0], SurfaceCfg::metal(0.0)),
        ("gold", gold, SurfaceCfg::metal(0.25)),
        ("matt gold", gold, SurfaceCfg::metal(0.6)),
        ("paint", [0.75, 0.08, 0.08, 1.0], paint),
        ("clay", [0.7, 0.42, 0.3, 1.0], SurfaceCfg { specular: Some(0.0), ..SurfaceCfg::default() }),
        ("glow", [1.0, 0.45, 0.15, 1.0], SurfaceCfg { emission: Some(2.0), ..SurfaceCfg::default() }),
    ]
}

fn run(args: &Args) -> launcher::Result {
    let renderer = args.launcher.renderer.for_cameras(args.paths)?;
    let light = LightCfg {
        kind: LightKindCfg::Spot { cutoff_deg: 50.0, exponent: 2.0 },
        position: [0.8, -1.2, 2.2].into(),
        direction: [-0.35, 0.55, -1.0].into(),
        color: [1.0, 0.96, 0.9],
        radius: args.lamp_radius,
        ..LightCfg::default()
    };
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        lights: vec![light],
        ..args.launcher.simulation_for_any_renderer()
    })?;
    const RADIUS: f64 = 0.16;
    for (k, (uid, rgba, surface)) in (0..).zip(materials()) {
        let [x, y] = [f64::from(k % 4) * 0.42 - 0.63, f64::from(k / 4) * 0.5 - 0.25];
        sim.add_rigid_object(RigidObjectCfg {
            uid: uid.into(),
            shape: ObjectShape::Sphere { radius: RADIUS },
            init_pose: Pose::translation(x, y, RADIUS),
            rgba,
            surface,
            ..Default::default()
        })?;
    }
    let placement = Placement::LookAt { eye: [0.35, -1.9, 0.95], target: [0.0, 0.0, 0.08], up: [0.0, 0.0, 1.0] };
    let camera = sim.add_sensor(
        "camera",
        CameraCfg {
            width: args.width,
            height: args.height,
            near: 0.05,
            far: 50.0,
            extrinsics: Extrinsics { placement, ..Default::default() },
            intrinsics: Intrinsics::Fovy { radians: 0.62 },
            channels: Channels { color: true, mask: true, ..Default::default() },
            renderer,
            ..Default::default()
        },
    )?;
    args.launcher.write_dump(&sim)?;
    let out = args.launcher.out_folder(true)?;
    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    // Without a viewer, the image is the only output, and one step is enough.
    let mut launcher = args.launcher.clone();
    launcher.steps = launcher.steps.or((launcher.headless && launcher.serve_address().is_none()).then_some(1));
    let progress = MainLoop::new(&launcher, 1);
    let mut step = 0;
    while !progress.should_stop(step) {
        sim.update(1);
        step += 1;
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    recording.finish(&mut sim)?;

    let camera = sim.sensor(camera)?;
    let color: Vec<u8> = camera.color()?.index_axis(Axis(0), 0).iter().copied().collect();
    let mask: Vec<i32> = camera.mask()?.index_axis(Axis(0), 0).iter().copied().collect();
    image_file::write_png(&out.join("surfaces.png"), &image_file::color_image([args.width, args.height], &color))?;
    let means: serde_json::Map<_, _> = sim
        .scene()
        .mask_ids()
        .iter()
        .filter_map(|id| {
            let pixels = color.as_chunks::<4>().0.iter().zip(&mask).filter(|(_, mask)| **mask == id.id);
            let (sum, count) = pixels.fold(([0.0; 3], 0usize), |(sum, count), (pixel, _)| {
                ([0, 1, 2].map(|k| sum[k] + f64::from(pixel[k])), count + 1)
            });
            (count > 0).then(|| (id.name(), json!(sum.map(|sum| sum / count as f64))))
        })
        .collect();
    println!("Written to {}", out.join("surfaces.png").display());
    if !matches!(renderer, Renderer::RayTraced { .. }) {
        println!("This renderer shows glass and water as opaque: --renderer rt refracts light in them.");
    }
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "threads": sim.threads(),
        "renderer": renderer,
        "lamp_radius": args.lamp_radius,
        "steps": step,
        "mean_colors": means,
        "env_steps_per_second": rate,
        "warnings": sim.warnings().counts(),
    }))
}
