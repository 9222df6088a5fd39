//! Mistakes in when sensors measure, and in what they measure.

use super::Mutation;

const fn unit(
    name: &'static str,
    file: &'static str,
    [search, replacement]: [&'static str; 2],
    tests: &'static [&'static str],
) -> Mutation {
    Mutation { name, file, search, replacement, tests: ("kinetoscope-sensors", tests) }
}

pub(super) const SENSORS: &[Mutation] = &[
    unit(
        "measurements due by the step of the world, not since the reset",
        "sensors/src/schedule.rs",
        [
            "period - step.saturating_sub(self.envs[env].start) % period",
            "period - step.saturating_sub(0 * self.envs[env].start) % period",
        ],
        &["schedule::tests::skipped_steps"],
    ),
    unit(
        "measurements that were not read counted as one",
        "sensors/src/schedule.rs",
        ["{ run / period - before }", "{ (run / period - before).min(1) }"],
        &["schedule::tests::skipped_steps", "slot::tests::lazy_and_eager"],
    ),
    unit(
        "newest measurement at the end of the history",
        "sensors/src/history.rs",
        ["flat[..width].copy_from_slice(row);", "flat[(length - 1) * width..].copy_from_slice(row);"],
        &["history::tests::rows", "sampling::tests::latency"],
    ),
    unit(
        "bias walks with the period, not its root",
        "sensors/src/noise.rs",
        ["noise.bias_walk * self.sqrt_period *", "noise.bias_walk * self.sqrt_period.powi(2) *"],
        &["sampling::tests::biases"],
    ),
    unit(
        "dropout loses what it should keep",
        "sensors/src/noise.rs",
        ["self.randoms[env].uniform() >= self.dropout", "self.randoms[env].uniform() < self.dropout"],
        &["sampling::tests::dropout"],
    ),
    unit(
        "measurement from the instant of a write replaces it",
        "sensors/src/sampling.rs",
        ["if captured > self.refreshed[env] {", "if captured >= self.refreshed[env] {"],
        &["sampling::tests::refresh"],
    ),
    unit(
        "arrivals forgotten in when something is due",
        "sensors/src/sampling.rs",
        ["arrivals.fold(due, u64::min)", "arrivals.fold(due, |due, _| due)"],
        &["sampling::tests::due"],
    ),
    unit(
        "resolution rounds down",
        "sensors/src/noise.rs",
        ["steps.round() * self.resolution", "steps.floor() * self.resolution"],
        &["sampling::tests::resolution"],
    ),
    unit(
        "friction of a contact with its normal part",
        "sensors/src/contact_sensor/pairs.rs",
        ["contact.force[k] - contact.normal_force * contact.normal[k]", "contact.force[k] - 0.0 * contact.normal[k]"],
        &["contact_sensor::tests::values"],
    ),
    unit(
        "pairs of contacts by the watched body itself",
        "sensors/src/contact_sensor/pairs.rs",
        ["Some((slot, sign, index(1 - side)))", "Some((slot, sign, index(side)))"],
        &["contact_sensor::tests::values"],
    ),
    unit(
        "first ray of a full turn cast twice",
        "sensors/src/ray/pattern/lidar.rs",
        ["if is_turn && ends_on_grid { whole }", "if is_turn && !ends_on_grid { whole }"],
        &["ray::pattern::tests::lidars"],
    ),
    unit(
        "order of rays in a grid exchanged",
        "sensors/src/ray/pattern/grid.rs",
        ["[at(0, k % nx), at(1, k / nx), 0.0]", "[at(0, k / ny), at(1, k % ny), 0.0]"],
        &["ray::pattern::tests::grids"],
    ),
    unit(
        "yaw of tilted bodies with a wrong sign",
        "sensors/src/ray/caster/alignment.rs",
        ["2.0 * (q.w * q.k + q.i * q.j)", "2.0 * (q.w * q.k - q.i * q.j)"],
        &["ray::caster::tests::alignments"],
    ),
];
