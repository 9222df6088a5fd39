//! The part of the scene that a shadow map covers: the surfaces in view, and the casters between them and the light.

use super::light::unit;
use crate::visibility::Projection;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::vector::dot;
use kinetoscope_scene::{Instance, Light, LightKind, OpenGlRules, PoseF32, RenderScene};

/// Margin around the covered part, in texels: for the taps around a point and for its offset along the normal.
const MARGIN: f32 = 6.0;
/// Largest displacement of receivers and casters by their level of detail \[m\] (see
/// [`RasterCfg::lod`](crate::request::RasterCfg::lod)).
const MAX_LOD_ERROR: f32 = 2e-3;
/// Nearest depth of a spot's map \[m\].
const SPOT_NEAR: f32 = 0.02;
/// Largest half angle of a spot's map \[deg\].
const SPOT_CUTOFF: f32 = 75.0;

/// A range of coordinates on a light's image plane and along its axis. For a directional light, x and y are lengths
/// \[m\]; for a spot, they are divided by the depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    lo: [f32; 3],
    hi: [f32; 3],
}

impl Extent {
    const EMPTY: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };
    const ALL: Self = Self { lo: [f32::NEG_INFINITY; 3], hi: [f32::INFINITY; 3] };

    fn is_empty(&self) -> bool {
        (0..3).any(|k| self.lo[k] > self.hi[k])
    }

    fn add(&mut self, p: [f32; 3]) {
        for (k, p) in p.into_iter().enumerate() {
            (self.lo[k], self.hi[k]) = (self.lo[k].min(p), self.hi[k].max(p));
        }
    }

    fn union(&mut self, other: &Self) {
        for k in 0..3 {
            (self.lo[k], self.hi[k]) = (self.lo[k].min(other.lo[k]), self.hi[k].max(other.hi[k]));
        }
    }

    fn intersection(&self, other: &Self) -> Self {
        Self { lo: [0, 1, 2].map(|k| self.lo[k].max(other.lo[k])), hi: [0, 1, 2].map(|k| self.hi[k].min(other.hi[k])) }
    }

    /// The part of this caster's extent whose shadow may fall into `other`.
    fn shading(&self, other: &Self) -> Self {
        let mut out = self.intersection(other);
        // The caster may have any depth in front of the receiver.
        (out.lo[2], out.hi[2]) = (self.lo[2], self.hi[2]);
        if self.lo[2] > other.hi[2] { Self::EMPTY } else { out }
    }
}

/// View of a light that casts shadows, for its map.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightView {
    parallel: bool,
    position: [f32; 3],
    /// World from light; the columns are the light's axes, the last one along its direction.
    pub(super) rotation: [[f32; 3]; 3],
    /// Range that the light can reach.
    cone: Extent,
    /// True if shadows end at this range: then the map covers no more.
    clips: bool,
}

/// Returns a rotation matrix, as rows, whose third column is the unit vector `z`. Source: Duff et al., Building an
/// Orthonormal Basis, Revisited, JCGT 2017.
fn frame_along(z: [f32; 3]) -> [[f32; 3]; 3] {
    let sign = if z[2] < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + z[2]);
    let b = z[0] * z[1] * a;
    let x = [1.0 + sign * z[0] * z[0] * a, sign * b, -sign * z[0]];
    let y = [b, sign + z[1] * z[1] * a, -z[1]];
    // The columns are the axes.
    [0, 1, 2].map(|k| [x[k], y[k], z[k]])
}

impl LightView {
    /// The view of a light; `None` for lights without shadow maps.
    pub(super) fn from_light(light: &Light) -> Option<Self> {
        let rotation = frame_along(unit(light.direction));
        match light.kind {
            LightKind::Directional => {
                Some(Self { parallel: true, position: [0.0; 3], rotation, cone: Extent::ALL, clips: false })
            }
            LightKind::Spot { cutoff_deg, .. } => {
                let finite = light.position.iter().all(|x| x.is_finite());
                if !finite || cutoff_deg.is_nan() || cutoff_deg <= 0.0 {
                    return None;
                }
                let half = f64::from(cutoff_deg.min(SPOT_CUTOFF) + 1.0).to_radians().tan() as f32;
                let cone = Extent { lo: [-half, -half, SPOT_NEAR], hi: [half, half, f32::INFINITY] };
                Some(Self { parallel: false, position: light.position, rotation, cone, clips: false })
            }
            LightKind::Point => None,
        }
    }

