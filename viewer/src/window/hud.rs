//! Text and controls on top of the window image: status, help, joint sliders. Pure drawing functions on a canvas.

use super::key_bindings;
use crate::control::{RecordingState, Speed};
use crate::scene_view::{Canvas, EnvSelection, Snapshot, slider_range};
use embedded_graphics::mono_font::MonoFont;
use embedded_graphics::mono_font::ascii::{FONT_6X10, FONT_7X13};

const FONT: &MonoFont<'_> = &FONT_7X13;
const SMALL: &MonoFont<'_> = &FONT_6X10;
const WHITE: [u8; 3] = [240; 3];
const GRAY: [u8; 3] = [170; 3];
const YELLOW: [u8; 3] = [255, 210, 60];
const BLUE: [u8; 3] = [80, 150, 240];
const DARK: [u8; 3] = [20, 22, 26];
const RED: [u8; 3] = [235, 60, 50];

/// Width of the slider panel \[pixels\].
pub(super) const SLIDER_PANEL_WIDTH: i32 = 210;
/// Size of the record button \[pixels\].
const RECORD_BUTTON_SIZE: [i32; 2] = [96, 19];
/// Height of a slider with its name \[pixels\].
const SLIDER_ROW_HEIGHT: i32 = 26;
/// Distance of the first slider from the top of the panel \[pixels\].
const FIRST_SLIDER_TOP: i32 = 22;

fn to_i32(n: usize) -> i32 {
    i32::try_from(n).unwrap_or(i32::MAX)
}

/// Draws time, speed, the shown environments, and the last refusal in the upper left corner.
pub(super) fn draw_status(
    canvas: &mut Canvas,
    snapshot: &Snapshot,
    shown: EnvSelection,
    view: &str,
    frames_per_second: f64,
    refused: Option<&str>,
) {
    let env = match shown {
        EnvSelection::All => 0,
        EnvSelection::One(env) => env,
    };
    let run = &snapshot.run;
    let time = snapshot.envs.get(env).map_or(0.0, |env| env.snapshot.time);
    let wanted = match run.speed {
        Speed::Unlimited => "unlimited".into(),
        Speed::Factor(factor) => format!("{factor}x"),
    };
    let measured = run.measured_speed.map_or_else(String::new, |speed| format!(", {speed:.2}x"));
    let which = match shown {
        EnvSelection::All if snapshot.envs.len() == 1 => "1 environment".into(),
        EnvSelection::All => format!("{} environments", snapshot.envs.len()),
        EnvSelection::One(env) => format!("environment {env} of {}", snapshot.envs.len()),
    };
    let state = if run.paused { "paused".into() } else { format!("speed {wanted}{measured}") };
    let mut lines = vec![format!("{time:.3} s   step {}   {state}", run.steps), format!("{which}   {view}")];
    lines.push(format!("{frames_per_second:.0} fps   H: help"));
    let color = if run.paused { YELLOW } else { WHITE };
    canvas.text(&lines.join("\n"), [8, 6], FONT, color);
    let diverged = snapshot.envs.iter().filter(|env| env.snapshot.diverged.is_some()).count();
    let mut below = 6 + 3 * 13 + 8;
    if diverged > 0 {
        let which = if diverged == 1 { "environment" } else { "environments" };
        canvas.text(&format!("{diverged} {which} diverged"), [8, below], FONT, YELLOW);
        below += 18;
    }
    if let Some(refused) = refused {
        canvas.text(&format!("refused: {refused}"), [8, below], SMALL, YELLOW);
    }
}

/// Returns the top left corner of the record button, on a canvas of this width. `aside` is the width of a panel on the
/// right side \[pixels\].
fn record_button_origin(width: usize, aside: usize) -> [i32; 2] {
    [to_i32(width.saturating_sub(aside)) - RECORD_BUTTON_SIZE[0] - 6, 6]
}

/// True if a pixel is on the record button.
pub(super) fn on_record_button(width: usize, aside: usize, at: [f64; 2]) -> bool {
    let corner = record_button_origin(width, aside);
    (0..2).all(|k| (f64::from(corner[k])..f64::from(corner[k] + RECORD_BUTTON_SIZE[k])).contains(&at[k]))
}

/// Draws the record button and the state of the recording.
pub(super) fn draw_record_button(canvas: &mut Canvas, aside: usize, recording: &RecordingState) {
    let width = canvas.dimensions()[0];
    let [x, y] = record_button_origin(width, aside);
    let (text, color) = if recording.on { ("R: stop", WHITE) } else { ("R: record", GRAY) };
    canvas.fill([x, y], RECORD_BUTTON_SIZE, DARK, 200);
    canvas.fill([x + 6, y + 5], [9, 9], if recording.on { RED } else { GRAY }, 255);
    canvas.text(text, [x + 24, y + 3], FONT, color);
    if !recording.text.is_empty() {
        let long = to_i32(recording.text.chars().count()) * 6;
        let right = to_i32(width.saturating_sub(aside)) - 8;
        canvas.text(&recording.text, [(right - long).max(8), y + RECORD_BUTTON_SIZE[1] + 5], SMALL, WHITE);
    }
}

/// Draws text lines in the lower left corner.
pub(super) fn draw_note(canvas: &mut Canvas, lines: &[String]) {
    let height = to_i32(canvas.dimensions()[1]);
    canvas.text(&lines.join("\n"), [8, height - 13 * to_i32(lines.len()) - 6], FONT, WHITE);
}

/// Draws a caption with its top left corner at a pixel.
pub(super) fn draw_caption(canvas: &mut Canvas, text: &str, [x, y]: [usize; 2]) {
    canvas.text(text, [to_i32(x), to_i32(y)], SMALL, WHITE);
}

