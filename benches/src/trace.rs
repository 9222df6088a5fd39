//! Ray tracing on one thread: what is seen of the vendor's SR5 (the bundled one where it is not there) where it covers about
//! 40 % of a picture, paths in a closed lit box around it, and how long its trees take to build. Against what we want; whole
//! pictures by rays also against MuJoCo Warp's ray caster, where it is on the machine.
//!
//! What we want is said of a core. A machine that others use too lends its cores' other halves to them, which no counter of ours
//! shows: there, the same work takes 1.0 to 1.4 times as long from one second to the next. With a rival in turns that cancels
//! out; against a number, what counts is the repetition that a tenth of all are faster than.

use crate::camera::by_rays;
use crate::row::Row;
use crate::startup::robots;
use crate::{Outcome, Settings};
use kinetoscope::prelude::*;
use kinetoscope::scene::shape::Plane;
use kinetoscope::scene::{Instance, Light, LightKind, Material, PoseF32, RenderScene};
use kinetoscope::sensors::camera::{Frame, ParallelRasterizer, Shot};
use kinetoscope::sensors::ray::{RayAssets, RayTargets};
use kinetoscope::sensors::visibility::View;
use kinetoscope::sim::Still;
use std::time::Instant;

const SIZE: [usize; 2] = [640, 480];
/// The part of the picture that the robot covers.
const COVERED: f64 = 0.4;
/// Half the side of the box \[m\].
const WALL: f32 = 1.5;
/// What we want: rays per second, paths per second, nanoseconds per triangle.
const RAYS: f64 = 8e6;
const PATHS: f64 = 0.3e6;
const BUILD: f64 = 60.0;

pub(crate) fn run(settings: &Settings) -> Outcome<Vec<Row>> {
    let vendor = robots().map(|dir| dir.join("rokae_description/urdf/SR5.urdf")).filter(|file| file.exists());
    let name = if vendor.is_some() { "vendor SR5" } else { "bundled SR5" };
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() })?;
    let urdf = UrdfCfg::single(match vendor {
        Some(file) => file,
        None => assets::path("sr5/SR5.urdf")?,
    });
    sim.add_robot(RobotCfg { urdf, ..Default::default() })?;
    let still = Still::of_env(&mut sim, EnvId(0))?;
    let (view, hits) = covering(&still)?;
    let shot = still.shot(&view);
    let pixels = (SIZE[0] * SIZE[1]) as f64;
    let geometry = Channels { depth: true, mask: true, ..Channels::default() };
    let (time, _) = seconds(settings, Renderer::FastRayTraced, geometry, &shot)?;
    let (rays, met) = (pixels / time, hits as f64 / time);

    let (scene, poses) = boxed(&still, &shot)?;
    let inside = View::look_at(SIZE, 0.9, [1.2, -1.1, 1.1], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0])?;
    let shot = Shot { scene: &scene, poses: &poses, view: &inside, lights: None, lens: None, before: None };
    let color = Channels { color: true, ..Channels::default() };
    let renderer = Renderer::RayTraced { samples: 1, max_bounces: 4, denoise: false, seed: 0 };
    let (time, cast) = seconds(settings, renderer, color, &shot)?;
    let paths = pixels / time;

    let scene = still.visible().scene();
    let (mut times, begin) = (Vec::new(), Instant::now());
    while times.len() < 5 || begin.elapsed().as_secs_f64() < settings.seconds {
        let start = Instant::now();
        let targets = RayTargets::new(scene, 0..scene.instances().len(), &RayAssets::default());
        times.push(start.elapsed().as_secs_f64());
        drop(targets);
    }
    let build = 1e9 * undisturbed(times) / scene.triangle_count() as f64;
    // What a picture's rays take: the lamps' light, the sky, masks and normals, and writing all of it, come on top.
    let pictures = by_rays(settings, COVERED)?;
    let at_least = |case: String, unit: &str, ours: f64, aim: f64| {
        Row::new("trace", case, unit, 1, ours).against("aim", aim, ours / aim).wanted(1.0)
    };
    Ok(vec![
        at_least(format!("{name}, what is seen, 640x480"), "rays/s", rays, RAYS),
        // Those that pass by cost little.
        Row::new("trace", format!("{name}, what is seen, 640x480, rays that meet it"), "rays/s", 1, met),
        pictures,
        at_least(format!("{name} in a lit box, 4 bounces"), "paths/s", paths, PATHS),
        // Where the time of a path goes: rays that go on and shadow rays.
        Row::new("trace", format!("{name} in a lit box, rays of a path"), "rays/path", 1, cast as f64 / pixels),
        Row::new("trace", format!("{name} in a lit box, rays of paths"), "rays/s", 1, cast as f64 / time),
        Row::new("trace", format!("{name}, trees"), "ns/triangle", 1, build)
            .against("aim", BUILD, BUILD / build)
            .wanted(1.0),
    ])
}

