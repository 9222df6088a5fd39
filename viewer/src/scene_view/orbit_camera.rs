//! Orbit camera of viewers.

use super::snapshot::Snapshot;
use kinetoscope_render::View;
use kinetoscope_scene::camera_fit::{CameraFit, DEFAULT_FILL, DEFAULT_REACH, PosedScene};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// An orbit camera that turns about a target point, pans, zooms and flies. The world's +z points up in the image; the
/// camera never rolls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OrbitCamera {
    /// Target point in the center of the image, in the frame of the overview \[m\].
    pub target: [f64; 3],
    /// Distance from the camera to the target \[m\].
    pub distance: f64,
    /// Heading of the viewing direction in the horizontal plane \[rad\]: 0 is along +x, π/2 along +y.
    pub azimuth: f64,
    /// Angle of the viewing direction above the horizontal plane \[rad\]; negative looks down.
    pub elevation: f64,
    /// Vertical field of view \[rad\].
    pub fovy: f64,
}

impl Default for OrbitCamera {
    fn default() -> Self {
        Self { target: [0.0, 0.0, 0.3], distance: 3.0, azimuth: 2.4, elevation: -0.45, fovy: 45f64.to_radians() }
    }
}

/// Largest elevation angle \[rad\]. Straight up or down, the right direction would be undefined.
const MAX_ELEVATION: f64 = 1.55;
/// Smallest and largest distance to the target \[m\].
const DISTANCE_RANGE: [f64; 2] = [0.02, 1e4];

impl OrbitCamera {
    /// Creates a camera at `eye` that looks at `target`, in the frame of the overview \[m\], with a `fovy` of 45°.
    /// Returns `None` if the points coincide or are not finite. The distance is clamped to 0.02 m to 10 km and the
    /// elevation to ±1.55 rad; the position then differs from `eye`.
    pub fn look_at(eye: [f64; 3], target: [f64; 3]) -> Option<Self> {
        let way = Vector3::from(target) - Vector3::from(eye);
        let distance = way.norm();
        if !(distance.is_finite() && distance > 1e-9) {
            return None;
        }
        let azimuth = if way.xy().norm() > 1e-9 { way.y.atan2(way.x) } else { 0.0 };
        let elevation = (way.z / distance).clamp(-1.0, 1.0).asin().clamp(-MAX_ELEVATION, MAX_ELEVATION);
        Some(Self {
            target,
            distance: distance.clamp(DISTANCE_RANGE[0], DISTANCE_RANGE[1]),
            azimuth,
            elevation,
            ..Self::default()
        })
    }

    /// Returns the camera set by the program ([`set_camera_view`](kinetoscope_sim::SceneViewMut::set_camera_view)), if
    /// any. Otherwise returns a camera from which all environments, without the ground and large surroundings, fill an
    /// image of `width` by `height` pixels, seen obliquely from above.
    pub fn overview(snapshot: &Snapshot, [width, height]: [usize; 2]) -> Self {
        if let Some(eye) = snapshot.viewpoint.and_then(|view| Self::look_at(view.eye, view.target)) {
            return eye;
        }
        let scenes: Vec<_> = snapshot.envs.iter().map(|env| snapshot.env_scene(env)).collect();
        let placed: Vec<PosedScene<'_>> = snapshot
            .envs
            .iter()
            .zip(&scenes)
            .filter_map(|(env, scene)| {
                Some(PosedScene {
                    scene: scene.as_deref()?,
                    poses: &env.snapshot.instances,
                    origin: env.origin,
                    reach: DEFAULT_REACH,
                })
            })
            .collect();
        Self::frame_scenes(&placed, [width, height])
    }

