//! `foxglove_msgs/msg/SceneUpdate`: the appearance of an environment. The names and the order of the fields are those
//! of the ROS package `foxglove_msgs`.

use super::cdr::Cdr;
use super::message::{Stamp, time};
use crate::scene_update::{Drawn, Entity, Form, SceneUpdate};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;

/// Deletes all entities of the topic in a viewer.
const ALL: u8 = 1;

/// Writes an update. `at.frame` is the frame of the environment, which prefixes all other frames.
pub(crate) fn scene_update(to: &mut Cdr, at: Stamp<'_>, update: &SceneUpdate) {
    to.count(1);
    time(to, at.nanos);
    to.u8(ALL);
    to.text("");
    let entities =
        update.entities.iter().filter_map(|entity| Some((entity, update.drawn.get(entity.instance)?.as_ref()?)));
    to.count(entities.clone().count());
    entities.for_each(|(entity, drawn)| one(to, at, entity, drawn));
}

fn one(to: &mut Cdr, at: Stamp<'_>, entity: &Entity, Drawn { form, rgba }: &Drawn) {
    time(to, at.nanos);
    match &entity.frame {
        Some(frame) => to.text(&format!("{}/{frame}", at.frame)),
        None => to.text(at.frame),
    }
    to.text(&format!("{}#{}", entity.name, entity.instance));
    // It stays until it is replaced, and moves with its frame.
    to.i32(0);
    to.u32(0);
    to.u8(1);
    let about = [("name", entity.name.to_string()), ("mask_id", entity.mask_id.to_string())];
    to.count(about.len());
    for (key, value) in about {
        to.text(key);
        to.text(&value);
    }
    // Arrows, cubes, spheres, cylinders, lines, triangles, texts, models.
    for kind in 0..8 {
        match (kind, form) {
            (1, Form::Cube(size)) | (2, Form::Ball(size)) => {
                to.count(1);
                pose(to, &entity.pose);
                to.f64s(size);
                to.f64s(rgba);
            }
            (3, Form::Cylinder(size)) => {
                to.count(1);
                pose(to, &entity.pose);
                to.f64s(size);
                // Equal radii at both ends.
                to.f64s(&[1.0, 1.0]);
                to.f64s(rgba);
            }
            (5, Form::Mesh(..) | Form::Triangles(_)) => {
                to.count(1);
                triangles(to, entity, form, *rgba);
            }
            _ => to.count(0),
        }
    }
}

fn triangles(to: &mut Cdr, entity: &Entity, form: &Form, rgba: [f64; 4]) {
    let (vertices, triangles) = form.triangles();
    pose(to, &entity.pose);
    to.count(vertices.len());
    vertices.iter().for_each(|vertex| to.f64s(&vertex.map(f64::from)));
    to.f64s(&rgba);
    let colors = if let Form::Mesh(_, colors) = form { colors.as_slice() } else { &[] };
    to.count(colors.len());
    colors.iter().for_each(|color| to.f64s(color));
    to.count(3 * triangles.len());
    triangles.iter().flatten().for_each(|index| to.u32(*index));
}

fn pose(to: &mut Cdr, pose: &Pose) {
    let [x, y, z, qw, qx, qy, qz] = to_row(pose);
    to.f64s(&[x, y, z, qx, qy, qz, qw]);
}
