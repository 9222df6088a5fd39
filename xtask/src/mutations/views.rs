//! Mistakes in windows, in the browser view, and in how they steer a simulation.

use super::Mutation;

pub(super) const VIEWS: &[Mutation] = &[
    Mutation::of(
        "kinetoscope-view",
        "slow motion is fast",
        "view/src/control/pace.rs",
        ["* self.dt / factor);", "* self.dt * factor);"],
        &["control::pace::tests::waits"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "spring of the mouse drives instead of damping",
        "view/src/control/spring.rs",
        ["- 2.0 * FREQUENCY * velocity;", "+ 2.0 * FREQUENCY * velocity;"],
        &["control::tests::spring_in_closed_form"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "view moves with the mouse, not against it",
        "view/src/stage/eye.rs",
        ["self.shift((up * dy - right * dx) * scale);", "self.shift((up * dy + right * dx) * scale);"],
        &["stage::eye::tests::drags"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "contact force on the selected body with the wrong sign",
        "view/src/stage/pick.rs",
        ["contact.bodies.iter().zip([-1.0, 1.0])", "contact.bodies.iter().zip([1.0, -1.0])"],
        &["stage::tests::selected_cube"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "time line begins at zero",
        "view/src/window/timeline.rs",
        ["Some(start + share * (end - start))", "Some(share * (end - start))"],
        &["window::timeline::tests::mark", "window::timeline::tests::seek"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "film shows the frame after the time",
        "view/src/control/conductor/playback.rs",
        [
            "partition_point(|frame| *frame <= self.now).saturating_sub(1)",
            "partition_point(|frame| *frame <= self.now).min(self.times.len() - 1)",
        ],
        &["playback::tests::seek_step_and_play"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "first letters of a token are enough",
        "view/src/serve/token.rs",
        ["own.len() == given.len()", "own.len() >= given.len()"],
        &["serve::token::tests::equality"],
    ),
    Mutation::of(
        "kinetoscope-view",
        "body pulled to its place in the grid of environments",
        "view/src/stage/pull.rs",
        ["f64::from(place[k]) - origin[k]", "f64::from(place[k])"],
        &["window::tests::selection_and_spring"],
    ),
];
