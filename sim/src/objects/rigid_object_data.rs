//! Rigid objects as they were added: configuration, mesh, mass.

use super::mass_properties::MassProperties;
use super::mesh_collision::MeshCollision;
use super::object_mesh::ObjectMesh;
use super::restitution;
use super::shape::ObjectShape;
use crate::error::{Error, Result};
use crate::objects::robot_data::check_pose;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_robot::mesh_key::MeshKey;
use kinetoscope_scene::Pose;
use serde::{Deserialize, Serialize};

/// The way in which an object moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum BodyType {
    /// Falls, is pushed and held.
    #[default]
    Dynamic,
    /// Is where it is put, in every environment by itself, and pushes others without being pushed. MuJoCo gives such a body
    /// a place and no velocity: it pushes what it is put into, which sinks in by 0.04 s times the speed, and does not drag
    /// along what lies on it. It does not collide with what is fixed or moved by hand, too.
    Kinematic,
    /// Stands fixed, and is in the way of others. Where it stands is a [property](crate::Property) of the environment:
    /// one in which it stands elsewhere has it there after resets, too.
    Static,
}

/// Configuration of a rigid object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigidObjectCfg {
    /// Name of the object, unique in the simulation.
    pub uid: String,
    /// Its shape.
    pub shape: ObjectShape,
    /// Collision shape of a mesh file.
    pub mesh_collision: MeshCollision,
    /// Type of motion.
    pub body_type: BodyType,
    /// Mass \[kg\]; from `density` where `None`.
    pub mass: Option<f64>,
    /// Density \[kg/m³\].
    pub density: f64,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\] (MuJoCo's three); the simulation's where `None`.
    /// MuJoCo takes the larger of the two surfaces that touch.
    pub friction: Option<[f64; 3]>,
    /// Centre of mass in the object's frame \[m\]; that of the shape where `None`.
    pub center_of_mass: Option<[f64; 3]>,
    /// Moments of inertia about the centre of mass along x, y and z of the object's frame \[kg m²\]; those of the shape,
    /// filled evenly, where `None`.
    pub inertia: Option<[f64; 3]>,
    /// Force against the velocity of the object's frame \[N s/m\]: `-linear_damping v`. Of single environments, and later:
    /// [`RigidObjectMut::set_damping`](crate::RigidObjectMut::set_damping), or the [property](crate::Property).
    pub linear_damping: f64,
    /// Torque against its angular velocity \[N m s/rad\]: `-angular_damping w`.
    pub angular_damping: f64,
    /// The part of the velocity that is left after a bounce, 0.14 to 1; MuJoCo's soft contacts, which leave about 0.1, where
    /// `None`.
    ///
    /// MuJoCo has no restitution: this is a contact that is a spring and a damper (`solref` below 0) for about ten steps.
    /// A body that arrives at speed v \[m/s\] sinks in by up to `3.2 v dt` meanwhile, so bouncing balls need a small time step.
    /// The instant of the step at which the surfaces meet makes up to 0.08 less or 0.04 more of it below 0.3, 0.06 less or 0.04 more at 0.5,
    /// 0.02 less or 0.03 more at 0.8, and 0.003 at 1. It holds for an impact through the centre of mass. Of two such surfaces
    /// the one that bounces less counts; against one that has none, this one's.
    pub restitution: Option<f64>,
    /// Distance at which contacts begin to push \[m\], as if the shape were larger by it. The larger of the two surfaces
    /// counts on MuJoCo 2.2.2, their sum on 4.x.
    pub contact_margin: f64,
    /// Pose at the start, in the environment.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Colour and opacity, 0..=1; of a mesh, where its file gives none.
    pub rgba: [f64; 4],
    /// Look of its surface besides the colour.
    pub surface: SurfaceCfg,
    /// Semantic class, for the table of mask ids; `object` where `None`.
    pub semantic_class: Option<String>,
}

impl Default for RigidObjectCfg {
    /// A grey cube of 10 cm with the density of water.
    fn default() -> Self {
        Self {
            uid: "object".into(),
            shape: ObjectShape::cube(0.1),
            mesh_collision: MeshCollision::Hull,
            body_type: BodyType::Dynamic,
            mass: None,
            density: 1000.0,
            friction: None,
            center_of_mass: None,
            inertia: None,
            linear_damping: 0.0,
            angular_damping: 0.0,
            restitution: None,
            contact_margin: 0.0,
            init_pose: Pose::identity(),
            rgba: [0.6, 0.6, 0.6, 1.0],
            surface: SurfaceCfg::default(),
            semantic_class: None,
        }
    }
}

