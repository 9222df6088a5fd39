//! Reader of `<link>` elements: mass properties, shapes and materials.

use super::error::UrdfError;
use super::file::{LinkMetadata, VisualMetadata};
use super::inertial::read_inertial;
use super::reader::{Reader, format_element, format_number, format_numbers, write_attribute};
use super::rotation::rpy_of;
use super::tree::owned;
use crate::diagnostic::DiagnosticKind;
use kinetoscope_scene::pattern::{closest_names, similar_name};
use kinetoscope_scene::source_location::SourceLocation;
use roxmltree::Node;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Child elements of a link that are read, or that are ignored on purpose.
const KNOWN_ELEMENTS: [&str; 12] = [
    "inertial",
    "visual",
    "collision",
    "self_filter",
    "self_collision_checking",
    "contact",
    "collision_checking",
    "gazebo",
    "plugin",
    "sensor",
    "drake",
    "mujoco",
];

const SHAPES: [&str; 5] = ["box", "cylinder", "capsule", "sphere", "mesh"];

/// Color and texture of a material.
#[derive(Clone, Debug, PartialEq)]
struct MaterialValues {
    rgba: Option<[f64; 4]>,
    texture: Option<String>,
}

/// Materials of a file.
#[derive(Debug, Default)]
pub(super) struct Materials {
    /// Materials with values, defined at the top of the file or inside a visual.
    defined: HashMap<String, (MaterialValues, SourceLocation)>,
    /// Names defined at the top of the file.
    top_level: HashSet<String>,
    /// Names used without values, with the location of their first use.
    referenced: BTreeMap<String, SourceLocation>,
    /// Top-level materials in normalized form.
    pub(super) xml: String,
}

impl Materials {
    /// Reads the top-level materials. A name may be repeated with equal values, or without values.
    pub(super) fn define(&mut self, reader: &mut Reader<'_>, root: Node<'_, '_>) -> Result<(), UrdfError> {
        for node in reader.named(root, "material") {
            let name = reader.required_text(node, "name", "robot", "<material name=\"grey\">")?;
            let look = read_material_values(reader, node, &format!("material \"{name}\""))?;
            if look.rgba.is_none() && look.texture.is_none() {
                // Another definition of the name, later or inside of a visual, has the values.
                continue;
            }
            let source = reader.source(node);
            match self.defined.get(name) {
                Some((first, _)) if *first == look => continue,
                Some((_, first)) => {
                    return Err(UrdfError::NameRepeated {
                        what: "material",
                        name: name.to_owned(),
                        first: first.clone(),
                        second: source,
                    });
                }
                None => {}
            }
            write_material(&mut self.xml, name, &look);
            self.top_level.insert(name.to_owned());
            self.defined.insert(name.to_owned(), (look, source));
        }
        Ok(())
    }

    /// Reads the material of a visual.
    fn read_visual(
        &mut self,
        reader: &mut Reader<'_>,
        node: Node<'_, '_>,
        owner: &str,
    ) -> Result<MaterialValues, UrdfError> {
        let name = reader.text(node, "name")?.unwrap_or_default();
        let look = read_material_values(reader, node, owner)?;
        if look.rgba.is_some() || look.texture.is_some() {
            if !name.is_empty() {
                self.defined.entry(name.to_owned()).or_insert_with(|| (look.clone(), reader.source(node)));
            }
        } else if !name.is_empty() {
            self.referenced.entry(name.to_owned()).or_insert_with(|| reader.source(node));
        }
        Ok(look)
    }

    /// Warns about each name that is used but not defined. Materials that are defined inside visuals are added to the
    /// normalized form, so that the model resolves every name in one place.
    pub(super) fn check(&mut self, reader: &mut Reader<'_>) {
        for (name, source) in &self.referenced {
            if !self.defined.contains_key(name) {
                let message = format!("material \"{name}\" is not defined; the visual keeps the default appearance");
                reader.warn(DiagnosticKind::MaterialUndefined, source.clone(), message);
            }
        }
        for name in self.referenced.keys().filter(|n| !self.top_level.contains(*n)) {
            if let Some((look, _)) = self.defined.get(name) {
                write_material(&mut self.xml, name, look);
            }
        }
    }
}

