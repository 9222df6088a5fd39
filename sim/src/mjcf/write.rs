//! Writer of MJCF text: deterministic, one element per line, with the location that each line came from.
//!
//! Differences between the supported MuJoCo versions are handled here, and for parts in `part`.

use super::document::{
    Actuator, Body, ContactSolver, FrictionCone, Geom, GeomRole, Inertial, Joint, JointType, MeshAsset, MeshContent,
    Mjcf, Shape,
};
use super::part::PartLines;
use crate::light_cfg::LightKindCfg;
use kinetoscope_mujoco::{CompileError, SupportedVersion};
use kinetoscope_scene::Pose;
use kinetoscope_scene::source_location::SourceLocation;
use std::fmt::Write as _;

/// MJCF text with the source of each of its lines.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfText {
    /// XML text.
    pub xml: String,
    /// Location in the user's file of the element that caused each line of `xml`; `None` for lines without one.
    pub sources: Vec<Option<SourceLocation>>,
}

impl MjcfText {
    /// Adds to a compile error the location in the user's file that caused the line in MuJoCo's message.
    #[must_use]
    pub fn locate(&self, mut error: CompileError) -> CompileError {
        error.source_location = error
            .line
            .and_then(|line| self.sources.get(usize::try_from(line).ok()?.checked_sub(1)?))
            .cloned()
            .flatten();
        error
    }
}

/// Writes the document as MJCF text for the MuJoCo version `target`, with the location in the user's file that caused
/// each line.
pub fn write(mjcf: &Mjcf, target: SupportedVersion) -> MjcfText {
    let mut out = MjcfWriter {
        xml: String::new(),
        sources: Vec::new(),
        depth: 0,
        target,
        friction: [2.0 * mjcf.option.timestep, 1.0],
    };
    out.document(mjcf);
    MjcfText { xml: out.xml, sources: out.sources }
}

/// Impedance of dry friction: MuJoCo's largest. Friction at rest is a stiff damper: under a load below its friction, a
/// joint creeps. Its speed is (1 - d) / d of the speed that the load would give it in the time constant of the damper,
/// here one time step. With MuJoCo's defaults (0.9, 10 ms) the joint slides out of the band in which friction holds
/// within a second.
const FRICTION_IMPEDANCE: &str = "0.9999 0.9999 0.001 0.5 2";

/// Impedance of a mimic coupling: MuJoCo's largest, 0.9999. The coupling yields by (1 - d) / d of the acceleration that
/// its load would cause; a finger link of 10 g under its own weight would hang 30 mrad low at MuJoCo's default 0.95.
const COUPLING_IMPEDANCE: &str = "0.9999 0.9999 0.001 0.5 2";

struct MjcfWriter {
    xml: String,
    sources: Vec<Option<SourceLocation>>,
    depth: usize,
    target: SupportedVersion,
    /// `solreffriction` of dry friction in joints.
    friction: [f64; 2],
}

/// Builder of one element.
pub(super) struct Element {
    text: String,
}

impl Element {
    pub(super) fn new(tag: &str) -> Self {
        Self { text: format!("<{tag}") }
    }

    pub(super) fn attr(mut self, name: &str, value: impl std::fmt::Display) -> Self {
        let _ = write!(self.text, " {name}=\"{}\"", escape(&value.to_string()));
        self
    }

    pub(super) fn numbers(self, name: &str, values: &[f64]) -> Self {
        self.attr(name, joined(values))
    }

    fn pose(self, pose: &Pose) -> Self {
        let p = pose.translation.vector;
        let q = pose.rotation;
        let mut out = self;
        if p != nalgebra::Vector3::zeros() {
            out = out.numbers("pos", p.as_slice());
        }
        if q != nalgebra::UnitQuaternion::identity() {
            out = out.numbers("quat", &[q.w, q.i, q.j, q.k]);
        }
        out
    }

    pub(super) fn opt(self, name: &str, value: Option<impl std::fmt::Display>) -> Self {
        match value {
            Some(value) => self.attr(name, value),
            None => self,
        }
    }

    /// Returns the text of an element without content.
    pub(super) fn leaf(self) -> String {
        self.text + "/>"
    }

    /// Returns the opening tag of an element.
    pub(super) fn open(self) -> String {
        self.text + ">"
    }
}

