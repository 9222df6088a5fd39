//! A height scanner on balls that roll over rough terrain.
//!
//! ```text
//! cargo run --release --example run_ray_caster -- --headless --num-envs 4 --steps 1000 --out images
//! ```

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program prints")]

mod launcher;

use clap::Parser;
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use kinetoscope::scene::terrain::RoughTerrain;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayAlignment, RayCaster, RayCasterCfg};
use kinetoscope::sim::{RigidObjectId, TerrainId};
use launcher::{Launcher, MainLoop, stage};
use serde_json::{Value, json};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Drops a ball on rough terrain in every environment and measures the ground around it with rays.
#[derive(Debug, Parser)]
#[command(name = "run_ray_caster", mut_arg("num_envs", |arg| arg.default_value("4")))]
struct Args {
    #[command(flatten)]
    launcher: Launcher,
    /// Steps between resets of the balls to random positions and velocities; 0 for one reset at the start
    #[arg(long, alias = "reset_every", default_value_t = 250)]
    reset_every: u64,
    /// Distance between neighboring rays, in meters
    #[arg(long, default_value_t = 0.1)]
    resolution: f64,
    /// Distance between neighboring points of the terrain, in meters
    #[arg(long, default_value_t = 0.2)]
    cell: f64,
    /// Height of the highest points of the terrain, in meters
    #[arg(long, default_value_t = 0.12)]
    roughness: f64,
}

/// Side of the terrain \[m\].
const SIDE: f64 = 8.0;
/// Steps between two lines of output.
const REPORT_EVERY: u64 = 50;

fn main() -> ExitCode {
    launcher::run("run_ray_caster", || run(&Args::parse()))
}

/// The ball, its terrain and its scanner.
struct Scene {
    ball: RigidObjectId,
    terrain: TerrainId,
    scanner: SensorId<RayCaster>,
}

/// Statistics of the whole run.
#[derive(Debug, Default)]
struct Totals {
    /// Durations of the steps without the scanner, and with it.
    stepping: [Vec<Duration>; 2],
    hits: u64,
    misses: u64,
    /// Largest vertical distance of a hit from the terrain's surface \[m\].
    worst: f64,
    lines: Vec<Value>,
}

fn run(args: &Args) -> launcher::Result {
    let mut sim = SimulationManager::new(SimulationManagerCfg {
        ground: None,
        arena_space: args.launcher.arena_space.unwrap_or(SIDE),
        ..args.launcher.simulation()?
    })?;
    let terrain = sim.add_terrain(terrain_cfg(args)?)?;
    let ball = sim.add_rigid_object(RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: 0.25 },
        mass: Some(0.5),
        init_pose: Pose::translation(0.0, 0.0, 1.0),
        rgba: [0.1, 0.25, 0.8, 1.0],
        ..Default::default()
    })?;
    let mut noise: Vec<KeyedRng> =
        (0..sim.num_envs()).map(|env| KeyedRng::keyed(args.launcher.seed, env as u64, "reset")).collect();
    // The same steps without the scanner show its cost.
    randomize_ball(&mut sim, ball, &mut noise.clone())?;
    let mut totals = Totals::default();
    let bare_steps = args.launcher.steps.unwrap_or(250).min(250);
    for _ in 0..bare_steps {
        let start = Instant::now();
        sim.update(1);
        totals.stepping[0].push(start.elapsed());
    }

    let scanner = sim.add_sensor("scanner", scanner_cfg(args))?;
    args.launcher.write_dump(&sim)?;
    println!("{}", sim.sensor(scanner)?);
    let scene = Scene { ball, terrain, scanner };
    args.launcher.serve(&mut sim)?;
    args.launcher.open_window(&mut sim);
    let recording = args.launcher.start_recording(&mut sim)?;
    let progress = MainLoop::new(&args.launcher, 1000);
    let mut step = 0;
    while !progress.should_stop(step) {
        if step == 0 || (args.reset_every > 0 && step % args.reset_every == 0) {
            randomize_ball(&mut sim, ball, &mut noise)?;
            progress.print_line("[INFO]: Resetting the balls...");
        }
        let start = Instant::now();
        sim.update(1);
        totals.stepping[1].push(start.elapsed());
        step += 1;
        totals.count(&sim, &scene)?;
        if step % REPORT_EVERY == 0 {
            let line = summary(&sim, &scene)?;
            progress.print_line(&line.0);
            totals.lines.push(line.1);
        }
        progress.advance(step);
    }
    let rate = progress.env_steps_per_second(step, sim.num_envs());
    let rays = sim.sensor(scanner)?.num_rays();
    let [bare, scanned] = totals.stepping.map(median_ms);
    println!(
        "\nA step of {} environments takes {bare:.3} ms without rays and {scanned:.3} ms with {rays} rays in each, on {} threads",
        sim.num_envs(),
        sim.threads()
    );
    println!("{} hits, {} misses; hits lie on the terrain to {:.1e} m", totals.hits, totals.misses, totals.worst);
    if let Some(out) = &args.launcher.out {
        launcher::make_folder(out)?;
        let origins = sim.cfg().env_origins();
        let reach = origins.iter().fold(SIDE / 2.0, |far: f64, x| far.max(x.abs() + 1.5));
        let (markers, file) = (sim.scene().markers(), out.join("run_ray_caster.png"));
        stage::write(&mut sim, &markers, [1.3 * reach, 1.6 * reach, 1.2 * reach], [0.6, 0.7, -0.5], &file)?;
        println!("Image written to {}", file.display());
    }
    recording.finish(&mut sim)?;
    args.launcher.write_report(&json!({
        "mujoco_version": kinetoscope::mujoco::version_string(),
        "num_envs": sim.num_envs(),
        "steps": step,
        "threads": sim.threads(),
        "rays_per_sensor": rays,
        "hits": totals.hits,
        "misses": totals.misses,
        "largest_distance_of_hits_from_the_terrain": totals.worst,
        "terrain_height_range": sim.entities().terrain(terrain).height_range(),
        "ms_per_step_without_rays": bare,
        "ms_per_step_with_rays": scanned,
        "rays_per_second": (scanned > bare).then(|| (rays * sim.num_envs()) as f64 / (scanned - bare) * 1e3),
        "env_steps_per_second": rate,
        "measurements": totals.lines,
        "warnings": sim.warnings().counts(),
    }))
}

