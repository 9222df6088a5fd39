//! Tables of the properties of a compiled scene: names, array indices and nominal values.

use super::Property;
use crate::drive::table::{Drive, DriveTable, Realization};
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{Model, ObjectKind};
use std::collections::BTreeMap;

/// Elements that have one property.
#[derive(Clone, Debug, Default)]
pub(crate) struct PropertyTable {
    /// Name of each element; shapes of one body have the same name.
    pub(super) names: Vec<String>,
    /// Index of each element in MuJoCo's arrays, or among the drives.
    pub(super) indices: Vec<usize>,
    /// Nominal values, element by element.
    pub(super) nominal: Vec<f64>,
    /// Elements that cannot have the property, with the reason.
    pub(super) unsupported: Vec<(String, &'static str)>,
}

/// Facts about the scene that the model does not contain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneContext<'a> {
    /// True for each proxy geom, which only has a pose and is replaced by another shape in rendering.
    pub(crate) proxies: &'a [bool],
    /// Static bodies, whose poses can differ between environments.
    pub(crate) static_bodies: &'a [usize],
}

/// Elements and nominal values of each randomizable property of a compiled scene.
#[derive(Clone, Debug)]
pub(crate) struct PropertyTables {
    /// Tables in the order of [`Property::ALL`].
    tables: [PropertyTable; Property::ALL.len()],
}

impl PropertyTables {
    /// Creates the tables for a model with its drives.
    pub(crate) fn of(model: &Model, drives: &DriveTable, beside: SceneContext<'_>) -> Self {
        Self { tables: Property::ALL.map(|property| table(property, model, drives, beside)) }
    }

    /// Index of an element in MuJoCo's arrays, or among the drives.
    pub(crate) fn index(&self, property: Property, element: usize) -> usize {
        self.get(property).indices[element]
    }

    /// Nominal value of an element.
    pub(crate) fn nominal(&self, property: Property, element: usize) -> &[f64] {
        let width = property.width();
        &self.get(property).nominal[element * width..(element + 1) * width]
    }

    pub(super) fn get(&self, property: Property) -> &PropertyTable {
        &self.tables[property as usize]
    }
}

impl PropertyTable {
    /// Values that differ from the nominal values, `width` numbers each, by index in MuJoCo's arrays.
    pub(super) fn changes<'v>(&self, width: usize, values: &'v [f64]) -> BTreeMap<usize, &'v [f64]> {
        let elements = values.chunks(width).zip(self.nominal.chunks(width)).zip(&self.indices);
        elements.filter(|((value, nominal), _)| value != nominal).map(|((value, _), &place)| (place, value)).collect()
    }

    /// Reason why the element `name` cannot have the property, if there is a reason.
    pub(super) fn unsupported_reason(&self, name: &str) -> Option<&'static str> {
        self.unsupported.iter().find(|(of, _)| of == name).map(|(_, reason)| *reason)
    }

    fn push(&mut self, name: String, place: usize, values: &[f64]) {
        self.names.push(name);
        self.indices.push(place);
        self.nominal.extend_from_slice(values);
    }
}

