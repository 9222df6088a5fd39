//! Reports of `check` on scenes: MJCF files that are not robots, and scene files.

use crate::command_status::Result;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;
use kinetoscope::sim::MjcfPart;
use kinetoscope::sim::inspect::{InspectCfg, RobotReport, inspect};
use serde_json::{Value, json};
use std::fmt;

/// Report on an MJCF file that is a scene: its bodies, joints and actuators.
pub(crate) struct MjcfReport {
    file: String,
    total_mass: f64,
    bodies: Vec<Body>,
    geoms: usize,
    actuators: Vec<String>,
    sensors: Vec<String>,
}

struct Body {
    name: String,
    parent: String,
    depth: usize,
    mass: f64,
    /// Name and kind of each joint of the body.
    joints: Vec<(String, &'static str)>,
    mocap: bool,
}

impl MjcfReport {
    pub(crate) fn of(file: &str, part: &MjcfPart<'_>) -> Self {
        let model = part.model();
        let name =
            |body: usize| body.checked_sub(1).map_or("world", |body| part.body_names()[body].as_str()).to_owned();
        let kind = |joint: usize| match model.jnt_type()[joint] as u32 {
            mj::mjJNT_FREE => "free",
            mj::mjJNT_BALL => "ball",
            mj::mjJNT_HINGE => "hinge",
            _ => "slide",
        };
        let mut depths = vec![0; model.nbody()];
        let bodies = (1..model.nbody()).map(|body| {
            let parent = model.body_parentid()[body] as usize;
            depths[body] = depths[parent] + 1;
            let joints = (0..model.njnt()).filter(|&joint| model.jnt_bodyid()[joint] as usize == body);
            Body {
                name: name(body),
                parent: name(parent),
                depth: depths[body] - 1,
                mass: model.body_mass()[body],
                joints: joints.map(|joint| (part.joint_names()[joint].clone(), kind(joint))).collect(),
                mocap: model.body_mocapid()[body] >= 0,
            }
        });
        Self {
            file: file.to_owned(),
            bodies: bodies.collect(),
            total_mass: part.total_mass(),
            geoms: model.ngeom(),
            actuators: part.actuator_names().to_vec(),
            sensors: part.sensor_names().to_vec(),
        }
    }

    fn joints(&self) -> usize {
        self.bodies.iter().map(|body| body.joints.len()).sum()
    }

    pub(crate) fn json(&self) -> Value {
        let joint = |(name, kind): &(String, &str)| json!({ "name": name, "kind": kind });
        let body = |body: &Body| {
            json!({
                "name": body.name, "parent": body.parent, "mass": body.mass, "mocap": body.mocap,
                "joints": body.joints.iter().map(joint).collect::<Vec<_>>(),
            })
        };
        json!({
            "file": self.file,
            "total_mass": self.total_mass,
            "bodies": self.bodies.iter().map(body).collect::<Vec<_>>(),
            "geoms": self.geoms,
            "actuators": self.actuators,
            "sensors": self.sensors,
        })
    }
}

impl fmt::Display for MjcfReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}   (a scene, not a single robot)", self.file)?;
        writeln!(
            f,
            "{}, {}, {}, {}, {}",
            counted(self.bodies.len(), "body", "bodies"),
            counted(self.joints(), "joint", "joints"),
            counted(self.geoms, "geom", "geoms"),
            counted(self.actuators.len(), "actuator", "actuators"),
            counted(self.sensors.len(), "sensor", "sensors"),
        )?;
        writeln!(f, "total mass {:.6} kg", self.total_mass)?;
        let names: Vec<String> = self.bodies.iter().map(|body| "  ".repeat(body.depth.min(16)) + &body.name).collect();
        let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(4);
        if !self.bodies.is_empty() {
            writeln!(f, "\n{:<width$}  {:>12}  joints", "body", "mass [kg]")?;
        }
        for (name, body) in names.iter().zip(&self.bodies) {
            let joints: Vec<String> = body.joints.iter().map(|(name, kind)| format!("{name} ({kind})")).collect();
            let joints = if body.mocap { "mocap body".to_owned() } else { joints.join(", ") };
            writeln!(f, "{name:<width$}  {:>12.6}  {}", body.mass, if joints.is_empty() { "-" } else { &joints })?;
        }
        for (what, names) in [("Actuators", &self.actuators), ("Sensors", &self.sensors)] {
            if !names.is_empty() {
                writeln!(f, "\n{what}: {}", names.join(", "))?;
            }
        }
        Ok(())
    }
}

