//! CPU rendering of cameras, compared with MuJoCo's own renderer on OSMesa, PyBullet's TinyRenderer and MuJoCo Warp's
//! ray caster.
//!
//! All renderers draw the same geoms from the same camera. This is checked: every baseline's depth image must agree
//! with ours.
//!
//! Our renderer fills color, depth, mask and normals; the baselines fill color, depth and segmentation (none of them
//! has normals). Baselines that render one image after the other render only a few environments per turn: rates are
//! images per second of each side. OSMesa uses all cores and is compared with two of our threads; the other baselines
//! use one core and are compared with one thread.
//!
//! `plain` is without shadows and with one sample per pixel, `full` with shadows and four samples. Reflections are off
//! in MuJoCo; ours has them in `full`. "MuJoCo on OSMesa" is `mujoco.Renderer` at its best settings
//! (`baselines/mujoco_osmesa.py`). "OSMesa by hand" calls the library with two passes instead of three, which that
//! class does not offer. Shadow maps have the default size of each side, 4096 texels in MuJoCo and at most 1024 in
//! ours. Another row reduces MuJoCo's shadow maps to the size of ours.

mod hardware_limits;
mod ray_casting;
mod scene;
mod sides;

pub(crate) use ray_casting::ray_casting;
pub(crate) use scene::Scene;

use crate::baseline::{can_run, python};
use crate::interleave::{Contender, MeasurementCfg, Times, measure};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use hardware_limits::{ComputeLoop, CopyLoop};
use kinetoscope::render::Renderer;
use scene::Scenes;
use sides::{Baseline, BaselineRenderer, OurRenderer, Quality, Work};
use std::ffi::OsString;

/// Steps between restarts: the scenes hardly move.
const STEPS: u32 = 1_000_000;
/// Number of environments in the batches, and for large images.
const BATCH: usize = 64;
const SMALL_BATCH: usize = 8;
/// Physics steps per image, for cases with physics: a camera with 50 Hz and steps of 5 ms.
const PHYSICS_STEPS: u32 = 4;
const VGA: [usize; 2] = [640, 480];

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let baselines = Baselines::new();
    let scenes = Scenes::new()?;
    let mut rows = Vec::new();
    // The benchmark takes minutes, so results are shown as they are measured.
    let mut add = |new: Vec<Row>| {
        for row in &new {
            let ratio = row.ratio.map_or_else(String::new, |ratio| format!(", {ratio:.1} x {}", row.baseline_name));
            eprintln!("    {}: {:.1} {}{ratio}", row.case, row.ours, row.unit);
        }
        rows.extend(new);
    };
    if let Some(humanoid) = &scenes.humanoid {
        for side in [64, 128] {
            add(per_core(settings, &baselines, humanoid, [side, side], BATCH)?);
        }
        add(large(settings, &baselines, humanoid, [10.0, 50.0])?);
    }
    if let Some(vendor) = &scenes.vendor {
        add(large(settings, &baselines, vendor, [10.0, 20.0])?);
    }
    add(stepping(settings, &baselines, &scenes.bundled)?);
    if let Some(humanoid) = &scenes.humanoid {
        add(scaling(settings, humanoid)?);
    }
    Ok(rows)
}

/// The baselines installed on this machine.
struct Baselines {
    python: Option<OsString>,
    missing: Vec<BaselineRenderer>,
}

impl Baselines {
    fn new() -> Self {
        let python = python("camera baselines");
        let all =
            [BaselineRenderer::OsMesa, BaselineRenderer::OsMesaTwoPass, BaselineRenderer::Tiny, BaselineRenderer::Warp];
        let missing =
            python.iter().flat_map(|python| all.into_iter().filter(|r| !can_run(python, r.probe()))).collect();
        for renderer in &missing {
            let renderer: &BaselineRenderer = renderer;
            eprintln!("  without {}: `{}` fails", renderer.name(), renderer.probe());
        }
        Self { python, missing }
    }

    fn start(&self, renderer: BaselineRenderer, scene: &Scene, work: &Work) -> BenchResult<Option<Baseline>> {
        match &self.python {
            Some(python) if !self.missing.contains(&renderer) => {
                Baseline::start(python, renderer, scene, work).map(Some)
            }
            _ => Ok(None),
        }
    }
}

/// Sides that take turns, and the number of images that each renders per step.
#[derive(Default)]
struct Comparison<'s> {
    sides: Vec<(f64, Box<dyn Contender + 's>)>,
}

impl<'s> Comparison<'s> {
    fn ours(&mut self, scene: &'s Scene, work: &Work, threads: usize) -> BenchResult<usize> {
        self.ours_with_renderer(scene, work, threads, Renderer::Raster)
    }

    fn ours_with_renderer(
        &mut self,
        scene: &'s Scene,
        work: &Work,
        threads: usize,
        by: Renderer,
    ) -> BenchResult<usize> {
        let ours = OurRenderer::new(scene, work, threads, by)?;
        self.sides.push((work.envs as f64, Box::new(ours)));
        Ok(self.sides.len() - 1)
    }

