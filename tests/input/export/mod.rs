//! `SimulationManager::dump`: the files load in plain MuJoCo, describe the same robot, and have the same bytes every
//! time.

/// Expands each check function of one robot to two tests: `bundled::...`, and `vendors::...`, which needs the vendors'
/// files.
macro_rules! of_each_robot {
    ($($check:ident)*) => {
        mod bundled {
            $(#[test]
            fn $check() {
                crate::export::robots::bundled_robots().into_iter().for_each(super::$check);
            })*
        }
        mod vendors {
            $(#[test]
            #[ignore = "needs real robots: cargo xtask test"]
            fn $check() {
                crate::export::robots::vendors_robots().into_iter().for_each(super::$check);
            })*
        }
    };
}

mod composite;
mod dump;
mod golden;
mod robots;
