//! Welds of an environment: the active welds and the relative poses of their bodies.
//!
//! The pose of a weld is in the model (`eq_data`). Its active flag is in the model on 2.2.2 and in the data on 4.x. An
//! environment with welds therefore gets a shallow model with its own copies of these arrays.

use super::data::Data;
use super::editor::set_pointer;
use super::model::{Model, OwnArray, array_pointer};
use mujoco_sys as mj;
use mujoco_sys::fields::model::{ModelArray, each};
use std::sync::Arc;

/// Weld equality of a model, and the relative pose of its two bodies with which [`Model::with_welds`] activates it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weld {
    /// Index of the equality constraint in the model (MuJoCo's eq id).
    pub equality: usize,
    /// Pose of the second body in the frame of the first: x, y, z \[m\], unit quaternion w, x, y, z.
    pub pose: [f64; 7],
}

/// Number of values of an equality in `eq_data`.
const EQ_DATA_WIDTH: usize = mj::mjNEQDATA as usize;

impl Model {
    /// True if equality constraint `index` exists and is a weld.
    pub fn is_weld(&self, index: usize) -> bool {
        self.eq_type().get(index).is_some_and(|&kind| kind as u32 == mj::mjEQ_WELD)
    }

    /// Returns the model with these welds active, besides those that are active from the start. Welds of an earlier
    /// call end. If a weld is listed twice, the last pose counts.
    ///
    /// On 4.x, the active flags are in the data: call [`Data::set_equality_active`] too.
    ///
    /// # Panics
    /// One of the equalities is not a weld of this model.
    #[must_use]
    pub fn with_welds(&self, welds: &[Weld]) -> Self {
        for weld in welds {
            assert!(self.is_weld(weld.equality), "equality {} is not a weld", weld.equality);
        }
        let own_of = |field: &ModelArray| matches!(field.name, "eq_data" | "eq_active");
        let mut own: Vec<OwnArray> =
            self.own_array_list().iter().filter(|array| !own_of(&array.field)).cloned().collect();
        let compiled = self.compiled();
        let mut header = self.copy_header();
        let mut fields = Vec::new();
        // SAFETY: the compiled model is alive.
        unsafe { each(compiled, |field| fields.extend((own_of(&field) && field.bytes > 0).then_some(field))) };
        for field in fields {
            set_pointer(&mut header, &field, array_pointer(compiled, &field));
            if welds.is_empty() {
                continue;
            }
            // SAFETY: the array has this size and lives as long as the compiled model, to which nothing writes.
            let values = unsafe { std::slice::from_raw_parts(array_pointer(compiled, &field), field.bytes) };
            let mut values = values.to_vec();
            for weld in welds {
                if field.name == "eq_active" {
                    values[weld.equality] = 1;
                    continue;
                }
                let numbers = weld.pose.iter().flat_map(|number| number.to_ne_bytes());
                // Anchor in the second body (its origin), then the pose of that body in the first.
                let row = &mut values[8 * EQ_DATA_WIDTH * weld.equality..8 * EQ_DATA_WIDTH * (weld.equality + 1)];
                row[..24].fill(0);
                row[24..80].iter_mut().zip(numbers).for_each(|(to, byte)| *to = byte);
            }
            own.push(OwnArray::from_bytes(field, &values));
        }
        for array in &own {
            set_pointer(&mut header, &array.field, array.memory.as_ptr().cast());
        }
        // SAFETY: sizes are those of `self`; pointers lead to the compiled model, which `self` keeps alive, except
        // those that were just set to `own`, each to memory of the size of its field: moving a box does not move its
        // content.
        unsafe { self.with_arrays(header, Arc::from(own)) }
    }
}

impl Data {
    /// Activates or deactivates an equality on 4.x, where the flag is in the data. Has no effect on 2.2.2.
    ///
    /// # Panics
    /// There is no such equality.
    pub fn set_equality_active(&mut self, equality: usize, active: bool) {
        #[cfg(mj4)]
        {
            let (m, d) = (self.model().raw(), self.raw_mut());
            // SAFETY: model and data belong together and are alive; `self` is borrowed mutably.
            let all = unsafe { mujoco_sys::fields::data::eq_active_mut(m, d) };
            all[equality] = active;
        }
        #[cfg(not(mj4))]
        {
            let _ = active;
            assert!(equality < self.model().neq(), "equality {equality} of {}", self.model().neq());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate as mj;

    const TWO: &str = r#"<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
        <body name="a"><freejoint/><geom size="0.1"/></body>
        <body name="b" pos="0.5 0.2 0"><freejoint/><geom size="0.1"/></body></worldbody>
        <equality><weld name="w" body1="a" body2="b" active="ACTIVE" relpose="0.1 0.2 0.3 0.8 0 0.6 0"/></equality></mujoco>"#;

    fn model(active: &str) -> Model {
        mj::compile(&TWO.replace("ACTIVE", active), &[]).expect("compiles").into_model()
    }

    /// The numbers are at the positions where MuJoCo's compiler puts them, and nothing else differs.
    #[test]
    fn compiled() {
        let (off, on) = (model("false"), model("true"));
        let weld = Weld { equality: 0, pose: [0.1, 0.2, 0.3, 0.8, 0.0, 0.6, 0.0] };
        let welded = off.with_welds(&[weld]);
        let same = welded.eq_data().iter().zip(on.eq_data()).all(|(a, b)| (a - b).abs() < 1e-15);
        assert!(same, "{:?}", welded.eq_data());
        assert_eq!(welded.eq_data().len(), EQ_DATA_WIDTH);
        let expected: &[&str] = if cfg!(mj4) { &["eq_data"] } else { &["eq_active", "eq_data"] };
        let mut apart = welded.unshared_arrays(&off);
        apart.sort_unstable();
        assert_eq!(apart, expected);
        #[cfg(not(mj4))]
        assert!(welded.equality_is_active(0) && !off.equality_is_active(0));
        // Another pose, then no weld.
        let moved = welded.with_welds(&[Weld { equality: 0, pose: [9.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] }]);
        assert_eq!(moved.eq_data()[3..10], [9.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        assert!(moved.with_welds(&[]).unshared_arrays(&off).is_empty());
        assert!(off.is_weld(0) && !off.is_weld(1));
    }

    /// Root cause: equalities were checked for each array that has values, so a model without equalities ignored welds.
    #[test]
    #[should_panic(expected = "equality 0 is not a weld")]
    fn no_equalities() {
        let plain = r#"<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"#;
        let weld = Weld { equality: 0, pose: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] };
        let _ = mj::compile(plain, &[]).expect("compiles").into_model().with_welds(&[weld]);
    }

    #[test]
    #[should_panic(expected = "equality 1 is not a weld")]
    fn other_equalities() {
        let welds = [0, 1].map(|equality| Weld { equality, pose: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] });
        let _ = model("false").with_welds(&welds);
    }

    /// Other own arrays of an environment are kept.
    #[test]
    fn other_arrays() {
        let off = model("false");
        let mut editor = mj::ModelEditor::new(&off).expect("small");
        editor.geom_friction_mut()[0] = 0.3;
        let edited = editor.model(&off);
        let weld = Weld { equality: 0, pose: [0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0] };
        let both = edited.with_welds(&[weld]);
        drop((edited, editor));
        assert_eq!((both.geom_friction()[0], both.eq_data()[5]), (0.3, 0.5));
        let again = both.with_buffers(mj::Buffers { contacts: 20, constraints: 100, arena_bytes: 1 << 20 });
        drop(both);
        assert_eq!((again.geom_friction()[0], again.eq_data()[5]), (0.3, 0.5));
    }
}
