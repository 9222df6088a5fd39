//! Robots as a whole: state, forces on links, root link, joints, the bundled quadruped.

mod quadruped;
mod state;
mod wrenches;

/// Number of environments.
const ENVS: usize = 3;

#[track_caller]
fn assert_near<'a>(
    found: impl IntoIterator<Item = &'a f64>,
    expected: impl IntoIterator<Item = &'a f64>,
    tolerance: f64,
    what: &str,
) {
    let tolerance = testkit::tolerance::Tolerance::absolute(tolerance, "at the top of the file or above the test");
    testkit::tolerance::assert_close(what, found, expected, tolerance);
}
