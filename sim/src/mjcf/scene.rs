//! Ground, terrain, objects and lights of the MJCF document.

use super::document::{
    Body, ContactParams, ContactSolver, Geom, GeomRole, HeightFieldAsset, Inertial, Joint, Light, MeshAsset,
    MeshContent, Mjcf, Shape,
};
use super::robot::MjcfDialect;
use super::scene_names::{MAX_ROBOTS, light_name};
use crate::light_cfg::{LightCfg, LightKindCfg};
use crate::objects::mass_properties::MassProperties;
use crate::objects::restitution;
use crate::objects::rigid_object_data::{BodyType, RigidObjectData};
use crate::objects::terrain::Terrain;
use kinetoscope_scene::Pose;

/// Contact bit of the ground, terrains and objects.
pub(crate) const WORLD_BIT: i32 = 1;
/// All usable bits: MuJoCo's are signed 32-bit numbers.
const ALL_BITS: i32 = i32::MAX;

/// Contact bits of the ground, terrains and objects, which collide with each other and with robots.
pub(crate) const WORLD_CONTACT: GeomRole =
    GeomRole::Collision { contype: WORLD_BIT, conaffinity: ALL_BITS, visible: true };

/// Contact bits of robot `index`. It collides with the ground, terrains, objects and other robots, and with itself if
/// `self_collision` is set.
pub(crate) fn robot_contact(index: usize, self_collision: bool) -> GeomRole {
    let bit = 1 << (index + 1).min(MAX_ROBOTS);
    let conaffinity = if self_collision { ALL_BITS } else { ALL_BITS & !bit };
    GeomRole::Collision { contype: bit, conaffinity, visible: false }
}

/// Adds a ground plane at z = 0 \[m\].
pub(crate) fn add_ground(mjcf: &mut Mjcf, half_size: f64, [r, g, b]: [f64; 3]) {
    mjcf.bodies[0].geoms.push(Geom {
        name: Some("ground".into()),
        shape: Shape::Plane([half_size, half_size]),
        pose: Pose::identity(),
        role: WORLD_CONTACT,
        friction: None,
        surface: None,
        rgba: Some([r, g, b, 1.0]),
        material: None,
        source: None,
    });
}

/// Name of the height field file of terrain `index`, next to the document.
pub(crate) fn terrain_file(index: usize) -> String {
    format!("terrain{index}.bin")
}

/// Adds a terrain: a height field and a geom of the world, both named by its uid.
pub(crate) fn add_terrain(mjcf: &mut Mjcf, index: usize, terrain: &Terrain) {
    let cfg = terrain.cfg();
    let [x, y] = cfg.size.map(|length| length / 2.0);
    mjcf.height_fields.push(HeightFieldAsset {
        name: cfg.uid.clone(),
        file: terrain_file(index),
        size: [x, y, terrain.elevation_scale(), cfg.thickness],
    });
    // Elevation 0 of MuJoCo is the lowest point.
    let lowest = Pose::translation(0.0, 0.0, terrain.height_range()[0]);
    mjcf.bodies[0].geoms.push(Geom {
        name: Some(cfg.uid.clone()),
        shape: Shape::HeightField(cfg.uid.clone()),
        pose: cfg.init_pose * lowest,
        role: WORLD_CONTACT,
        friction: cfg.friction,
        surface: None,
        rgba: Some(cfg.rgba),
        material: None,
        source: None,
    });
}