/// An object that was added: what does not change while the simulation runs.
#[derive(Debug)]
pub(crate) struct RigidObjectData {
    cfg: RigidObjectCfg,
    pub(super) mask_id: i32,
    mesh: Option<ObjectMesh>,
    pub(super) mass_properties: MassProperties,
}

impl RigidObjectData {
    /// Checks every number and reads the mesh.
    pub(crate) fn new(cfg: RigidObjectCfg, mask_id: i32, diagnostics: &mut Vec<Diagnostic>) -> Result<Self> {
        let fail = |field, value: &dyn std::fmt::Debug, expected| {
            Err(Error::Config { field, value: format!("{value:?}"), expected })
        };
        if !cfg.shape.sizes().iter().all(|s| s.is_finite() && (1e-6..=1e6).contains(s)) {
            return fail("shape", &cfg.shape, "every size must be 1e-6 to 1e6 metres, every scale 1e-6 to 1e6");
        }
        if !(cfg.density.is_finite() && cfg.density > 0.0) {
            return fail("density", &cfg.density, "it must be above 0 kg/m³, such as 1000 for water");
        }
        if let Some(mass) = cfg.mass
            && !(mass.is_finite() && mass >= 0.0)
        {
            return fail("mass", &mass, "it must be a finite number >= 0 in kilograms");
        }
        if let Some(com) = cfg.center_of_mass
            && !com.iter().all(|x| x.is_finite())
        {
            return fail("center_of_mass", &com, "the three coordinates must be finite");
        }
        if let Some(moments) = cfg.inertia {
            // As MuJoCo asks it, rounding included.
            let [a, b, c] = moments;
            let triangle = a + b >= c && a + c >= b && b + c >= a;
            if !(moments.iter().all(|m| m.is_finite() && *m > 1e-14) && triangle) {
                let expected = "the moments must be above 1e-14 kg m², and none larger than the sum of the others";
                return fail("inertia", &moments, expected);
            }
        }
        for (field, value) in [("linear_damping", cfg.linear_damping), ("angular_damping", cfg.angular_damping)] {
            if !(value.is_finite() && value >= 0.0) {
                return fail(field, &value, "it must be a finite number >= 0");
            }
            if value > 0.0 && cfg.body_type != BodyType::Dynamic {
                return fail(field, &value, "only what is BodyType::Dynamic is damped; leave it 0");
            }
        }
        if let Some(restitution) = cfg.restitution
            && !(restitution::LEAST..=1.0).contains(&restitution)
        {
            let expected = "it must be 0.14 to 1; leave it out for contacts that hardly bounce";
            return fail("restitution", &restitution, expected);
        }
        if !(cfg.contact_margin.is_finite() && cfg.contact_margin >= 0.0) {
            return fail("contact_margin", &cfg.contact_margin, "it must be a distance >= 0 in metres");
        }
        if let Some(friction) = cfg.friction
            && !friction.iter().all(|f| f.is_finite() && *f >= 0.0)
        {
            return fail("friction", &friction, "the three coefficients must be >= 0");
        }
        if !cfg.rgba.iter().all(|c| (0.0..=1.0).contains(c)) {
            return fail("rgba", &cfg.rgba, "each component must be 0 to 1");
        }
        cfg.surface.validate()?;
        check_pose("init_pose", &cfg.init_pose)?;
        let mesh = ObjectMesh::of(&cfg, diagnostics)?;
        let mass_properties = MassProperties::of(&cfg, mesh.as_ref());
        let MassProperties { mass, moments, .. } = mass_properties;
        if cfg.body_type == BodyType::Dynamic && !(mass.is_finite() && mass > 1e-12 && moments.min() > 1e-14) {
            let expected = "MuJoCo moves nothing lighter than 1e-12 kg or with a moment below 1e-14 kg m²";
            return fail("mass", &mass, expected);
        }
        Ok(Self { cfg, mask_id, mesh, mass_properties })
    }

    /// Name of the object.
    pub(crate) fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// The configuration it was added with.
    pub(crate) fn cfg(&self) -> &RigidObjectCfg {
        &self.cfg
    }

    /// Value of the mask channel of cameras.
    pub(crate) fn mask_id(&self) -> i32 {
        self.mask_id
    }

    pub(crate) fn mass_properties(&self) -> &MassProperties {
        &self.mass_properties
    }

    /// Geometry that collides and is seen, for a mesh.
    pub(crate) fn mesh(&self) -> Option<&ObjectMesh> {
        self.mesh.as_ref()
    }

    /// The file that says what it looks like.
    pub(crate) fn mesh_key(&self) -> Option<MeshKey> {
        match &self.cfg.shape {
            ObjectShape::Mesh { path, scale, .. } => Some(MeshKey::new(path, &(*scale).into())),
            _ => None,
        }
    }
}
