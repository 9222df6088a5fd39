//! Reader of `<joint>` elements.

use super::error::UrdfError;
use super::file::{JointMetadata, LimitMetadata};
use super::link::read_origin;
use super::reader::{Reader, format_number, format_numbers, write_attribute};
use super::tree::{JointEdge, NamedElement, owned};
use crate::description::JointKind;
use crate::diagnostic::DiagnosticKind;
use kinetoscope_scene::pattern::closest_names;
use roxmltree::Node;

/// Deviation of the length of an axis from 1 that is reported. A smaller deviation is rounding in the file.
const AXIS_TOLERANCE: f64 = 1e-3;
/// An axis shorter than this has no direction.
const MIN_AXIS_LENGTH: f64 = 1e-9;

const KINDS: [JointKind; 6] = [
    JointKind::Fixed,
    JointKind::Revolute,
    JointKind::Continuous,
    JointKind::Prismatic,
    JointKind::Floating,
    JointKind::Planar,
];

/// Child elements of a joint that are read, or that are ignored on purpose.
const KNOWN_ELEMENTS: [&str; 12] = [
    "origin",
    "parent",
    "child",
    "axis",
    "limit",
    "dynamics",
    "mimic",
    "calibration",
    "safety_controller",
    "gazebo",
    "plugin",
    "transmission",
];

/// Reads a joint and appends its normalized form to `xml`.
pub(super) fn read_joint(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    name: &str,
    xml: &mut String,
) -> Result<(JointMetadata, JointEdge), UrdfError> {
    let owner = format!("joint \"{name}\"");
    let kind = read_kind(reader, node, name, &owner)?;
    super::link::warn_unknown(reader, node, &owner, &KNOWN_ELEMENTS);

    xml.push_str("<joint");
    write_attribute(xml, "name", name);
    write_attribute(xml, "type", kind.name());
    xml.push('>');
    read_origin(reader, node, &owner, xml)?;
    let parent = read_link_reference(reader, node, "parent", &owner, xml)?;
    let child = read_link_reference(reader, node, "child", &owner, xml)?;
    read_axis(reader, node, kind, &owner, xml)?;
    let limit = read_limit(reader, node, kind, name, &owner, xml)?;
    let (damping, friction) = read_dynamics(reader, node, &owner, xml)?;
    read_calibration(reader, node, &owner, xml)?;
    let mimic = read_mimic(reader, node, kind, &owner, xml)?;
    xml.push_str("</joint>");

    if kind.is_drivable() && mimic.is_none() {
        warn_unlimited(reader, node, &owner)?;
    }
    let source = reader.source(node);
    let notes = JointMetadata {
        source: source.clone(),
        limit,
        damping,
        friction,
        mimic: mimic.as_ref().map(|m| m.source.clone()),
    };
    let joint = NamedElement { name: name.to_owned(), source };
    Ok((notes, JointEdge { joint, parent, child, mimic, kind: kind.name(), is_drivable: kind.is_drivable() }))
}

fn read_kind(reader: &Reader<'_>, node: Node<'_, '_>, name: &str, owner: &str) -> Result<JointKind, UrdfError> {
    let found = reader.required_text(node, "type", owner, "type=\"revolute\"")?;
    KINDS.into_iter().find(|k| k.name() == found).ok_or_else(|| UrdfError::JointTypeUnknown {
        at: reader.attribute_source(node, "type"),
        joint: name.to_owned(),
        found: found.to_owned(),
        candidates: owned(closest_names(found, KINDS.map(JointKind::name))),
    })
}

/// Reads the parent or child link.
fn read_link_reference(
    reader: &Reader<'_>,
    node: Node<'_, '_>,
    role: &'static str,
    owner: &str,
    xml: &mut String,
) -> Result<NamedElement, UrdfError> {
    let fix = "a joint connects <parent link=\"...\"/> and <child link=\"...\"/>";
    let end = reader.required_child(node, role, owner, fix)?;
    let name = reader.required_text(end, "link", owner, "link=\"name_of_a_link\"")?;
    xml.push('<');
    xml.push_str(role);
    write_attribute(xml, "link", name);
    xml.push_str("/>");
    Ok(NamedElement { name: name.to_owned(), source: reader.source(end) })
}