/// Time of a picture \[s\], and how many rays were cast for its paths.
fn seconds(settings: &Settings, renderer: Renderer, channels: Channels, shot: &Shot<'_>) -> Outcome<(f64, u64)> {
    let mut rasterizer = ParallelRasterizer::new(RasterCfg { samples: 1, ..RasterCfg::default() }, 1);
    rasterizer.set_renderer(renderer);
    let mut frame = Frame::new(SIZE[0], SIZE[1], channels);
    let mut times = Vec::new();
    let begin = Instant::now();
    // The first picture builds the trees.
    while times.len() < 2 || begin.elapsed().as_secs_f64() < settings.seconds {
        let start = Instant::now();
        rasterizer.render(&mut [(*shot, frame.as_mut())]).map_err(|(_, error)| error)?;
        times.push(start.elapsed().as_secs_f64());
    }
    Ok((undisturbed(times.split_off(1)), rasterizer.progress().rays()))
}

/// The time that a tenth of all are faster than; NaN of nothing.
fn undisturbed(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 10).copied().unwrap_or(f64::NAN)
}

/// A view of which the robot covers about [`COVERED`], and how many pixels these are.
fn covering(still: &Still) -> Outcome<(View, usize)> {
    let mut rasterizer = ParallelRasterizer::new(RasterCfg::default(), 1);
    let (mut near, mut far) = (0.2f32, 4.0f32);
    loop {
        let distance = 0.5 * (near + far);
        let eye = [0.8 * distance, -0.55 * distance, 0.5 + 0.2 * distance];
        let view = View::look_at(SIZE, 0.8, eye, [0.0, 0.0, 0.5], [0.0, 0.0, 1.0])?;
        let mut frame = Frame::new(SIZE[0], SIZE[1], Channels { mask: true, ..Channels::default() });
        rasterizer.render(&mut [(still.shot(&view), frame.as_mut())]).map_err(|(_, error)| error)?;
        let hits = frame.mask.iter().flatten().filter(|&&id| id != 0).count();
        let covered = hits as f64 / (SIZE[0] * SIZE[1]) as f64;
        if (covered - COVERED).abs() < 0.01 || far - near < 1e-3 {
            eprintln!("  the robot covers {:.0} % from {distance:.2} m", 100.0 * covered);
            return Ok((view, hits));
        }
        if covered > COVERED { near = distance } else { far = distance }
    }
}

/// The robot in a room of six walls, with a lamp under the ceiling.
fn boxed(still: &Still, shot: &Shot<'_>) -> Outcome<(RenderScene, Vec<PoseF32>)> {
    let mut instances = still.visible().scene().instances().to_vec();
    let mut poses = shot.poses.to_vec();
    let material = Material { specular: 0.0, ..Material::from_rgba([0.8, 0.8, 0.8, 1.0]) };
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            // Columns are the axes of a wall: its normal looks inward.
            let mut normal = [0.0; 3];
            normal[axis] = -sign;
            let mut along = [0.0; 3];
            along[(axis + 1) % 3] = 1.0;
            let across = [0, 1, 2].map(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                normal[i] * along[j] - normal[j] * along[i]
            });
            let rotation = [0, 1, 2].map(|k| [along[k], across[k], normal[k]]);
            let mut translation = [0.0, 0.0, WALL];
            translation[axis] += sign * WALL;
            instances.push(Instance::new(Plane { half: [WALL; 2] }, material.clone(), 1));
            poses.push(PoseF32 { rotation, translation });
        }
    }
    let mut scene = still.visible().scene().with_instances(instances)?;
    let kind = LightKind::Point;
    scene.lights = vec![Light { kind, position: [0.3, 0.2, 2.6], radius: 0.1, ..Light::default() }];
    Ok((scene, poses))
}

#[cfg(test)]
mod tests {
    use super::undisturbed;

    #[test]
    fn a_tenth_is_faster() {
        assert_eq!(undisturbed((0..40).rev().map(f64::from).collect()), 4.0);
        assert_eq!(undisturbed(vec![2.0, 1.0]), 1.0);
        assert!(undisturbed(Vec::new()).is_nan());
    }
}