    /// Returns a camera from which the scenes, without the ground and large surroundings ([`CameraFit::fit`]), fill an
    /// image of `width` by `height` pixels, seen obliquely from above. `placed` may contain one scene at several
    /// instants. Returns the default camera if there is nothing to frame.
    pub fn frame_scenes(placed: &[PosedScene<'_>], [width, height]: [usize; 2]) -> Self {
        let eye = Self::default();
        let (forward, aspect) = (eye.direction(), width.max(1) as f64 / height.max(1) as f64);
        let framing = CameraFit { forward, fovy: eye.fovy, aspect, fill: DEFAULT_FILL };
        let Some(placement) = framing.fit(placed) else { return eye };
        let distance = Vector3::from(placement.eye).metric_distance(&Vector3::from(placement.target));
        Self { target: placement.target, distance: distance.clamp(DISTANCE_RANGE[0], DISTANCE_RANGE[1]), ..eye }
    }

    /// Viewing direction, from the camera to the target: a unit vector.
    pub fn direction(&self) -> [f64; 3] {
        let (sin, cos) = self.elevation.sin_cos();
        [cos * self.azimuth.cos(), cos * self.azimuth.sin(), sin]
    }

    /// Position of the camera in the frame of the overview \[m\].
    pub fn position(&self) -> [f64; 3] {
        let forward = self.direction();
        [0, 1, 2].map(|k| self.target[k] - self.distance * forward[k])
    }

    /// Directions to the right and up in the image.
    fn axes(&self) -> [Vector3<f64>; 2] {
        let forward = Vector3::from(self.direction());
        let right = Vector3::new(self.azimuth.sin(), -self.azimuth.cos(), 0.0);
        [right, right.cross(&forward)]
    }

    fn shift(&mut self, by: Vector3<f64>) {
        self.target = (Vector3::from(self.target) + by).into();
    }

    /// Orbits about the target, for a mouse drag of `[dx, dy]` pixels (right, down) in an image of `height` rows. The
    /// scene turns with the mouse, by half a turn per `height` pixels.
    pub fn orbit(&mut self, [dx, dy]: [f64; 2], height: usize) {
        let scale = std::f64::consts::PI / height.max(1) as f64;
        self.azimuth = (self.azimuth - dx * scale).rem_euclid(std::f64::consts::TAU);
        self.elevation = (self.elevation - dy * scale).clamp(-MAX_ELEVATION, MAX_ELEVATION);
    }

    /// Turns the camera in place, for a mouse drag of `[dx, dy]` pixels (right, down) in an image of `height` rows. The
    /// image moves with the mouse: a drag to the right turns the camera to the left. The position stays, and the target
    /// moves.
    pub fn look_around(&mut self, [dx, dy]: [f64; 2], height: usize) {
        let eye = Vector3::from(self.position());
        self.orbit([-dx, -dy], height);
        self.target = (eye + self.distance * Vector3::from(self.direction())).into();
    }

    /// Pans for a mouse drag of `[dx, dy]` pixels (right, down) in an image of `height` rows. Points at the depth of
    /// the target follow the mouse.
    pub fn pan(&mut self, [dx, dy]: [f64; 2], height: usize) {
        let [right, up] = self.axes();
        let scale = 2.0 * self.distance * (0.5 * self.fovy).tan() / height.max(1) as f64;
        self.shift((up * dy - right * dx) * scale);
    }

    /// Zooms in by steps of a mouse wheel: each multiplies the distance to the target by 0.85. Negative steps zoom out.
    pub fn zoom(&mut self, steps: f64) {
        self.distance = (self.distance * 0.85f64.powf(steps)).clamp(DISTANCE_RANGE[0], DISTANCE_RANGE[1]);
    }

    /// Moves camera and target: along the viewing direction, to the right in the horizontal plane, and up along +z
    /// \[m\].
    pub fn translate(&mut self, [ahead, right, up]: [f64; 3]) {
        let [to_right, _] = self.axes();
        self.shift(Vector3::from(self.direction()) * ahead + to_right * right + Vector3::z() * up);
    }

    /// Returns the pinhole view of an image of `width` by `height` pixels, each clamped to 1 to [`View::MAX_SIDE`].
    pub fn view(&self, width: usize, height: usize) -> View {
        let [eye, target] = [self.position(), self.target].map(|p| p.map(|x| x as f32));
        let near = (0.01 * self.distance).clamp(0.005, 0.05) as f32;
        let far = (20.0 * self.distance).max(500.0) as f32;
        let size = [width, height].map(|n| n.clamp(1, View::MAX_SIDE));
        let view = View::look_at(size, self.fovy as f32, eye, target, [0.0, 0.0, 1.0]);
        // Far from the origin, the target may be lost in single precision.
        let fallback = || View::look_at(size, self.fovy as f32, [-1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]);
        view.or_else(|_| fallback()).map_or_else(|_| origin_view(size), |view| View { near, far, ..view })
    }
}

/// Returns a camera at the origin.
fn origin_view([width, height]: [usize; 2]) -> View {
    let [cx, cy] = [0.5 * width as f32, 0.5 * height as f32];
    let world_from_camera = kinetoscope_scene::PoseF32::IDENTITY;
    View {
        parallel: false,
        width,
        height,
        fx: cy.max(1.0),
        fy: cy.max(1.0),
        cx,
        cy,
        near: 0.01,
        far: 100.0,
        world_from_camera,
    }
}

/// Projects a world point to pixel coordinates; `None` if it is nearer than the near plane or behind the camera.
pub(super) fn project(view: &View, point: [f64; 3]) -> Option<[f32; 2]> {
    let [x, y, z] = view.world_from_camera.apply_inverse(point.map(|p| p as f32));
    (z > view.near).then(|| [view.fx * x / z + view.cx, view.fy * y / z + view.cy])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|k| (a[k] - b[k]).abs() < 1e-9)
    }

    /// True if a point projects to this pixel of 960 by 540, to 0.01 pixels. Coordinates of a few meters in single
    /// precision, at 650 pixels per radian, have an error of 1e-3 pixels.
    fn seen_at(eye: &OrbitCamera, point: [f64; 3], pixel: [f32; 2]) -> bool {
        project(&eye.view(960, 540), point).is_some_and(|at| (0..2).all(|k| (at[k] - pixel[k]).abs() < 0.01))
    }

    #[test]
    fn places() {
        let eye = OrbitCamera::look_at([3.0, -1.0, 2.0], [0.5, 0.5, 0.5]);
        assert!(eye.is_some_and(|eye| close(eye.position(), [3.0, -1.0, 2.0]) && close(eye.target, [0.5; 3])));
        assert_eq!(OrbitCamera::look_at([1.0; 3], [1.0; 3]), None);
        assert_eq!(OrbitCamera::look_at([f64::NAN; 3], [1.0; 3]), None);
        for [width, height] in [[0, 0], [1, 1], [1, 10_000], [100_000, 1]] {
            assert!(OrbitCamera::default().view(width, height).validate().is_ok(), "{width} x {height}");
        }
    }

    /// An orbit keeps the target in the center, a turn keeps the position, and panning moves the target plane with the
    /// mouse, pixel by pixel.
    #[test]
    fn drags() {
        let mut eye = OrbitCamera::default();
        eye.orbit([200.0, -35.0], 540);
        assert!(seen_at(&eye, eye.target, [480.0, 270.0]));
        let place = eye.position();
        eye.look_around([33.0, 12.0], 540);
        assert!(close(place, eye.position()));
        // Repeated drags down over the whole height end almost above the target.
        (0..9).for_each(|_| eye.orbit([0.0, 540.0], 540));
        assert!((eye.elevation + MAX_ELEVATION).abs() < 1e-12);
        assert!(eye.view(960, 540).validate().is_ok());
        let mut eye = OrbitCamera::default();
        let point = eye.target;
        eye.pan([40.0, -25.0], 540);
        assert!(seen_at(&eye, point, [520.0, 245.0]));
    }

    #[test]
    fn zoom_and_flight() {
        let mut eye = OrbitCamera::default();
        let away = eye.distance;
        eye.zoom(1.0);
        assert!((eye.distance / away - 0.85).abs() < 1e-12);
        for (steps, expected) in [(1e6, DISTANCE_RANGE[0]), (-1e6, DISTANCE_RANGE[1])] {
            eye.zoom(steps);
            assert!(eye.distance == expected && eye.view(10, 10).validate().is_ok());
        }
        let mut eye = OrbitCamera { azimuth: 0.0, elevation: 0.0, ..OrbitCamera::default() };
        let place = eye.position();
        eye.translate([1.0, 2.0, 3.0]);
        // Looking along +x, the right direction is -y.
        assert!(close(eye.position(), [place[0] + 1.0, place[1] - 2.0, place[2] + 3.0]));
    }
}
