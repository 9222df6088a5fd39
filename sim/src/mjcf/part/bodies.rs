//! Writer of the bodies of a part, with mass properties, joints, geoms, sites, cameras and lights.

use super::super::write::{Element, number};
use super::{PartError, PartWriter, PassiveJointProperties, RootAttachment, format_f32s, mj_index, row, row_of};
use kinetoscope_look::LightType;
use kinetoscope_mujoco::{SupportedVersion, mjcf_keywords};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::{from_row, to_row};

/// MuJoCo's gray of geoms without a color; it lets the color of the material show through.
const DEFAULT_GEOM_RGBA: [f32; 4] = [0.5, 0.5, 0.5, 1.0];

/// Indices of the elements of one kind, one list for each body. `of[i]` is the body of element i; elements with a
/// negative body are skipped.
fn by_body(bodies: usize, of: &[i32]) -> Vec<Vec<usize>> {
    let mut lists = vec![Vec::new(); bodies];
    for (index, body) in of.iter().enumerate() {
        if let Some(body) = mj_index(*body) {
            lists[body].push(index);
        }
    }
    lists
}

/// A tree of elements as indented lines.
struct IndentedLines {
    lines: Vec<String>,
    depth: usize,
}

impl IndentedLines {
    fn push(&mut self, text: &str) {
        self.lines.push("  ".repeat(self.depth) + text);
    }
}

