//! Depth, mask, normal and position of every pixel compared with `mj_ray`, on MuJoCo's sample models and on random
//! scenes.
//!
//! Renderer and `mj_ray` both see planes from the front and solids from both sides. Pixels at silhouettes are excluded:
//! pixels for which a ray half a pixel away from the center hits another geom or leaves the tangent plane.

use super::view;
use crate::rays::mujoco_rays::{
    GROUPS, MESH_WITH_INNER_EDGES, TestRng, at_rest, data_of, data_with, height_field, mask_of,
};
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::Data;
use kinetoscope::prelude::*;
use kinetoscope::render::ImageRenderer;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::scene::PoseF32;
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::VisualScene;
use nalgebra::Vector3;

const SIZE: [usize; 2] = [160, 120];

/// A camera in the world of `data` that casts rays with `mj_ray`.
struct RayCamera<'a> {
    data: &'a Data,
    view: View,
    pose: Pose,
}

struct Hit {
    geom: usize,
    /// Depth along the optical axis \[m\]: the ray parameter of a direction with z = 1 in the camera frame.
    depth: f64,
    point: Vector3<f64>,
    direction: Vector3<f64>,
}

impl RayCamera<'_> {
    fn ray(&self, u: f64, v: f64) -> Option<Hit> {
        let [fx, fy, cx, cy, near, far] =
            [self.view.fx, self.view.fy, self.view.cx, self.view.cy, self.view.near, self.view.far].map(f64::from);
        let direction = self.pose.rotation * Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0);
        // The ray starts at the near plane, because the camera sees nothing closer.
        let origin = self.pose.translation.vector + direction * near;
        let hit = self.data.ray(origin.into(), direction.into(), GROUPS).unwrap()?;
        let depth = hit.distance + near;
        let point = self.pose.translation.vector + direction * depth;
        (depth < far).then_some(Hit { geom: hit.geom, depth, point, direction })
    }

    /// The surface normal at a pixel, from four rays a hundredth of a pixel around it. `None` if their hits are not in
    /// one plane, because an edge lies between them.
    fn tangent_plane(&self, u: f64, v: f64) -> Option<Vector3<f64>> {
        const STEP: f64 = 0.01;
        let at = |du, dv| self.ray(u + du * STEP, v + dv * STEP).map(|hit| hit.point);
        let (left, right, up, down) = (at(-1.0, 0.0)?, at(1.0, 0.0)?, at(0.0, -1.0)?, at(0.0, 1.0)?);
        let plane = (right - left).cross(&(down - up)).try_normalize(1e-300)?;
        // Both diagonals intersect in the plane, except for the curvature, whose effect vanishes with the step.
        let gap = ((left + right) - (up + down)).dot(&plane).abs() / 2.0;
        (gap < 1e-3 * (right - left).norm().min((down - up).norm())).then_some(plane)
    }
}

/// A ray camera in `rays`, and the rasterized image of `seen` from the same view.
fn images<'a>(
    seen: &Data,
    rays: &'a Data,
    eye: [f64; 3],
    target: [f64; 3],
    clip: [f64; 2],
) -> (RayCamera<'a>, Frame, VisualScene) {
    let pose = look_at_pose(eye, target, [0.0, 0.0, 1.0]).unwrap();
    let view = view(SIZE, 0.8, &pose, clip);
    let visible = VisualScene::of_model(seen.model());
    let scene = visible.scene();
    let mut poses = vec![PoseF32::IDENTITY; scene.instances().len()];
    visible.read_poses(seen, &mut poses, &mut scene.lights.clone());
    let channels = Channels { depth: true, mask: true, normal: true, position: true, ..Channels::default() };
    let mut frame = Frame::new(SIZE[0], SIZE[1], channels);
    let cfg = RasterCfg { groups: GROUPS, ..RasterCfg::default() };
    ImageRenderer::new(cfg).render(scene, &poses, &view, &mut frame).unwrap();
    (RayCamera { data: rays, view, pose }, frame, visible)
}

/// Compares every pixel off silhouettes.
fn check(name: &str, data: &Data, eye: [f64; 3], target: [f64; 3], clip: [f64; 2], least: usize) {
    let (camera, frame, visible) = images(data, data, eye, target, clip);
    let (depth, mask) = (frame.depth.unwrap(), frame.mask.unwrap());
    let (normal, position) = (frame.normal.unwrap(), frame.position.unwrap());
    let (mut compared, mut differing, mut normals, mut worst_normal_deg) = (0, 0, 0, 0.0_f64);
    for k in 0..SIZE[0] * SIZE[1] {
        let (u, v) = ((k % SIZE[0]) as f64 + 0.5, (k / SIZE[0]) as f64 + 0.5);
        let around = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)].map(|(du, dv)| camera.ray(u + du, v + dv));
        let Some(hit) = camera.ray(u, v) else {
            if around.iter().all(Option::is_none) {
                compared += 1;
                differing += usize::from(mask[k] != 0 || depth[k].is_finite());
            }
            continue;
        };
        if !around.iter().all(|a| a.as_ref().is_some_and(|a| a.geom == hit.geom)) {
            continue;
        }
        // The surface around the pixel as a plane: rays that disagree with it indicate an edge.
        let corner = around.map(|a| a.unwrap().point);
        let (a, b) = (corner[3] - corner[0], corner[2] - corner[1]);
        let Some(plane) = a.cross(&b).try_normalize(1e-300) else { continue };
        let bent = corner.iter().any(|c| (c - hit.point).dot(&plane).abs() > 0.02 * (c - hit.point).norm());
        let grazing = plane.dot(&hit.direction.normalize()).abs() < 0.1;
        if bent || grazing {
            continue;
        }
        compared += 1;
        let error = (f64::from(depth[k]) / hit.depth - 1.0).abs();
        if mask[k] != mask_of(&visible, data, hit.geom) || error > 1e-4 {
            differing += 1;
            continue;
        }
        let vector = |values: &[f32]| Vector3::from_fn(|i, _| f64::from(values[3 * k + i]));
        if let Some(plane) = camera.tangent_plane(u, v) {
            let facing = if plane.dot(&hit.direction) > 0.0 { -plane } else { plane };
            let n = vector(&normal);
            worst_normal_deg = worst_normal_deg.max(n.cross(&facing).norm().atan2(n.dot(&facing)).to_degrees());
            normals += 1;
        }
        let p = vector(&position);
        assert!((p - hit.point).norm() < 2e-4 * hit.depth + 1e-6, "position {p} where the ray hits {}", hit.point);
    }
    assert!(compared >= least, "{name}: only {compared} pixels to compare");
    assert_eq!(differing, 0, "{name}: pixels differ from mj_ray");
    assert!(normals >= least / 2, "{name}: only {normals} normals to compare");
    assert!(worst_normal_deg < 0.5, "{name}: a normal is {worst_normal_deg} degrees off the surface");
}

