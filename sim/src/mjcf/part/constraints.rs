//! Writer of the constraints of a part: contact pairs, equalities, tendons.

use super::super::write::{Element, number};
use super::{PartError, PartWriter, format_f32s, mj_index, row, row_of};
use kinetoscope_mujoco::SupportedVersion;
use kinetoscope_mujoco::mjcf_keywords;
use kinetoscope_mujoco::mjcf_keywords::WrapType;

impl PartWriter<'_> {
    /// Writes pairs of geoms with their own contact parameters, and pairs of bodies that never collide.
    pub(super) fn contacts(&self) -> Vec<String> {
        let m = self.model;
        let geom = |id: i32| mj_index(id).map(|id| self.scoped_name(&self.names.geoms[id]));
        let pair = |p: usize| {
            Element::new("pair")
                .opt("geom1", geom(m.pair_geom1()[p]))
                .opt("geom2", geom(m.pair_geom2()[p]))
                .attr("condim", m.pair_dim()[p])
                .numbers("friction", row(m.pair_friction(), 5, p))
                .numbers("solref", row_of(m.pair_solref(), m.npair(), p))
                .numbers("solimp", row_of(m.pair_solimp(), m.npair(), p))
                .attr("margin", number(m.pair_margin()[p]))
                .attr("gap", number(m.pair_gap()[p]))
                .leaf()
        };
        // Geoms of the file's world are in the scene's world.
        let body = |body: usize| if body == 0 { "world".into() } else { self.body(body) };
        let exclude = |[first, second]: [usize; 2]| {
            Element::new("exclude").attr("body1", body(first)).attr("body2", body(second)).leaf()
        };
        let is_kept = |p: &usize| self.rig.is_none_or(|rig| !rig.pairs.contains(p));
        // The world of a robot's file is not the world of the scene.
        let excluded = m.excluded_bodies().filter(|bodies| self.rig.is_none() || !bodies.contains(&0));
        (0..m.npair()).filter(is_kept).map(pair).chain(excluded.map(exclude)).collect()
    }

    pub(super) fn equalities(&self) -> Result<Vec<String>, PartError> {
        (0..self.model.neq()).filter_map(|e| self.equality(e).transpose()).collect()
    }

    /// Writes an equality; `None` if it couples sites and the target MuJoCo version supports bodies only.
    fn equality(&self, e: usize) -> Result<Option<String>, PartError> {
        let m = self.model;
        let kind = mjcf_keywords::equality(m.eq_type()[e])
            .ok_or_else(|| self.unsupported("equality", e, "a type other than connect, weld, joint or tendon"))?;
        let (first, second) = (mj_index(m.eq_obj1id()[e]), mj_index(m.eq_obj2id()[e]));
        let data = row_of(m.eq_data(), m.neq(), e);
        let element = Element::new(kind).attr("name", self.scoped_name(&self.names.equalities[e]));
        let between_sites = m.equality_is_between_sites(e);
        if between_sites && !self.supports_v4("equality", e, &format!("the whole {kind}, because it connects sites")) {
            return Ok(None);
        }
        let site = |id: usize| self.scoped_name(&self.names.sites[id]);
        let element = match kind {
            "joint" => element
                .opt("joint1", first.map(|id| self.scoped_name(&self.names.joints[id])))
                .opt("joint2", second.map(|id| self.scoped_name(&self.names.joints[id])))
                .numbers("polycoef", &data[..5]),
            "tendon" => element
                .opt("tendon1", first.map(|id| self.scoped_name(&self.names.tendons[id])))
                .opt("tendon2", second.map(|id| self.scoped_name(&self.names.tendons[id])))
                .numbers("polycoef", &data[..5]),
            _ if between_sites => element.opt("site1", first.map(site)).opt("site2", second.map(site)),
            _ => element
                .opt("body1", first.map(|id| self.body(id)))
                .opt("body2", second.map(|id| self.body(id)))
                .numbers("anchor", &data[..3]),
        };
        let element = match kind {
            "weld" if between_sites => element.attr("torquescale", number(data[10])),
            "weld" => element.numbers("relpose", &data[3..10]).attr("torquescale", number(data[10])),
            _ => element,
        };
        let element = element
            .attr("active", m.equality_is_active(e))
            .numbers("solref", row_of(m.eq_solref(), m.neq(), e))
            .numbers("solimp", row_of(m.eq_solimp(), m.neq(), e));
        Ok(Some(element.leaf()))
    }

    pub(super) fn tendons(&self) -> Result<Vec<String>, PartError> {
        let mut lines = Vec::new();
        for tendon in 0..self.model.ntendon() {
            self.tendon(tendon, &mut lines)?;
        }
        Ok(lines)
    }

    fn tendon(&self, t: usize, lines: &mut Vec<String>) -> Result<(), PartError> {
        let m = self.model;
        let first = m.tendon_adr()[t] as usize;
        let path = first..first + m.tendon_num()[t] as usize;
        let point = |p: usize| mjcf_keywords::wrap_type(m.wrap_type()[p]);
        let fixed = path.clone().all(|p| point(p) == Some(WrapType::Joint));
        let tag = if fixed { "fixed" } else { "spatial" };
        let mut element = Element::new(tag)
            .attr("name", self.scoped_name(&self.names.tendons[t]))
            .attr("group", m.tendon_group()[t])
            .attr("margin", number(m.tendon_margin()[t]))
            .attr("stiffness", number(m.tendon_stiffness()[t]))
            .attr("damping", number(m.tendon_damping()[t]))
            .attr("frictionloss", number(m.tendon_frictionloss()[t]));
        element = match m.tendon_limited(t) {
            true => element.attr("limited", "true").numbers("range", row(m.tendon_range(), 2, t)),
            false => element.attr("limited", "false"),
        };
        let rest = row_of(m.tendon_lengthspring(), m.ntendon(), t);
        // 2.2.2 has one rest length; 4.x has a range of lengths without force.
        let is_range = rest.windows(2).any(|ends| ends[0] != ends[1]);
        let keeps_range = is_range && self.supports_v4("tendon", t, &format!("upper end {} of springlength", rest[1]));
        let rest = if keeps_range || self.target == SupportedVersion::V4 { rest } else { &rest[..1] };
        element = element
            .numbers("springlength", rest)
            .numbers("solreflimit", row_of(m.tendon_solref_lim(), m.ntendon(), t))
            .numbers("solimplimit", row_of(m.tendon_solimp_lim(), m.ntendon(), t))
            .numbers("solreffriction", row_of(m.tendon_solref_fri(), m.ntendon(), t))
            .numbers("solimpfriction", row_of(m.tendon_solimp_fri(), m.ntendon(), t));
        let inertia = m.tendon_armature(t);
        if inertia != 0.0 && self.supports_v4("tendon", t, &format!("armature {inertia}")) {
            element = element.attr("armature", number(inertia));
        }
        if let Some(range) = m.tendon_actuator_force(t)
            && self.supports_v4("tendon", t, &format!("actuatorfrcrange {range:?}"))
        {
            element = element.attr("actuatorfrclimited", "true").numbers("actuatorfrcrange", &range);
        }
        if !fixed {
            let material = mj_index(m.tendon_matid()[t]).map(|id| self.scoped_name(&self.names.materials[id]));
            element = element
                .attr("width", number(m.tendon_width()[t]))
                .opt("material", material)
                .attr("rgba", format_f32s(row(m.tendon_rgba(), 4, t)));
        }
        lines.push(element.open());
        for p in path {
            let (id, parameter) = (mj_index(m.wrap_objid()[p]), m.wrap_prm()[p]);
            let site = |id: usize| self.scoped_name(&self.names.sites[id]);
            let element = match point(p) {
                Some(WrapType::Joint) => Element::new("joint")
                    .opt("joint", id.map(|id| self.scoped_name(&self.names.joints[id])))
                    .attr("coef", number(parameter)),
                Some(WrapType::Pulley) => Element::new("pulley").attr("divisor", number(parameter)),
                Some(WrapType::Site) => Element::new("site").opt("site", id.map(site)),
                Some(WrapType::Geom) => Element::new("geom")
                    .opt("geom", id.map(|id| self.scoped_name(&self.names.geoms[id])))
                    // MuJoCo stores the index of the side site as a floating-point number.
                    .opt("sidesite", mj_index(parameter.round() as i32).map(site)),
                None => return Err(self.unsupported("tendon", t, "a path with an unknown element type")),
            };
            lines.push(format!("  {}", element.leaf()));
        }
        lines.push(format!("</{tag}>"));
        Ok(())
    }
}
