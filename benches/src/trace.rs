//! Ray tracing on one thread, on the vendor's SR5 (or the bundled one without the vendor's files).
//!
//! There are three measurements: primary rays with the robot covering 40 % of an image, paths in a closed lit box
//! around the robot, and the build time of its BVHs. Each is compared with a target; whole ray-cast images also with
//! MuJoCo Warp's ray caster, if it is on the machine. Collision shapes are neither rendered nor built.
//!
//! Rows in percent split the time by leaving work out: the same image without the robot, the same paths without shadow
//! rays, the same paths that end at the first surface. All variants take turns with the full work.

use crate::camera::{Scene, ray_casting};
use crate::interleave::{Contender, MeasurementCfg, Times, measure};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::mujoco::trim_heap;
use kinetoscope::prelude::*;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::render::geometry::{RayAssetCache, RayTargets};
use kinetoscope::render::{ParallelRenderer, RenderRequest};
use kinetoscope::scene::shape::Plane;
use kinetoscope::scene::{Instance, Light, LightKind, Material, PoseF32, RenderScene};
use std::time::{Duration, Instant};

const SIZE: [usize; 2] = [640, 480];
/// Share of the image that the robot covers.
const COVERED: f64 = 0.4;
/// Half of the box's side \[m\].
const BOX_HALF_SIZE: f32 = 1.5;
/// Targets: rays per second, paths per second, nanoseconds per triangle.
const TARGET_RAYS: f64 = 8e6;
const TARGET_PATHS: f64 = 0.3e6;
const TARGET_BUILD_NS: f64 = 60.0;
/// Steps until a restart: never reached.
const RESTART_AFTER: u32 = 1_000_000;

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let scene = Scene::arm_alone()?.with_coverage(COVERED)?;
    let name = scene.name;
    let (robot, poses) = scene.rendered(0)?;
    let view = scene.view(SIZE)?;
    let pixels = (SIZE[0] * SIZE[1]) as f64;
    let row = |case: &str, unit: &str, ours: f64| Row::new("trace", format!("{name}, {case}"), unit, 1, ours);
    let at_least = |row: Row, aim: f64, ratio: f64| row.against("target", aim, ratio).with_target_ratio(1.0);
    let percent = |times: &Times, part: usize| 100.0 * times.median_of(|t| t[part] / t[0]);

    let geometry = Channels { depth: true, mask: true, ..Channels::default() };
    let empty = RenderScene::empty();
    let mut seen = ImageLoop::new(Renderer::FastRayTraced, geometry, request(&robot, &poses, &view));
    let mut without = ImageLoop::new(Renderer::FastRayTraced, geometry, request(&empty, &[], &view));
    let rays = times(settings, &mut [&mut seen, &mut without])?;
    let per_second = pixels / rays.per_step(0);
    let hits = seen.frame.mask.iter().flatten().filter(|&&id| id != 0).count() as f64;
    let covered = 100.0 * hits / pixels;
    let mut rows = vec![
        at_least(row("primary rays, 640x480", "rays/s", per_second), TARGET_RAYS, per_second / TARGET_RAYS),
        row("primary rays, 640x480, pixels covered by the robot", "%", covered),
        // Rays that miss the robot cost little.
        row("primary rays, 640x480, rays that hit the robot", "rays/s", hits / rays.per_step(0)),
        row("primary rays, 640x480, time without the robot", "%", percent(&rays, 1)),
        ray_casting(settings, &scene)?,
    ];

    let (boxed, poses) = in_box(&robot, &poses)?;
    let mut unshaded = boxed.clone();
    unshaded.lights.iter_mut().for_each(|light| light.cast_shadow = false);
    let inside = View::look_at(SIZE, 0.9, [1.2, -1.1, 1.1], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0])?;
    let color = Channels { color: true, ..Channels::default() };
    let by = |max_bounces| Renderer::RayTraced { samples: 1, max_bounces, denoise: false, seed: 0 };
    let mut whole = ImageLoop::new(by(4), color, request(&boxed, &poses, &inside));
    let mut without_shadows = ImageLoop::new(by(4), color, request(&unshaded, &poses, &inside));
    let mut first = ImageLoop::new(by(0), color, request(&boxed, &poses, &inside));
    let paths = times(settings, &mut [&mut whole, &mut without_shadows, &mut first])?;
    let (per_second, cast) = (pixels / paths.per_step(0), whole.rasterizer.progress().rays() as f64);
    rows.extend([
        at_least(row("in a lit box, 4 bounces", "paths/s", per_second), TARGET_PATHS, per_second / TARGET_PATHS),
        row("in a lit box, rays per path", "rays/path", cast / pixels),
        row("in a lit box, all rays of the paths", "rays/s", cast / paths.per_step(0)),
        row("in a lit box, time without shadow rays", "%", percent(&paths, 1)),
        row("in a lit box, time up to the first surface and its light", "%", percent(&paths, 2)),
    ]);

    let triangles = robot.triangle_count() as f64;
    let (mut warm, mut cold) = (BvhBuild { of: &robot, cold: false }, BvhBuild { of: &robot, cold: true });
    let trees = times(settings, &mut [&mut warm, &mut cold])?;
    let [warm, cold] = [0, 1].map(|side| 1e9 * trees.per_step(side) / triangles);
    rows.extend([
        at_least(row("BVH build", "ns/triangle", warm), TARGET_BUILD_NS, TARGET_BUILD_NS / warm),
        // The system clears pages on first use.
        row("BVH build, memory used for the first time", "ns/triangle", cold),
    ]);
    Ok(rows)
}