/// Report on a scene file: a report per robot and articulation, and the kinds of the other entities.
pub(crate) struct SceneReport {
    file: String,
    num_envs: usize,
    dt: f64,
    robots: Vec<(String, RobotReport)>,
    /// Name and kind of each entity that is neither a robot nor an articulation.
    others: Vec<(String, &'static str)>,
}

impl SceneReport {
    /// Inspects the robots and articulations of a scene file, each alone, and lists its other entities.
    ///
    /// # Errors
    /// A robot or articulation cannot be inspected.
    pub(crate) fn of(file: &str, cfg: &SceneCfg) -> Result<Self> {
        let (mut robots, mut others) = (Vec::new(), Vec::new());
        for (key, (_, entity)) in cfg.keys().zip(&cfg.entities) {
            let (urdf, mjcf, fixed) = match entity {
                EntityCfg::Robot(robot) => (&robot.urdf, &robot.mjcf, robot.fix_base),
                EntityCfg::Articulation(joints) => (&joints.urdf, &joints.mjcf, joints.fix_base),
                _ => {
                    others.push((key.to_owned(), kind_of(entity)));
                    continue;
                }
            };
            let cfg =
                InspectCfg { urdf: urdf.clone(), mjcf: mjcf.clone(), floating_base: !fixed, ..Default::default() };
            robots.push((key.to_owned(), inspect(&cfg)?));
        }
        let simulation = &cfg.simulation;
        Ok(Self { file: file.to_owned(), num_envs: simulation.num_envs, dt: simulation.physics_dt, robots, others })
    }

    /// True if a robot or articulation has warnings.
    pub(crate) fn has_warnings(&self) -> bool {
        self.robots.iter().any(|(_, report)| !report.warnings.is_empty())
    }

    /// Returns the report as JSON.
    ///
    /// # Errors
    /// A report cannot be written as JSON.
    pub(crate) fn json(&self) -> Result<Value> {
        let robots = self.robots.iter().map(|(name, report)| Ok((name.clone(), serde_json::to_value(report)?)));
        let others = self.others.iter().map(|(name, kind)| (name.clone(), json!(kind)));
        Ok(json!({
            "file": self.file,
            "num_envs": self.num_envs,
            "physics_dt": self.dt,
            "robots": robots.collect::<Result<serde_json::Map<_, _>>>()?,
            "others": others.collect::<serde_json::Map<_, _>>(),
        }))
    }
}

impl fmt::Display for SceneReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}   (a scene)\n{}, {}, in {} with steps of {} s",
            self.file,
            counted(self.robots.len(), "robot or articulation", "robots and articulations"),
            counted(self.others.len(), "other entity", "other entities"),
            counted(self.num_envs, "environment", "environments"),
            self.dt
        )?;
        let width = self.others.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        for (name, kind) in &self.others {
            writeln!(f, "  {name:<width$}  {kind}")?;
        }
        for (name, report) in &self.robots {
            write!(f, "\n{name}: {}", report.without_warnings())?;
        }
        Ok(())
    }
}

/// Returns the kind of an entity.
fn kind_of(entity: &EntityCfg) -> &'static str {
    match entity {
        EntityCfg::Robot(_) => "robot",
        EntityCfg::Articulation(_) => "articulation",
        EntityCfg::RigidObject(_) => "rigid object",
        EntityCfg::Group(_) => "group of rigid objects",
        EntityCfg::Terrain(_) => "terrain",
        EntityCfg::Mjcf(_) => "MJCF file",
        EntityCfg::Weld(_) => "weld",
        EntityCfg::Sensor(_) => "sensor",
        _ => "entity",
    }
}

/// Returns a number with its noun.
pub(crate) fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}
