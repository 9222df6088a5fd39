//! Benchmark scenes: MuJoCo's humanoid, the vendor's arm with its 160 000 triangles, and the bundled arm. Each is an
//! MJCF file that our renderer and the baselines compile.

use crate::models::{Case, HUMANOID, arm_with_hand, sr5};
use crate::settings::BenchResult;
use crate::startup::robots;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{BUILD_VERSION, Data, Model, SupportedVersion};
use kinetoscope::prelude::*;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::render::{ParallelRenderer, RenderRequest};
use kinetoscope::scene::shape::Shape;
use kinetoscope::scene::{Instance, PoseF32, RenderScene};
use kinetoscope::sim::VisualScene;
use std::path::{Path, PathBuf};

/// Rendered geom groups: all but those of collision shapes.
pub(super) const GROUPS: [u8; 3] = [0, 1, 2];
/// Vertical field of view \[deg\].
const FOVY: f32 = 45.0;
/// Number of different states to render.
const STATES: usize = 64;

/// A model, its visual scene, and a camera.
pub(crate) struct Scene {
    /// Name in the results.
    pub(crate) name: &'static str,
    /// The MJCF with the camera `bench`.
    pub(super) file: PathBuf,
    pub(super) model: Model,
    pub(super) visible: VisualScene,
    /// Joint positions to render, assigned to the environments in turn.
    states: Vec<Vec<f64>>,
    eye: [f32; 3],
    target: [f32; 3],
    /// The MJCF without the camera.
    mjcf: String,
    /// The temporary folder of the file.
    _folder: tempfile::TempDir,
}

/// The scenes with files on this machine.
pub(super) struct Scenes {
    pub(super) humanoid: Option<Scene>,
    pub(super) vendor: Option<Scene>,
    pub(super) bundled: Scene,
}

impl Scenes {
    pub(super) fn new() -> BenchResult<Self> {
        let humanoid = match Case::humanoid()? {
            None => None,
            Some(case) => {
                let states = (0..STATES).map(|i| case.state(i).qpos.clone()).collect();
                let text = std::fs::read_to_string(HUMANOID)?;
                Some(Scene::new("humanoid", &text, tempfile::tempdir()?, states, [2.5, -2.5, 1.8], [0.0, 0.0, 0.9])?)
            }
        };
        let vendor = match vendor_arm() {
            None => {
                eprintln!("  skipped: no vendor robots; set KINETOSCOPE_ROBOTS to their folder");
                None
            }
            Some(file) => Some(Scene::exported("vendor SR5", &arm_with_hand(&file, "joint[1-6]", 1, 1)?.0)?),
        };
        Ok(Self { humanoid, vendor, bundled: Scene::exported("SR5 + hand", &sr5(1, 1)?.0)? })
    }
}

/// The vendor's SR5, if it is on the machine.
fn vendor_arm() -> Option<PathBuf> {
    robots().map(|dir| dir.join("rokae_description/urdf/SR5.urdf")).filter(|file| file.exists())
}

