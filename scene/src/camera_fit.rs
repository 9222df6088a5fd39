//! Camera placement in which the drawn scene fills the image.

use crate::shape::Shape;
use crate::vector::{cross, norm, sub, try_normalize};
use crate::{Instance, PoseF32, RenderScene};

/// Instances of a scene at their poses, shifted by an offset.
#[derive(Clone, Copy, Debug)]
pub struct PosedScene<'a> {
    /// Scene to draw.
    pub scene: &'a RenderScene,
    /// World-from-instance poses, one for each instance of the scene.
    pub poses: &'a [PoseF32],
    /// Offset that is added to all positions \[m\], such as the origin of the environment.
    pub origin: [f64; 3],
    /// Largest absolute coordinate of movable instances in `poses` \[m\], without the offset. Movable instances beyond
    /// it have flown away and are ignored.
    pub reach: f32,
}

/// View direction and image that the scene must fit.
#[derive(Clone, Copy, Debug)]
pub struct CameraFit {
    /// Viewing direction of the camera in world axes, of any length; not vertical.
    pub forward: [f64; 3],
    /// Vertical field of view \[rad\].
    pub fovy: f64,
    /// Aspect ratio of the image: width over height.
    pub aspect: f64,
    /// Filled fraction of the image in the limiting direction, above 0 and at most 1.
    pub fill: f64,
}

/// A camera placement, in the frame of the fitted scenes with their offsets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedView {
    /// Position of the camera \[m\].
    pub eye: [f64; 3],
    /// Point on the optical axis, at the middle depth of the drawn scene \[m\].
    pub target: [f64; 3],
    /// Longest side of the bounding box of the drawn scene \[m\].
    pub extent: f64,
}

/// Filled fraction of the image for initial views.
pub const DEFAULT_FILL: f64 = 0.9;
/// Reach of an environment \[m\]: movable instances farther from its origin have flown away.
pub const DEFAULT_REACH: f32 = 20.0;
/// Ratio of sizes above which a static instance is a room or terrain around the moving ones.
const SURROUNDINGS_SIZE_RATIO: f64 = 2.0;
/// Geom groups that are drawn, as in MuJoCo's viewers.
const DRAWN_GROUPS: std::ops::Range<u8> = 0..3;

impl CameraFit {
    /// Returns the nearest placement with the whole scene in the image.
    ///
    /// Returns `None` if nothing of a finite size is drawn, or if the viewing direction is vertical, zero or not
    /// finite. The smallest distance follows from four supporting planes of the instances, so it is exact. Planes and
    /// geom groups above 2 are ignored, and so are static instances that are much larger than robots and objects, such
    /// as terrain and walls of a room.
    pub fn fit(&self, placed: &[PosedScene<'_>]) -> Option<FittedView> {
        let forward = unit(self.forward)?;
        let right = unit([forward[1], -forward[0], 0.0])?;
        let up = cross(right, forward);
        let framed = drawn_instances(placed);
        let support = |direction: [f64; 3]| support(&framed, direction);
        let [low, high] = bounds(&framed)?;
        let half = (0.5 * self.fovy).tan() * self.fill;
        // Upper bounds of x - slope z and of -x - slope z over all points (x, y, z) in image axes.
        let limits = |across: [f64; 3], slope: f64| {
            let along = |sign: f64| support([0, 1, 2].map(|k| sign * across[k] - slope * forward[k]));
            (along(1.0), along(-1.0))
        };
        let slopes = [half * self.aspect, half];
        let ((right_of, left_of), (above, below)) = (limits(right, slopes[0]), limits(up, slopes[1]));
        let nearest = -support(forward.map(|x| -x));
        let farthest = support(forward);
        let depth = (-(right_of + left_of) / (2.0 * slopes[0])).min(-(above + below) / (2.0 * slopes[1]));
        // The camera stays outside of a flat object that is seen edge-on.
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let depth = depth.min(nearest - 1e-3 * extent.max(1e-6));
        let (x, y) = (0.5 * (right_of - left_of), 0.5 * (above - below));
        let at = |z: f64| [0, 1, 2].map(|k| x * right[k] + y * up[k] + z * forward[k]);
        let placement = FittedView { eye: at(depth), target: at(0.5 * (nearest + farthest)), extent };
        placement.eye.iter().chain(&placement.target).all(|x| x.is_finite()).then_some(placement)
    }
}

/// A drawn instance: the instance, its pose and its offset.
type DrawnInstance<'a> = (&'a Instance, &'a PoseF32, [f64; 3]);

/// Instances that must fit in the image: visible ones of geom groups 0 to 2 with an opacity above 0. Planes are left
/// out, and movable instances with a coordinate of `reach` or more. If there are bodies, static instances with a
/// bounding box more than twice as large as that of the bodies are left out, too.
fn drawn_instances<'a>(placed: &[PosedScene<'a>]) -> Vec<DrawnInstance<'a>> {
    let each = |placed: &PosedScene<'a>| {
        let PosedScene { scene, poses, origin, reach } = *placed;
        let shown =
            scene.instances().iter().zip(poses).filter(move |(i, pose)| is_drawn(i) && is_within_reach(i, pose, reach));
        shown.map(move |(instance, pose)| (instance, pose, origin))
    };
    let all: Vec<DrawnInstance<'a>> = placed.iter().flat_map(each).collect();
    let of_body = |instance: &Instance| instance.body.is_some() || !instance.fixed;
    let of_bodies: Vec<DrawnInstance<'a>> = all.iter().copied().filter(|(instance, ..)| of_body(instance)).collect();
    let Some(size) = bounds(&of_bodies).map(diagonal) else { return all };
    let fits = |framed: &DrawnInstance<'a>| {
        bounds(&[*framed]).is_some_and(|box_| diagonal(box_) <= SURROUNDINGS_SIZE_RATIO * size)
    };
    all.into_iter().filter(|framed| of_body(framed.0) || fits(framed)).collect()
}