/// All primitives at random poses, with cameras outside and inside of shapes, and widely spaced near and far planes.
#[test]
fn random_scenes() {
    let mut rng = TestRng(12345);
    for scene in 0..6 {
        let data = rng.primitives(12, 1, [0.08, 0.3]);
        let eye = rng.numbers([[-3.0, 3.0], [-3.0, -1.5], [0.5, 2.5]]);
        check(&format!("scene {scene}"), &data, eye, [0.0, 0.0, 0.5], [0.01, 50.0], 8000);
        check(&format!("scene {scene}, far apart"), &data, eye, [0.0, 0.0, 0.5], [1e-4, 1e5], 8000);
        // Inside of the first shape, whose center is the origin of its body.
        let inside: [f64; 3] = data.xpos()[3..6].try_into().unwrap();
        check(&format!("scene {scene}, inside"), &data, inside, [0.0, 0.3, 0.5], [1e-3, 50.0], 5000);
    }
}

/// MuJoCo's sample models, with height fields, meshes and textures, from two sides.
#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn sample_models() {
    for name in ["humanoid/humanoid.xml", "slider_crank/slider_crank.xml", "tendon_arm/arm26.xml", "mug/mug.xml"] {
        // The samples are of 2.2.2; later versions have dropped some elements.
        let Ok(compiled) = mj::compile_file(kinetoscope_testkit::test_resources::sample_model(name)) else {
            assert!(mj::BUILD_VERSION == mj::SupportedVersion::V4, "{name}");
            continue;
        };
        let data = at_rest(compiled);
        let (center, extent) = (data.model().center(), data.model().extent());
        for side in [[1.2, 0.7, 0.5], [-0.4, -1.3, 0.9]] {
            let eye = [0, 1, 2].map(|i| center[i] + extent * side[i]);
            check(name, &data, eye, center, [0.01 * extent, 50.0 * extent], 3000);
        }
    }
}

/// A height field and a mesh, including the walls of the field.
#[test]
fn height_fields_and_meshes() {
    let elevation = |k: i32| (((k % 17) as f32 * 0.7).sin() * ((k / 17) as f32 * 0.5).cos() + 1.0) / 2.0;
    let assets = format!("<hfield name='h' file='terrain.bin' size='1 1 .4 .1'/>{MESH_WITH_INNER_EDGES}");
    let world = "<geom type='hfield' hfield='h'/><body pos='.2 .1 1'><freejoint/><geom type='mesh' mesh='fan'/></body>";
    let data = data_with(&assets, world, &[height_field(17, elevation)]);
    for eye in [[1.8, 1.2, 1.4], [-1.6, 0.4, 1.0], [0.3, -2.0, 0.6]] {
        check("terrain", &data, eye, [0.0, 0.0, 0.4], [0.01, 50.0], 4000);
    }
}

/// Control: the test detects a scene that is a centimeter lower.
#[test]
fn one_centimeter() {
    let [data, moved] = [0.0, -0.01].map(|z: f64| {
        data_of(&format!(
            "<geom type='plane' size='5 5 .1' pos='0 0 {z}'/><geom type='box' size='.2 .3 .4' pos='0 0 {}'/>",
            0.4 + z
        ))
    });
    let (eye, target, clip) = ([1.0, -1.5, 1.2], [0.0, 0.0, 0.4], [0.01, 50.0]);
    check("in place", &data, eye, target, clip, 8000);
    let (camera, frame, _) = images(&data, &moved, eye, target, clip);
    let depth = frame.depth.unwrap();
    let wrong = |k: &usize| {
        let (u, v) = ((k % SIZE[0]) as f64 + 0.5, (k / SIZE[0]) as f64 + 0.5);
        camera.ray(u, v).is_some_and(|hit| (f64::from(depth[*k]) / hit.depth - 1.0).abs() > 1e-4)
    };
    let wrong = (0..SIZE[0] * SIZE[1]).filter(wrong).count();
    assert!(wrong > 1000, "only {wrong} pixels tell a centimeter");
}