impl PartWriter<'_> {
    /// Writes the bodies depth first with an explicit stack, like the writer of the document.
    pub(super) fn bodies(&self) -> Result<Vec<String>, PartError> {
        enum Visit {
            Enter(usize),
            Leave,
        }
        let m = self.model;
        let count = m.nbody();
        let mut children = vec![Vec::new(); count];
        for body in 1..count {
            children[m.body_parentid()[body] as usize].push(body);
        }
        let contents = BodyElements {
            joints: by_body(count, m.jnt_bodyid()),
            geoms: by_body(count, m.geom_bodyid()),
            sites: by_body(count, m.site_bodyid()),
            cameras: by_body(count, m.cam_bodyid()),
            lights: by_body(count, m.light_bodyid()),
        };
        let mut tree = IndentedLines { lines: Vec::new(), depth: 0 };
        tree.push(&with_pose(Element::new("body").attr("name", self.uid), &to_row(self.pose)).open());
        if self.rig.is_none() {
            tree.depth += 1;
            self.cameras_and_lights(0, &contents, &mut tree)?;
            tree.depth -= 1;
        }
        tree.push("</body>");
        if self.rig.is_none() {
            // In the world body: MuJoCo 2.2.2 finds the contacts of planes in other bodies twice.
            self.shapes(0, &contents, &mut tree)?;
        }
        let mut stack: Vec<Visit> = children[0].iter().rev().map(|&b| Visit::Enter(b)).collect();
        while let Some(visit) = stack.pop() {
            match visit {
                Visit::Enter(body) => {
                    tree.push(&self.body_element(body).open());
                    tree.depth += 1;
                    self.content(body, &contents, &mut tree)?;
                    stack.push(Visit::Leave);
                    stack.extend(children[body].iter().rev().map(|&b| Visit::Enter(b)));
                }
                Visit::Leave => {
                    tree.depth -= 1;
                    tree.push("</body>");
                }
            }
        }
        Ok(tree.lines)
    }

    fn body_element(&self, body: usize) -> Element {
        let m = self.model;
        let place = pose_row(row(m.body_pos(), 3, body), row(m.body_quat(), 4, body));
        let place = self.to_scene_body(m.body_parentid()[body], place);
        let mut element = with_pose(Element::new("body").attr("name", self.body(body)), &place);
        if m.body_mocapid()[body] >= 0 {
            element = element.attr("mocap", "true");
        }
        let gravcomp = m.body_gravity_compensation(body);
        if gravcomp != 0.0 && self.supports_v4("body", body, &format!("gravcomp {gravcomp}")) {
            element.attr("gravcomp", number(gravcomp))
        } else {
            element
        }
    }

    fn content(&self, body: usize, contents: &BodyElements, tree: &mut IndentedLines) -> Result<(), PartError> {
        let m = self.model;
        if let Some(own) = self.rig.and_then(|rig| rig.inertials.get(&body)) {
            let axes = own.axes.quaternion();
            let element = Element::new("inertial")
                .numbers("pos", own.com.as_slice())
                .numbers("quat", &[axes.w, axes.i, axes.j, axes.k])
                .attr("mass", number(own.mass))
                .numbers("diaginertia", own.moments.as_slice());
            tree.push(&element.leaf());
        } else if body > 0 && (m.body_mass()[body] > 0.0 || row(m.body_inertia(), 3, body).iter().any(|x| *x > 0.0)) {
            let element = Element::new("inertial")
                .numbers("pos", row(m.body_ipos(), 3, body))
                .numbers("quat", row(m.body_iquat(), 4, body))
                .attr("mass", number(m.body_mass()[body]))
                .numbers("diaginertia", row(m.body_inertia(), 3, body));
            tree.push(&element.leaf());
        }
        let base = self.rig.map(|rig| &rig.base);
        if let Some(RootAttachment::Free { name, .. }) =
            base.filter(|base| matches!(base, RootAttachment::Free { body: b, .. } if *b == body))
        {
            tree.push(&Element::new("joint").attr("name", name).attr("type", "free").leaf());
        }
        for &joint in &contents.joints[body] {
            if base != Some(&RootAttachment::Fixed(joint)) {
                tree.push(&self.joint(joint)?.leaf());
            }
        }
        self.shapes(body, contents, tree)?;
        self.cameras_and_lights(body, contents, tree)
    }

    fn shapes(&self, body: usize, contents: &BodyElements, tree: &mut IndentedLines) -> Result<(), PartError> {
        for &geom in &contents.geoms[body] {
            tree.push(&self.geom(geom)?.leaf());
        }
        for &site in &contents.sites[body] {
            tree.push(&self.site(site)?.leaf());
        }
        Ok(())
    }

    /// Transforms a pose in a body of the file to the same body of the scene. The pose of the part applies to children
    /// of the world.
    fn to_scene_body(&self, body: i32, place: [f64; 7]) -> [f64; 7] {
        let moved = body == 0 && *self.pose != Pose::identity();
        if moved { to_row(&(self.pose * from_row(&place))) } else { place }
    }

    fn cameras_and_lights(
        &self,
        body: usize,
        contents: &BodyElements,
        tree: &mut IndentedLines,
    ) -> Result<(), PartError> {
        for &camera in &contents.cameras[body] {
            tree.push(&self.camera(camera)?.leaf());
        }
        for &light in &contents.lights[body] {
            if let Some(element) = self.light(light)? {
                tree.push(&element.leaf());
            }
        }
        Ok(())
    }

    fn joint(&self, joint: usize) -> Result<Element, PartError> {
        let m = self.model;
        let kind = mjcf_keywords::joint(m.jnt_type()[joint])
            .ok_or_else(|| self.unsupported("joint", joint, "an unknown type"))?;
        let (qpos, dof) = (m.jnt_qposadr()[joint] as usize, m.jnt_dofadr()[joint] as usize);
        let mut element =
            Element::new("joint").attr("name", self.scoped_name(&self.names.joints[joint])).attr("type", kind);
        if matches!(kind, "hinge" | "slide") {
            element = element
                .numbers("axis", row(m.jnt_axis(), 3, joint))
                .attr("ref", number(m.qpos0()[qpos]))
                .attr("springref", number(m.qpos_spring()[qpos]));
        }
        if kind != "free" {
            element = element.numbers("pos", row(m.jnt_pos(), 3, joint));
        }
        element = match m.jnt_limited(joint) {
            true => element.attr("limited", "true").numbers("range", row(m.jnt_range(), 2, joint)),
            false => element.attr("limited", "false"),
        };
        // A robot's drives have that limit as their largest effort, which the configuration may raise.
        if self.rig.is_none()
            && let Some(range) = m.joint_actuator_force(joint)
            && self.supports_v4("joint", joint, &format!("actuatorfrcrange {range:?}"))
        {
            element = element.attr("actuatorfrclimited", "true").numbers("actuatorfrcrange", &range);
        }
        let of_file = PassiveJointProperties {
            damping: m.dof_damping()[dof],
            armature: m.dof_armature()[dof],
            frictionloss: m.dof_frictionloss()[dof],
        };
        let PassiveJointProperties { damping, armature, frictionloss } =
            self.rig.map_or(of_file, |rig| rig.joints[joint]);
        Ok(element
            .attr("margin", number(m.jnt_margin()[joint]))
            .attr("stiffness", number(m.jnt_stiffness()[joint]))
            .attr("damping", number(damping))
            .attr("armature", number(armature))
            .attr("frictionloss", number(frictionloss))
            .numbers("solreflimit", row_of(m.jnt_solref(), m.njnt(), joint))
            .numbers("solimplimit", row_of(m.jnt_solimp(), m.njnt(), joint))
            .numbers("solreffriction", row_of(m.dof_solref(), m.nv(), dof))
            .numbers("solimpfriction", row_of(m.dof_solimp(), m.nv(), dof))
            .attr("group", m.jnt_group()[joint]))
    }

    fn geom(&self, geom: usize) -> Result<Element, PartError> {
        let m = self.model;
        let (kind, sizes) = mjcf_keywords::geom(m.geom_type()[geom])
            .ok_or_else(|| self.unsupported("geom", geom, "a type other than plane, hfield, primitive or mesh"))?;
        let place = pose_row(row(m.geom_pos(), 3, geom), row(m.geom_quat(), 4, geom));
        let place = self.to_scene_body(m.geom_bodyid()[geom], place);
        let mut element =
            Element::new("geom").attr("name", self.scoped_name(&self.names.geoms[geom])).attr("type", kind);
        if sizes > 0 {
            element = element.numbers("size", &row(m.geom_size(), 3, geom)[..sizes]);
        }
        if let Some(data) = mj_index(m.geom_dataid()[geom]) {
            element = match kind {
                "mesh" => element.attr("mesh", self.scoped_name(&self.names.meshes[data])),
                "hfield" => element.attr("hfield", self.scoped_name(&self.names.height_fields[data])),
                // A primitive that was fitted to a mesh has its size already.
                _ => element,
            };
        }
        let of_file = [m.geom_contype()[geom], m.geom_conaffinity()[geom]];
        let [contype, conaffinity] = match self.rig {
            Some(rig) if of_file != [0, 0] || rig.colliding.contains(&geom) => rig.contact,
            _ => of_file,
        };
        element = with_pose(element, &place)
            .attr("contype", contype)
            .attr("conaffinity", conaffinity)
            .attr("condim", m.geom_condim()[geom])
            .attr("priority", m.geom_priority()[geom])
            .attr("group", m.geom_group()[geom])
            .numbers("friction", row(m.geom_friction(), 3, geom))
            .attr("solmix", number(m.geom_solmix()[geom]))
            .numbers("solref", row_of(m.geom_solref(), m.ngeom(), geom))
            .numbers("solimp", row_of(m.geom_solimp(), m.ngeom(), geom))
            .attr("margin", number(m.geom_margin()[geom]))
            .attr("gap", number(m.geom_gap()[geom]));
        // The first number enables the coefficients; the numbers after the five coefficients follow from the size.
        let fluid = row_of(m.geom_fluid(), m.ngeom(), geom);
        if let Some(coefficients) = fluid.get(1..6).filter(|_| fluid[0] > 0.0) {
            element = element.attr("fluidshape", "ellipsoid").numbers("fluidcoef", coefficients);
        }
        Ok(self.with_appearance(element, m.geom_matid()[geom], row(m.geom_rgba(), 4, geom)))
    }

    fn with_appearance(&self, element: Element, material: i32, rgba: &[f32]) -> Element {
        let element = element.opt("material", mj_index(material).map(|id| self.scoped_name(&self.names.materials[id])));
        if rgba == DEFAULT_GEOM_RGBA { element } else { element.attr("rgba", format_f32s(rgba)) }
    }

    fn site(&self, site: usize) -> Result<Element, PartError> {
        let m = self.model;
        let (kind, sizes) = mjcf_keywords::geom(m.site_type()[site])
            .filter(|(_, sizes)| *sizes > 0)
            .ok_or_else(|| self.unsupported("site", site, "a type other than a primitive"))?;
        let place = pose_row(row(m.site_pos(), 3, site), row(m.site_quat(), 4, site));
        let place = self.to_scene_body(m.site_bodyid()[site], place);
        let element = Element::new("site")
            .attr("name", self.scoped_name(&self.names.sites[site]))
            .attr("type", kind)
            .numbers("size", &row(m.site_size(), 3, site)[..sizes])
            .attr("group", m.site_group()[site]);
        Ok(self.with_appearance(with_pose(element, &place), m.site_matid()[site], row(m.site_rgba(), 4, site)))
    }

    fn camera(&self, camera: usize) -> Result<Element, PartError> {
        let m = self.model;
        let mode = mjcf_keywords::tracking_mode(m.cam_mode()[camera])
            .ok_or_else(|| self.unsupported("camera", camera, "an unknown mode"))?;
        let place = pose_row(row(m.cam_pos(), 3, camera), row(m.cam_quat(), 4, camera));
        let element = Element::new("camera")
            .attr("name", self.scoped_name(&self.names.cameras[camera]))
            .attr("mode", mode)
            .opt("target", mj_index(m.cam_targetbodyid()[camera]).map(|body| self.body(body)))
            .attr("fovy", number(m.cam_fovy()[camera]))
            .attr("ipd", number(m.cam_ipd()[camera]));
        Ok(with_pose(element, &place))
    }

    /// Writes a light; `None` for an image-based light, which lights whole scenes.
    fn light(&self, light: usize) -> Result<Option<Element>, PartError> {
        let m = self.model;
        let mode = mjcf_keywords::tracking_mode(m.light_mode()[light])
            .ok_or_else(|| self.unsupported("light", light, "an unknown mode"))?;
        let values = m.light(light);
        let element = Element::new("light")
            .attr("name", self.scoped_name(&self.names.lights[light]))
            .attr("mode", mode)
            .opt("target", mj_index(m.light_targetbodyid()[light]).map(|body| self.body(body)));
        let element = match (values.kind, self.target) {
            (LightType::Image, _) => return Ok(None),
            (LightType::Point, _) if self.supports_v4("light", light, "type point") => element.attr("type", "point"),
            (kind, _) => element.attr("directional", kind == LightType::Directional),
        };
        let element = element
            .attr("active", values.active)
            .attr("castshadow", values.cast_shadow)
            .numbers("pos", row(m.light_pos(), 3, light))
            .numbers("dir", row(m.light_dir(), 3, light))
            .attr("attenuation", format_f32s(&values.attenuation))
            .attr("cutoff", values.cutoff_deg)
            .attr("exponent", values.exponent)
            .attr("ambient", format_f32s(&values.ambient))
            .attr("diffuse", format_f32s(&values.diffuse))
            .attr("specular", format_f32s(&values.specular))
            .opt("bulbradius", (self.target == SupportedVersion::V4).then(|| format_f32s(&[values.radius])));
        Ok(Some(element))
    }
}

/// Indices of the elements in each body of the file.
struct BodyElements {
    joints: Vec<Vec<usize>>,
    geoms: Vec<Vec<usize>>,
    sites: Vec<Vec<usize>>,
    cameras: Vec<Vec<usize>>,
    lights: Vec<Vec<usize>>,
}

fn pose_row(position: &[f64], quat: &[f64]) -> [f64; 7] {
    [position[0], position[1], position[2], quat[0], quat[1], quat[2], quat[3]]
}

/// Writes a pose with its numbers unchanged, without normalizing them again.
fn with_pose(element: Element, place: &[f64; 7]) -> Element {
    let element = if place[..3] == [0.0; 3] { element } else { element.numbers("pos", &place[..3]) };
    if place[3..] == [1.0, 0.0, 0.0, 0.0] { element } else { element.numbers("quat", &place[3..]) }
}
