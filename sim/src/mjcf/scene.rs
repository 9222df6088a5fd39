//! What is in the world beside robots: the ground, terrain, objects, lights.

use super::document::{Body, Geom, GeomRole, HeightFieldAsset, Inertial, Joint, Light, Mjcf, Shape};
use crate::objects::rigid_object::{BodyType, RigidObjectData};
use crate::objects::terrain::Terrain;
use nalgebra::{UnitQuaternion, Vector3};
use scene::Pose;

/// Contact bit of the ground and of objects.
pub const WORLD_BIT: i32 = 1;
/// Bits that can be used: MuJoCo's are signed 32-bit numbers.
const ALL_BITS: i32 = i32::MAX;
/// How many robots can have a bit of their own.
pub const MAX_ROBOTS: usize = 30;

/// Contact bits of the ground and of objects: they collide with everything.
pub const WORLD_CONTACT: GeomRole = GeomRole::Collision { contype: WORLD_BIT, conaffinity: ALL_BITS, seen: true };

/// Contact bits of robot number `index`: it collides with the world and with other robots, and with itself where
/// `self_collision`.
pub fn robot_contact(index: usize, self_collision: bool) -> GeomRole {
    let bit = 1 << (index + 1).min(MAX_ROBOTS);
    let conaffinity = if self_collision { ALL_BITS } else { ALL_BITS & !bit };
    GeomRole::Collision { contype: bit, conaffinity, seen: false }
}

/// Adds a ground plane at z = 0 \[m\].
pub fn add_ground(mjcf: &mut Mjcf, half_size: f64, [r, g, b]: [f64; 3]) {
    mjcf.bodies[0].geoms.push(Geom {
        name: Some("ground".into()),
        shape: Shape::Plane([half_size, half_size]),
        pose: Pose::identity(),
        role: WORLD_CONTACT,
        friction: None,
        rgba: Some([r, g, b, 1.0]),
        material: None,
        source: None,
    });
}

/// File of terrain number `index`, next to the document.
pub(crate) fn terrain_file(index: usize) -> String {
    format!("terrain{index}.bin")
}

/// Adds a terrain: a height field and a geom of the world, both called by its uid.
pub(crate) fn add_terrain(mjcf: &mut Mjcf, index: usize, terrain: &Terrain) {
    let cfg = terrain.cfg();
    let [x, y] = cfg.size.map(|length| length / 2.0);
    mjcf.height_fields.push(HeightFieldAsset {
        name: cfg.uid.clone(),
        file: terrain_file(index),
        size: [x, y, terrain.rise(), cfg.thickness],
    });
    // MuJoCo's elevation 0 is the lowest point.
    let lowest = Pose::translation(0.0, 0.0, terrain.height_range()[0]);
    mjcf.bodies[0].geoms.push(Geom {
        name: Some(cfg.uid.clone()),
        shape: Shape::HeightField(cfg.uid.clone()),
        pose: cfg.init_pose * lowest,
        role: WORLD_CONTACT,
        friction: cfg.friction,
        rgba: Some(cfg.rgba),
        material: None,
        source: None,
    });
}

/// Adds a rigid object: a body called by its uid, with the geom `uid/shape` and the joint `uid/free`.
pub(crate) fn add_object(mjcf: &mut Mjcf, object: &RigidObjectData) {
    let cfg = object.cfg();
    let (mass, moments) = object.inertia();
    let moves = cfg.body_type == BodyType::Dynamic;
    let free = Joint::free(format!("{}/free", cfg.uid), None);
    let inertial = Inertial { mass, com: Vector3::zeros(), axes: UnitQuaternion::identity(), moments, source: None };
    mjcf.bodies.push(Body {
        name: cfg.uid.clone(),
        parent: 0,
        pose: cfg.init_pose,
        inertial: moves.then_some(inertial),
        joints: if moves { vec![free] } else { Vec::new() },
        geoms: vec![Geom {
            name: Some(format!("{}/shape", cfg.uid)),
            shape: cfg.shape.to_mjcf(),
            pose: Pose::identity(),
            role: WORLD_CONTACT,
            friction: cfg.friction,
            rgba: Some(cfg.rgba),
            material: None,
            source: None,
        }],
        sites: Vec::new(),
        source: None,
    });
}

/// Adds a light from above.
pub fn add_light(mjcf: &mut Mjcf, name: &str, direction: Vector3<f64>, color: [f64; 3]) {
    // MuJoCo takes a short direction for none.
    let direction = direction.normalize();
    mjcf.lights.push(Light { name: name.into(), position: Vector3::new(0.0, 0.0, 4.0), direction, diffuse: color });
}
