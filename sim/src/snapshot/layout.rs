//! Layout of states: sizes, names and step settings of a compiled scene, which distinguish one scene from another.

use crate::drive::table::DriveTable;
use kinetoscope_mujoco::{Model, ObjectKind, mjcf_keywords};

/// Step settings, then sizes and names of everything that has numbers in a state, one line each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct StateLayout(Vec<String>);

impl StateLayout {
    /// Layout of a model with its drives. One step of the simulation is `substeps` steps of the model.
    pub(crate) fn of(model: &Model, drives: &DriveTable, substeps: u32) -> Self {
        let sizes = [
            ("positions", model.nq()),
            ("degrees of freedom", model.nv()),
            ("controls", model.nu()),
            ("activations", model.na()),
            ("bodies", model.nbody()),
            ("equalities", model.neq()),
        ];
        // Every bit of the step counts: Rust writes the shortest number that reads back to the same value.
        let stepped = |(name, _): &(&str, String)| matches!(*name, "timestep" | "integrator" | "cone");
        let options = model.options().into_iter().filter(stepped);
        let mut lines: Vec<String> = options.map(|(name, value)| format!("{name} {value}")).collect();
        lines.push(format!("{substeps} substeps"));
        lines.extend(sizes.map(|(what, count)| format!("{count} {what}")));
        let name = |kind, index| model.name(kind, index).unwrap_or_default();
        for joint in 0..model.njnt() {
            let word = mjcf_keywords::joint(model.jnt_type()[joint]).unwrap_or("joint");
            lines.push(format!("{word} joint {:?}", name(ObjectKind::Joint, joint)));
        }
        for body in 0..model.nbody() {
            let by_hand = if model.body_mocapid()[body] >= 0 { " moved by hand" } else { "" };
            lines.push(format!("body {:?}{by_hand}", name(ObjectKind::Body, body)));
        }
        for weld in (0..model.neq()).filter(|&equality| model.is_weld(equality)) {
            // The pose of a weld is relative to its bodies: it has no meaning for other bodies.
            let sites = model.equality_is_between_sites(weld);
            let kind = if sites { ObjectKind::Site } else { ObjectKind::Body };
            let held = |of: &[i32]| name(kind, usize::try_from(of[weld]).unwrap_or(0));
            let (first, second) = (held(model.eq_obj1id()), held(model.eq_obj2id()));
            lines.push(format!("weld {:?} of {first:?} and {second:?}", name(ObjectKind::Equality, weld)));
        }
        for actuator in 0..model.nactuator() {
            lines.push(format!("actuator {:?}", name(ObjectKind::Actuator, actuator)));
        }
        for drive in &drives.drives {
            let joint = usize::try_from(model.dof_jntid()[drive.dof]).unwrap_or(0);
            lines.push(format!("drive of {:?}", name(ObjectKind::Joint, joint)));
        }
        Self(lines)
    }

    /// Number of drives.
    pub(super) fn drives(&self) -> usize {
        self.0.iter().filter(|line| line.starts_with("drive of ")).count()
    }

    /// Lines as in a file.
    pub(super) fn lines(&self) -> &[String] {
        &self.0
    }

    /// Creates a layout from the result of [`lines`](Self::lines).
    pub(super) fn from_lines(lines: Vec<String>) -> Self {
        Self(lines)
    }

    /// Text on the first difference of a snapshot's layout (`self`) from the layout of a scene; `None` if they are
    /// equal.
    pub(super) fn difference(&self, scene: &Self) -> Option<String> {
        if self == scene {
            return None;
        }
        let count = self.0.len().max(scene.0.len());
        let at = |lines: &[String], i: usize| lines.get(i).cloned().unwrap_or_else(|| "no further element".into());
        let first = (0..count).find(|&i| self.0.get(i) != scene.0.get(i)).unwrap_or(0);
        Some(format!("it has {}, this scene has {}", at(&self.0, first), at(&scene.0, first)))
    }
}
