//! Markers of a camera's frame and view frustum.

use kinetoscope_render::lens::Optics;
use kinetoscope_scene::{Marker, Pose};
use nalgebra::Vector3;

/// Depth at which the arrows along the edges end \[m\].
const DEPTH: f64 = 0.3;
/// Length of the axes \[m\].
const AXES: f32 = 0.1;
const COLOR: [f32; 4] = [0.95, 0.8, 0.1, 1.0];

/// Returns the axes of the optical frame (blue is the viewing direction), and arrows from the camera center along the
/// four edges of the view frustum. Arrows end at a depth of 0.3 m, or at this distance if rays do not all go forward.
/// Image corners without a ray get no arrow.
pub(crate) fn frustum(world_from_camera: &Pose, optics: &Optics, height: usize, width: usize) -> Vec<Marker> {
    let (w, h) = (width as f64, height as f64);
    let eye = world_from_camera.translation.vector;
    let edge = |corner: [f64; 2]| {
        let ray = Vector3::from(optics.ray(corner)?) * DEPTH;
        Marker::arrow(eye.into(), (world_from_camera.rotation * ray).into(), COLOR)
    };
    let edges = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].into_iter().filter_map(edge);
    std::iter::once(Marker::axes(*world_from_camera, AXES)).chain(edges).collect()
}