    /// The view with the limits of MuJoCo's OpenGL renderer: the square around a directional light, the part of a spot's
    /// cone, and the depths of the camera \[m\]. `None` if nothing is left.
    pub(super) fn limited(&self, light: &Light, rules: &OpenGlRules, [near, far]: [f32; 2]) -> Option<Self> {
        let half = match light.kind {
            LightKind::Spot { cutoff_deg, .. } => {
                // OpenGL's field of view is at most 160 degrees.
                let angle = (cutoff_deg * rules.shadow_scale).min(80.0);
                f64::from(angle).to_radians().tan() as f32
            }
            _ => rules.shadow_clip,
        };
        let position = light.position;
        if !(half > 0.0 && half.is_finite() && position.iter().all(|x| x.is_finite())) {
            return None;
        }
        let bounds = Extent {
            lo: [-half, -half, near.max(if self.parallel { f32::MIN } else { SPOT_NEAR })],
            hi: [half, half, far],
        };
        Some(Self { position, cone: bounds.intersection(&self.cone), clips: true, ..*self })
    }

    fn axis(&self, k: usize) -> [f32; 3] {
        [self.rotation[0][k], self.rotation[1][k], self.rotation[2][k]]
    }

    /// Extent of the convex hull of world points, `margin` \[m\] wider on each side.
    fn hull(&self, points: &[[f32; 3]], margin: f32) -> Extent {
        let mut out = Extent::EMPTY;
        for point in points {
            let d = [0, 1, 2].map(|k| point[k] - self.position[k]);
            let [x, y, z] = [0, 1, 2].map(|k| dot(self.axis(k), d));
            if self.parallel {
                out.add([x - margin, y - margin, z]);
                out.add([x + margin, y + margin, z]);
                continue;
            }
            // A point at the height of the light or behind it has no bounds in its view.
            let depth = z.max(SPOT_NEAR);
            let reach = if z < SPOT_NEAR { f32::INFINITY } else { margin / depth };
            out.add([x / depth - reach, y / depth - reach, z]);
            out.add([x / depth + reach, y / depth + reach, z]);
        }
        out
    }

    fn of_box(&self, instance: &Instance, pose: &PoseF32, margin: f32) -> Extent {
        let [lo, hi] = instance.shape.aabb();
        if lo.iter().chain(&hi).any(|x| !x.is_finite()) {
            return Extent::ALL;
        }
        self.hull(&corners(lo, hi).map(|p| pose.apply(p)), margin)
    }

    /// Range of x and y in which the light casts shadows, in the frame of the map's projection, \[m\] or slopes; `None`
    /// for a light without limits.
    pub(super) fn limits(&self, projection: &Projection) -> Option<[[f32; 2]; 2]> {
        let d = [0, 1, 2].map(|k| projection.world_from_camera.translation[k] - self.position[k]);
        let offset = [0, 1].map(|k| if self.parallel { dot(self.axis(k), d) } else { 0.0 });
        let Extent { lo, hi } = self.cone;
        self.clips.then(|| [lo, hi].map(|bound| [bound[0] - offset[0], bound[1] - offset[1]]))
    }

