//! `update(n)` equals n calls of `update(1)`, bit for bit.
//!
//! Tolerance: none. Control: one step less.

use super::scenes::{Fall, difference, legged};
use crate::law::law;

fn fallen(parts: &[u32]) -> Vec<f64> {
    let mut fall = Fall::new(legged(2, 1), 0.0);
    for &steps in parts {
        fall.update(steps);
    }
    fall.state(0)
}

#[test]
fn holds() {
    law(module_path!(), "update(n) = n update(1), bit for bit", |m| {
        let whole = fallen(&[150]);
        let parts = [1; 150];
        m.row("largest difference", "", 0.0, difference(&whole, &fallen(&parts)), (0.0, "the same bits"));
        m.control("largest difference", "with a step less", difference(&whole, &fallen(&parts[1..])));
    });
}
