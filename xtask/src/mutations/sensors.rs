//! Mutations of the schedule and of the measurements of sensors.

use super::Mutation;

pub(super) const SENSORS: &[Mutation] = &[
    Mutation::of(
        "kinetoscope-sensors",
        "measurements due by the step of the world, not since the reset",
        "sensors/src/schedule.rs",
        [
            "period - step.saturating_sub(self.envs[env].start) % period",
            "period - step.saturating_sub(0 * self.envs[env].start) % period",
        ],
        &["schedule::tests::skipped_steps"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "measurements that were not read counted as one",
        "sensors/src/schedule.rs",
        ["{ run / period - before }", "{ (run / period - before).min(1) }"],
        &["schedule::tests::skipped_steps", "slot::tests::lazy_and_eager"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "newest measurement at the end of the history",
        "sensors/src/history.rs",
        ["flat[..width].copy_from_slice(row);", "flat[(length - 1) * width..].copy_from_slice(row);"],
        &["history::tests::rows", "sampling::tests::latency"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "bias walks with the period, not its root",
        "sensors/src/noise.rs",
        ["noise.bias_walk * self.sqrt_period *", "noise.bias_walk * self.sqrt_period.powi(2) *"],
        &["sampling::tests::biases"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "dropout loses what it should keep",
        "sensors/src/noise.rs",
        ["self.rngs[env].uniform() >= self.dropout", "self.rngs[env].uniform() < self.dropout"],
        &["sampling::tests::dropout"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "measurement from the instant of a write replaces it",
        "sensors/src/delay.rs",
        ["*captured > self.last_refresh[env]", "*captured >= self.last_refresh[env]"],
        &["sampling::tests::refresh"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "arrivals forgotten in when something is due",
        "sensors/src/sampling.rs",
        ["arrival.map_or(due, |arrival| arrival.min(due))", "arrival.map_or(due, |_| due)"],
        &["sampling::tests::due"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "resolution rounds down",
        "sensors/src/noise.rs",
        ["steps.round() * self.resolution", "steps.floor() * self.resolution"],
        &["sampling::tests::resolution"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "friction of a contact with its normal part",
        "sensors/src/contact_sensor/pairs.rs",
        ["contact.force[k] - contact.normal_force * contact.normal[k]", "contact.force[k] - 0.0 * contact.normal[k]"],
        &["contact_sensor::tests::values"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "pairs of contacts by the watched body itself",
        "sensors/src/contact_sensor/pairs.rs",
        ["Some((slot, sign, index(1 - side)))", "Some((slot, sign, index(side)))"],
        &["contact_sensor::tests::values"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "first ray of a full turn cast twice",
        "sensors/src/ray/pattern/lidar.rs",
        ["if is_turn && ends_on_grid { whole }", "if is_turn && !ends_on_grid { whole }"],
        &["ray::pattern::tests::lidars"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "order of rays in a grid exchanged",
        "sensors/src/ray/pattern/grid.rs",
        ["[at(0, k % nx), at(1, k / nx), 0.0]", "[at(0, k / ny), at(1, k % ny), 0.0]"],
        &["ray::pattern::tests::grids"],
    ),
    Mutation::of(
        "kinetoscope-sensors",
        "yaw of tilted bodies with a wrong sign",
        "sensors/src/ray/caster/alignment.rs",
        ["2.0 * (q.w * q.k + q.i * q.j)", "2.0 * (q.w * q.k - q.i * q.j)"],
        &["ray::caster::tests::alignments"],
    ),
];