    /// Projection of the map over the casters that can shade the receivers, and true if planes are among these casters;
    /// `None` without such casters.
    pub(super) fn fit(
        &self,
        scene: &RenderScene,
        poses: &[PoseF32],
        receivers: &Extent,
        side: usize,
        casts: impl Fn(&Instance) -> bool,
    ) -> Option<(Projection, bool)> {
        let receivers = receivers.intersection(&self.cone);
        let mut all = Extent::EMPTY;
        let things = || scene.instances().iter().zip(poses);
        for (instance, pose) in things().filter(|(i, _)| casts(i) && !matches!(i.shape, Shape::Plane(_))) {
            let one = self.of_box(instance, pose, MAX_LOD_ERROR).shading(&receivers);
            let in_range = !self.clips || one.hi[2] >= self.cone.lo[2];
            if in_range && !one.is_empty() {
                all.union(&one);
            }
        }
        let extent = |all: &Extent| (all.hi[0] - all.lo[0]).max(all.hi[1] - all.lo[1]).max(1e-3);
        // A plane shades only objects that reach below it, by more than the map's resolution.
        let texel = if all.is_empty() { 0.0 } else { extent(&all) / side as f32 };
        let mut planes = false;
        for (k, (plane, plane_pose)) in things().enumerate() {
            let Shape::Plane(_) = plane.shape else { continue };
            let normal = [0, 1, 2].map(|i| plane_pose.rotation[i][2]);
            let toward = match self.parallel {
                true => -dot(normal, self.axis(2)),
                false => dot(normal, [0, 1, 2].map(|i| self.position[i] - plane_pose.translation[i])),
            };
            if !casts(plane) || toward <= 0.0 {
                continue;
            }
            let own = self.of_box(plane, plane_pose, 0.0).shading(&receivers);
            for (_, (other, pose)) in things().enumerate().filter(|(i, (other, _))| *i != k && other.visible) {
                let depth = depth_below(plane_pose, normal, other, pose);
                let below = self.of_box(other, pose, MAX_LOD_ERROR);
                let least = if self.parallel { 2.0 * texel } else { 2.0 * texel * own.hi[2].abs() };
                let one = own.intersection(&below);
                if depth > least.max(1e-4) && (0..2).all(|k| one.lo[k] <= one.hi[k]) {
                    let one = Extent { lo: [one.lo[0], one.lo[1], own.lo[2]], hi: [one.hi[0], one.hi[1], own.hi[2]] };
                    all.union(&one);
                    planes = true;
                }
            }
        }
        if all.is_empty() {
            return None;
        }
        let [scale, middle] = [(side as f32 - 2.0 * MARGIN) / extent(&all), 0.5 * side as f32];
        let center = [0, 1].map(|k| 0.5 * (all.lo[k] + all.hi[k]));
        if !(scale.is_finite() && center.iter().all(|x| x.is_finite())) {
            return None;
        }
        let square = Projection {
            parallel: self.parallel,
            is_camera: false,
            width: side,
            height: side,
            fx: scale,
            fy: scale,
            cx: middle - scale * center[0],
            cy: middle - scale * center[1],
            near: if self.clips { self.cone.lo[2] } else { SPOT_NEAR },
            far: 1000.0,
            world_from_camera: PoseF32 { rotation: self.rotation, translation: self.position },
        };
        if !self.parallel {
            return Some((square, planes));
        }
        let depth = (all.hi[2] - all.lo[2]).max(1e-3);
        let start = [center[0], center[1], all.lo[2] - 0.01 * depth - 1e-3];
        let translation = [0, 1, 2].map(|k| self.position[k] + dot(self.rotation[k], start));
        let near = if self.clips { (self.cone.lo[2] - start[2]).max(0.0) } else { 0.0 };
        Some((
            Projection {
                cx: middle,
                cy: middle,
                near,
                // Receivers behind all casters are still compared.
                far: 1.1 * depth + 2e-3,
                world_from_camera: PoseF32 { rotation: self.rotation, translation },
                ..square
            },
            planes,
        ))
    }
}

/// Depth of the lowest point of a box below a plane \[m\].
fn depth_below(plane: &PoseF32, normal: [f32; 3], instance: &Instance, pose: &PoseF32) -> f32 {
    let [lo, hi] = instance.shape.aabb();
    let local = pose.rotate_inverse(normal);
    // 0 times infinity: an infinite plane does not reach below a parallel one.
    let reach = |k: usize| {
        let (tilt, half) = (local[k].abs(), 0.5 * (hi[k] - lo[k]));
        if half.is_finite() || tilt > 1e-6 { tilt * half } else { 0.0 }
    };
    let middle = [0, 1, 2].map(|k| if hi[k].is_finite() { 0.5 * (lo[k] + hi[k]) } else { 0.0 });
    let middle = pose.apply(middle);
    let above = dot(normal, [0, 1, 2].map(|k| middle[k] - plane.translation[k]));
    (0..3).map(reach).sum::<f32>() - above
}

fn corners(lo: [f32; 3], hi: [f32; 3]) -> [[f32; 3]; 8] {
    std::array::from_fn(|c| [0, 1, 2].map(|k| if c >> k & 1 == 1 { hi[k] } else { lo[k] }))
}

/// The corners of each face of a box, in the order of [`corners`].
const FACES: [[usize; 4]; 6] = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
/// Largest number of corners of a quadrilateral clipped by six planes.
const MAX_CORNERS: usize = 10;

/// Adds the corners of a polygon's part on the positive side of all planes.
fn clip(polygon: [[f32; 3]; 4], planes: &[[f32; 4]; 6], points: &mut [[f32; 3]], count: &mut usize) {
    let mut from = ([[0.0f32; 3]; MAX_CORNERS], 4);
    from.0[..4].copy_from_slice(&polygon);
    for plane in planes {
        let side = |p: [f32; 3]| dot([plane[0], plane[1], plane[2]], p) + plane[3];
        let mut to = ([[0.0f32; 3]; MAX_CORNERS], 0);
        for k in 0..from.1 {
            let (a, b) = (from.0[k], from.0[(k + 1) % from.1]);
            let (da, db) = (side(a), side(b));
            let mut push = |p| {
                if to.1 < MAX_CORNERS {
                    to.0[to.1] = p;
                    to.1 += 1;
                }
            };
            if da >= 0.0 {
                push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                let k = da / (da - db);
                push([0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * k));
            }
        }
        from = to;
    }
    for p in &from.0[..from.1] {
        if let Some(to) = points.get_mut(*count) {
            *to = *p;
            *count += 1;
        }
    }
}

