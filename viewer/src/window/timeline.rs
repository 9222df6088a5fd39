//! Timeline of a recording, along the lower edge of a window.

use crate::scene_view::{Canvas, Snapshot, Timeline};
use embedded_graphics::mono_font::ascii::FONT_6X10;

const DARK: [u8; 3] = [20, 22, 26];
const GRAY: [u8; 3] = [170; 3];
const YELLOW: [u8; 3] = [255, 210, 60];

/// Distance from the sides of the window to the timeline \[pixels\].
const MARGIN: f64 = 70.0;
/// Height of the clickable strip at the lower edge \[pixels\].
const HEIGHT: f64 = 16.0;

/// Returns the left and right end of the timeline \[pixels\].
fn x_range(width: usize) -> [f64; 2] {
    let width = width as f64;
    [MARGIN.min(width / 2.0), (width - MARGIN).max(width / 2.0)]
}

/// Draws the timeline if the snapshot belongs to a recording.
pub(super) fn draw(canvas: &mut Canvas, snapshot: &Snapshot) {
    let Some(Timeline { time, start, end }) = snapshot.run.timeline else { return };
    let [width, height] = canvas.dimensions();
    let [left, right] = x_range(width).map(|x| x as i32);
    let top = i32::try_from(height).unwrap_or(i32::MAX) - HEIGHT as i32;
    canvas.fill([0, top], [i32::try_from(width).unwrap_or(i32::MAX), HEIGHT as i32], DARK, 200);
    canvas.fill([left, top + 6], [right - left, 4], GRAY, 110);
    let share = if end > start { (time - start) / (end - start) } else { 0.0 };
    let at = left + (share.clamp(0.0, 1.0) * f64::from(right - left)) as i32;
    canvas.fill([left, top + 6], [at - left, 4], YELLOW, 160);
    canvas.fill([at - 1, top + 2], [3, 12], YELLOW, 255);
    canvas.text(&format!("{start:.2}"), [4, top + 3], &FONT_6X10, GRAY);
    canvas.text(&format!("{end:.2} s"), [right + 8, top + 3], &FONT_6X10, GRAY);
}

/// Returns the recording time \[s\] at a pixel, or `None` above the strip at the lower edge or without a recording.
pub(super) fn time_at(snapshot: &Snapshot, size: [usize; 2], [x, y]: [f64; 2]) -> Option<f64> {
    snapshot.run.timeline?;
    (y >= size[1] as f64 - HEIGHT).then(|| time_at_x(snapshot, size[0], x))?
}

/// Returns the recording time \[s\] at a horizontal pixel position; beyond the ends of the timeline, its first or last
/// time. `None` without a recording.
pub(super) fn time_at_x(snapshot: &Snapshot, width: usize, x: f64) -> Option<f64> {
    let Timeline { start, end, .. } = snapshot.run.timeline?;
    let [left, right] = x_range(width);
    let share = if right > left { ((x - left) / (right - left)).clamp(0.0, 1.0) } else { 0.0 };
    Some(start + share * (end - start))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::Command;
    use crate::scene_view::RunState;
    use crate::window::{App, Input, Modifiers};
    use std::sync::Arc;

    fn at(time: f64) -> Snapshot {
        let timeline = Some(Timeline { time, start: 2.0, end: 6.0 });
        Snapshot { run: RunState { timeline, ..RunState::default() }, ..Snapshot::default() }
    }

    /// The mark is at the pixel that seeks to its time. Without a recording and in the smallest windows, drawing is
    /// harmless.
    #[test]
    fn mark() {
        let size = [400, 300];
        for now in [2.0, 3.0, 5.5, 6.0] {
            let mut canvas = Canvas::new(size[0], size[1]);
            draw(&mut canvas, &at(now));
            let row: Vec<usize> = (0..400).filter(|x| canvas.pixel(*x, 287) == Some(YELLOW)).collect();
            assert_eq!(row.len(), 3, "{row:?}");
            // 260 pixels are 4 s.
            let time = time_at(&at(now), size, [row[1] as f64 + 0.5, 287.0]).unwrap();
            assert!((time - now).abs() < 4.0 / 260.0, "{time} instead of {now}");
        }
        assert_eq!(time_at(&at(3.0), size, [200.0, 250.0]), None, "above the line");
        assert_eq!([-50.0, 900.0].map(|x| time_at_x(&at(3.0), 400, x).unwrap()), [2.0, 6.0]);
        let mut canvas = Canvas::new(50, 50);
        draw(&mut canvas, &Snapshot::default());
        assert_eq!(canvas, Canvas::new(50, 50));
        assert_eq!(time_at(&Snapshot::default(), [50, 50], [25.0, 49.0]), None);
        for size in [[1, 1], [3, 100], [0, 0]] {
            draw(&mut Canvas::new(size[0], size[1]), &at(3.0));
            assert!(time_at_x(&at(3.0), size[0], 1.0).unwrap().is_finite());
        }
    }

    /// Pressing and dragging on the timeline seeks.
    #[test]
    fn seek() {
        let mut app = App::new([400, 300], 1);
        for (what, snapshot, y, expected) in [
            // From the start at 2 s to the middle of 2 s to 6 s, at any height of the mouse.
            ("on the line", at(3.0), 290.0, &[Command::Seek(2.0), Command::Seek(4.0)][..]),
            ("above the line", at(3.0), 200.0, &[]),
            ("no line", Snapshot::default(), 290.0, &[]),
        ] {
            app.set_snapshot(Arc::new(snapshot));
            app.handle(Input::ButtonPress(1, [70.0, y], Modifiers::default()));
            app.handle(Input::Move([200.0, 100.0]));
            app.handle(Input::ButtonRelease(1, [200.0, 100.0]));
            assert_eq!(app.take_commands(), expected, "{what}");
        }
    }
}