/// Formats a number with the shortest text that reads back to the same value; -0 becomes 0.
pub(super) fn number(value: f64) -> String {
    let value = value + 0.0;
    if value != 0.0 && !(1e-4..1e9).contains(&value.abs()) { format!("{value:e}") } else { format!("{value}") }
}

fn joined(values: &[f64]) -> String {
    values.iter().map(|&v| number(v)).collect::<Vec<_>>().join(" ")
}

fn escape(text: &str) -> String {
    quick_xml::escape::escape(text).replace(['\n', '\r', '\t'], " ")
}

impl MjcfWriter {
    fn line(&mut self, text: &str, source: Option<&SourceLocation>) {
        for _ in 0..self.depth {
            self.xml.push_str("  ");
        }
        self.xml.push_str(text);
        self.xml.push('\n');
        self.sources.push(source.cloned());
    }

    fn leaf(&mut self, element: Element, source: Option<&SourceLocation>) {
        self.line(&element.leaf(), source);
    }

    fn open(&mut self, element: Element, source: Option<&SourceLocation>) {
        self.line(&element.open(), source);
        self.depth += 1;
    }

    fn close(&mut self, tag: &str) {
        self.depth -= 1;
        self.line(&format!("</{tag}>"), None);
    }

    fn document(&mut self, mjcf: &Mjcf) {
        self.open(Element::new("mujoco").attr("model", &mjcf.model), None);
        for comment in &mjcf.comments {
            // "--" would end the comment.
            self.line(&format!("<!-- {} -->", comment.replace("--", "- -").replace('\n', " ")), None);
        }
        self.leaf(
            Element::new("compiler")
                .attr("angle", "radian")
                .attr("autolimits", "false")
                .attr("inertiafromgeom", "false"),
            None,
        );
        self.option(mjcf);
        self.open(Element::new("default"), None);
        self.leaf(Element::new("geom").numbers("friction", &mjcf.option.friction), None);
        self.close("default");
        self.assets(mjcf);
        self.bodies(mjcf);
        self.constraints(mjcf);
        if !mjcf.actuators.is_empty() {
            self.open(Element::new("actuator"), None);
            for actuator in &mjcf.actuators {
                self.actuator(actuator);
            }
            self.close("actuator");
        }
        self.parts(mjcf, "actuator", |part| &part.actuators);
        // MuJoCo 2.2.2 requires actuators with an activation after all others.
        self.parts(mjcf, "actuator", |part| &part.stateful_actuators);
        self.parts(mjcf, "sensor", |part| &part.sensors);
        if !mjcf.keyframes.is_empty() {
            self.open(Element::new("keyframe"), None);
            for key in &mjcf.keyframes {
                let mut element = Element::new("key").attr("name", &key.name).numbers("qpos", &key.qpos);
                if !key.ctrl.is_empty() {
                    element = element.numbers("ctrl", &key.ctrl);
                }
                self.leaf(element, None);
            }
            self.close("keyframe");
        }
        self.close("mujoco");
    }

    fn option(&mut self, mjcf: &Mjcf) {
        let o = &mjcf.option;
        self.leaf(
            Element::new("option")
                .attr("timestep", number(o.timestep))
                .numbers("gravity", o.gravity.as_slice())
                .attr("integrator", o.integrator.name())
                .attr("cone", if o.cone == FrictionCone::Elliptic { "elliptic" } else { "pyramidal" })
                .attr("impratio", number(o.impratio))
                .attr("iterations", o.iterations),
            None,
        );
        // 2.2.2's defaults (500 rows, 100 contacts) drop contacts silently in plain viewers; 4.x sizes its arena on its
        // own.
        if self.target == SupportedVersion::V2 {
            self.leaf(Element::new("size").attr("njmax", 1500).attr("nconmax", 300), None);
        }
    }

    /// Writes the lines of all parts for a section of the document.
    fn parts(&mut self, mjcf: &Mjcf, section: &str, lines: impl Fn(&PartLines) -> &Vec<String>) {
        let target = self.target;
        if mjcf.parts.iter().all(|part| lines(part.lines(target)).is_empty()) {
            return;
        }
        self.open(Element::new(section), None);
        self.part_lines(mjcf, lines);
        self.close(section);
    }