/// Adds a rigid object: a body named by its uid, with the geom `uid/shape` (and `uid/shape1`... for several collision
/// shapes). A dynamic object has the joint `uid/free`. An object from a mesh file also has visual geoms: `uid/visual`
/// in a simulation, `uid/visual0`, `uid/visual1`... in an export.
pub(crate) fn add_object(mjcf: &mut Mjcf, object: &RigidObjectData, purpose: &MjcfDialect<'_>) {
    let cfg = object.cfg();
    let MassProperties { mass, com, axes, moments } = *object.mass_properties();
    let moves = cfg.body_type == BodyType::Dynamic;
    let mut free = Joint::free(format!("{}/free", cfg.uid), None);
    if cfg.linear_damping == cfg.angular_damping {
        free.damping = cfg.linear_damping;
    } else if matches!(purpose, MjcfDialect::Export(_)) {
        mjcf.comments.push(format!(
            "{}: linear damping {} N s/m and angular damping {} N m s/rad are not written, because a free joint has a \
             single damping value.",
            cfg.uid, cfg.linear_damping, cfg.angular_damping
        ));
    }
    let mut shapes = vec![format!("{}/shape", cfg.uid)];
    if let Some(mesh) = object.mesh() {
        shapes.extend((1..mesh.collision.len()).map(|k| format!("{}/shape{k}", cfg.uid)));
        for (name, mesh) in shapes.iter().zip(&mesh.collision) {
            let (vertices, triangles) = (mesh.positions.clone(), mesh.triangles.clone());
            let content = MeshContent::Inline { vertices, triangles };
            mjcf.meshes.push(MeshAsset { name: name.clone(), content, visual: false, source: None });
        }
    }
    let visuals = visual_geoms(object, purpose);
    let role = GeomRole::Collision { contype: WORLD_BIT, conaffinity: ALL_BITS, visible: visuals.is_empty() };
    let solver = cfg.restitution.map(|wanted| ContactSolver {
        solref: restitution::solref(wanted, mjcf.option.timestep),
        solimp: restitution::IMPEDANCE,
        solmix: restitution::SOLMIX,
    });
    let collision = |shape: String| Geom {
        name: Some(shape.clone()),
        shape: cfg.shape.to_mjcf(shape),
        pose: Pose::identity(),
        role,
        friction: cfg.friction,
        surface: Some(ContactParams { margin: cfg.contact_margin, solver }),
        rgba: Some(cfg.rgba),
        material: None,
        source: None,
    };
    mjcf.bodies.push(Body {
        name: cfg.uid.clone(),
        parent: 0,
        pose: cfg.init_pose,
        inertial: moves.then_some(Inertial { mass, com, axes, moments, source: None }),
        joints: if moves { vec![free] } else { Vec::new() },
        mocap: cfg.body_type == BodyType::Kinematic,
        geoms: shapes.into_iter().map(collision).chain(visuals).collect(),
        sites: Vec::new(),
        source: None,
    });
}

/// Visual geoms of an object that looks different from its collision shapes. A simulation has a proxy that only has a
/// pose, an export has the parts of the mesh file.
fn visual_geoms(object: &RigidObjectData, purpose: &MjcfDialect<'_>) -> Vec<Geom> {
    let cfg = object.cfg();
    let Some(key) = object.mesh_key() else { return Vec::new() };
    let visual = |name: String, shape, rgba, material| Geom {
        name: Some(name),
        shape,
        pose: Pose::identity(),
        role: GeomRole::Visual,
        friction: None,
        surface: None,
        rgba,
        material,
        source: None,
    };
    let name = format!("{}/visual", cfg.uid);
    match purpose {
        MjcfDialect::Simulation { .. } => vec![visual(name, Shape::Sphere(PROXY), None, None)],
        MjcfDialect::Export(assets) => {
            let parts = assets.parts.get(&key).into_iter().flatten().enumerate();
            parts
                .map(|(k, part)| {
                    let rgba = part.material.is_none().then_some(cfg.rgba);
                    visual(format!("{name}{k}"), Shape::Mesh(part.mesh.clone()), rgba, part.material.clone())
                })
                .collect()
        }
    }
}

/// Size of a proxy \[m\]: it has a pose, no mass and no contact.
const PROXY: f64 = 1e-3;

/// Adds a light. Dome lights are skipped: MuJoCo does not have them, and only the renderers of this project use them.
pub(crate) fn add_light(mjcf: &mut Mjcf, index: usize, cfg: &LightCfg) {
    if matches!(cfg.kind, LightKindCfg::Dome { .. }) {
        return;
    }
    mjcf.lights.push(Light {
        name: light_name(index),
        position: cfg.position,
        // MuJoCo treats a short direction as no direction.
        direction: cfg.direction.normalize(),
        diffuse: cfg.color,
        kind: cfg.kind,
        attenuation: cfg.attenuation,
        radius: cfg.radius,
        cast_shadow: cfg.cast_shadow,
    });
}
