//! Heights of the lowest collision points of a robot: clearance above the ground, or penetration.

use crate::compile::compile;
use crate::entity_set::EntitySet;
use crate::env::Stage;
use crate::error::{Error, Result};
use crate::indexing::GeomIndexing;
use crate::objects::robot::Robot;
use crate::objects::robot_data::RobotData;
use crate::simulation_cfg::SimulationManagerCfg;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{Data, Model};
use kinetoscope_robot::description::LinkId;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use ndarray::{Array1, Array2, Axis};
use std::sync::Arc;

impl Robot<'_> {
    /// Heights of the lowest collision points of links in the environment \[m\], in the order of
    /// [`link_names`](Self::link_names), shape (N, links); +∞ for a link without collision shapes.
    ///
    /// They are exact for MuJoCo's primitives, and for meshes, which collide as their convex hulls. Planes and height
    /// fields of a link do not count.
    #[doc(alias = "get_link_lowest_heights")]
    pub fn link_lowest_heights(&self) -> Array2<f64> {
        let links: Vec<usize> = (0..self.link_names().len()).collect();
        self.simulation.batch.gather(Stage::Kinematics, &links, |env, link| {
            let geoms = self.indexing().geoms.iter().filter(|geom| geom.link == *link);
            lowest_height(env.data(), geoms)
        })
    }

    /// Height of the lowest collision point of the robot in the environment \[m\], shape (N,); +∞ for a robot without
    /// collision shapes. With the ground plane at z = 0, a positive height is the clearance of the robot, and a
    /// negative height the penetration.
    #[doc(alias = "get_lowest_heights")]
    pub fn lowest_heights(&self) -> Array1<f64> {
        let heights = self
            .simulation
            .batch
            .gather(Stage::Kinematics, &[()], |env, ()| lowest_height(env.data(), &self.indexing().geoms));
        heights.index_axis(Axis(1), 0).to_owned()
    }

    /// True if a link is fixed in the world: the robot's base is fixed, and no joint moves the link. Such links do not
    /// collide with the ground.
    ///
    /// # Errors
    /// The index of the link does not exist.
    pub fn is_link_fixed(&self, link: LinkId) -> Result<bool> {
        let links = &self.indexing().links;
        let frame = links.get(link.0).ok_or(Error::UnknownIndex { what: "link", index: link.0, count: links.len() })?;
        Ok(self.simulation.batch.model().is_fixed(frame.body))
    }
}

impl RobotData {
    /// Moves the initial pose along z until the lowest collision point has the configured clearance. `others` has the
    /// other entities of the scene.
    pub(crate) fn with_clearance(
        self,
        manager: &SimulationManagerCfg,
        others: &EntitySet,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Self> {
        let Some(clearance) = self.cfg().ground_clearance else { return Ok(self) };
        // Trial scene with one environment and without a ground.
        let one = SimulationManagerCfg { num_envs: 1, threads: Some(1), ground: None, ..manager.clone() };
        let (mut contents, index) = (others.clone(), others.robots.len());
        contents.robots.push(Arc::new(self));
        let trial = compile(&one, &contents, &kinetoscope_exec::ThreadPool::serial())?;
        let height = Robot::new(&contents.robots[index], &trial, index).lowest_heights()[0];
        let mut robot = Arc::unwrap_or_clone(contents.robots.swap_remove(index));
        if height.is_finite() {
            robot.move_initial_pose_z(clearance - height);
        } else {
            let message = format!(
                "{}: no link has a collision shape, so ground_clearance {clearance} is ignored and the ground does not \
                 support the robot",
                robot.label()
            );
            diagnostics.push(Diagnostic::new(DiagnosticKind::ClearanceIgnored, None, message));
        }
        Ok(robot)
    }
}

/// Height of the lowest point of the collision geoms among `geoms` \[m\].
fn lowest_height<'g>(data: &Data, geoms: impl IntoIterator<Item = &'g GeomIndexing>) -> f64 {
    let model = data.model();
    let collides = |geom: usize| model.geom_contype()[geom] != 0 || model.geom_conaffinity()[geom] != 0;
    let shapes = geoms.into_iter().filter(|geom| geom.visual.is_none() && collides(geom.geom));
    shapes.map(|geom| lowest_geom_height(model, data, geom.geom)).fold(f64::INFINITY, f64::min)
}

/// Height of the lowest point of a geom \[m\]; +∞ for planes and height fields, which do not move.
fn lowest_geom_height(model: &Model, data: &Data, geom: usize) -> f64 {
    let middle = data.geom_xpos().as_chunks::<3>().0[geom][2];
    // The world's z axis in the axes of the geom.
    let [.., x, y, z] = data.geom_xmat().as_chunks::<9>().0[geom];
    let [a, b, c] = model.geom_size().as_chunks::<3>().0[geom];
    let below = match model.geom_type()[geom] as u32 {
        mj::mjGEOM_SPHERE => a,
        mj::mjGEOM_CAPSULE => a + b * z.abs(),
        mj::mjGEOM_ELLIPSOID => (a * x).hypot(b * y).hypot(c * z),
        mj::mjGEOM_CYLINDER => a * x.hypot(y) + b * z.abs(),
        mj::mjGEOM_BOX => a * x.abs() + b * y.abs() + c * z.abs(),
        mj::mjGEOM_PLANE | mj::mjGEOM_HFIELD => f64::NEG_INFINITY,
        _ => match usize::try_from(model.geom_dataid()[geom]) {
            Ok(mesh) => {
                let along = |p: &[f32; 3]| x * f64::from(p[0]) + y * f64::from(p[1]) + z * f64::from(p[2]);
                model.mesh(mesh).positions.iter().map(|p| -along(p)).fold(f64::NEG_INFINITY, f64::max)
            }
            Err(_) => f64::NEG_INFINITY,
        },
    };
    middle - below
}