    /// Writes the lines that `lines` selects, of all embedded MJCF files, into the open section.
    fn part_lines(&mut self, mjcf: &Mjcf, lines: impl Fn(&PartLines) -> &Vec<String>) {
        let target = self.target;
        for part in &mjcf.parts {
            let part = part.lines(target);
            for line in lines(part) {
                self.line(line, Some(&part.source));
            }
        }
    }

    fn assets(&mut self, mjcf: &Mjcf) {
        self.own_assets(mjcf);
        self.parts(mjcf, "asset", |part| &part.assets);
    }

    fn own_assets(&mut self, mjcf: &Mjcf) {
        let empty = mjcf.meshes.is_empty() && mjcf.height_fields.is_empty();
        if empty && mjcf.textures.is_empty() && mjcf.materials.is_empty() {
            return;
        }
        self.open(Element::new("asset"), None);
        for texture in &mjcf.textures {
            let element =
                Element::new("texture").attr("type", "2d").attr("name", &texture.name).attr("file", &texture.file);
            self.leaf(element, None);
        }
        for material in &mjcf.materials {
            let element = Element::new("material")
                .attr("name", &material.name)
                .opt("texture", material.texture.as_ref())
                .numbers("rgba", &material.rgba);
            self.leaf(element, None);
        }
        for mesh in &mjcf.meshes {
            self.mesh(mesh);
        }
        for field in &mjcf.height_fields {
            let element =
                Element::new("hfield").attr("name", &field.name).attr("file", &field.file).numbers("size", &field.size);
            self.leaf(element, None);
        }
        self.close("asset");
    }

    fn mesh(&mut self, mesh: &MeshAsset) {
        let mut element = Element::new("mesh").attr("name", &mesh.name);
        if mesh.visual && self.target == SupportedVersion::V4 {
            // A flat or open mesh has no volume: 4.x needs its inertia as a shell; 2.2.2 does not support the
            // attribute.
            element = element.attr("inertia", "shell");
        }
        element = match &mesh.content {
            MeshContent::File(file) => element.attr("file", file),
            MeshContent::Inline { vertices, triangles } => {
                let vertices: Vec<String> = vertices.iter().flatten().map(|v| format!("{v}")).collect();
                let triangles: Vec<String> = triangles.iter().flatten().map(ToString::to_string).collect();
                element.attr("vertex", vertices.join(" ")).attr("face", triangles.join(" "))
            }
        };
        self.leaf(element, mesh.source.as_ref());
    }