fn read_material_values(reader: &mut Reader<'_>, node: Node<'_, '_>, owner: &str) -> Result<MaterialValues, UrdfError> {
    let mut rgba = None;
    if let Some(color) = reader.child(node, "color", owner)? {
        rgba = reader.numbers::<4>(color, "rgba")?;
        if let Some(found) = rgba
            && found.iter().any(|c| !(0.0..=1.0).contains(c))
        {
            let at = reader.attribute_source(color, "rgba");
            let message = format!("{owner}: the color {} is outside 0..1; it was clamped", format_numbers(&found));
            reader.warn(DiagnosticKind::ColorClamped, at, message);
            rgba = Some(found.map(|c| c.clamp(0.0, 1.0)));
        }
    }
    let texture = match reader.child(node, "texture", owner)? {
        // Exporters write an empty file name for a material without texture.
        Some(texture) => reader.text(texture, "filename")?.map(str::trim).filter(|f| !f.is_empty()).map(str::to_owned),
        None => None,
    };
    Ok(MaterialValues { rgba, texture })
}

fn write_material(xml: &mut String, name: &str, look: &MaterialValues) {
    xml.push_str("<material");
    write_attribute(xml, "name", name);
    xml.push('>');
    if let Some(rgba) = &look.rgba {
        xml.push_str("<color");
        write_attribute(xml, "rgba", &format_numbers(rgba));
        xml.push_str("/>");
    }
    if let Some(texture) = &look.texture {
        xml.push_str("<texture");
        write_attribute(xml, "filename", texture);
        xml.push_str("/>");
    }
    xml.push_str("</material>");
}

/// Reads a link and appends its normalized form to `xml`.
pub(super) fn read_link(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    name: &str,
    materials: &mut Materials,
    xml: &mut String,
) -> Result<LinkMetadata, UrdfError> {
    let owner = format!("link \"{name}\"");
    warn_unknown(reader, node, &owner, &KNOWN_ELEMENTS);
    xml.push_str("<link");
    write_attribute(xml, "name", name);
    xml.push('>');
    let (mut inertial, mut partial_inertial) = (None, None);
    if let Some(element) = reader.first_child(node, "inertial", &owner)? {
        partial_inertial = read_inertial(reader, element, &owner, xml)?;
        inertial = partial_inertial.is_none().then(|| reader.source(element));
    }
    let (mut visuals, mut collisions) = (Vec::new(), Vec::new());
    for visual in reader.named(node, "visual") {
        let before = xml.len();
        xml.push_str("<visual>");
        read_origin(reader, visual, &owner, xml)?;
        let has_shape = read_geometry(reader, visual, name, &owner, xml)?;
        let material = reader.first_child(visual, "material", &owner)?;
        if let Some(material) = material {
            let look = materials.read_visual(reader, material, &owner)?;
            write_material(xml, material.attribute("name").unwrap_or_default(), &look);
        }
        xml.push_str("</visual>");
        if !has_shape {
            xml.truncate(before);
            continue;
        }
        visuals.push(VisualMetadata {
            source: reader.source(visual),
            material: material.map(|material| reader.source(material)),
        });
    }
    for collision in reader.named(node, "collision") {
        let before = xml.len();
        xml.push_str("<collision>");
        read_origin(reader, collision, &owner, xml)?;
        if !read_geometry(reader, collision, name, &owner, xml)? {
            xml.truncate(before);
            continue;
        }
        xml.push_str("</collision>");
        collisions.push(reader.source(collision));
    }
    xml.push_str("</link>");
    Ok(LinkMetadata { source: reader.source(node), inertial, partial_inertial, visuals, collisions })
}

/// Warns about child elements that are not read: most are typing errors, such as `<colision>`.
pub(super) fn warn_unknown(reader: &mut Reader<'_>, node: Node<'_, '_>, owner: &str, known: &[&str]) {
    let unknown = reader.elements(node).filter(|n| !known.contains(&n.tag_name().name()));
    for child in unknown.collect::<Vec<_>>() {
        let name = child.tag_name().name();
        let hint = similar_name(name, known.iter().copied()).map_or_else(String::new, |like| format!(" (<{like}>?)"));
        let message = format!("{owner}: <{name}> is not read and was ignored{hint}");
        let at = reader.source(child);
        reader.warn(DiagnosticKind::ElementIgnored, at, message);
    }
}