/// Reads the axis as a unit vector. Joint types without an axis may have any value: exporters write `0 0 0` for fixed
/// joints.
fn read_axis(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    kind: JointKind,
    owner: &str,
    xml: &mut String,
) -> Result<(), UrdfError> {
    let Some(axis) = reader.first_child(node, "axis", owner)? else { return Ok(()) };
    let has_axis = !matches!(kind, JointKind::Fixed | JointKind::Floating);
    let Some(xyz) = reader.numbers::<3>(axis, "xyz")? else {
        let at = reader.source(axis);
        let error = UrdfError::AttributeMissing {
            at: at.clone(),
            owner: owner.to_owned(),
            element: "axis".to_owned(),
            attribute: "xyz",
            example: "xyz=\"0 0 1\"",
        };
        if has_axis {
            return Err(error);
        }
        let done = format!("a {} joint needs no axis, so it was ignored", kind.name());
        return reader.warn_or_fail(DiagnosticKind::ElementIgnored, at, error, &done);
    };
    if !has_axis {
        return Ok(());
    }
    // Scaled by the largest component first: squares of huge or tiny components would overflow or vanish.
    let largest = xyz.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let norm =
        if largest > 0.0 { largest * xyz.map(|c| (c / largest).powi(2)).iter().sum::<f64>().sqrt() } else { 0.0 };
    if norm < MIN_AXIS_LENGTH {
        return Err(reader.value(axis, "xyz", owner, "is zero, the axis needs a direction, such as \"0 0 1\""));
    }
    if (norm - 1.0).abs() > AXIS_TOLERANCE {
        let at = reader.attribute_source(axis, "xyz");
        let message = format!("{owner}: the axis {} has length {norm:.6}; it was normalized", format_numbers(&xyz));
        reader.warn(DiagnosticKind::AxisNormalized, at, message);
    }
    let length = xyz.map(|c| (c / largest).powi(2)).iter().sum::<f64>().sqrt();
    xml.push_str("<axis");
    write_attribute(xml, "xyz", &format_numbers(&xyz.map(|c| c / largest / length)));
    xml.push_str("/>");
    Ok(())
}

fn read_limit(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    kind: JointKind,
    name: &str,
    owner: &str,
    xml: &mut String,
) -> Result<Option<LimitMetadata>, UrdfError> {
    let Some(limit) = reader.first_child(node, "limit", owner)? else {
        return match kind {
            JointKind::Revolute | JointKind::Prismatic => {
                Err(UrdfError::LimitMissing { at: reader.source(node), joint: name.to_owned(), kind: kind.name() })
            }
            _ => Ok(None),
        };
    };
    let (mut lower, mut upper) = (reader.number(limit, "lower")?, reader.number(limit, "upper")?);
    let (effort, velocity) =
        (reader.non_negative(limit, "effort", owner)?, reader.non_negative(limit, "velocity", owner)?);
    // An absent bound is 0, URDF's default.
    let (l, u) = (lower.unwrap_or(0.0), upper.unwrap_or(0.0));
    if l > u {
        let message = format!("{owner}: lower limit {l} is above upper limit {u}; both were ignored");
        let at = reader.source(limit);
        reader.warn(DiagnosticKind::LimitIgnored, at, message);
        (lower, upper) = (None, None);
    }
    xml.push_str("<limit");
    for (attribute_name, value) in [("lower", lower), ("upper", upper), ("effort", effort), ("velocity", velocity)] {
        write_attribute(xml, attribute_name, &format_number(value.unwrap_or(0.0)));
    }
    xml.push_str("/>");
    Ok(Some(LimitMetadata {
        source: reader.source(limit),
        lower: lower.is_some(),
        upper: upper.is_some(),
        effort: effort.is_some(),
        velocity: velocity.is_some(),
    }))
}

