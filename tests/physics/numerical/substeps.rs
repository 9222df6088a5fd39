//! Substeps equal steps: 10 substeps in `physics_dt` = 10 ms are ten updates of 1 ms, bit for bit, with drives and
//! contacts.
//!
//! Tolerance: none. Control: one step of 10 ms instead.

use super::scenes::{Fall, difference, legged};
use crate::law::law;
use kinetoscope::prelude::*;

fn final_state(dt: f64, substeps: u32, updates: u32) -> Vec<f64> {
    let mut fall = Fall::new(SimulationManagerCfg { physics_dt: dt, substeps, ..legged(1, 1) }, 0.0);
    fall.update(updates);
    assert!(fall.has_landed());
    fall.state(0)
}

#[test]
fn holds() {
    law(module_path!(), "x(dt, n substeps) = x(dt/n), bit for bit", |m| {
        let fine = final_state(1e-3, 1, 600);
        m.row("largest difference", "", 0.0, difference(&fine, &final_state(1e-2, 10, 60)), (0.0, "the same bits"));
        m.control("largest difference", "without substeps", difference(&fine, &final_state(1e-2, 1, 60)));
    });
}