impl Scene {
    /// The vendor's SR5 alone, or the bundled one without the vendor's files.
    pub(crate) fn arm_alone() -> BenchResult<Self> {
        let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() })?;
        let (name, file) = match vendor_arm() {
            Some(file) => ("vendor SR5", file),
            None => ("bundled SR5", assets::path("sr5/SR5.urdf")?),
        };
        sim.add_robot(RobotCfg { urdf: UrdfCfg::single(file), ..Default::default() })?;
        Self::exported(name, &sim)
    }

    fn new(
        name: &'static str,
        mjcf: &str,
        folder: tempfile::TempDir,
        states: Vec<Vec<f64>>,
        eye: [f32; 3],
        target: [f32; 3],
    ) -> BenchResult<Self> {
        let view = View::look_at([1, 1], FOVY.to_radians(), eye, target, [0.0, 0.0, 1.0])?;
        let file = folder.path().join("scene.xml");
        std::fs::write(&file, with_camera(mjcf, &view)?)?;
        let model = compile(&file)?;
        let visible = VisualScene::of_model(&model);
        for left_out in visible.omitted() {
            eprintln!("  {name}: {left_out}");
        }
        Ok(Self { name, file, model, visible, states, eye, target, mjcf: mjcf.into(), _folder: folder })
    }

    /// A robot as exported for other programs, with a bent arm that differs slightly in every state.
    fn exported(name: &'static str, sim: &SimulationManager) -> BenchResult<Self> {
        let folder = tempfile::tempdir()?;
        sim.dump(folder.path())?;
        let file = match BUILD_VERSION {
            SupportedVersion::V4 => "robot.mjcf4.xml",
            SupportedVersion::V2 => "robot.mjcf2.xml",
        };
        let mjcf = std::fs::read_to_string(folder.path().join(file))?;
        let (bent, nq) = ([0.0, 0.5, 1.5, 0.3, 0.5, 0.0], sim.batch().model().nq());
        let state = |i: usize| {
            let sway = |k: usize| 0.15 * (1.3 * k as f64 + 0.7 * i as f64).sin();
            (0..nq).map(|k| bent.get(k).map_or(0.0, |q| q + sway(k))).collect()
        };
        Self::new(name, &mjcf, folder, (0..STATES).map(state).collect(), [1.5, -1.1, 1.1], [0.1, 0.0, 0.5])
    }

    /// The scene seen from the distance at which the robot covers this share of an image.
    pub(crate) fn with_coverage(mut self, share: f64) -> BenchResult<Self> {
        let size = [320, 240];
        let (drawn, poses) = self.rendered(0)?;
        let mut rasterizer = ParallelRenderer::new(RasterCfg::default(), 1);
        let (far, target) = (self.eye, self.target);
        let (mut nearest, mut farthest, mut covered) = (0.1f32, 4.0f32, 0.0);
        while farthest - nearest > 1e-3 {
            let distance_scale = 0.5 * (nearest + farthest);
            self.eye = [0, 1, 2].map(|k| target[k] + distance_scale * (far[k] - target[k]));
            let mut frame = Frame::new(size[0], size[1], Channels { depth: true, ..Channels::default() });
            let view = self.view(size)?;
            let request =
                RenderRequest { scene: &drawn, poses: &poses, view: &view, lights: None, lens: None, previous: None };
            rasterizer.render(&mut [(request, frame.as_mut())]).map_err(|(_, error)| error)?;
            let hits = frame.depth.iter().flatten().filter(|depth| depth.is_finite()).count();
            covered = hits as f64 / (size[0] * size[1]) as f64;
            if covered > share { nearest = distance_scale } else { farthest = distance_scale }
        }
        if (covered - share).abs() > 0.01 {
            return Err(format!("{} covers {:.0} % of the image at best", self.name, 100.0 * covered).into());
        }
        std::fs::write(&self.file, with_camera(&self.mjcf, &self.view([1, 1])?)?)?;
        Ok(self)
    }

    /// The rendered scene without other geom groups, and its poses in environment `index`.
    pub(crate) fn rendered(&self, index: usize) -> BenchResult<(RenderScene, Vec<PoseF32>)> {
        let mut data = Data::new(&self.model)?;
        data.qpos_mut().copy_from_slice(self.state(index));
        data.step1()?;
        let all = self.visible.scene();
        let mut poses = vec![PoseF32::IDENTITY; all.instances().len()];
        self.visible.read_poses(&data, &mut poses, &mut all.lights.clone());
        let drawn = all.instances().iter().cloned().zip(poses).filter(|(instance, _)| is_drawn(instance));
        let (instances, poses) = drawn.unzip();
        Ok((all.with_instances(instances)?, poses))
    }

    /// The joint positions of environment `index`.
    pub(super) fn state(&self, index: usize) -> &[f64] {
        &self.states[index % self.states.len()]
    }

    /// The camera's view with images of this size.
    pub(crate) fn view(&self, size: [usize; 2]) -> BenchResult<View> {
        Ok(View::look_at(size, FOVY.to_radians(), self.eye, self.target, [0.0, 0.0, 1.0])?)
    }

    /// Number of triangles of the rendered meshes.
    pub(super) fn triangles(&self) -> usize {
        let drawn = self.visible.scene().instances().iter().filter(|instance| is_drawn(instance));
        drawn
            .filter_map(|i| if let Shape::Mesh(shape) = &i.shape { Some(shape.mesh.triangles().len()) } else { None })
            .sum()
    }
}

fn is_drawn(instance: &Instance) -> bool {
    instance.visible && GROUPS.contains(&instance.group)
}

fn compile(file: &Path) -> BenchResult<Model> {
    let mut compiled = mj::compile_file(file)?;
    compiled.prepare_for_stepping(false);
    Ok(compiled.into_model())
}

/// The MJCF with the camera in its world body.
fn with_camera(mjcf: &str, view: &View) -> BenchResult<String> {
    let end = mjcf.rfind("</worldbody>").ok_or("an MJCF without a world")?;
    let pose = &view.world_from_camera;
    // MuJoCo's cameras look along -z, with y up.
    let column = |j: usize, sign: f32| pose.rotation.map(|row| sign * row[j]);
    let words = |numbers: &[f32]| numbers.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
    Ok(format!(
        "{}<camera name=\"bench\" pos=\"{}\" xyaxes=\"{}\" fovy=\"{FOVY}\"/>\n{}",
        &mjcf[..end],
        words(&pose.translation),
        words(&[column(0, 1.0), column(1, -1.0)].concat()),
        &mjcf[end..],
    ))
}