fn terrain_cfg(args: &Args) -> launcher::Result<TerrainCfg> {
    let rough = RoughTerrain {
        size: [SIDE; 2],
        cell: args.cell,
        range: [0.0, args.roughness],
        step: 0.02,
        seed: args.launcher.seed,
    };
    let mut heights = rough.heights()?;
    // Environments stand side by side, so both terrains get the lowest height along their common edge. Otherwise the
    // wall of the higher terrain shows as a dark seam.
    for axis in [Axis(0), Axis(1)] {
        for edge in [0, heights.len_of(axis) - 1] {
            heights.index_axis_mut(axis, edge).fill(rough.range[0]);
        }
    }
    Ok(TerrainCfg { heights, size: rough.size, ..Default::default() })
}

/// Isaac Lab's height scanner: a square of 2 m around the ball that turns with the heading only.
fn scanner_cfg(args: &Args) -> RayCasterCfg {
    RayCasterCfg {
        parent: Some("ball".into()),
        alignment: RayAlignment::Yaw,
        pattern: Grid { resolution: args.resolution, size: [2.0; 2], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec!["terrain".into()]),
        debug_vis: true,
        ..RayCasterCfg::default()
    }
}

/// Resets the simulation, then puts every ball at a random place near its start, with a random horizontal velocity.
fn randomize_ball(sim: &mut SimulationManager, ball: RigidObjectId, noise: &mut [KeyedRng]) -> launcher::Result {
    sim.reset(None)?;
    let mut between = |env: usize, most: f64| most * (2.0 * noise[env].uniform() - 1.0);
    let mut poses = sim.rigid_object(ball).pose();
    let mut velocities = Array2::zeros((sim.num_envs(), 6));
    for env in 0..sim.num_envs() {
        for axis in 0..2 {
            poses[(env, axis)] += between(env, 0.5);
            velocities[(env, axis)] = between(env, 0.5);
        }
    }
    let mut ball = sim.rigid_object_mut(ball);
    ball.write_pose(&poses, None)?;
    Ok(ball.write_velocity(&velocities, None)?)
}

impl Totals {
    /// Compares every hit with the height of the terrain at that place.
    fn count(&mut self, sim: &SimulationManager, scene: &Scene) -> launcher::Result {
        let (scanner, terrain) = (sim.sensor(scene.scanner)?, sim.entities().terrain(scene.terrain));
        for hit in scanner.hits().rows() {
            if !hit[2].is_finite() {
                self.misses += 1;
                continue;
            }
            self.hits += 1;
            // The terrain stands in the middle of its environment, without rotation.
            if let Some(height) = terrain.height_at([hit[0], hit[1]]) {
                self.worst = self.worst.max((height - hit[2]).abs());
            }
        }
        Ok(())
    }
}

/// The median duration \[ms\], which other programs on the machine disturb little.
fn median_ms(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    times.get(times.len() / 2).map_or(0.0, Duration::as_secs_f64) * 1e3
}

/// Position of the ball of environment 0, and the range of heights that its rays hit: as text, and for the report.
fn summary(sim: &SimulationManager, scene: &Scene) -> launcher::Result<(String, Value)> {
    let (scanner, pose) = (sim.sensor(scene.scanner)?, sim.rigid_object(scene.ball).pose());
    let of_first = scanner.hits().index_axis_move(Axis(0), 0);
    let heights: Vec<f64> = of_first.rows().into_iter().map(|hit| hit[2]).filter(|z| z.is_finite()).collect();
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(*z), b.max(*z)));
    let (low, high) = (low.is_finite().then_some(low), high.is_finite().then_some(high));
    let time = sim.time().first().copied().unwrap_or(0.0);
    let shape = scanner.hits().dim();
    let ball = [0, 1, 2].map(|k| pose[(0, k)]);
    let [x, y, z] = ball;
    let text = match (low, high) {
        (Some(low), Some(high)) => format!(
            "t = {time:5.2} s: ball 0 at ({x:6.3}, {y:6.3}, {z:6.3}) m, hits {shape:?} at {low:.3} to {high:.3} m"
        ),
        _ => format!("t = {time:5.2} s: ball 0 at ({x:6.3}, {y:6.3}, {z:6.3}) m, no hits"),
    };
    Ok((text, json!({ "time": time, "ball_0": ball, "hits": heights.len(), "lowest": low, "highest": high })))
}