/// Width of a column of the help \[pixels\].
const HELP_COLUMN_WIDTH: i32 = 315;

/// Draws the help in the center, in two columns if the canvas is wide enough, otherwise in one.
pub(super) fn draw_help(canvas: &mut Canvas) {
    let lines = key_bindings::help();
    let [width, height] = canvas.dimensions().map(to_i32);
    let columns = if width < 2 * HELP_COLUMN_WIDTH + 10 { 1 } else { 2 };
    let rows = to_i32(lines.len().div_ceil(columns));
    let [w, h] = [HELP_COLUMN_WIDTH * to_i32(columns) + 10, rows * 15 + 34];
    let [x, y] = [((width - w) / 2).max(0), ((height - h) / 2).max(0)];
    canvas.fill([x, y], [w, h], DARK, 225);
    canvas.text("Keys and mouse", [x + 12, y + 8], FONT, YELLOW);
    for (index, [keys, text]) in lines.iter().enumerate() {
        let (column, row) = (to_i32(index) / rows.max(1), to_i32(index) % rows.max(1));
        let [left, top] = [x + 12 + column * HELP_COLUMN_WIDTH, y + 28 + row * 15];
        canvas.text(keys, [left, top], SMALL, WHITE);
        canvas.text(text, [left + 84, top], SMALL, GRAY);
    }
}

/// Returns the joints with sliders, as indices into the joint names.
pub(super) fn slider_joints(snapshot: &Snapshot) -> Vec<usize> {
    snapshot.names.joints.iter().enumerate().filter(|(_, joint)| joint.accepts_target).map(|(k, _)| k).collect()
}

/// Returns the range of the slider of a joint \[rad or m\]: its limits, or a default where a limit is missing. `values`
/// are position, target, lower and upper limit of the joint.
fn slider_ends(snapshot: &Snapshot, joint: usize, values: &[f64; 4]) -> [f64; 2] {
    let slides = snapshot.names.joints.get(joint).is_some_and(|name| name.is_prismatic);
    slider_range([values[2], values[3]], slides)
}

/// Returns the number of sliders that fit into a panel of this height \[pixels\].
fn visible_rows(height: i32) -> usize {
    usize::try_from((height - FIRST_SLIDER_TOP) / SLIDER_ROW_HEIGHT).unwrap_or(0)
}

/// Draws the sliders of environment `env` along the right side, starting with slider number `first`.
pub(super) fn draw_sliders(canvas: &mut Canvas, snapshot: &Snapshot, env: usize, first: usize) {
    let [width, height] = canvas.dimensions().map(to_i32);
    let left = width - SLIDER_PANEL_WIDTH;
    canvas.fill([left, 0], [SLIDER_PANEL_WIDTH, height], DARK, 170);
    canvas.text(&format!("Joints, environment {env}"), [left + 8, 5], SMALL, YELLOW);
    let Some(stage) = snapshot.envs.get(env) else { return };
    for (row, joint) in slider_joints(snapshot).into_iter().skip(first).take(visible_rows(height)).enumerate() {
        let top = FIRST_SLIDER_TOP + SLIDER_ROW_HEIGHT * to_i32(row);
        let Some((name, values)) = snapshot.names.joints.get(joint).zip(stage.joints.get(joint)) else { return };
        let [position, target, ..] = *values;
        let short = name.name.rsplit('/').next().unwrap_or(&name.name);
        // A value that rounds to zero is shown as +0.
        let shown = if position.abs() < 5e-4 { 0.0 } else { position };
        canvas.text(&format!("{short:<20.20} {shown:+.3}"), [left + 8, top], SMALL, WHITE);
        let [low, high] = slider_ends(snapshot, joint, values);
        let place = |value: f64| {
            left + 8
                + ((value - low) / (high - low) * f64::from(SLIDER_PANEL_WIDTH - 16))
                    .clamp(0.0, f64::from(SLIDER_PANEL_WIDTH - 16)) as i32
        };
        canvas.fill([left + 8, top + 15], [SLIDER_PANEL_WIDTH - 16, 4], GRAY, 110);
        canvas.fill([place(position) - 1, top + 13], [3, 8], BLUE, 255);
        canvas.fill([place(target) - 1, top + 12], [3, 10], YELLOW, 255);
    }
}

/// Returns the slider at a pixel of a canvas of this size: joint index, and the target at that pixel.
pub(super) fn slider_at(
    snapshot: &Snapshot,
    env: usize,
    first: usize,
    [width, height]: [usize; 2],
    [x, y]: [f64; 2],
) -> Option<(usize, f64)> {
    let left = f64::from(to_i32(width) - SLIDER_PANEL_WIDTH);
    let row = (y - f64::from(FIRST_SLIDER_TOP)) / f64::from(SLIDER_ROW_HEIGHT);
    if x < left || row < 0.0 || row as usize >= visible_rows(to_i32(height)) {
        return None;
    }
    let joint = *slider_joints(snapshot).get(first + row as usize)?;
    Some((joint, slider_value(snapshot, env, joint, width, x)?))
}

/// Returns the target of a slider for a horizontal pixel position, limited to the range of the slider.
pub(super) fn slider_value(snapshot: &Snapshot, env: usize, joint: usize, width: usize, x: f64) -> Option<f64> {
    let [low, high] = slider_ends(snapshot, joint, snapshot.envs.get(env)?.joints.get(joint)?);
    let left = f64::from(to_i32(width) - SLIDER_PANEL_WIDTH) + 8.0;
    let share = ((x - left) / f64::from(SLIDER_PANEL_WIDTH - 16)).clamp(0.0, 1.0);
    Some(low + share * (high - low))
}
