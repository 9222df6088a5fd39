//! Images with one ray per pixel, ours and MuJoCo Warp's: one core each, the same robot from the same viewpoint.

use super::scene::Scene;
use super::sides::{BaselineRenderer, Quality, Work};
use super::{Baselines, Comparison, VGA};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::render::Renderer as OurRenderer;

/// Images per step.
const ENVS: usize = 4;
/// Target of the speed ratio.
const TARGET_RATIO: f64 = 2.0;

/// Benchmarks color, depth and mask of a scene (our renderer also fills normals).
pub(crate) fn ray_casting(settings: &Settings, scene: &Scene) -> BenchResult<Row> {
    let [width, height] = VGA;
    let work = Work { size: VGA, envs: ENVS, physics: 0, look: Quality::Plain, shadow_size: None };
    let mut contest = Comparison::default();
    let ours = contest.ours_with_renderer(scene, &work, 1, OurRenderer::FastRayTraced)?;
    let warp = contest.baseline_for_renderer(
        &Baselines::new(),
        BaselineRenderer::Warp,
        scene,
        &work,
        OurRenderer::FastRayTraced,
    )?;
    let rates = contest.run(settings.seconds)?;
    let case = format!("{}, {width}x{height}, plain, by rays", scene.name);
    Ok(Row {
        bench: "trace".into(),
        ..rates.row(case, 1, ours, (BaselineRenderer::Warp, warp)).with_target_ratio(TARGET_RATIO)
    })
}
