//! The tolerances that judge the laws reject what they must.

use kinetoscope_testkit::tolerance::{Tolerance, assert_vector};

/// An infinite expected value made its relative limit infinite, and accepted every number.
#[test]
fn infinities() {
    let limit = Tolerance::relative(1e-9, "none");
    assert!(limit.holds(f64::INFINITY, f64::INFINITY) && limit.holds(1.0 + 1e-10, 1.0));
    for (found, expected) in
        [(0.0, f64::INFINITY), (f64::NEG_INFINITY, f64::INFINITY), (f64::INFINITY, 1.0), (f64::NAN, 1.0)]
    {
        assert!(!limit.holds(found, expected), "{found} {expected}");
    }
    let loose = std::panic::catch_unwind(|| assert_vector("rows", [f64::INFINITY, 2.0], [f64::INFINITY, 1.0], limit));
    assert!(loose.is_err());
}