/// Reads the origin of `node` and appends it to `xml`.
pub(super) fn read_origin(
    reader: &Reader<'_>,
    node: Node<'_, '_>,
    owner: &str,
    xml: &mut String,
) -> Result<(), UrdfError> {
    if let Some([xyz, rpy]) = read_pose(reader, node, owner)? {
        xml.push_str("<origin");
        write_attribute(xml, "xyz", &format_numbers(&xyz));
        write_attribute(xml, "rpy", &format_numbers(&rpy));
        xml.push_str("/>");
    }
    Ok(())
}

/// Reads position, and roll, pitch, yaw of the origin of `node`; `None` without an `<origin>`. A quaternion (URDF 1.1)
/// is converted to roll, pitch, yaw.
pub(super) fn read_pose(
    reader: &Reader<'_>,
    node: Node<'_, '_>,
    owner: &str,
) -> Result<Option<[[f64; 3]; 2]>, UrdfError> {
    let Some(origin) = reader.child(node, "origin", owner)? else { return Ok(None) };
    let xyz = reader.numbers::<3>(origin, "xyz")?;
    let mut rpy = reader.numbers::<3>(origin, "rpy")?;
    if let Some(quaternion) = reader.numbers::<4>(origin, "quat_xyzw")? {
        if rpy.is_some() {
            return Err(reader.value(origin, "quat_xyzw", owner, "and rpy are both given; keep one"));
        }
        let largest = quaternion.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        if largest < 1e-9 {
            return Err(reader.value(origin, "quat_xyzw", owner, "is zero, no rotation is \"0 0 0 1\""));
        }
        rpy = Some(rpy_of(&kinetoscope_scene::pose::from_xyzw(quaternion.map(|c| c / largest))));
    }
    Ok(Some([xyz.unwrap_or_default(), rpy.unwrap_or_default()]))
}

/// Reads the shape of `node`. In lenient reading, returns `false` for a shape of size 0 and for a visual without a
/// shape, which the caller leaves out.
fn read_geometry(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    link: &str,
    owner: &str,
    xml: &mut String,
) -> Result<bool, UrdfError> {
    let example = "write <geometry><box size=\"0.1 0.1 0.1\"/></geometry>";
    let geometry = match reader.required_child(node, "geometry", owner, example) {
        Err(error @ UrdfError::ElementMissing { .. }) if node.tag_name().name() == "visual" => {
            let at = reader.source(node);
            reader.warn_or_fail(DiagnosticKind::ShapeEmpty, at, error, "the visual is left out")?;
            return Ok(false);
        }
        found => found?,
    };
    let mut shapes = reader.elements(geometry);
    let Some(shape) = shapes.next() else {
        let error = UrdfError::ElementMissing {
            at: reader.source(geometry),
            owner: owner.to_owned(),
            element: "geometry".to_owned(),
            child: "box",
            fix: "it needs one of <box>, <cylinder>, <capsule>, <sphere>, <mesh>",
        };
        if node.tag_name().name() != "visual" {
            return Err(error);
        }
        let at = reader.source(geometry);
        reader.warn_or_fail(DiagnosticKind::ShapeEmpty, at, error, "the visual is left out")?;
        return Ok(false);
    };
    if let Some(second) = shapes.next() {
        let at = reader.source(second);
        let found = second.tag_name().name().to_owned();
        let error =
            UrdfError::GeometryRepeated { at: at.clone(), owner: owner.to_owned(), found, first: reader.source(shape) };
        reader.warn_or_fail(DiagnosticKind::ElementRepeated, at, error, "the first is used")?;
    }
    let name = shape.tag_name().name();
    if !SHAPES.contains(&name) {
        return Err(UrdfError::ShapeUnknown {
            at: reader.source(shape),
            owner: owner.to_owned(),
            found: name.to_owned(),
            candidates: owned(closest_names(name, SHAPES)),
        });
    }
    xml.push_str("<geometry><");
    xml.push_str(name);
    let has_size = match name {
        "box" => read_box(reader, shape, owner, xml)?,
        "mesh" => {
            read_mesh(reader, shape, link, owner, xml)?;
            true
        }
        "sphere" => read_size(reader, shape, owner, "radius", xml)?,
        // Both sizes are read, so that an invalid length is reported even if the radius is 0.
        _ => read_size(reader, shape, owner, "radius", xml)? & read_size(reader, shape, owner, "length", xml)?,
    };
    xml.push_str("/></geometry>");
    Ok(has_size)
}

