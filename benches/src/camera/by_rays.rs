//! Images with one ray per pixel, ours and MuJoCo Warp's: one core each, the same robot from the same viewpoint.

use super::scene::Scene;
use super::sides::{Look, Renderer, Work};
use super::{Contest, Rivals, VGA};
use crate::row::Row;
use crate::settings::{Outcome, Settings};
use kinetoscope::render::Renderer as OurRenderer;

/// Images per step.
const ENVS: usize = 4;
/// Target of the speed ratio.
const WANTED: f64 = 2.0;

/// Benchmarks color, depth and mask of a scene (our renderer also fills normals).
pub(crate) fn by_rays(settings: &Settings, scene: &Scene) -> Outcome<Row> {
    let [width, height] = VGA;
    let work = Work { size: VGA, envs: ENVS, physics: 0, look: Look::Plain, shadow_size: None };
    let mut contest = Contest::default();
    let ours = contest.ours_by(scene, &work, 1, OurRenderer::FastRayTraced)?;
    let warp = contest.rival_of(&Rivals::new(), Renderer::Warp, scene, &work, OurRenderer::FastRayTraced)?;
    let rates = contest.run(settings.seconds)?;
    let case = format!("{}, {width}x{height}, plain, by rays", scene.name);
    Ok(Row { bench: "trace".into(), ..rates.row(case, 1, ours, (Renderer::Warp, warp)).wanted(WANTED) })
}