fn table(property: Property, model: &Model, drives: &DriveTable, beside: SceneContext<'_>) -> PropertyTable {
    let mut table = PropertyTable::default();
    match property {
        Property::Mass => bodies(model, &mut table, |body| &model.body_mass()[body..=body]),
        Property::CenterOfMass => bodies(model, &mut table, |body| &model.body_ipos()[3 * body..3 * body + 3]),
        Property::Inertia => bodies(model, &mut table, |body| &model.body_inertia()[3 * body..3 * body + 3]),
        Property::Friction => shapes(model, &mut table, 0),
        Property::TorsionalFriction => shapes(model, &mut table, 1),
        Property::RollingFriction => shapes(model, &mut table, 2),
        Property::JointDamping => joints(model, &mut table, |joint| {
            let dof = model.jnt_dofadr()[joint] as usize;
            let moved = drives.damped.iter().find(|(of, _)| *of == dof).map(|(_, damping)| *damping);
            Some(moved.unwrap_or(model.dof_damping()[dof]))
        }),
        Property::Armature => joints(model, &mut table, |joint| {
            let dof = model.jnt_dofadr()[joint] as usize;
            Some(user_armature(model, drives, dof))
        }),
        Property::DryFriction => joints(model, &mut table, |joint| {
            Some(match friction_location(model, drives, joint)? {
                FrictionLocation::Joint => model.dof_frictionloss()[model.jnt_dofadr()[joint] as usize],
                FrictionLocation::Tendon(tendon) => model.tendon_frictionloss()[tendon],
            })
        }),
        Property::Gravity => table.push("gravity".into(), 0, &model.gravity()),
        Property::Stiffness | Property::DriveDamping | Property::MaxEffort => {
            for (index, drive) in drives.drives.iter().enumerate() {
                if drive.realization != Realization::Actuator {
                    let joint = usize::try_from(model.dof_jntid()[drive.dof]).unwrap_or(0);
                    let name = model.name(ObjectKind::Joint, joint).unwrap_or_default();
                    let gains = drive.initial;
                    let value = match property {
                        Property::Stiffness => gains.kp,
                        Property::DriveDamping => gains.kd,
                        _ => gains.max_effort,
                    };
                    table.push(name, index, &[value]);
                }
            }
        }
        Property::Size => {
            for geom in (0..model.ngeom()).filter(|&geom| !beside.proxies[geom]) {
                let (size, numbers) = (&model.geom_size()[3 * geom..3 * geom + 3], sizes(model.geom_type()[geom]));
                let value = [0, 1, 2].map(|k| if k < numbers { size[k] } else { 0.0 });
                match (geom_name(model, geom), no_size_reason(model.geom_type()[geom])) {
                    (Some(name), None) if numbers > 0 => table.push(name, geom, &value),
                    (Some(name), Some(reason)) => table.unsupported.push((name, reason)),
                    _ => {}
                }
            }
            let PropertyTable { names, unsupported, .. } = &mut table;
            unsupported.retain(|(name, _)| !names.contains(name));
        }
        Property::Color => {
            for geom in 0..model.ngeom() {
                // The color of the ground is in its checkerboard squares.
                if let Some(name) = geom_name(model, geom).filter(|name| name != "ground") {
                    table.push(name, geom, &crate::visible::color_of(model, geom).map(f64::from));
                }
            }
        }
        Property::Position => standing(model, &mut table, beside, |body| &model.body_pos()[3 * body..3 * body + 3]),
        Property::Rotation => standing(model, &mut table, beside, |body| &model.body_quat()[4 * body..4 * body + 4]),
        Property::LinearDamping => free_bodies(model, &mut table, 0),
        Property::AngularDamping => free_bodies(model, &mut table, 3),
    }
    table
}

/// Number of sizes of a geom type; 0 for a type whose size is not a property.
fn sizes(kind: i32) -> usize {
    match kind as u32 {
        mj::mjGEOM_SPHERE => 1,
        mj::mjGEOM_CAPSULE | mj::mjGEOM_CYLINDER => 2,
        mj::mjGEOM_ELLIPSOID | mj::mjGEOM_BOX => 3,
        _ => 0,
    }
}

/// Reason why the size of a geom type is not a property, if there is a reason.
fn no_size_reason(kind: i32) -> Option<&'static str> {
    match kind as u32 {
        mj::mjGEOM_MESH => Some(
            "its shape is a mesh, and MuJoCo stores the vertices, hull, frame and bounds of a mesh once for all \
             environments; add one object (or body) per scale and move the unused ones away, or use boxes, spheres, \
             capsules, cylinders or ellipsoids as collision shapes",
        ),
        mj::mjGEOM_HFIELD => Some(
            "its shape is a height field, and MuJoCo stores its heights and extent once for all environments; place \
             several terrains side by side and start environments on different ones",
        ),
        mj::mjGEOM_PLANE => {
            Some("its shape is a plane, whose collision ignores the size; use a box of the required size instead")
        }
        _ => None,
    }
}

/// Name of the element that a geom belongs to: its body or, in the world, the geom itself. `None` if that element has
/// no name.
fn geom_name(model: &Model, geom: usize) -> Option<String> {
    match usize::try_from(model.geom_bodyid()[geom]) {
        Ok(body) if body > 0 => model.name(ObjectKind::Body, body),
        _ => model.name(ObjectKind::Geom, geom),
    }
}

