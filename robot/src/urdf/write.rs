//! Writer of a [`RobotDescription`] as URDF.
//!
//! The text is the same for the same description. The description of a URDF robot reads back to the same robot up to
//! rounding (1e-12). Data that only MJCF has ([`Joint::defaults`]) are left out. Materials are written inside the
//! visuals, since two components may use one name for two materials.

use super::reader::{format_number, format_numbers, write_attribute};
use super::rotation::rpy_of;
use crate::description::{Geometry, Inertial, Joint, JointKind, Material, PartialInertial, RobotDescription};
use kinetoscope_scene::Pose;
use nalgebra::Matrix3;
use std::path::Path;

/// Writes the robot as URDF, with absolute paths of meshes and textures.
pub fn write_urdf(robot: &RobotDescription) -> String {
    write_urdf_with(robot, |path| {
        std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).to_string_lossy().into_owned()
    })
}

/// Writes the robot as URDF. `file_name` returns the name to write for each mesh and texture file.
pub fn write_urdf_with(robot: &RobotDescription, file_name: impl Fn(&Path) -> String) -> String {
    let mut writer = Writer { out: "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n".to_owned(), depth: 0 };
    writer.open("robot", &[("name", robot.name.clone())]);
    for link in &robot.links {
        let name = [("name", link.name.clone())];
        let has_mass = link.inertial.is_some() || link.partial_inertial.is_some();
        if !has_mass && link.visuals.is_empty() && link.collisions.is_empty() {
            writer.empty("link", &name);
            continue;
        }
        writer.open("link", &name);
        if let Some(inertial) = &link.inertial {
            writer.inertial(inertial);
        }
        if let Some(partial) = link.partial_inertial.as_ref().filter(|_| link.inertial.is_none()) {
            writer.partial_inertial(partial);
        }
        for visual in &link.visuals {
            writer.open("visual", &[]);
            writer.origin(&visual.link_from_shape);
            writer.geometry(&visual.geometry, &file_name);
            if let Some(material) = &visual.material {
                writer.material(material, &file_name);
            }
            writer.close("visual");
        }
        for collision in &link.collisions {
            writer.open("collision", &[]);
            writer.origin(&collision.link_from_shape);
            writer.geometry(&collision.geometry, &file_name);
            writer.close("collision");
        }
        writer.close("link");
    }
    for joint in &robot.joints {
        writer.joint(robot, joint);
    }
    writer.close("robot");
    writer.out
}

type Attributes<'a> = [(&'a str, String)];

struct Writer {
    out: String,
    depth: usize,
}

impl Writer {
    fn start(&mut self, element: &str, attributes: &Attributes<'_>) {
        self.out.extend(std::iter::repeat_n("  ", self.depth));
        self.out.push('<');
        self.out.push_str(element);
        for (name, text) in attributes {
            write_attribute(&mut self.out, name, text);
        }
    }

    fn empty(&mut self, element: &str, attributes: &Attributes<'_>) {
        self.start(element, attributes);
        self.out.push_str("/>\n");
    }

    fn open(&mut self, element: &str, attributes: &Attributes<'_>) {
        self.start(element, attributes);
        self.out.push_str(">\n");
        self.depth += 1;
    }

    fn close(&mut self, element: &str) {
        self.depth -= 1;
        self.out.extend(std::iter::repeat_n("  ", self.depth));
        self.out.push_str("</");
        self.out.push_str(element);
        self.out.push_str(">\n");
    }

    fn origin(&mut self, pose: &Pose) {
        if *pose != Pose::identity() {
            let xyz = format_numbers(pose.translation.vector.as_slice());
            self.empty("origin", &[("xyz", xyz), ("rpy", format_numbers(&rpy_of(&pose.rotation)))]);
        }
    }

    fn inertial(&mut self, inertial: &Inertial) {
        self.open("inertial", &[]);
        self.origin(&inertial.link_from_com);
        self.empty("mass", &[("value", format_number(inertial.mass))]);
        self.moments(&inertial.inertia);
        self.close("inertial");
    }