    /// Writes the bodies depth first with an explicit stack: a chain of any length must not exhaust the call stack.
    fn bodies(&mut self, mjcf: &Mjcf) {
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); mjcf.bodies.len()];
        for (i, body) in mjcf.bodies.iter().enumerate().skip(1) {
            children[body.parent].push(i);
        }
        self.open(Element::new("worldbody"), None);
        for light in &mjcf.lights {
            let element = Element::new("light").attr("name", &light.name);
            let element = match (light.kind, self.target) {
                (LightKindCfg::Directional, _) => element.attr("directional", "true"),
                (LightKindCfg::Spot { cutoff_deg, exponent }, _) => {
                    element.attr("directional", "false").attr("cutoff", cutoff_deg).attr("exponent", exponent)
                }
                (LightKindCfg::Point, SupportedVersion::V4) => element.attr("type", "point"),
                // As in OpenGL: a cone in all directions. A document has no dome lights.
                (LightKindCfg::Point | LightKindCfg::Dome { .. }, _) => {
                    element.attr("directional", "false").attr("cutoff", 180).attr("exponent", 0)
                }
            };
            // Defaults of MuJoCo are omitted. A directional light has an angle, not a radius.
            let attenuation = light.attenuation.map(|x| x.to_string()).join(" ");
            let radius = self.target == SupportedVersion::V4 && light.kind != LightKindCfg::Directional;
            let element = element
                .numbers("pos", light.position.as_slice())
                .numbers("dir", light.direction.as_slice())
                .numbers("diffuse", &light.diffuse)
                .opt("attenuation", (light.attenuation != [1.0, 0.0, 0.0]).then_some(attenuation))
                .opt("castshadow", (!light.cast_shadow).then_some("false"))
                .opt("bulbradius", radius.then_some(light.radius));
            self.leaf(element, None);
        }
        self.body_content(&mjcf.bodies[0]);
        enum Visit {
            Enter(usize),
            Leave,
        }
        let mut stack: Vec<Visit> = children[0].iter().rev().map(|&b| Visit::Enter(b)).collect();
        while let Some(visit) = stack.pop() {
            match visit {
                Visit::Enter(index) => {
                    let body = &mjcf.bodies[index];
                    let element = self.body(body, children[index].is_empty());
                    self.open(element, body.source.as_ref());
                    self.body_content(body);
                    stack.push(Visit::Leave);
                    stack.extend(children[index].iter().rev().map(|&b| Visit::Enter(b)));
                }
                Visit::Leave => self.close("body"),
            }
        }
        self.part_lines(mjcf, |part| &part.bodies);
        self.close("worldbody");
    }

    fn body(&self, body: &Body, is_leaf: bool) -> Element {
        let mut element = Element::new("body").attr("name", &body.name).pose(&body.pose);
        if body.mocap {
            element = element.attr("mocap", "true");
        }
        let is_free = body.joints.iter().any(|joint| joint.kind == JointType::Free);
        if self.target == SupportedVersion::V4 && is_free && is_leaf {
            // Otherwise 4.x keeps only the diagonal of the inertia matrix of a centered body without children, and an
            // environment cannot have another center of mass. 2.2.2 does not support the attribute.
            element = element.attr("simple", "false");
        }
        element
    }

    fn body_content(&mut self, body: &Body) {
        if let Some(inertial) = &body.inertial {
            self.inertial(inertial);
        }
        for joint in &body.joints {
            self.joint(joint);
        }
        for geom in &body.geoms {
            self.geom(geom);
        }
        for site in &body.sites {
            self.leaf(Element::new("site").attr("name", &site.name).pose(&site.pose), None);
        }
    }

    fn inertial(&mut self, inertial: &Inertial) {
        let q = inertial.axes;
        self.leaf(
            Element::new("inertial")
                .numbers("pos", inertial.com.as_slice())
                .numbers("quat", &[q.w, q.i, q.j, q.k])
                .attr("mass", number(inertial.mass))
                .numbers("diaginertia", inertial.moments.as_slice()),
            inertial.source.as_ref(),
        );
    }

    fn joint(&mut self, joint: &Joint) {
        let mut element = Element::new("joint").attr("name", &joint.name).attr(
            "type",
            match joint.kind {
                JointType::Free => "free",
                JointType::Ball => "ball",
                JointType::Hinge => "hinge",
                JointType::Slide => "slide",
            },
        );
        if matches!(joint.kind, JointType::Hinge | JointType::Slide) {
            element = element.numbers("axis", joint.axis.as_slice());
        }
        element = match joint.range {
            Some(range) => element.attr("limited", "true").numbers("range", &range),
            None => element.attr("limited", "false"),
        };
        for (name, value) in
            [("damping", joint.damping), ("frictionloss", joint.frictionloss), ("armature", joint.armature)]
        {
            if value != 0.0 {
                element = element.attr(name, number(value));
            }
        }
        if joint.frictionloss != 0.0 {
            element = element.numbers("solreffriction", &self.friction).attr("solimpfriction", FRICTION_IMPEDANCE);
        }
        self.leaf(element, joint.source.as_ref());
    }

    fn geom(&mut self, geom: &Geom) {
        let mut element = Element::new("geom").opt("name", geom.name.as_ref());
        element = match &geom.shape {
            Shape::Plane([x, y]) => element.attr("type", "plane").numbers("size", &[*x, *y, 1.0]),
            Shape::Sphere(r) => element.attr("type", "sphere").numbers("size", &[*r]),
            Shape::Capsule(r, h) => element.attr("type", "capsule").numbers("size", &[*r, *h]),
            Shape::Cylinder(r, h) => element.attr("type", "cylinder").numbers("size", &[*r, *h]),
            Shape::Box(half) => element.attr("type", "box").numbers("size", half),
            Shape::Mesh(name) => element.attr("type", "mesh").attr("mesh", name),
            Shape::HeightField(name) => element.attr("type", "hfield").attr("hfield", name),
        };
        element = element.pose(&geom.pose);
        element = match geom.role {
            // MuJoCo's viewers show groups 0 to 2.
            GeomRole::Collision { contype, conaffinity, visible } => element
                .attr("contype", contype)
                .attr("conaffinity", conaffinity)
                .attr("group", if visible { 0 } else { 3 }),
            GeomRole::Visual => element.attr("contype", 0).attr("conaffinity", 0).attr("group", 2),
        };
        if let Some(friction) = &geom.friction {
            element = element.numbers("friction", friction);
        }
        if let Some(surface) = &geom.surface {
            if surface.margin != 0.0 {
                element = element.attr("margin", number(surface.margin));
            }
            if let Some(ContactSolver { solref, solimp, solmix }) = &surface.solver {
                let element_with = element.numbers("solref", solref).numbers("solimp", solimp);
                element = element_with.attr("solmix", number(*solmix));
            }
        }
        element = element.opt("material", geom.material.as_ref());
        if let Some(rgba) = &geom.rgba {
            element = element.numbers("rgba", rgba);
        }
        self.leaf(element, geom.source.as_ref());
    }

    fn constraints(&mut self, mjcf: &Mjcf) {
        if !mjcf.excludes.is_empty() {
            self.open(Element::new("contact"), None);
            for (a, b) in &mjcf.excludes {
                self.leaf(Element::new("exclude").attr("body1", a).attr("body2", b), None);
            }
            self.close("contact");
        }
        if !mjcf.equalities.is_empty() || !mjcf.welds.is_empty() {
            self.open(Element::new("equality"), None);
            for e in &mjcf.equalities {
                let element = Element::new("joint")
                    .attr("name", &e.name)
                    .attr("joint1", &e.follower)
                    .attr("joint2", &e.driver)
                    .numbers("polycoef", &[e.offset, e.multiplier, 0.0, 0.0, 0.0])
                    .numbers("solref", &[2.0 * mjcf.option.timestep, 1.0])
                    .attr("solimp", COUPLING_IMPEDANCE);
                self.leaf(element, e.source.as_ref());
            }
            for weld in &mjcf.welds {
                let element = Element::new("weld")
                    .attr("name", &weld.name)
                    .attr("body1", &weld.first)
                    .attr("body2", &weld.second)
                    .attr("active", "false")
                    .numbers("solref", &[2.0 * mjcf.option.timestep, 1.0])
                    .attr("solimp", COUPLING_IMPEDANCE);
                self.leaf(element, None);
            }
            self.close("equality");
        }
        if !mjcf.friction_tendons.is_empty() {
            self.open(Element::new("tendon"), None);
            for tendon in &mjcf.friction_tendons {
                let element = Element::new("fixed")
                    .attr("name", &tendon.name)
                    .attr("frictionloss", number(tendon.frictionloss))
                    .numbers("solreffriction", &self.friction)
                    .attr("solimpfriction", FRICTION_IMPEDANCE);
                self.open(element, None);
                self.leaf(Element::new("joint").attr("joint", &tendon.joint).attr("coef", 1), None);
                self.close("fixed");
            }
            self.close("tendon");
        }
        self.parts(mjcf, "contact", |part| &part.contacts);
        self.parts(mjcf, "equality", |part| &part.equalities);
        self.parts(mjcf, "tendon", |part| &part.tendons);
    }

    fn actuator(&mut self, a: &Actuator) {
        let mut element = Element::new("general")
            .attr("name", &a.name)
            .attr("joint", &a.joint)
            .numbers("gainprm", &[a.gain])
            .attr("biastype", "affine")
            .numbers("biasprm", &[0.0, -a.kp, -a.kd]);
        element = match a.force_limit {
            Some(limit) => element.attr("forcelimited", "true").numbers("forcerange", &[-limit, limit]),
            None => element.attr("forcelimited", "false"),
        };
        element = match a.ctrl_range {
            Some(range) => element.attr("ctrllimited", "true").numbers("ctrlrange", &range),
            None => element.attr("ctrllimited", "false"),
        };
        self.leaf(element, a.source.as_ref());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        for value in [0.1, 1.0 / 3.0, 1e-300, 6.02e23, -0.0, 1e-5, 123_456_789.25, f64::MIN_POSITIVE] {
            assert_eq!(number(value).parse::<f64>().ok(), Some(value + 0.0), "{}", number(value));
        }
    }

    #[test]
    fn escapes() {
        assert_eq!(escape("a<b>\"&'\n"), "a&lt;b&gt;&quot;&amp;&apos; ");
    }
}
