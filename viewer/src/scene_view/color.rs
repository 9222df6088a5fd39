//! Colors of overlays.

/// Contact forces.
pub(super) const FORCE: [f32; 4] = [0.95, 0.45, 0.05, 1.0];
/// Axes of hinge joints.
pub(super) const HINGE: [f32; 4] = [0.15, 0.75, 0.85, 1.0];
/// Axes of slide joints.
pub(super) const SLIDE: [f32; 4] = [0.85, 0.35, 0.85, 1.0];
/// Centers of mass.
pub(super) const MASS: [f32; 4] = [0.95, 0.9, 0.2, 1.0];
/// Selected point and mouse spring.
pub(super) const SELECTION: [f32; 4] = [1.0, 0.2, 0.2, 1.0];
/// Axes of frames.
pub(super) const X: [f32; 4] = [0.85, 0.1, 0.1, 1.0];
pub(super) const Y: [f32; 4] = [0.1, 0.65, 0.1, 1.0];
pub(super) const Z: [f32; 4] = [0.1, 0.25, 0.9, 1.0];
/// Dark quarters of the center-of-mass symbol.
pub(super) const MASS_DARK: [u8; 3] = [20, 20, 20];
/// Names of bodies.
pub(super) const TEXT: [u8; 3] = [235, 235, 235];
/// Newest part of a trail.
pub(super) const TRAIL: [u8; 3] = [255, 210, 60];

/// Converts a color of 0 to 1 to bytes, without the opacity.
pub(super) fn bytes([r, g, b, _]: [f32; 4]) -> [u8; 3] {
    [r, g, b].map(|value| (255.0 * value) as u8)
}
