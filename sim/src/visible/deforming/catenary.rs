//! Slack tendons as catenaries.
//!
//! Source of the conditions: `mjv_isCatenary` of `engine_vis_visualize.c`. A slack tendon between two sites hangs if it
//! is limited to lengths from 0, or has a spring that acts beyond a length only. A tendon with damping, friction or an
//! actuator does not hang.

use kinetoscope_mujoco::{Data, Model, mjcf_keywords};
use kinetoscope_scene::vector::{dot, norm, scale, sub};

/// Number of segments of a hanging tendon; MuJoCo has as many as its round shapes have slices, 28 by default.
pub(super) const SEGMENTS: usize = 28;
/// Relative excess over the straight length up to which a tendon is straight: it would sag by 1/50 000 of its length.
const STRAIGHT_TOLERANCE: f64 = 1e-9;
/// Ratio of length to horizontal distance above which a tendon hangs as two straight lines, as in MuJoCo.
const MAX_LENGTH_RATIO: f64 = 100.0;

/// True if a tendon hangs when it is slack.
pub(super) fn may_hang(model: &Model, tendon: usize) -> bool {
    let acts = |actuator: usize| {
        mjcf_keywords::transmission(model.actuator_trntype()[actuator]) == Some("tendon")
            && usize::try_from(model.actuator_trnid()[2 * actuator]) == Ok(tendon)
    };
    model.tendon_num()[tendon] == 2
        && model.tendon_damping()[tendon] == 0.0
        && !model.tendon_has_nonlinear_terms(tendon)
        && model.tendon_frictionloss()[tendon] == 0.0
        && model.has_gravity()
        && !(0..model.nactuator()).any(acts)
}

/// Length of a tendon that may hang \[m\]; `None` if it is straight.
pub(super) fn hanging_length(data: &Data, tendon: usize) -> Option<f64> {
    let model = data.model();
    let [lower, upper] = [0, 1].map(|k| model.tendon_range()[2 * tendon + k]);
    if model.tendon_stiffness()[tendon] != 0.0 {
        let rest = model.tendon_lengthspring();
        // 2.2.2 has one rest length for both ends of the range.
        let ends = rest.len() / model.ntendon().max(1);
        let [low, high] = [rest[ends * tendon], rest[ends * tendon + ends - 1]];
        return (low == 0.0 && high > 0.0).then_some(high);
    }
    let is_slack = model.tendon_limited(tendon) && lower == 0.0 && data.ten_length()[tendon] < upper;
    is_slack.then_some(upper)
}

/// Segments of a string of a length \[m\] that hangs between two points. A string that is not longer than their
/// distance is straight.
pub(super) fn segments([from, to]: [[f64; 3]; 2], gravity: [f64; 3], length: f64, each: &mut dyn FnMut([[f64; 3]; 2])) {
    let pull = norm(gravity);
    let up = gravity.map(|g| -g / pull);
    let between = sub(to, from);
    let rise = dot(between, up);
    let level = sub(between, scale(up, rise));
    let run = norm(level);
    if length <= norm(between) {
        return each([from, to]);
    }
    let across = if run > 1e-15 { level.map(|x| x / run) } else { [0.0; 3] };
    let at = |x: f64, height: f64| [0, 1, 2].map(|k| from[k] + x * across[k] + height * up[k]);
    if length > MAX_LENGTH_RATIO * run {
        // A bead on a string hangs where both parts are equally steep.
        let down = -0.5 * ((length * length - run * run).max(0.0).sqrt() - rise);
        let fall = 2.0 * down - rise;
        let lowest = at(if fall < 0.0 { run * down / fall } else { 0.5 * run }, down);
        each([from, lowest]);
        return each([lowest, to]);
    }
    let ratio = (length * length - rise * rise).sqrt() / run;
    if ratio - 1.0 <= STRAIGHT_TOLERANCE {
        return each([from, to]);
    }
    let scale = 0.5 * run / half_angle(ratio);
    // The curve is scale * cosh((x - lowest) / scale), moved so that it passes through the first point.
    let lowest = 0.5 * (run - scale * ((length + rise) / (length - rise)).ln());
    let height = |x: f64| scale * (((x - lowest) / scale).cosh() - (lowest / scale).cosh());
    let mut last = from;
    for k in 1..=SEGMENTS {
        let x = run * k as f64 / SEGMENTS as f64;
        let next = if k == SEGMENTS { to } else { at(x, height(x)) };
        each([last, next]);
        last = next;
    }
}

/// Solves sinh(u) / u = `ratio` for u, with a ratio above 1, by Newton's method.
///
/// A catenary y = a cosh(x / a) of a length over a run and a rise has u = run / 2a, since 2 a sinh(run / 2a) is the
/// square root of length² - rise².
fn half_angle(ratio: f64) -> f64 {
    // Starts from above: sinh(u) / u >= 1 + u²/6, and sinh(u) / u > exp(u) / 2u - 1/2 for large u.
    let mut u = if ratio < 3.0 {
        (6.0 * (ratio - 1.0)).max(1e-12).sqrt()
    } else {
        (2.0 * ratio).ln() + (2.0 * ratio).ln().ln()
    };
    for _ in 0..50 {
        let (value, slope) = (u.sinh() / u - ratio, (u * u.cosh() - u.sinh()) / (u * u));
        let step = value / slope;
        u -= step;
        if step.abs() <= 1e-14 * u.abs() {
            break;
        }
    }
    u
}