fn is_drawn(instance: &Instance) -> bool {
    let seen = instance.visible && instance.material.rgba[3] > 0.0 && DRAWN_GROUPS.contains(&instance.group);
    seen && !matches!(instance.shape, Shape::Plane(_))
}

/// True if an instance has a finite pose, and is fixed or has coordinates below `reach` in magnitude.
fn is_within_reach(instance: &Instance, pose: &PoseF32, reach: f32) -> bool {
    let near = |x: &f32| x.is_finite() && (instance.fixed || x.abs() < reach);
    pose.translation.iter().all(near) && pose.rotation.iter().flatten().all(|x| x.is_finite())
}

/// Largest coordinate of the instances along a direction, times the length of the direction \[m\]; -inf without
/// instances.
fn support(framed: &[DrawnInstance<'_>], direction: [f64; 3]) -> f64 {
    let of = |(instance, pose, origin): &DrawnInstance<'_>| {
        let rotation = pose.rotation.map(|row| row.map(f64::from));
        let own = [0, 1, 2].map(|j| (0..3).map(|i| rotation[i][j] * direction[i]).sum::<f64>());
        let place = (0..3).map(|k| direction[k] * (f64::from(pose.translation[k]) + origin[k])).sum::<f64>();
        place + instance.shape.support(own)
    };
    framed.iter().map(of).fold(f64::NEG_INFINITY, f64::max)
}

