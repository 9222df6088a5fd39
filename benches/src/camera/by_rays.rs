//! Pictures whose every pixel is a ray, ours and MuJoCo Warp's: one core each, the same robot from the same place.

use super::scene::{Scene, Scenes};
use super::sides::{Look, Renderer, Work};
use super::{Contest, Rivals, VGA};
use crate::row::Row;
use crate::{Outcome, Settings};
use kinetoscope::sensors::camera::Renderer as OurRenderer;

/// Pictures in a step.
const ENVS: usize = 4;
/// Times of the ratio that was set as the aim.
const WANTED: f64 = 2.0;

/// Colour, depth and mask (ours also normals) of the vendor's SR5, which covers this part of the picture; the bundled robot
/// where there is none.
pub(crate) fn by_rays(settings: &Settings, covered: f64) -> Outcome<Row> {
    let Scenes { vendor, bundled, .. } = Scenes::new()?;
    let scene: Scene = vendor.unwrap_or(bundled).covering(covered)?;
    let [width, height] = VGA;
    let work = Work { size: VGA, envs: ENVS, physics: 0, look: Look::Plain, shadow_size: None };
    let mut contest = Contest::default();
    let ours = contest.ours_by(&scene, &work, 1, OurRenderer::FastRayTraced)?;
    let warp = contest.rival(&Rivals::new(), Renderer::Warp, &scene, &work)?;
    let rates = contest.run(settings.seconds)?;
    let case = format!("{}, {width}x{height}, plain, by rays", scene.name);
    Ok(Row { bench: "trace".into(), ..rates.row(case, 1, ours, (Renderer::Warp, warp)).wanted(WANTED) })
}
