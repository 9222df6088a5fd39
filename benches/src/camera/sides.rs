//! The compared renderers: our rasterizer in this process, baselines in other processes.

use super::scene::{GROUPS, Scene};
use crate::baseline::Process;
use crate::interleave::Contender;
use crate::settings::BenchResult;
use kinetoscope::exec::ThreadPool;
use kinetoscope::render::View;
use kinetoscope::render::frame::{Channels, Frame};
use kinetoscope::render::{ParallelRenderer, RasterCfg, RenderRequest};
use kinetoscope::scene::{Light, PoseF32};
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::drive::table::DriveTable;
use serde_json::json;
use std::ffi::OsString;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Rendering quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quality {
    /// No shadows, one sample per pixel.
    Plain,
    /// Shadows, four samples per pixel; in ours also reflections.
    Full,
    /// The baseline's default settings; as `Full` in ours.
    Defaults,
}

impl Quality {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Full => "full",
            Self::Defaults => "defaults",
        }
    }
}

/// The work of every side in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Work {
    pub(super) size: [usize; 2],
    pub(super) envs: usize,
    /// Physics steps before an image.
    pub(super) physics: u32,
    pub(super) look: Quality,
    /// Width of the baseline's shadow maps \[texels\]; `None` for its default.
    pub(super) shadow_size: Option<u32>,
}

/// Our renderer: environments, and a frame for each.
pub(super) struct OurRenderer<'s> {
    scene: &'s Scene,
    batch: Batch,
    rasterizer: ParallelRenderer,
    view: View,
    physics: u32,
    poses: Vec<PoseF32>,
    lights: Vec<Light>,
    frames: Vec<Frame>,
}

impl<'s> OurRenderer<'s> {
    pub(super) fn new(
        scene: &'s Scene,
        work: &Work,
        threads: usize,
        by: kinetoscope::render::Renderer,
    ) -> BenchResult<Self> {
        let full = work.look != Quality::Plain;
        let groups = GROUPS.iter().fold(0, |mask, group| mask | 1 << group);
        let cfg = RasterCfg {
            samples: if full { 4 } else { 1 },
            shadows: full,
            reflections: full,
            groups,
            ..RasterCfg::default()
        };
        let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
        let [width, height] = work.size;
        let seen = scene.visible.scene();
        let mut ours = Self {
            scene,
            batch: Batch::new(&scene.model, &Arc::new(DriveTable::default()), work.envs, threads, ThreadPool::new())?,
            rasterizer: ParallelRenderer::new(cfg, threads).with_pool(ThreadPool::new()),
            view: scene.view(work.size)?,
            physics: work.physics,
            poses: vec![PoseF32::IDENTITY; work.envs * seen.instances().len()],
            lights: (0..work.envs).flat_map(|_| seen.lights.clone()).collect(),
            frames: vec![Frame::new(width, height, channels); work.envs],
        };
        ours.rasterizer.set_renderer(by);
        ours.restart()?;
        Ok(ours)
    }

    fn draw(&mut self) -> BenchResult<()> {
        let Self { scene, batch, rasterizer, view, poses, lights, frames, .. } = self;
        let seen = scene.visible.scene();
        let (things, light_count) = (seen.instances().len(), seen.lights.len());
        batch.for_each(|i, env| {
            let lights = &mut lights[i * light_count..(i + 1) * light_count];
            scene.visible.read_poses(env.data(), &mut poses[i * things..(i + 1) * things], lights);
        });
        let render_request = |i: usize| RenderRequest {
            scene: seen,
            poses: &poses[i * things..(i + 1) * things],
            view,
            lights: Some(&lights[i * light_count..(i + 1) * light_count]),
            lens: None,
            previous: None,
        };
        let mut jobs: Vec<_> =
            frames.iter_mut().enumerate().map(|(i, frame)| (render_request(i), frame.as_mut())).collect();
        rasterizer.render(&mut jobs).map_err(|(index, error)| format!("image {index}: {error}").into())
    }

    /// The depth image of the first environment at its start.
    pub(super) fn depth(&mut self) -> BenchResult<Vec<f32>> {
        self.restart()?;
        self.draw()?;
        self.frames.first().and_then(|frame| frame.depth.clone()).ok_or_else(|| "no depth image".into())
    }
}

impl Contender for OurRenderer<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        for i in 0..self.batch.num_envs() {
            let state = self.scene.state(i);
            self.batch.write(i, |env| env.reset(|data, _| data.qpos_mut().copy_from_slice(state)));
        }
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            if self.physics > 0 {
                self.batch.step(self.physics);
            }
            self.draw()?;
        }
        Ok(start.elapsed())
    }
}

/// Renderers of the baselines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BaselineRenderer {
    /// `mujoco.Renderer`, MuJoCo's renderer with its public API.
    OsMesa,
    /// The same library, called directly with the minimum number of passes.
    OsMesaTwoPass,
    Tiny,
    Warp,
}

