//! Environments are independent: environment 0 is the same, bit for bit, alone and with 63 others, one of which is
//! pushed.
//!
//! Tolerance: none. Control: one joint of environment 0 is 1e-12 rad/s faster.

use super::scenes::{Fall, difference, legged};
use crate::law::law;

#[test]
fn holds() {
    law(module_path!(), "x₀(1 environment) = x₀(64 environments), bit for bit", |m| {
        let mut alone = Fall::new(legged(1, 1), 0.0);
        let (mut many, mut nudged) = (Fall::new(legged(64, 2), 0.0), Fall::new(legged(64, 2), 1e-12));
        let mut pushed = Fall::new(legged(64, 2), 0.0);
        pushed.add_joint_velocity(1, 0.5);
        for fall in [&mut alone, &mut many, &mut nudged, &mut pushed] {
            fall.update(120);
            assert!(fall.has_landed());
        }
        let first = alone.state(0);
        m.row("largest difference", "", 0.0, difference(&first, &many.state(0)), (0.0, "the same bits"));
        let quantity = "largest difference, environment 1 pushed";
        m.row(quantity, "", 0.0, difference(&first, &pushed.state(0)), (0.0, "the same bits"));
        assert!(difference(&many.state(1), &pushed.state(1)) > 1e-3, "the push is felt where it is");
        for quantity in ["largest difference", quantity] {
            let differs = difference(&first, &nudged.state(0));
            m.control(quantity, "with a nudge of 1e-12 rad/s to environment 0", differs);
        }
    });
}
