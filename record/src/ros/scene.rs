//! `foxglove_msgs/msg/SceneUpdate`: the appearance of an environment. The names and the order of the fields are those
//! of the ROS package `foxglove_msgs`.

use super::cdr::CdrWriter;
use super::message::{RosHeader, time};
use crate::scene_update::{Entity, InstanceVisual, SceneUpdate, VisualShape};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;

/// Deletes all entities of the topic in a viewer.
const ALL: u8 = 1;

/// Writes an update. `at.frame` is the frame of the environment, which prefixes all other frames.
pub(crate) fn scene_update(to: &mut CdrWriter, at: RosHeader<'_>, update: &SceneUpdate) {
    to.length(1);
    time(to, at.nanos);
    to.u8(ALL);
    to.string("");
    let entities =
        update.entities.iter().filter_map(|entity| Some((entity, update.visuals.get(entity.instance)?.as_ref()?)));
    to.length(entities.clone().count());
    entities.for_each(|(entity, drawn)| write_entity(to, at, entity, drawn));
}

fn write_entity(
    to: &mut CdrWriter,
    at: RosHeader<'_>,
    entity: &Entity,
    InstanceVisual { shape, rgba }: &InstanceVisual,
) {
    time(to, at.nanos);
    match &entity.frame {
        Some(frame) => to.string(&format!("{}/{frame}", at.frame)),
        None => to.string(at.frame),
    }
    to.string(&format!("{}#{}", entity.name, entity.instance));
    // It stays until it is replaced, and moves with its frame.
    to.i32(0);
    to.u32(0);
    to.u8(1);
    let about = [("name", entity.name.to_string()), ("mask_id", entity.mask_id.to_string())];
    to.length(about.len());
    for (key, value) in about {
        to.string(key);
        to.string(&value);
    }
    // Arrows, cubes, spheres, cylinders, lines, triangles, texts, models.
    for kind in 0..8 {
        match (kind, shape) {
            (1, VisualShape::Box(size)) | (2, VisualShape::Ellipsoid(size)) => {
                to.length(1);
                pose(to, &entity.pose);
                to.f64s(size);
                to.f64s(rgba);
            }
            (3, VisualShape::Cylinder(size)) => {
                to.length(1);
                pose(to, &entity.pose);
                to.f64s(size);
                // Equal radii at both ends.
                to.f64s(&[1.0, 1.0]);
                to.f64s(rgba);
            }
            (5, VisualShape::Mesh(..) | VisualShape::Triangles(_)) => {
                to.length(1);
                triangles(to, entity, shape, *rgba);
            }
            _ => to.length(0),
        }
    }
}

fn triangles(to: &mut CdrWriter, entity: &Entity, form: &VisualShape, rgba: [f64; 4]) {
    let (vertices, triangles) = form.triangles();
    pose(to, &entity.pose);
    to.length(vertices.len());
    vertices.iter().for_each(|vertex| to.f64s(&vertex.map(f64::from)));
    to.f64s(&rgba);
    let colors = if let VisualShape::Mesh(_, colors) = form { colors.as_slice() } else { &[] };
    to.length(colors.len());
    colors.iter().for_each(|color| to.f64s(color));
    to.length(3 * triangles.len());
    triangles.iter().flatten().for_each(|index| to.u32(*index));
}

fn pose(to: &mut CdrWriter, pose: &Pose) {
    let [x, y, z, qw, qx, qy, qz] = to_row(pose);
    to.f64s(&[x, y, z, qx, qy, qz, qw]);
}
