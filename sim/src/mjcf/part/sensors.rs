//! Writer of MuJoCo's own sensors.
//!
//! Sensors do not affect the motion, so a part leaves out the sensors that cannot be written.

use super::super::write::{Element, number};
use super::{OmittedElement, PartError, PartNames, PartWriter, mj_index};
use kinetoscope_mujoco::Model;
use kinetoscope_mujoco::mjcf_keywords;
use kinetoscope_mujoco::mjcf_keywords::SensorObjectSyntax;

/// Sensors that only MuJoCo 4.x supports.
const V4_SENSORS: [&str; 4] = ["jointactuatorfrc", "tendonactuatorfrc", "e_potential", "e_kinetic"];

/// Finds the sensors of a file that a part cannot have, with their indices.
pub(crate) fn unsupported_sensors(model: &Model, names: &PartNames) -> Vec<(usize, OmittedElement)> {
    let reason = |s: usize| {
        let property = unsupported_reason(model, s)?;
        Some((s, OmittedElement { element: "sensor", name: names.of("sensor", s), property }))
    };
    (0..model.nsensor()).filter_map(reason).collect()
}

/// Reason why a sensor cannot be written; `None` if it can.
fn unsupported_reason(m: &Model, s: usize) -> Option<String> {
    let code = m.sensor_type()[s];
    let Some(word) = mjcf_keywords::sensor(code) else {
        return Some(format!(
            "the type {}",
            mjcf_keywords::unsupported_sensor(code).map_or_else(|| code.to_string(), String::from)
        ));
    };
    let id = mj_index(m.sensor_objid()[s]).unwrap_or(0);
    let of_the_world = match word.keyword {
        "subtreecom" | "subtreelinvel" | "subtreeangmom" => id == 0,
        "force" | "torque" => m.site_bodyid()[id] == 0,
        _ => false,
    };
    if of_the_world {
        return Some(format!("{} of the world body, which contains the whole scene", word.keyword));
    }
    let observed = [(m.sensor_objtype()[s], m.sensor_objid()[s]), (m.sensor_reftype()[s], m.sensor_refid()[s])];
    if observed.into_iter().any(|(kind, id)| id >= 0 && kind != 0 && mjcf_keywords::object_type(kind).is_none()) {
        return Some("an object type without a frame".into());
    }
    m.unsupported_sensor_feature(s).map(Into::into)
}

impl PartWriter<'_> {
    pub(super) fn sensors(&self) -> Result<Vec<String>, PartError> {
        let is_kept = |s: &usize| self.sensors_left_out.iter().all(|(left_out, _)| left_out != s);
        (0..self.model.nsensor()).filter(is_kept).filter_map(|s| self.sensor(s).transpose()).collect()
    }

    /// Writes a sensor; `None` if the target MuJoCo version does not support its type.
    fn sensor(&self, s: usize) -> Result<Option<String>, PartError> {
        let m = self.model;
        let word = mjcf_keywords::sensor(m.sensor_type()[s])
            .ok_or_else(|| self.unsupported("sensor", s, "an unknown type"))?;
        if V4_SENSORS.contains(&word.keyword) && !self.supports_v4("sensor", s, &format!("the type {}", word.keyword)) {
            return Ok(None);
        }
        let object = self.observed(s, m.sensor_objtype()[s], m.sensor_objid()[s])?;
        let reference = self.observed(s, m.sensor_reftype()[s], m.sensor_refid()[s])?;
        let mut element = Element::new(word.keyword).attr("name", self.scoped_name(&self.names.sensors[s]));
        match (word.object_syntax, object) {
            // Sensors of subtrees name a body.
            (SensorObjectSyntax::Named, Some((kind, name))) => {
                element = element.attr(if kind == "xbody" { "body" } else { kind }, name);
            }
            (SensorObjectSyntax::Frame, Some((kind, name))) => {
                element = element.attr("objtype", kind).attr("objname", name);
                if let Some((kind, name)) = reference {
                    element = element.attr("reftype", kind).attr("refname", name);
                }
            }
            (SensorObjectSyntax::None, _) | (_, None) => {}
        }
        for (attribute, value) in [("cutoff", m.sensor_cutoff()[s]), ("noise", m.sensor_noise()[s])] {
            if value > 0.0 {
                element = element.attr(attribute, number(value));
            }
        }
        Ok(Some(element.leaf()))
    }

    /// Kind and name of an object that a sensor observes; `None` for no object.
    fn observed(&self, sensor: usize, kind: i32, id: i32) -> Result<Option<(&'static str, String)>, PartError> {
        let Some(id) = mj_index(id) else { return Ok(None) };
        if kind == 0 {
            return Ok(None);
        }
        let unknown = || self.unsupported("sensor", sensor, "an object type without a frame");
        let kind = mjcf_keywords::object_type(kind).ok_or_else(unknown)?;
        let names = &self.names;
        let name = match kind {
            "body" | "xbody" => self.body(id),
            "geom" => self.scoped_name(&names.geoms[id]),
            "site" => self.scoped_name(&names.sites[id]),
            "camera" => self.scoped_name(&names.cameras[id]),
            "joint" => self.scoped_name(&names.joints[id]),
            "tendon" => self.scoped_name(&names.tendons[id]),
            _ => self.scoped_name(&names.actuators[id]),
        };
        Ok(Some((kind, name)))
    }
}
