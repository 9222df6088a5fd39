//! Mutations of windows, of the browser view, and of their control of a simulation.

use super::Mutation;

pub(super) const VIEWS: &[Mutation] = &[
    Mutation::of(
        "kinetoscope-viewer",
        "slow motion is fast",
        "viewer/src/control/real_time_clock.rs",
        ["* self.dt / factor);", "* self.dt * factor);"],
        &["control::real_time_clock::tests::waits"],
    ),
    Mutation::of(
        "kinetoscope-viewer",
        "spring of the mouse drives instead of damping",
        "viewer/src/control/spring.rs",
        ["- 2.0 * FREQUENCY * velocity;", "+ 2.0 * FREQUENCY * velocity;"],
        &["control::tests::spring_in_closed_form"],
    ),
    Mutation::of(
        "kinetoscope-viewer",
        "view moves with the mouse, not against it",
        "viewer/src/scene_view/orbit_camera.rs",
        ["self.shift((up * dy - right * dx) * scale);", "self.shift((up * dy + right * dx) * scale);"],
        &["scene_view::orbit_camera::tests::drags"],
    ),
    Mutation::of(
        "kinetoscope-viewer",
        "contact force on the selected body with the wrong sign",
        "viewer/src/scene_view/pick.rs",
        ["contact.bodies.iter().zip([-1.0, 1.0])", "contact.bodies.iter().zip([1.0, -1.0])"],
        &["scene_view::tests::selected_cube"],
    ),
    Mutation::of(
        "kinetoscope-viewer",
        "time line begins at zero",
        "viewer/src/window/timeline.rs",
        ["Some(start + share * (end - start))", "Some(share * (end - start))"],
        &["window::timeline::tests::mark", "window::timeline::tests::seek"],
    ),
    Mutation::of(
        "kinetoscope-viewer",
        "film shows the frame after the time",
        "viewer/src/control/view_controller/playback.rs",
        [
            "partition_point(|frame| *frame <= self.time).saturating_sub(1)",
            "partition_point(|frame| *frame <= self.time).min(self.times.len() - 1)",
        ],
        &["playback::tests::seek_step_and_play"],
    ),
    Mutation::of(
        "kinetoscope-http",
        "first letters of a token are enough",
        "http/src/token.rs",
        ["self.0.as_bytes().ct_eq", "self.0.as_bytes()[..given.len().min(self.0.len())].ct_eq"],
        &["token::tests::equality"],
    ),
    Mutation::of(
        "kinetoscope-viewer",
        "body pulled to its place in the grid of environments",
        "viewer/src/scene_view/mouse_spring.rs",
        ["f64::from(place[k]) - origin[k]", "f64::from(place[k])"],
        &["window::tests::selection_and_spring"],
    ),
];