    fn partial_inertial(&mut self, partial: &PartialInertial) {
        self.open("inertial", &[]);
        if let Some(pose) = &partial.link_from_com {
            let xyz = format_numbers(pose.translation.vector.as_slice());
            self.empty("origin", &[("xyz", xyz), ("rpy", format_numbers(&rpy_of(&pose.rotation)))]);
        }
        for (name, value) in [("mass", partial.mass), ("density", partial.density)] {
            if let Some(value) = value {
                self.empty(name, &[("value", format_number(value))]);
            }
        }
        if let Some(inertia) = &partial.inertia {
            self.moments(inertia);
        }
        self.close("inertial");
    }

    fn moments(&mut self, i: &Matrix3<f64>) {
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        let values = [i[(0, 0)], i[(0, 1)], i[(0, 2)], i[(1, 1)], i[(1, 2)], i[(2, 2)]];
        let attributes: Vec<_> = names.into_iter().zip(values.map(format_number)).collect();
        self.empty("inertia", &attributes);
    }

    fn geometry(&mut self, geometry: &Geometry, file_name: &impl Fn(&Path) -> String) {
        self.open("geometry", &[]);
        match geometry {
            Geometry::Box { size } => self.empty("box", &[("size", format_numbers(size.as_slice()))]),
            Geometry::Cylinder { radius, length } => {
                self.empty("cylinder", &[("radius", format_number(*radius)), ("length", format_number(*length))]);
            }
            Geometry::Capsule { radius, length } => {
                self.empty("capsule", &[("radius", format_number(*radius)), ("length", format_number(*length))]);
            }
            Geometry::Sphere { radius } => self.empty("sphere", &[("radius", format_number(*radius))]),
            Geometry::Mesh { path, scale, .. } => {
                self.empty("mesh", &[("filename", file_name(path)), ("scale", format_numbers(scale.as_slice()))]);
            }
        }
        self.close("geometry");
    }

    fn material(&mut self, material: &Material, file_name: &impl Fn(&Path) -> String) {
        let name = [("name", material.name.clone().unwrap_or_default())];
        if material.rgba.is_none() && material.texture.is_none() {
            return self.empty("material", &name);
        }
        self.open("material", &name);
        if let Some(rgba) = &material.rgba {
            self.empty("color", &[("rgba", format_numbers(rgba))]);
        }
        if let Some(texture) = &material.texture {
            self.empty("texture", &[("filename", file_name(texture))]);
        }
        self.close("material");
    }

    fn joint(&mut self, robot: &RobotDescription, joint: &Joint) {
        self.open("joint", &[("name", joint.name.clone()), ("type", joint.kind.name().to_owned())]);
        self.origin(&joint.parent_from_joint);
        self.empty("parent", &[("link", robot.link(joint.parent).name.clone())]);
        self.empty("child", &[("link", robot.link(joint.child).name.clone())]);
        if !matches!(joint.kind, JointKind::Fixed | JointKind::Floating) {
            self.empty("axis", &[("xyz", format_numbers(joint.axis.as_slice()))]);
        }
        // A strict reader requires `<limit>` for these types; without bounds it limits nothing.
        if joint.limit.is_none() && matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic) {
            self.empty("limit", &[]);
        }
        if let Some(limit) = &joint.limit {
            let values = [
                ("lower", limit.lower),
                ("upper", limit.upper),
                ("effort", limit.effort),
                ("velocity", limit.velocity),
            ];
            self.element_with_values("limit", &values);
        }
        if joint.damping.is_some() || joint.friction.is_some() {
            self.element_with_values("dynamics", &[("damping", joint.damping), ("friction", joint.friction)]);
        }
        if let Some(mimic) = &joint.mimic {
            let attributes = [
                ("joint", robot.joint(mimic.joint).name.clone()),
                ("multiplier", format_number(mimic.multiplier)),
                ("offset", format_number(mimic.offset)),
            ];
            self.empty("mimic", &attributes);
        }
        self.close("joint");
    }

    /// Writes an element with the attributes that have a value.
    fn element_with_values(&mut self, element: &str, values: &[(&'static str, Option<f64>)]) {
        let given: Vec<_> = values.iter().filter_map(|&(name, v)| v.map(|v| (name, format_number(v)))).collect();
        self.empty(element, &given);
    }
}
