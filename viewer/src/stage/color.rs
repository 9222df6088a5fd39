//! Colours of what is drawn over the scene.

/// Contact forces.
pub(super) const FORCE: [f32; 4] = [0.95, 0.45, 0.05, 1.0];
/// Axes of joints that turn.
pub(super) const HINGE: [f32; 4] = [0.15, 0.75, 0.85, 1.0];
/// Axes of joints that slide.
pub(super) const SLIDE: [f32; 4] = [0.85, 0.35, 0.85, 1.0];
/// Centres of mass.
pub(super) const MASS: [f32; 4] = [0.95, 0.9, 0.2, 1.0];
/// What was clicked on.
pub(super) const CHOSEN: [f32; 4] = [1.0, 0.2, 0.2, 1.0];
/// Axes of frames.
pub(super) const X: [f32; 4] = [0.85, 0.1, 0.1, 1.0];
pub(super) const Y: [f32; 4] = [0.1, 0.65, 0.1, 1.0];
pub(super) const Z: [f32; 4] = [0.1, 0.25, 0.9, 1.0];
/// The dark quarters of the sign of a centre of mass.
pub(super) const DARK: [u8; 3] = [20, 20, 20];
/// Letters.
pub(super) const NAME: [u8; 3] = [235, 235, 235];
/// Trails, newest.
pub(super) const TRAIL: [u8; 3] = [255, 210, 60];

/// A colour of light as one of bytes, without its opacity.
pub(super) fn bytes([r, g, b, _]: [f32; 4]) -> [u8; 3] {
    [r, g, b].map(|value| (255.0 * value) as u8)
}
