//! Writer of the actuators of a part, all as `<general>`: MuJoCo's shortcuts only choose parameters of it.

use super::super::write::{Element, number};
use super::{PartError, PartWriter, mj_index, row, row_of};
use kinetoscope_mujoco::mjcf_keywords;

impl PartWriter<'_> {
    /// Returns the actuators without an activation state, and those with one, one XML element each. Both lists are
    /// empty for a robot, because drives replace its actuators.
    pub(super) fn actuators(&self) -> Result<[Vec<String>; 2], PartError> {
        let mut lists = [Vec::new(), Vec::new()];
        if self.rig.is_some() {
            return Ok(lists);
        }
        for actuator in 0..self.model.nactuator() {
            let with_state = usize::from(!self.model.actuator_activation(actuator).is_empty());
            lists[with_state].push(self.actuator(actuator)?);
        }
        Ok(lists)
    }

    fn actuator(&self, a: usize) -> Result<String, PartError> {
        let m = self.model;
        let count = m.nactuator();
        let beyond = |what: &str| self.unsupported("actuator", a, what);
        let transmission = mjcf_keywords::transmission(m.actuator_trntype()[a])
            .ok_or_else(|| beyond("an unknown transmission type"))?;
        let dynamics = mjcf_keywords::dynamics(m.actuator_dyntype()[a]).ok_or_else(|| beyond("an unknown dyntype"))?;
        let gain = mjcf_keywords::gain(m.actuator_gaintype()[a]).ok_or_else(|| beyond("an unknown gaintype"))?;
        let bias = mjcf_keywords::bias(m.actuator_biastype()[a]).ok_or_else(|| beyond("an unknown biastype"))?;
        let dynamics = match dynamics {
            // The same filter, which MuJoCo 2.2.2 integrates with Euler's rule.
            "filterexact" if !self.supports_v4("actuator", a, "dyntype filterexact (replaced by filter)") => "filter",
            known => known,
        };
        let ids = row(m.actuator_trnid(), 2, a);
        let site = |id: usize| self.scoped_name(&self.names.sites[id]);
        let names = &self.names;
        let first = mj_index(ids[0]).map(|id| match transmission {
            "joint" | "jointinparent" => self.scoped_name(&names.joints[id]),
            "tendon" => self.scoped_name(&names.tendons[id]),
            "body" => self.body(id),
            _ => site(id),
        });
        let mut element =
            Element::new("general").attr("name", self.scoped_name(&names.actuators[a])).opt(transmission, first);
        element = match transmission {
            "cranksite" => element
                .opt("slidersite", mj_index(ids[1]).map(site))
                .attr("cranklength", number(m.actuator_cranklength()[a])),
            "site" => element.opt("refsite", mj_index(ids[1]).map(site)),
            _ => element,
        };
        let control = m.actuator_control(a);
        let ranges = [
            ("ctrl", m.actuator_ctrllimited(control), row(m.actuator_ctrlrange(), 2, control)),
            ("force", m.actuator_forcelimited(a), row(m.actuator_forcerange(), 2, a)),
            ("act", m.actuator_actlimited(a), row(m.actuator_actrange(), 2, a)),
        ];
        for (what, limited, range) in ranges {
            element = element.attr(&format!("{what}limited"), limited);
            if limited {
                element = element.numbers(&format!("{what}range"), range);
            }
        }
        let lengths = row(m.actuator_lengthrange(), 2, a);
        if lengths[0] < lengths[1] {
            element = element.numbers("lengthrange", lengths);
        }
        let element = element
            .numbers("gear", row(m.actuator_gear(), 6, a))
            .attr("dyntype", dynamics)
            .attr("gaintype", gain)
            .attr("biastype", bias)
            .numbers("dynprm", row_of(m.actuator_dynprm(), count, a))
            .numbers("gainprm", row_of(m.actuator_gainprm(), count, a))
            .numbers("biasprm", row_of(m.actuator_biasprm(), count, a))
            .attr("group", m.actuator_group()[a]);
        Ok(element.leaf())
    }
}