fn times(settings: &Settings, sides: &mut [&mut dyn Contender]) -> BenchResult<Times> {
    measure(MeasurementCfg { seconds: 2.0 * settings.seconds, restart_after: RESTART_AFTER }, sides)
}

fn request<'a>(scene: &'a RenderScene, poses: &'a [PoseF32], view: &'a View) -> RenderRequest<'a> {
    RenderRequest { scene, poses, view, lights: None, lens: None, previous: None }
}

/// Renders the same image repeatedly.
struct ImageLoop<'a> {
    rasterizer: ParallelRenderer,
    frame: Frame,
    request: RenderRequest<'a>,
}

impl<'a> ImageLoop<'a> {
    fn new(renderer: Renderer, channels: Channels, request: RenderRequest<'a>) -> Self {
        let mut rasterizer = ParallelRenderer::new(RasterCfg { samples: 1, ..RasterCfg::default() }, 1);
        rasterizer.set_renderer(renderer);
        Self { rasterizer, frame: Frame::new(SIZE[0], SIZE[1], channels), request }
    }
}

impl Contender for ImageLoop<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.rasterizer.render(&mut [(self.request, self.frame.as_mut())]).map_err(|(_, error)| error)?;
        }
        Ok(start.elapsed())
    }
}

/// Builds the BVHs of a scene repeatedly: bounds, order, nodes and reordered triangles. Dropping them is not counted.
struct BvhBuild<'a> {
    of: &'a RenderScene,
    /// True to release memory to the system before each build.
    cold: bool,
}

impl Contender for BvhBuild<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let mut taken = Duration::ZERO;
        for _ in 0..steps {
            if self.cold {
                trim_heap();
            }
            let start = Instant::now();
            let targets = RayTargets::new(self.of, 0..self.of.instances().len(), &RayAssetCache::default());
            taken += start.elapsed();
            drop(targets);
        }
        Ok(taken)
    }
}

/// The robot in a box of six walls, with a light under the ceiling.
fn in_box(robot: &RenderScene, poses: &[PoseF32]) -> BenchResult<(RenderScene, Vec<PoseF32>)> {
    let mut instances = robot.instances().to_vec();
    let mut poses = poses.to_vec();
    let material = Material { specular: 0.0, ..Material::from_rgba([0.8, 0.8, 0.8, 1.0]) };
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            // Columns are the axes of a wall; its normal points inward.
            let mut normal = [0.0; 3];
            normal[axis] = -sign;
            let mut along = [0.0; 3];
            along[(axis + 1) % 3] = 1.0;
            let across = [0, 1, 2].map(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                normal[i] * along[j] - normal[j] * along[i]
            });
            let rotation = [0, 1, 2].map(|k| [along[k], across[k], normal[k]]);
            let mut translation = [0.0, 0.0, BOX_HALF_SIZE];
            translation[axis] += sign * BOX_HALF_SIZE;
            instances.push(Instance::new(Plane { half: [BOX_HALF_SIZE; 2] }, material.clone(), 1));
            poses.push(PoseF32 { rotation, translation });
        }
    }
    let mut scene = robot.with_instances(instances)?;
    let kind = LightKind::Point;
    scene.lights = vec![Light { kind, position: [0.3, 0.2, 2.6], radius: 0.1, ..Light::default() }];
    Ok((scene, poses))
}
