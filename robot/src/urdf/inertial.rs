//! Reader of `<inertial>` elements, complete or partial.

use super::error::UrdfError;
use super::link::{read_origin, read_pose};
use super::reader::{Reader, format_number, write_attribute};
use crate::description::PartialInertial;
use crate::diagnostic::DiagnosticKind;
use kinetoscope_scene::pose::from_xyz_rpy;
use nalgebra::Matrix3;
use roxmltree::Node;

const EXAMPLE: &str = "an <inertial> needs <mass value=\"1\"/> and <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" \
                       iyz=\"0\" izz=\"0.01\"/>; without mass properties leave the whole <inertial> out";

/// Reads mass properties. Complete ones are appended to `xml`, with the result `None`; partial ones are returned.
pub(super) fn read_inertial(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    owner: &str,
    xml: &mut String,
) -> Result<Option<PartialInertial>, UrdfError> {
    let mut missing = None;
    let mass = match optional_element(reader.required_child(node, "mass", owner, EXAMPLE), &mut missing)? {
        Some(mass) => Some(reader.required_number(mass, "value", owner, "<mass value=\"1\"/>").and_then(|value| {
            let negative = || reader.value(mass, "value", owner, "is negative, a mass is at least 0");
            if value < 0.0 { Err(negative()) } else { Ok(value) }
        })?),
        None => None,
    };
    let moments = match optional_element(reader.required_child(node, "inertia", owner, EXAMPLE), &mut missing)? {
        Some(inertia) => Some(read_moments(reader, inertia, owner)?),
        None => None,
    };
    let (Some(mass), Some(moments)) = (mass, moments) else {
        let at = reader.source(node);
        let done = match (mass, moments) {
            (Some(_), _) => "the inertia is computed from the link's shapes",
            (None, Some(_)) => "the mass is computed from the link's shapes",
            (None, None) => "mass and inertia are computed from the link's shapes",
        };
        if let Some(error) = missing {
            reader.warn_or_fail(DiagnosticKind::InertialIncomplete, at, error, done)?;
        }
        return read_partial(reader, node, owner, mass, moments).map(Some);
    };
    xml.push_str("<inertial>");
    read_origin(reader, node, owner, xml)?;
    xml.push_str("<mass");
    write_attribute(xml, "value", &format_number(mass));
    xml.push_str("/><inertia");
    for (name, value) in MOMENTS.into_iter().zip(moments) {
        write_attribute(xml, name, &format_number(value));
    }
    xml.push_str("/></inertial>");
    Ok(None)
}

/// Makes a required element optional: `None` if it is missing. `missing` keeps the first error about a missing element.
fn optional_element<T>(found: Result<T, UrdfError>, missing: &mut Option<UrdfError>) -> Result<Option<T>, UrdfError> {
    match found {
        Ok(element) => Ok(Some(element)),
        Err(error @ UrdfError::ElementMissing { .. }) => {
            missing.get_or_insert(error);
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn read_partial(
    reader: &Reader<'_>,
    node: Node<'_, '_>,
    owner: &str,
    mass: Option<f64>,
    moments: Option<[f64; 6]>,
) -> Result<PartialInertial, UrdfError> {
    let mut density = None;
    if mass.is_none()
        && let Some(element) = reader.child(node, "density", owner)?
    {
        let value = reader.required_number(element, "value", owner, "<density value=\"1000\"/>")?;
        if value <= 0.0 {
            return Err(reader.value(element, "value", owner, "must be positive, in kg/m³"));
        }
        density = Some(value);
    }
    Ok(PartialInertial {
        source: reader.source(node),
        link_from_com: read_pose(reader, node, owner)?.map(|[xyz, rpy]| from_xyz_rpy(xyz, rpy)),
        mass,
        density,
        inertia: moments.map(|[xx, xy, xz, yy, yz, zz]| Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)),
    })
}

const MOMENTS: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

/// Reads the moments of inertia. Lenient reading takes missing products of inertia as 0.
fn read_moments(reader: &mut Reader<'_>, inertia: Node<'_, '_>, owner: &str) -> Result<[f64; 6], UrdfError> {
    let mut moments = [0.0; 6];
    let mut first_missing = None;
    for (name, moment) in MOMENTS.into_iter().zip(&mut moments) {
        let number = reader.required_number(inertia, name, owner, "all six of ixx ixy ixz iyy iyz izz");
        *moment = match number {
            Err(error @ UrdfError::AttributeMissing { .. }) if matches!(name, "ixy" | "ixz" | "iyz") => {
                first_missing.get_or_insert(error);
                0.0
            }
            number => number?,
        };
    }
    if let Some(error) = first_missing {
        let at = reader.source(inertia);
        reader.warn_or_fail(DiagnosticKind::InertialIncomplete, at, error, "missing products of inertia are 0")?;
    }
    Ok(moments)
}
