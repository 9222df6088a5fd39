//! Environments do not know of each other: environment 0 is the same, bit for bit, alone and with 63 others.
//!
//! Tolerance: none. Control: environment 1 of the 64 is not it.

use super::scenes::{Fall, difference, legged};
use crate::law::law;

#[test]
fn holds() {
    law(module_path!(), "x₀(1 environment) = x₀(64 environments), bit for bit", |m| {
        let mut alone = Fall::new(legged(1, 1), 0.0);
        let mut many = Fall::new(legged(64, 2), 0.0);
        for fall in [&mut alone, &mut many] {
            fall.update(120);
            assert!(fall.has_landed());
        }
        let first = alone.state(0);
        m.row("largest difference", "", 0.0, difference(&first, &many.state(0)), (0.0, "the same bits"));
        m.control("largest difference", "with environment 1", difference(&first, &many.state(1)));
    });
}