    /// Adds a baseline if it is installed; its depth image must agree with our rasterizer's.
    fn baseline(
        &mut self,
        baselines: &Baselines,
        renderer: BaselineRenderer,
        scene: &'s Scene,
        work: &Work,
    ) -> BenchResult<Option<usize>> {
        self.baseline_for_renderer(baselines, renderer, scene, work, Renderer::Raster)
    }

    /// Adds a baseline that is compared with one of our renderers.
    fn baseline_for_renderer(
        &mut self,
        baselines: &Baselines,
        renderer: BaselineRenderer,
        scene: &'s Scene,
        work: &Work,
        by: Renderer,
    ) -> BenchResult<Option<usize>> {
        let Some(mut baseline) = baselines.start(renderer, scene, work)? else { return Ok(None) };
        let mut ours = OurRenderer::new(scene, &Work { envs: 1, physics: 0, ..*work }, 1, by)?;
        baseline.check_depth(&ours.depth()?, work.size)?;
        let (ours, theirs) = (scene.triangles(), baseline.triangles()?);
        if ours != theirs {
            return Err(format!("{} draws {theirs} triangles, ours {ours}", renderer.name()).into());
        }
        self.sides.push((renderer.images(work) as f64, Box::new(baseline)));
        Ok(Some(self.sides.len() - 1))
    }

    fn run(mut self, seconds: f64) -> BenchResult<Rates> {
        let mut sides: Vec<&mut dyn Contender> = Vec::new();
        for (_, side) in &mut self.sides {
            sides.push(&mut **side);
        }
        let times = measure(MeasurementCfg { seconds, restart_after: STEPS }, &mut sides)?;
        Ok(Rates { times, images: self.sides.iter().map(|(images, _)| *images).collect() })
    }
}

/// Times of a comparison, with the number of images per step of each side.
struct Rates {
    times: Times,
    images: Vec<f64>,
}

impl Rates {
    /// Images per second.
    fn rate(&self, side: usize) -> f64 {
        self.images[side] / self.times.per_step(side)
    }

    fn row(&self, case: String, threads: usize, ours: usize, baseline: (BaselineRenderer, Option<usize>)) -> Row {
        let row = Row::new("camera", case, "images/s", threads, self.rate(ours));
        match baseline {
            (renderer, None) => row.without(renderer.name()),
            (renderer, Some(baseline)) => {
                let ratio = self.times.ratio(ours, baseline) * self.images[ours] / self.images[baseline];
                row.against(renderer.name(), self.rate(baseline), ratio)
            }
        }
    }
}

/// Large images in both quality settings: two threads against OSMesa, one thread against the other baselines.
fn large(settings: &Settings, baselines: &Baselines, scene: &Scene, wanted: [f64; 2]) -> BenchResult<Vec<Row>> {
    let [width, height] = VGA;
    let name = |look: &str| format!("{}, {width}x{height}, {look}", scene.name);
    eprintln!("  {}, {width}x{height}: {} triangles", scene.name, scene.triangles());
    let plain = Work { size: VGA, envs: SMALL_BATCH, physics: 0, look: Quality::Plain, shadow_size: None };
    let full = Work { look: Quality::Full, ..plain };
    let mut contest = Comparison::default();
    let ours = contest.ours(scene, &plain, 2)?;
    let ours_full = contest.ours(scene, &full, 2)?;
    let osmesa = contest.baseline(baselines, BaselineRenderer::OsMesa, scene, &plain)?;
    let osmesa_full = contest.baseline(baselines, BaselineRenderer::OsMesa, scene, &full)?;
    let by_hand = contest.baseline(baselines, BaselineRenderer::OsMesaTwoPass, scene, &plain)?;
    let by_hand_full = contest.baseline(baselines, BaselineRenderer::OsMesaTwoPass, scene, &full)?;
    let shadows_as_ours = Work { shadow_size: Some(1024), ..full };
    let by_hand_small = contest.baseline(baselines, BaselineRenderer::OsMesaTwoPass, scene, &shadows_as_ours)?;
    let copying = contest.sides.len();
    contest.sides.push((1.0, Box::new(CopyLoop::new(2))));
    let rates = contest.run(3.0 * settings.seconds)?;
    let against = |look: &str, ours, baseline| rates.row(name(look), 2, ours, baseline);
    let mut rows = vec![
        against("plain", ours, (BaselineRenderer::OsMesa, osmesa)).with_target_ratio(wanted[0]),
        against("full", ours_full, (BaselineRenderer::OsMesa, osmesa_full)).with_target_ratio(wanted[1]),
        against("plain", ours, (BaselineRenderer::OsMesaTwoPass, by_hand)),
        against("full", ours_full, (BaselineRenderer::OsMesaTwoPass, by_hand_full)),
        against("full, shadow maps of 1024", ours_full, (BaselineRenderer::OsMesaTwoPass, by_hand_small)),
    ];
    for (look, side) in [("plain", ours), ("full", ours_full)] {
        // Color, depth and mask take 4 bytes per pixel each, a normal 12.
        let seconds = (width * height * 24) as f64 * rates.times.per_step(copying) / CopyLoop::BYTES as f64;
        let distance = rates.times.median_of(|t| t[side] / rates.images[side]) / seconds;
        rows.push(Row::new("camera", name(look), "x of bandwidth limit", 2, distance).against(
            "copy loop",
            1.0,
            1.0 / distance,
        ));
    }
    rows.extend(per_core(settings, baselines, scene, VGA, SMALL_BATCH)?);
    Ok(rows)
}