/// Adds the static bodies.
fn standing<'m>(
    model: &'m Model,
    table: &mut PropertyTable,
    beside: SceneContext<'_>,
    values: impl Fn(usize) -> &'m [f64],
) {
    for &body in beside.static_bodies {
        if let Some(name) = model.name(ObjectKind::Body, body) {
            table.push(name, body, values(body));
        }
    }
}

/// Adds the bodies that can move and have a mass.
fn bodies<'m>(model: &'m Model, table: &mut PropertyTable, values: impl Fn(usize) -> &'m [f64]) {
    for body in 1..model.nbody() {
        if !model.is_held(body)
            && model.body_mass()[body] > 0.0
            && let Some(name) = model.name(ObjectKind::Body, body)
        {
            table.push(name, body, values(body));
        }
    }
}

/// Adds the free joints, named after the bodies that they move. Their indices are degrees of freedom: the `first` of
/// each joint's six, together with the two after it.
fn free_bodies(model: &Model, table: &mut PropertyTable, first: usize) {
    for joint in 0..model.njnt() {
        let name = model.name(ObjectKind::Body, usize::try_from(model.jnt_bodyid()[joint]).unwrap_or(0));
        if let Some(name) = name.filter(|_| model.jnt_type()[joint] as u32 == mj::mjJNT_FREE) {
            let dof = model.jnt_dofadr()[joint] as usize + first;
            table.push(name, dof, &[model.dof_damping()[dof]]);
        }
    }
}

/// Adds the geoms that collide, named after their body or, in the world, after themselves.
fn shapes(model: &Model, table: &mut PropertyTable, coefficient: usize) {
    for geom in 0..model.ngeom() {
        if model.geom_contype()[geom] == 0 && model.geom_conaffinity()[geom] == 0 {
            continue;
        }
        if let Some(name) = geom_name(model, geom) {
            table.push(name, geom, &[model.geom_friction()[3 * geom + coefficient]]);
        }
    }
}

/// Adds the joints for which `value` returns a value, except free joints. All degrees of freedom of a joint have this
/// value.
fn joints(model: &Model, table: &mut PropertyTable, value: impl Fn(usize) -> Option<f64>) {
    for joint in 0..model.njnt() {
        if model.jnt_type()[joint] as u32 != mj::mjJNT_FREE
            && let (Some(name), Some(value)) = (model.name(ObjectKind::Joint, joint), value(joint))
        {
            table.push(name, joint, &[value]);
        }
    }
}

/// Degrees of freedom of a joint that is not free.
pub(super) fn dofs_of(model: &Model, joint: usize) -> std::ops::Range<usize> {
    let first = model.jnt_dofadr()[joint] as usize;
    first..first + if model.jnt_type()[joint] as u32 == mj::mjJNT_BALL { 3 } else { 1 }
}

/// Armature without the part `h B` that implicit damping adds to it; see [`crate::drive::implicit`].
pub(super) fn user_armature(model: &Model, drives: &DriveTable, dof: usize) -> f64 {
    match drives.damped.iter().position(|(of, _)| *of == dof) {
        // Subtracting `h B` again would lose bits.
        Some(k) => drives.undamped_armature[k],
        None => model.dof_armature()[dof],
    }
}

/// Location of the dry friction of a joint in the model.
pub(super) enum FrictionLocation {
    /// The friction of the joint itself.
    Joint,
    /// A fixed tendon, because the joint's own friction row carries its drive, or could.
    Tendon(usize),
}

/// Finds the dry friction of a joint; `None` if its drive uses the friction row and it has no tendon. Where drives are
/// rows, the writer of the scene adds a tendon for each driven joint with friction, also with an explicit model. If
/// [`DriveCfg::friction`](crate::DriveCfg::friction) is set, every driven joint of the robot has one.
pub(super) fn friction_location(model: &Model, drives: &DriveTable, joint: usize) -> Option<FrictionLocation> {
    let tendon = format!("{}/friction", model.name(ObjectKind::Joint, joint)?);
    if let Some(tendon) = model.id(ObjectKind::Tendon, &tendon) {
        return Some(FrictionLocation::Tendon(tendon));
    }
    let dof = model.jnt_dofadr()[joint] as usize;
    let is_row = |drive: &Drive| drive.dof == dof && drive.realization == Realization::ConstraintRow;
    (!drives.drives.iter().any(is_row)).then_some(FrictionLocation::Joint)
}
