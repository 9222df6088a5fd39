//! Force law of one actuator of a file, and its features that a drive does not reproduce.
//!
//! MuJoCo's actuator with gear g on a length `l = g Σ cᵢ qᵢ` (on a joint: c = 1) has the force `gain u + b0 + b1 l + b2
//! l̇`, clamped. With `b0 = 0` and `b1 < 0` it is a position servo with the stiffness `-b1` and the damping `-b2`; its
//! gain only scales its control. A velocity servo has no `b1` and `gain = -b2`.

use kinetoscope_mujoco::Model;
use kinetoscope_mujoco::mjcf_keywords;

/// Row `index` of an array with `count` rows.
fn row_of<T>(values: &[T], count: usize, index: usize) -> &[T] {
    let width = values.len() / count.max(1);
    &values[width * index..width * (index + 1)]
}

/// Force law of an actuator along its length.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ActuatorLaw {
    /// Stiffness \[N/m or N m/rad\]; 0 without a position servo.
    pub(super) stiffness: f64,
    /// Damping \[N s/m or N m s/rad\]; 0 without a servo.
    pub(super) damping: f64,
    /// Largest force in both directions \[N or N m\]; `None` without a limit.
    pub(super) force: Option<f64>,
    /// Features of the actuator that a drive with these numbers does not reproduce, as texts for messages.
    pub(super) unsupported: Vec<String>,
}

/// Determines the law of an actuator on the length `gear Σ cᵢ qᵢ` with the joints and coefficients `path`.
pub(super) fn law(model: &Model, actuator: usize, gear: f64, path: &[(usize, f64)]) -> ActuatorLaw {
    let count = model.nactuator();
    let unknown = "unknown";
    let gain_type = mjcf_keywords::gain(model.actuator_gaintype()[actuator]).unwrap_or(unknown);
    let bias_type = mjcf_keywords::bias(model.actuator_biastype()[actuator]).unwrap_or(unknown);
    let dynamics = mjcf_keywords::dynamics(model.actuator_dyntype()[actuator]).unwrap_or(unknown);
    let gain = row_of(model.actuator_gainprm(), count, actuator)[0];
    let bias = row_of(model.actuator_biasprm(), count, actuator);
    let (stiffness, damping) = (-bias[1], -bias[2]);
    let affine = gain_type == "fixed" && bias_type == "affine" && bias[0] == 0.0;
    let follows_position = affine && stiffness > 0.0 && gain != 0.0 && damping >= 0.0;
    let follows_velocity = affine && stiffness == 0.0 && damping > 0.0 && gain == damping;
    let is_motor = gain_type == "fixed" && bias_type == "none";
    let (stiffness, damping) = if follows_position || follows_velocity { (stiffness, damping) } else { (0.0, 0.0) };
    let mut unsupported = Vec::new();
    if !(follows_position || follows_velocity || is_motor) {
        let law = format!("gaintype {gain_type}, biastype {bias_type}, biasprm {:?}", &bias[..3]);
        unsupported.push(format!(
            "its force law is neither a position or velocity servo nor a motor ({law}); its gains are not used"
        ));
    }
    if dynamics != "none" {
        unsupported.push(format!(
            "its activation dynamics ({dynamics}) are not used: the drive follows its targets without delay"
        ));
    }
    let mut force = None;
    let mut limit = |what: &str, low: f64, high: f64| {
        let end = low.abs().max(high.abs());
        if low != -high {
            unsupported.push(format!("its {what} {low} .. {high} became {} .. {end}", -end));
        }
        force = Some(force.map_or(end, |old: f64| old.min(end)));
    };
    if model.actuator_forcelimited(actuator) {
        let range = &model.actuator_forcerange()[2 * actuator..2 * actuator + 2];
        limit("forcerange", range[0], range[1]);
    }
    let control = model.actuator_control(actuator);
    if model.actuator_ctrllimited(control) {
        let range = &model.actuator_ctrlrange()[2 * control..2 * control + 2];
        let of_gain = |scale: f64| {
            let ends = [range[0] * gain / scale, range[1] * gain / scale];
            [ends[0].min(ends[1]), ends[0].max(ends[1])]
        };
        let said = format!("its ctrlrange {} .. {} does not limit targets", range[0], range[1]);
        if is_motor && dynamics == "none" {
            let [low, high] = of_gain(1.0);
            limit("force at the ends of its ctrlrange", low, high);
        } else if !follows_position || !is_within(lengths(model, gear, path), of_gain(stiffness)) {
            unsupported.push(said);
        }
    }
    ActuatorLaw { stiffness, damping, force, unsupported }
}

/// Range of lengths of an actuator within the limits of the joints; infinite if a joint has no limits.
fn lengths(model: &Model, gear: f64, path: &[(usize, f64)]) -> [f64; 2] {
    path.iter().fold([0.0; 2], |[low, high], &(joint, coefficient)| {
        if !model.jnt_limited(joint) {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let ends = [0, 1].map(|end| gear * coefficient * model.jnt_range()[2 * joint + end]);
        [low + ends[0].min(ends[1]), high + ends[0].max(ends[1])]
    })
}

/// True if `inner` is within `outer`, with a slack of a thousandth of `outer`: files write ranges with few digits.
fn is_within(inner: [f64; 2], outer: [f64; 2]) -> bool {
    let slack = 1e-3 * (outer[1] - outer[0]);
    inner[0] >= outer[0] - slack && inner[1] <= outer[1] + slack
}