/// Stepping and rendering of environments on two threads.
fn stepping(settings: &Settings, baselines: &Baselines, scene: &Scene) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for side in [64, 128, 256] {
        let name = |look: &str| format!("{}, {BATCH} envs, {PHYSICS_STEPS} steps + {side}x{side}, {look}", scene.name);
        eprintln!("  {}", name("plain and full"));
        let plain =
            Work { size: [side, side], envs: BATCH, physics: PHYSICS_STEPS, look: Quality::Plain, shadow_size: None };
        let full = Work { look: Quality::Full, ..plain };
        let mut contest = Comparison::default();
        let ours = contest.ours(scene, &plain, 2)?;
        let ours_full = contest.ours(scene, &full, 2)?;
        if side != 128 {
            let rates = contest.run(0.5 * settings.seconds)?;
            for (look, ours) in [("plain", ours), ("full", ours_full)] {
                rows.push(Row::new("camera", name(look), "images/s", 2, rates.rate(ours)));
            }
            continue;
        }
        let osmesa = contest.baseline(baselines, BaselineRenderer::OsMesa, scene, &plain)?;
        let osmesa_defaults =
            contest.baseline(baselines, BaselineRenderer::OsMesa, scene, &Work { look: Quality::Defaults, ..plain })?;
        let rates = contest.run(2.0 * settings.seconds)?;
        rows.push(rates.row(name("plain"), 2, ours, (BaselineRenderer::OsMesa, osmesa)).with_target_ratio(10.0));
        let defaults = rates.row(
            name("full, baseline at its defaults"),
            2,
            ours_full,
            (BaselineRenderer::OsMesa, osmesa_defaults),
        );
        rows.push(defaults.with_target_ratio(50.0));
    }
    Ok(rows)
}

/// One thread against the single-threaded baselines.
fn per_core(
    settings: &Settings,
    baselines: &Baselines,
    scene: &Scene,
    size: [usize; 2],
    envs: usize,
) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for look in [Quality::Plain, Quality::Full] {
        let name = format!("{}, {envs} x {}x{}, {}", scene.name, size[0], size[1], look.name());
        eprintln!("  {name}, one core");
        let work = Work { size, envs, physics: 0, look, shadow_size: None };
        let mut contest = Comparison::default();
        let ours = contest.ours(scene, &work, 1)?;
        let warp = contest.baseline(baselines, BaselineRenderer::Warp, scene, &work)?;
        // TinyRenderer has no multisampling.
        let has_tiny = look == Quality::Plain;
        let tiny = if has_tiny { contest.baseline(baselines, BaselineRenderer::Tiny, scene, &work)? } else { None };
        let rates = contest.run(settings.seconds)?;
        let row = rates.row(name.clone(), 1, ours, (BaselineRenderer::Warp, warp));
        // The target applies to batches of small images.
        rows.push(if has_tiny && envs == BATCH { row.with_target_ratio(5.0) } else { row });
        if has_tiny {
            rows.push(rates.row(name, 1, ours, (BaselineRenderer::Tiny, tiny)));
        }
    }
    Ok(rows)
}

/// Speed-up of two threads over one, compared with that of a compute loop on this machine.
fn scaling(settings: &Settings, scene: &Scene) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for (size, envs) in [(VGA, SMALL_BATCH), ([128, 128], BATCH)] {
        for look in [Quality::Plain, Quality::Full] {
            let work = Work { size, envs, physics: 0, look, shadow_size: None };
            let mut contest = Comparison::default();
            contest.ours(scene, &work, 1)?;
            contest.ours(scene, &work, 2)?;
            for threads in [1, 2] {
                contest.sides.push((1.0, Box::new(ComputeLoop::new(threads))));
            }
            let times = contest.run(settings.seconds)?.times;
            let name = format!("{}, {envs} x {}x{}, {}", scene.name, size[0], size[1], look.name());
            let [ours, compute_only] = [times.median_of(|t| t[0] / t[1]), times.median_of(|t| t[2] / t[3])];
            let ratio = times.median_of(|t| (t[0] / t[1]) / (t[2] / t[3]));
            // A speed-up of 1.8 where the compute loop has 1.9.
            rows.push(
                Row::new("camera", name, "speed-up", 2, ours)
                    .against("compute loop", compute_only, ratio)
                    .with_target_ratio(1.8 / 1.9),
            );
        }
    }
    Ok(rows)
}