impl BaselineRenderer {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::OsMesa => "MuJoCo on OSMesa",
            Self::OsMesaTwoPass => "OSMesa by hand",
            Self::Tiny => "PyBullet TinyRenderer",
            Self::Warp => "MuJoCo Warp on the CPU",
        }
    }

    fn script(self) -> &'static str {
        match self {
            Self::OsMesa | Self::OsMesaTwoPass => "mujoco_osmesa.py",
            Self::Tiny => "pybullet_tiny.py",
            Self::Warp => "warp_rays.py",
        }
    }

    /// Python code that fails if the baseline is not installed.
    pub(super) fn probe(self) -> &'static str {
        match self {
            Self::OsMesa | Self::OsMesaTwoPass => {
                "import os; os.environ['MUJOCO_GL'] = 'osmesa'; import mujoco; mujoco.GLContext(8, 8)"
            }
            Self::Tiny => "import mujoco, pybullet",
            Self::Warp => "import mujoco_warp",
        }
    }

    /// Number of images per step of this baseline: a whole batch, or as many as take a fraction of a second.
    pub(super) fn images(self, work: &Work) -> usize {
        match self {
            Self::Warp => work.envs,
            Self::OsMesa | Self::OsMesaTwoPass if work.look != Quality::Plain => 1,
            Self::OsMesa | Self::OsMesaTwoPass => 4.min(work.envs),
            Self::Tiny => work.envs.min(4_000_000_usize.div_ceil(work.size[0] * work.size[1] * 8)),
        }
    }
}

/// A baseline's process.
pub(super) struct Baseline {
    name: &'static str,
    process: Process,
}

impl Baseline {
    pub(super) fn start(
        python: &OsString,
        renderer: BaselineRenderer,
        scene: &Scene,
        work: &Work,
    ) -> BenchResult<Self> {
        let starts: Vec<&[f64]> = (0..work.envs).map(|i| scene.state(i)).collect();
        let job = json!({
            "model": scene.file,
            "size": work.size,
            "groups": GROUPS,
            "envs": work.envs,
            "starts": starts,
            "images": renderer.images(work),
            "physics": work.physics,
            "look": work.look.name(),
            "passes": if renderer == BaselineRenderer::OsMesaTwoPass { "by_hand" } else { "api" },
            "shadow_size": work.shadow_size,
        });
        let process = Process::start(python, renderer.script(), &job, tempfile::tempdir()?)?;
        Ok(Self { name: renderer.name(), process })
    }

    /// Number of triangles of the baseline's meshes.
    pub(super) fn triangles(&mut self) -> BenchResult<usize> {
        Ok(self.process.request("triangles")?.parse()?)
    }

    /// Checks that the baseline's depth image agrees with ours, so that camera, objects and poses are the same.
    pub(super) fn check_depth(&mut self, ours: &[f32], size: [usize; 2]) -> BenchResult<()> {
        let bytes = self.process.bytes("depth")?;
        let theirs: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|chunk| f32::from_le_bytes(*chunk)).collect();
        let share = agreement(ours, &theirs, size);
        if theirs.len() == size[0] * size[1] && share > MIN_AGREEMENT {
            return Ok(());
        }
        Err(format!("{} sees something else: {:.1} % of the depths agree", self.name, 100.0 * share).into())
    }
}

/// Required share of agreeing pixels.
const MIN_AGREEMENT: f64 = 0.97;
/// Farther depths count as background, which renderers encode differently \[m\].
const FAR: f32 = 20.0;

/// Share of pixels with a depth within 2 % of the range of depths around that pixel in the other image: renderers place
/// pixel centers differently.
fn agreement(ours: &[f32], theirs: &[f32], [width, height]: [usize; 2]) -> f64 {
    // Ray casters report 0 for rays without a hit.
    let far = |x: f32| if x > 0.0 && x < FAR { x } else { FAR };
    let around = |k: usize, n: usize| k.saturating_sub(1)..(k + 2).min(n);
    let agrees = |(index, &depth): (usize, &f32)| {
        let (x, y) = (index % width, index / width);
        let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
        for neighbor in around(y, height).flat_map(|y| around(x, width).map(move |x| y * width + x)) {
            let depth = far(ours.get(neighbor).copied().unwrap_or(0.0));
            (least, most) = (least.min(depth), most.max(depth));
        }
        (0.98 * least..=1.02 * most).contains(&far(depth))
    };
    theirs.iter().enumerate().filter(|pixel| agrees(*pixel)).count() as f64 / (width * height) as f64
}

impl Contender for Baseline {
    fn restart(&mut self) -> BenchResult<()> {
        self.process.request("restart").map(drop)
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        self.process.block(steps)
    }

    fn process(&self) -> Option<u32> {
        Some(self.process.id())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comparison_of_pictures() {
        let ours = [1.0, 1.0, 2.0, 2.0, 3.0, f32::INFINITY];
        assert_eq!(agreement(&ours, &[1.01, 1.0, 1.0, 3.0, 0.0, 99.0], [6, 1]), 1.0);
        assert_eq!(agreement(&ours, &[2.0, 1.0, 2.0, 1.0, 1.0, 99.0], [6, 1]), 0.5);
    }
}
