//! Welds of an environment: the active welds and the relative poses of their bodies.
//!
//! The pose of a weld is in the model (`eq_data`). Its active flag is in the model on 2.2.2 and in the data on 4.x. An
//! environment with welds therefore has them in its [`ModelPatch`].

use super::data::Data;
use super::model::Model;
use super::patch::{ModelPatch, word};
use mujoco_sys as mj;
use std::collections::BTreeMap;

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
        match ModelPatch::with_welds(self.patch(), self, welds) {
            Some(patch) => self.clone().patched(&patch),
            None => self.without_patch(),
        }
    }
}

impl Weld {
    /// Puts the words of the array `name` that this weld sets into `words`, by index. `bytes` are those of the compiled
    /// array.
    pub(super) fn write(&self, name: &str, bytes: &[u8], words: &mut BTreeMap<u32, u64>) {
        if name == "eq_active" {
            let at = self.equality / 8;
            let word = words.entry(at as u32).or_insert_with(|| word(bytes, at));
            let mut flags = word.to_ne_bytes();
            flags[self.equality % 8] = 1;
            *word = u64::from_ne_bytes(flags);
            return;
        }
        // Anchor in the second body (its origin), then the pose of that body in the first.
        let numbers = [0.0; 3].into_iter().chain(self.pose);
        let first = EQ_DATA_WIDTH * self.equality;
        words.extend(numbers.enumerate().map(|(k, number)| ((first + k) as u32, number.to_bits())));
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
