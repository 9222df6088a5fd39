//! MuJoCo's own sensors.

use super::super::write::{Element, number};
use super::{PartError, Writing, some};
use crate::mj::words::{self, SensorObjects};

impl Writing<'_> {
    pub(super) fn sensors(&self) -> Result<Vec<String>, PartError> {
        (0..self.model.nsensor()).map(|s| self.sensor(s)).collect()
    }

    fn sensor(&self, s: usize) -> Result<String, PartError> {
        let m = self.model;
        let code = m.sensor_type()[s];
        let word = words::sensor(code).ok_or_else(|| {
            let word = words::other_sensor(code).map_or_else(|| code.to_string(), String::from);
            self.beyond("sensor", s, format!("the type {word}"))
        })?;
        let id = some(m.sensor_objid()[s]).unwrap_or(0);
        let of_the_world = match word.word {
            "subtreecom" | "subtreelinvel" | "subtreeangmom" => id == 0,
            "force" | "torque" => m.site_bodyid()[id] == 0,
            _ => false,
        };
        if of_the_world {
            let what = format!("{} of the world, which holds the whole scene", word.word);
            return Err(self.beyond("sensor", s, what));
        }
        let object = self.observed(s, m.sensor_objtype()[s], m.sensor_objid()[s])?;
        let reference = self.observed(s, m.sensor_reftype()[s], m.sensor_refid()[s])?;
        let mut element = Element::new(word.word).attr("name", self.full(&self.names.sensors[s]));
        match (word.objects, object) {
            // Subtrees are called by their body.
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
        Ok(element.leaf())
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
