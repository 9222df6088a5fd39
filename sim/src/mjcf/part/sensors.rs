//! Writer of MuJoCo's own sensors.
//!
//! Sensors do not affect the motion, so a part leaves out the sensors that cannot be written.

use super::super::write::{Element, number};
use super::{LeftOut, PartError, PartNames, Writing, some};
use kinetoscope_mujoco::Model;
use kinetoscope_mujoco::words;
use kinetoscope_mujoco::words::SensorObjects;

/// Sensors that only MuJoCo 4.x supports.
const NEWER: [&str; 4] = ["jointactuatorfrc", "tendonactuatorfrc", "e_potential", "e_kinetic"];

/// Finds the sensors of a file that a part cannot have, with their indices.
pub(crate) fn left_out(model: &Model, names: &PartNames) -> Vec<(usize, LeftOut)> {
    let reason = |s: usize| {
        let what = obstacle(model, s)?;
        Some((s, LeftOut { element: "sensor", name: names.of("sensor", s), what }))
    };
    (0..model.nsensor()).filter_map(reason).collect()
}

/// Reason why a sensor cannot be written, if any.
fn obstacle(m: &Model, s: usize) -> Option<String> {
    let code = m.sensor_type()[s];
    let Some(word) = words::sensor(code) else {
        return Some(format!("the type {}", words::other_sensor(code).map_or_else(|| code.to_string(), String::from)));
    };
    let id = some(m.sensor_objid()[s]).unwrap_or(0);
    let of_the_world = match word.word {
        "subtreecom" | "subtreelinvel" | "subtreeangmom" => id == 0,
        "force" | "torque" => m.site_bodyid()[id] == 0,
        _ => false,
    };
    if of_the_world {
        return Some(format!("{} of the world, which holds the whole scene", word.word));
    }
    let observed = [(m.sensor_objtype()[s], m.sensor_objid()[s]), (m.sensor_reftype()[s], m.sensor_refid()[s])];
    if observed.into_iter().any(|(kind, id)| id >= 0 && kind != 0 && words::observed(kind).is_none()) {
        return Some("an object of a kind that has no frame".into());
    }
    m.sensor_beyond(s).map(Into::into)
}

impl Writing<'_> {
    pub(super) fn sensors(&self) -> Result<Vec<String>, PartError> {
        let is_kept = |s: &usize| self.sensors_left_out.iter().all(|(left_out, _)| left_out != s);
        (0..self.model.nsensor()).filter(is_kept).filter_map(|s| self.sensor(s).transpose()).collect()
    }

    /// Writes a sensor; `None` if the target MuJoCo version does not support its type.
    fn sensor(&self, s: usize) -> Result<Option<String>, PartError> {
        let m = self.model;
        let word = words::sensor(m.sensor_type()[s]).ok_or_else(|| self.beyond("sensor", s, "an unknown type"))?;
        if NEWER.contains(&word.word) && !self.newer("sensor", s, &format!("the type {}", word.word)) {
            return Ok(None);
        }
        let object = self.observed(s, m.sensor_objtype()[s], m.sensor_objid()[s])?;
        let reference = self.observed(s, m.sensor_reftype()[s], m.sensor_refid()[s])?;
        let mut element = Element::new(word.word).attr("name", self.full(&self.names.sensors[s]));
        match (word.objects, object) {
            // Sensors of subtrees name a body.
            (SensorObjects::Named, Some((kind, name))) => {
                element = element.attr(if kind == "xbody" { "body" } else { kind }, name);
            }
            (SensorObjects::Frame, Some((kind, name))) => {
                element = element.attr("objtype", kind).attr("objname", name);
                if let Some((kind, name)) = reference {
                    element = element.attr("reftype", kind).attr("refname", name);
                }
            }
            (SensorObjects::None, _) | (_, None) => {}
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
        let Some(id) = some(id) else { return Ok(None) };
        if kind == 0 {
            return Ok(None);
        }
        let unknown = || self.beyond("sensor", sensor, "an object of a kind that has no frame");
        let kind = words::observed(kind).ok_or_else(unknown)?;
        let names = &self.names;
        let name = match kind {
            "body" | "xbody" => self.body(id),
            "geom" => self.full(&names.geoms[id]),
            "site" => self.full(&names.sites[id]),
            "camera" => self.full(&names.cameras[id]),
            "joint" => self.full(&names.joints[id]),
            "tendon" => self.full(&names.tendons[id]),
            _ => self.full(&names.actuators[id]),
        };
        Ok(Some((kind, name)))
    }
}