/// Returns, for each light, the extent of the boxes of all `shown` instances in the frustum of a camera without a lens.
/// Occlusion is ignored; `None` for a light gives an empty extent.
pub(super) fn visible_extents<const N: usize>(
    projection: &Projection,
    scene: &RenderScene,
    poses: &[PoseF32],
    shown: impl Fn(&Instance) -> bool,
    lights: &[Option<LightView>; N],
) -> [Extent; N] {
    let Projection { width, height, fx, fy, cx, cy, near, far, .. } = *projection;
    let (w, h) = (width as f32, height as f32);
    let is_parallel = projection.parallel;
    let side = |x: f32, y: f32, c: f32| if is_parallel { [x, y, 0.0, c] } else { [x, y, c, 0.0] };
    // Positive inside, for points of the optical frame.
    let frustum = [
        [0.0, 0.0, 1.0, -near],
        [0.0, 0.0, -1.0, far],
        side(fx, 0.0, cx),
        side(-fx, 0.0, w - cx),
        side(0.0, fy, cy),
        side(0.0, -fy, h - cy),
    ];
    let frustum_corners: [[f32; 3]; 8] = std::array::from_fn(|c| {
        let z = if c & 4 == 0 { near } else { far };
        let (u, v) = (if c & 1 == 0 { 0.0 } else { w }, if c & 2 == 0 { 0.0 } else { h });
        let k = if is_parallel { 1.0 } else { z };
        [(u - cx) / fx * k, (v - cy) / fy * k, z]
    });
    let reach = frustum_corners[4..].iter().map(|p| dot(*p, *p).sqrt()).fold(0.0, f32::max);
    let mut out = [Extent::EMPTY; N];
    for (instance, pose) in scene.instances().iter().zip(poses).filter(|(instance, _)| shown(instance)) {
        let [mut lo, mut hi] = instance.shape.aabb();
        let camera = projection.world_from_camera.inverse_times(pose);
        // Clips an infinite plane to the camera's reach.
        let eye = pose.inverse_times(&projection.world_from_camera).translation;
        for k in 0..3 {
            lo[k] = lo[k].max(eye[k] - reach - 1.0).min(hi[k]);
            hi[k] = hi[k].min(eye[k] + reach + 1.0).max(lo[k]);
        }
        let at = corners(lo, hi).map(|p| camera.apply(p));
        let outside = |p: [f32; 3], plane: &[f32; 4]| dot([plane[0], plane[1], plane[2]], p) + plane[3] < 0.0;
        if frustum.iter().any(|plane| at.iter().all(|p| outside(*p, plane))) {
            continue;
        }
        let mut points = [[0.0f32; 3]; 12 * MAX_CORNERS];
        let mut count = 0;
        if frustum.iter().any(|plane| at.iter().any(|p| outside(*p, plane))) {
            let sides: [[f32; 4]; 6] = std::array::from_fn(|face| {
                let (k, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
                let normal = [0, 1, 2].map(|i| sign * camera.rotation[i][k]);
                let bound = if face % 2 == 0 { -lo[k] } else { hi[k] };
                // Slightly outward, so that points on a face are inside.
                let slack = 1e-5 * (1.0 + bound.abs());
                [normal[0], normal[1], normal[2], bound + slack - dot(normal, camera.translation)]
            });
            for face in FACES {
                clip(face.map(|c| at[c]), &frustum, &mut points, &mut count);
                clip(face.map(|c| frustum_corners[c]), &sides, &mut points, &mut count);
            }
        } else {
            points[..8].copy_from_slice(&at);
            count = 8;
        }
        for point in &mut points[..count] {
            *point = projection.world_from_camera.apply(*point);
        }
        for (out, light) in out.iter_mut().zip(lights) {
            if let Some(light) = light {
                out.union(&light.hull(&points[..count], MAX_LOD_ERROR));
            }
        }
    }
    out
}

/// Unbounded extents, for images through a lens.
pub(super) fn unbounded_extents<const N: usize>() -> [Extent; N] {
    [Extent::ALL; N]
}