/// Reads joint dynamics. Returns whether the file gives damping, and whether it gives friction.
fn read_dynamics(
    reader: &Reader<'_>,
    node: Node<'_, '_>,
    owner: &str,
    xml: &mut String,
) -> Result<(bool, bool), UrdfError> {
    let Some(dynamics) = reader.child(node, "dynamics", owner)? else { return Ok((false, false)) };
    let damping = reader.non_negative(dynamics, "damping", owner)?;
    let friction = reader.non_negative(dynamics, "friction", owner)?;
    xml.push_str("<dynamics");
    write_attribute(xml, "damping", &format_number(damping.unwrap_or(0.0)));
    write_attribute(xml, "friction", &format_number(friction.unwrap_or(0.0)));
    xml.push_str("/>");
    Ok((damping.is_some(), friction.is_some()))
}

/// Copies calibration and safety controller into the model. The simulation does not use them.
fn read_calibration(reader: &Reader<'_>, node: Node<'_, '_>, owner: &str, xml: &mut String) -> Result<(), UrdfError> {
    if let Some(calibration) = reader.child(node, "calibration", owner)? {
        xml.push_str("<calibration");
        for name in ["rising", "falling"] {
            if let Some(value) = reader.number(calibration, name)? {
                write_attribute(xml, name, &format_number(value));
            }
        }
        xml.push_str("/>");
    }
    if let Some(safety) = reader.child(node, "safety_controller", owner)? {
        xml.push_str("<safety_controller");
        for name in ["soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"] {
            write_attribute(xml, name, &format_number(reader.number(safety, name)?.unwrap_or(0.0)));
        }
        xml.push_str("/>");
    }
    Ok(())
}

/// Reads the followed joint; `None` without a `<mimic>`. A mimic on a joint without a single degree of freedom is
/// ignored with a warning.
fn read_mimic(
    reader: &mut Reader<'_>,
    node: Node<'_, '_>,
    kind: JointKind,
    owner: &str,
    xml: &mut String,
) -> Result<Option<NamedElement>, UrdfError> {
    let Some(mimic) = reader.child(node, "mimic", owner)? else { return Ok(None) };
    let joint = reader.required_text(mimic, "joint", owner, "joint=\"name_of_a_joint\"")?;
    let multiplier = reader.number(mimic, "multiplier")?.unwrap_or(1.0);
    let offset = reader.number(mimic, "offset")?.unwrap_or(0.0);
    let source = reader.source(mimic);
    if !kind.is_drivable() {
        let message = format!("{owner}: is {} and cannot follow \"{joint}\"; its <mimic> was ignored", kind.name());
        reader.warn(DiagnosticKind::ElementIgnored, source, message);
        return Ok(None);
    }
    xml.push_str("<mimic");
    write_attribute(xml, "joint", joint);
    write_attribute(xml, "multiplier", &format_number(multiplier));
    write_attribute(xml, "offset", &format_number(offset));
    xml.push_str("/>");
    Ok(Some(NamedElement { name: joint.to_owned(), source }))
}

fn warn_unlimited(reader: &mut Reader<'_>, node: Node<'_, '_>, owner: &str) -> Result<(), UrdfError> {
    // `read_limit` reports further limits.
    let limit = reader.named(node, "limit").next();
    let effort = match limit {
        Some(limit) => reader.number(limit, "effort")?,
        None => None,
    };
    let found = match effort {
        None => "has no effort limit",
        Some(0.0) => "has effort limit 0",
        Some(_) => return Ok(()),
    };
    let at = reader.source(limit.unwrap_or(node));
    reader.warn(DiagnosticKind::EffortUnlimited, at, format!("{owner} {found}; its effort is not limited"));
    Ok(())
}