/// Bounding box of instances \[m\]; `None` without instances or for an infinite box.
fn bounds(framed: &[DrawnInstance<'_>]) -> Option<[[f64; 3]; 2]> {
    if framed.is_empty() {
        return None;
    }
    let axis = |k: usize, sign: f64| std::array::from_fn(|i| if i == k { sign } else { 0.0 });
    let high = [0, 1, 2].map(|k| support(framed, axis(k, 1.0)));
    let low = [0, 1, 2].map(|k| -support(framed, axis(k, -1.0)));
    (0..3).all(|k| low[k].is_finite() && high[k].is_finite()).then_some([low, high])
}

fn diagonal([low, high]: [[f64; 3]; 2]) -> f64 {
    norm(sub(high, low))
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    try_normalize(a, 1e-9)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::Material;
    use crate::shape::{Box, Capsule, Plane, Sphere};

    fn framing(aspect: f64) -> CameraFit {
        CameraFit { forward: [1.0, 0.0, 0.0], fovy: 45f64.to_radians(), aspect, fill: DEFAULT_FILL }
    }

    /// A sphere of radius r at distance d has a half angle of asin(r / d). At `r / sin(atan(fill tan(fovy / 2)))` it
    /// fills the image.
    #[test]
    fn distance_of_a_ball() {
        let ball = Instance::new(Sphere { radius: 0.5 }, Material::default(), 1).with_body(0);
        let ground = Instance::new(Plane::INFINITE, Material::default(), 2);
        let wall = Instance::new(Box { half: [0.1, 50.0, 50.0] }, Material::default(), 3).into_fixed();
        let scene = RenderScene::new(vec![ball, ground, wall]).unwrap();
        let at = PoseF32::from_translation([1.0, 2.0, 3.0]);
        let poses = [at, PoseF32::IDENTITY, PoseF32::from_translation([60.0, 0.0, 0.0])];
        let placed = PosedScene { scene: &scene, poses: &poses, origin: [10.0, 0.0, 0.0], reach: DEFAULT_REACH };
        for aspect in [2.0, 1.0, 0.25] {
            let narrow = (DEFAULT_FILL * 22.5f64.to_radians().tan() * f64::min(aspect, 1.0)).atan();
            let found = framing(aspect).fit(&[placed]).unwrap();
            let expected = [11.0 - 0.5 / narrow.sin(), 2.0, 3.0];
            assert!((0..3).all(|k| (found.eye[k] - expected[k]).abs() < 1e-6), "{aspect}: {found:?} {expected:?}");
            assert!((found.target[0] - 11.0).abs() < 1e-6 && (found.extent - 1.0).abs() < 1e-6, "{found:?}");
        }
        // Control: a wall alone is framed.
        let alone = RenderScene::new(vec![scene.instances()[2].clone()]).unwrap();
        let wall = PosedScene { scene: &alone, poses: &poses[2..], origin: [0.0; 3], reach: DEFAULT_REACH };
        assert!((framing(1.0).fit(&[wall]).unwrap().extent - 100.0).abs() < 1e-3);
    }

    /// The support function of every shape agrees with its triangles.
    #[test]
    fn supports() {
        let shapes: [Shape; 3] = [
            Box { half: [0.1, 0.2, 0.3] }.into(),
            Capsule { radius: 0.1, half_length: 0.4 }.into(),
            crate::shape::Cylinder { radius: 0.3, half_length: 0.2 }.into(),
        ];
        let more: [Shape; 2] =
            [Sphere { radius: 0.7 }.into(), crate::shape::Ellipsoid { radii: [0.1, 0.5, 0.3] }.into()];
        for shape in shapes.iter().chain(&more) {
            let mesh = shape.tessellate(512);
            for direction in [[1.0, 0.0, 0.0], [-0.3, 0.8, 0.5], [0.2, -0.1, -0.9]] {
                let along = |p: &[f32; 3]| (0..3).map(|k| direction[k] * f64::from(p[k])).sum::<f64>();
                let of_triangles = mesh.positions.iter().map(along).fold(f64::MIN, f64::max);
                let found = shape.support(direction);
                // A polygon of 512 sides is within 1 - cos(pi / 512) of its circle.
                assert!(found >= of_triangles - 1e-6 && found <= of_triangles + 1e-4, "{}: {found}", shape.name());
            }
        }
    }

    /// Scenes without a drawn instance, and a vertical viewing direction, have no placement.
    #[test]
    fn nothing() {
        let plane = RenderScene::new(vec![Instance::new(Plane::INFINITE, Material::default(), 1)]).unwrap();
        let ball = Instance::new(Sphere { radius: 0.5 }, Material::default(), 1);
        let hidden = RenderScene::new(vec![Instance { group: 3, ..ball.clone() }]).unwrap();
        let ball = RenderScene::new(vec![ball]).unwrap();
        let lost = PoseF32::from_translation([f32::NAN, 0.0, 0.0]);
        let far = PoseF32::from_translation([0.0, 30.0, 0.0]);
        let rows = [(&plane, PoseF32::IDENTITY), (&hidden, PoseF32::IDENTITY), (&ball, lost), (&ball, far)];
        for (scene, pose) in rows {
            assert_eq!(
                framing(1.0).fit(&[PosedScene { scene, poses: &[pose], origin: [0.0; 3], reach: DEFAULT_REACH }]),
                None
            );
        }
        let down = CameraFit { forward: [0.0, 0.0, -1.0], ..framing(1.0) };
        assert_eq!(
            down.fit(&[PosedScene {
                scene: &ball,
                poses: &[PoseF32::IDENTITY],
                origin: [0.0; 3],
                reach: DEFAULT_REACH
            }]),
            None
        );
        assert_eq!(framing(1.0).fit(&[]), None);
    }
}