/// Reads the edge lengths of a box. Returns `false` if one is 0.
fn read_box(reader: &mut Reader<'_>, shape: Node<'_, '_>, owner: &str, xml: &mut String) -> Result<bool, UrdfError> {
    let Some(size) = reader.numbers::<3>(shape, "size")? else {
        return Err(missing(reader, shape, owner, "size", "size=\"0.1 0.1 0.1\""));
    };
    write_attribute(xml, "size", &format_numbers(&size));
    check_size(reader, shape, owner, "size", &size, "must be positive, full edge lengths in meters")
}

fn read_mesh(
    reader: &mut Reader<'_>,
    mesh: Node<'_, '_>,
    link: &str,
    owner: &str,
    xml: &mut String,
) -> Result<(), UrdfError> {
    let Some(uri) = reader.text(mesh, "filename")? else {
        return Err(missing(reader, mesh, owner, "filename", "filename=\"meshes/part.stl\""));
    };
    if uri.trim().is_empty() {
        return Err(UrdfError::MeshUnnamed { at: reader.source(mesh), link: link.to_owned() });
    }
    write_attribute(xml, "filename", uri.trim());
    if let Some(scale) = read_scale(reader, mesh)? {
        if scale.contains(&0.0) {
            return Err(reader.value(mesh, "scale", owner, "must not be zero along any axis; negative values mirror"));
        }
        write_attribute(xml, "scale", &format_numbers(&scale));
    }
    Ok(())
}

/// Reads the scale of a mesh; `None` without the attribute. In lenient reading, a single number applies to all axes.
fn read_scale(reader: &mut Reader<'_>, mesh: Node<'_, '_>) -> Result<Option<[f64; 3]>, UrdfError> {
    let error = match reader.numbers::<3>(mesh, "scale") {
        Ok(scale) => return Ok(scale),
        Err(error) => error,
    };
    let Ok(Some(scale)) = reader.number(mesh, "scale") else { return Err(error) };
    let at = reader.attribute_source(mesh, "scale");
    reader.warn_or_fail(DiagnosticKind::ScaleUniform, at, error, "the value is used for all three axes")?;
    Ok(Some([scale; 3]))
}

/// Reads a size of a shape. Returns `false` if it is 0.
fn read_size(
    reader: &mut Reader<'_>,
    shape: Node<'_, '_>,
    owner: &str,
    name: &'static str,
    xml: &mut String,
) -> Result<bool, UrdfError> {
    let Some(size) = reader.number(shape, name)? else {
        return Err(missing(reader, shape, owner, name, "a positive number of meters, such as \"0.1\""));
    };
    write_attribute(xml, name, &format_number(size));
    check_size(reader, shape, owner, name, &[size], "must be positive, in meters")
}

/// Checks sizes. Negative sizes are errors; sizes of 0 give `false`, or an error in strict reading.
fn check_size(
    reader: &mut Reader<'_>,
    shape: Node<'_, '_>,
    owner: &str,
    name: &str,
    sizes: &[f64],
    rule: &str,
) -> Result<bool, UrdfError> {
    if sizes.iter().all(|&size| size > 0.0) {
        return Ok(true);
    }
    let error = reader.value(shape, name, owner, rule);
    if sizes.iter().any(|&size| size < 0.0) {
        return Err(error);
    }
    let at = reader.attribute_source(shape, name);
    reader.warn_or_fail(DiagnosticKind::ShapeEmpty, at, error, "the shape is left out")?;
    Ok(false)
}

fn missing(
    reader: &Reader<'_>,
    node: Node<'_, '_>,
    owner: &str,
    attribute: &'static str,
    example: &'static str,
) -> UrdfError {
    UrdfError::AttributeMissing {
        at: reader.source(node),
        owner: format!("{owner}: {}", format_element(node, None)),
        element: node.tag_name().name().to_owned(),
        attribute,
        example,
    }
}
