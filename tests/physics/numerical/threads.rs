//! The number of threads does not change a bit: sixteen quadrupeds fall on the ground, on 1 thread and on 8.
//!
//! Tolerance: none. Control: one joint of one robot is a billionth of a rad/s faster.

use super::scenes::{Fall, difference, legged};
use crate::law::law;

const ENVS: usize = 16;

fn final_states(threads: usize, nudge: f64) -> Vec<f64> {
    let mut fall = Fall::new(legged(ENVS, threads), nudge);
    fall.update(150);
    assert!(fall.has_landed());
    (0..ENVS).flat_map(|env| fall.state(env)).collect()
}

#[test]
fn holds() {
    law(module_path!(), "x(8 threads) = x(1 thread), bit for bit", |m| {
        let one = final_states(1, 0.0);
        m.row("largest difference", "", 0.0, difference(&one, &final_states(8, 0.0)), (0.0, "the same bits"));
        m.control("largest difference", "with a nudge of 1e-9 rad/s", difference(&one, &final_states(8, 1e-9)));
    });
}
