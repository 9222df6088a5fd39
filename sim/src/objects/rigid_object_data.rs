//! Data of rigid objects: configuration, meshes, mass properties.

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

/// Type of motion of an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum BodyType {
    /// Moves by forces and contacts.
    #[default]
    Dynamic,
    /// Has the pose that is set in each environment, and pushes other bodies without being pushed. MuJoCo gives such a
    /// body (a mocap body) a pose but no velocity. Other bodies are pushed out of it, after they sink in by 0.04 s
    /// times the speed, and bodies on top of it are not dragged along. It does not collide with fixed bodies or other
    /// kinematic bodies.
    Kinematic,
    /// Stays fixed, and collides with other bodies. Its pose is a [property](crate::Property) of the environment, which
    /// survives resets.
    Static,
}

/// Configuration of a rigid object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigidObjectCfg {
    /// Name of the object, unique in the simulation.
    pub uid: String,
    /// Shape of the object.
    pub shape: ObjectShape,
    /// Collision geometry of an [`ObjectShape::Mesh`]; other shapes collide as they are.
    pub mesh_collision: MeshCollision,
    /// Type of motion: dynamic (the default), kinematic or static.
    pub body_type: BodyType,
    /// Mass \[kg\]; `None` to compute it from `density`.
    pub mass: Option<f64>,
    /// Density \[kg/m³\], used only without `mass`.
    pub density: f64,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\] (MuJoCo's three); `None` for the simulation's
    /// default. In a contact, MuJoCo takes the larger value of the two surfaces.
    pub friction: Option<[f64; 3]>,
    /// Center of mass in the object's frame \[m\]; `None` for that of the shape.
    pub center_of_mass: Option<[f64; 3]>,
    /// Moments of inertia about the center of mass along x, y and z of the object's frame \[kg m²\]; `None` for those
    /// of the shape with uniform density.
    pub inertia: Option<[f64; 3]>,
    /// Linear damping \[N s/m\]: the force `-linear_damping v` against the velocity of the object's frame.
    /// [`RigidObjectMut::set_damping`](crate::RigidObjectMut::set_damping) or the [property](crate::Property) changes
    /// it at run time, in single environments.
    pub linear_damping: f64,
    /// Angular damping \[N m s/rad\]: the torque `-angular_damping w` against the angular velocity. Both dampings must
    /// be 0 for an object that is not dynamic.
    pub angular_damping: f64,
    /// Coefficient of restitution, 0.14 to 1: ratio of the normal velocities after and before an impact. `None` for
    /// MuJoCo's soft contacts, which leave about 0.1.
    ///
    /// MuJoCo has no restitution: this value turns the contact into a spring and a damper (`solref` below 0) for about
    /// ten steps. Meanwhile a body that arrives at speed v \[m/s\] sinks in by up to `3.2 v dt`, so bouncing balls need
    /// a small time step. The actual coefficient depends on the instant of impact within the time step. It deviates by
    /// -0.08 to 0.04 below 0.3, by -0.06 to 0.04 at 0.5, by -0.02 to 0.03 at 0.8, and by 0.003 at 1. The coefficient
    /// applies to an impact through the center of mass. Between two surfaces with coefficients, the smaller coefficient
    /// applies. Against a surface without one, this coefficient applies.
    pub restitution: Option<f64>,
    /// Contact margin \[m\]: distance at which contact forces begin, as if the shape were larger by it. MuJoCo 2.2.2
    /// uses the larger margin of the two surfaces, 4.x their sum.
    pub contact_margin: f64,
    /// Initial pose in the environment.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// RGBA color (sRGB) in 0..=1; for a mesh, it applies where the file gives no color.
    pub rgba: [f64; 4],
    /// Surface properties besides the color, for rendering only.
    pub surface: SurfaceCfg,
    /// Semantic class in the table of mask ids; `None` for `object`.
    pub semantic_class: Option<String>,
}

impl Default for RigidObjectCfg {
    /// Gray cube of 10 cm with the density of water.
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

/// Rigid object of a simulation: everything that does not change while the simulation runs.
#[derive(Debug)]
pub(crate) struct RigidObjectData {
    cfg: RigidObjectCfg,
    pub(super) mask_id: i32,
    mesh: Option<ObjectMesh>,
    pub(super) mass_properties: MassProperties,
}

impl RigidObjectData {
    /// Checks every number, and reads the mesh.
    pub(crate) fn new(cfg: RigidObjectCfg, mask_id: i32, diagnostics: &mut Vec<Diagnostic>) -> Result<Self> {
        let fail = |field, value: &dyn std::fmt::Debug, expected| {
            Err(Error::Config { field, value: format!("{value:?}"), expected })
        };
        if !cfg.shape.sizes().iter().all(|s| s.is_finite() && (1e-6..=1e6).contains(s)) {
            return fail("shape", &cfg.shape, "every size must be 1e-6 to 1e6 m, every scale 1e-6 to 1e6");
        }
        if !(cfg.density.is_finite() && cfg.density > 0.0) {
            return fail("density", &cfg.density, "it must be above 0 kg/m³, such as 1000 for water");
        }
        if let Some(mass) = cfg.mass
            && !(mass.is_finite() && mass >= 0.0)
        {
            return fail("mass", &mass, "it must be a finite mass >= 0 kg");
        }
        if let Some(com) = cfg.center_of_mass
            && !com.iter().all(|x| x.is_finite())
        {
            return fail("center_of_mass", &com, "the three coordinates must be finite");
        }
        if let Some(moments) = cfg.inertia {
            // The same check as in MuJoCo, rounding included.
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
                return fail(field, &value, "only a BodyType::Dynamic object is damped; leave it 0");
            }
        }
        if let Some(restitution) = cfg.restitution
            && !(restitution::MIN_RESTITUTION..=1.0).contains(&restitution)
        {
            let expected = "it must be 0.14 to 1; omit it for contacts with hardly any bounce";
            return fail("restitution", &restitution, expected);
        }
        if !(cfg.contact_margin.is_finite() && cfg.contact_margin >= 0.0) {
            return fail("contact_margin", &cfg.contact_margin, "it must be a distance >= 0 m");
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
            let expected =
                "MuJoCo requires a mass above 1e-12 kg and principal moments above 1e-14 kg m² for a moving body";
            return fail("mass", &mass, expected);
        }
        Ok(Self { cfg, mask_id, mesh, mass_properties })
    }

    /// Name of the object.
    pub(crate) fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// Configuration that the object was added with.
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

    /// Collision and visual meshes; `None` for a shape without a mesh.
    pub(crate) fn mesh(&self) -> Option<&ObjectMesh> {
        self.mesh.as_ref()
    }

    /// Key of the mesh file that the object is rendered with; `None` for a shape without a mesh file.
    pub(crate) fn mesh_key(&self) -> Option<MeshKey> {
        match &self.cfg.shape {
            ObjectShape::Mesh { path, scale, .. } => Some(MeshKey::new(path, &(*scale).into())),
            _ => None,
        }
    }
}
