//! Range of joint sliders, shared by windows and browser views.

use std::f64::consts::PI;

/// Returns the range of a joint's slider \[rad or m\]: its limits. A missing upper limit is replaced by half a turn
/// (1 m if the joint `slides`), counted from 0 or from a positive lower limit. A missing lower limit is replaced in the
/// same way, with opposite signs. An empty range counts as unlimited.
pub(crate) fn slider_range([low, high]: [f64; 2], slides: bool) -> [f64; 2] {
    let reach = if slides { 1.0 } else { PI };
    match (low.is_finite(), high.is_finite()) {
        (true, true) if low < high => [low, high],
        (true, false) => [low, reach.max(low + reach)],
        (false, true) => [(-reach).min(high - reach), high],
        _ => [-reach, reach],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slider ends at the limits, and at a default distance where a limit is missing.
    #[test]
    fn ranges() {
        let none = f64::INFINITY;
        for (limits, turns, slides) in [
            ([-0.5, 2.0], [-0.5, 2.0], [-0.5, 2.0]),
            ([-none, none], [-PI, PI], [-1.0, 1.0]),
            ([f64::NAN, f64::NAN], [-PI, PI], [-1.0, 1.0]),
            // One limit: on the near side of zero, at zero, beyond the default distance.
            ([-0.5, none], [-0.5, PI], [-0.5, 1.0]),
            ([0.0, none], [0.0, PI], [0.0, 1.0]),
            ([5.0, none], [5.0, 5.0 + PI], [5.0, 6.0]),
            ([-none, 0.5], [-PI, 0.5], [-1.0, 0.5]),
            ([-none, -5.0], [-5.0 - PI, -5.0], [-6.0, -5.0]),
            // An empty range.
            ([1.0, 1.0], [-PI, PI], [-1.0, 1.0]),
            ([2.0, -2.0], [-PI, PI], [-1.0, 1.0]),
        ] {
            assert_eq!([slider_range(limits, false), slider_range(limits, true)], [turns, slides], "{limits:?}");
        }
    }
}
