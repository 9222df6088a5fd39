//! Names of all elements of a file: given or generated.

use kinetoscope_mujoco::{Model, ObjectKind};
use std::collections::BTreeSet;

/// Names of a file's elements, without the part's uid: one entry per element, in MuJoCo's order. Names are unique
/// within each kind. An element without a name gets the kind and its index (`geom3`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartNames {
    /// The first body is the world.
    pub bodies: Vec<String>,
    pub joints: Vec<String>,
    pub geoms: Vec<String>,
    pub sites: Vec<String>,
    /// True for each site that has a name in the file.
    pub named_sites: Vec<bool>,
    pub cameras: Vec<String>,
    pub lights: Vec<String>,
    pub meshes: Vec<String>,
    pub height_fields: Vec<String>,
    pub textures: Vec<String>,
    pub materials: Vec<String>,
    pub equalities: Vec<String>,
    pub tendons: Vec<String>,
    pub actuators: Vec<String>,
    pub sensors: Vec<String>,
}

/// Names of the elements of one kind. An element without a name gets the kind and its index, followed by underscores if
/// another element has this name.
fn of_kind(model: &Model, kind: ObjectKind, word: &str, count: usize) -> Vec<String> {
    let given: Vec<Option<String>> = (0..count).map(|i| model.name(kind, i)).collect();
    let mut taken: BTreeSet<String> = given.iter().flatten().cloned().collect();
    let mut name = |(index, name): (usize, Option<String>)| {
        name.unwrap_or_else(|| {
            let mut made_up = format!("{word}{index}");
            while !taken.insert(made_up.clone()) {
                made_up.push('_');
            }
            made_up
        })
    };
    given.into_iter().enumerate().map(&mut name).collect()
}

impl PartNames {
    /// Collects the names of a model.
    pub fn of_model(model: &Model) -> Self {
        let named = |kind, word, count| of_kind(model, kind, word, count);
        Self {
            bodies: named(ObjectKind::Body, "body", model.nbody()),
            joints: named(ObjectKind::Joint, "joint", model.njnt()),
            geoms: named(ObjectKind::Geom, "geom", model.ngeom()),
            sites: named(ObjectKind::Site, "site", model.nsite()),
            named_sites: (0..model.nsite()).map(|i| model.name(ObjectKind::Site, i).is_some()).collect(),
            cameras: named(ObjectKind::Camera, "camera", model.ncam()),
            lights: named(ObjectKind::Light, "light", model.nlight()),
            meshes: named(ObjectKind::Mesh, "mesh", model.nmesh()),
            height_fields: named(ObjectKind::HeightField, "hfield", model.nhfield()),
            textures: named(ObjectKind::Texture, "texture", model.ntex()),
            materials: named(ObjectKind::Material, "material", model.nmat()),
            equalities: named(ObjectKind::Equality, "equality", model.neq()),
            tendons: named(ObjectKind::Tendon, "tendon", model.ntendon()),
            actuators: named(ObjectKind::Actuator, "actuator", model.nactuator()),
            sensors: named(ObjectKind::Sensor, "sensor", model.nsensor()),
        }
    }

    /// Name of an element, by MJCF's keyword for its kind; the index for any other keyword or an unknown index.
    pub(super) fn of(&self, element: &str, index: usize) -> String {
        let names = match element {
            "body" => &self.bodies,
            "joint" => &self.joints,
            "geom" => &self.geoms,
            "site" => &self.sites,
            "camera" => &self.cameras,
            "light" => &self.lights,
            "material" => &self.materials,
            "mesh" => &self.meshes,
            "texture" => &self.textures,
            "equality" => &self.equalities,
            "tendon" => &self.tendons,
            "actuator" => &self.actuators,
            "sensor" => &self.sensors,
            _ => return index.to_string(),
        };
        names.get(index).cloned().unwrap_or_else(|| index.to_string())
    }
}
