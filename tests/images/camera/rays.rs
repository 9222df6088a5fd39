//! Depth, mask, normal and position of every pixel against `mj_ray`, on MuJoCo's sample models and on random scenes.
//!
//! Both see planes from the front and solids from both sides. Pixels at silhouettes are left out: where the four rays
//! around a pixel's centre, half a pixel away, hit other geoms than its own, or leave its tangent plane.

use kinetoscope::prelude::*;
use kinetoscope::scene::PoseF32;
use kinetoscope::sensors::camera::{Frame, Rasterizer, look_at_pose};
use kinetoscope::sensors::visibility::View;
use kinetoscope::sim::mj::{self, Data, RayHit};

const SIZE: [usize; 2] = [160, 120];
const GROUPS: u32 = 0b111;

fn view(eye: [f64; 3], target: [f64; 3], clip: [f64; 2]) -> (View, Pose) {
    let pose = look_at_pose(eye, target, [0.0, 0.0, 1.0]).unwrap();
    let pixels = Intrinsics::Fovy { radians: 0.8 }.to_pixels(SIZE[0], SIZE[1]).unwrap();
    let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
    let [near, far] = clip.map(|c| c as f32);
    let (width, height, world_from_camera) = (SIZE[0], SIZE[1], PoseF32::from(&pose));
    (View { width, height, fx, fy, cx, cy, near, far, world_from_camera }, pose)
}

/// The ray through (u, v): depth along the optical axis is the distance in multiples of the direction.
fn ray(data: &Data, view: &View, pose: &Pose, u: f64, v: f64) -> Option<(RayHit, [f64; 3], [f64; 3])> {
    let local = nalgebra::Vector3::new(
        (u - f64::from(view.cx)) / f64::from(view.fx),
        (v - f64::from(view.cy)) / f64::from(view.fy),
        1.0,
    );
    let direction = pose.rotation * local;
    // The camera sees nothing nearer than its near plane, a ray starts there.
    let origin = pose.translation.vector + direction * f64::from(view.near);
    let hit = data.ray(origin.into(), direction.into(), GROUPS).unwrap()?;
    let distance = hit.distance + f64::from(view.near);
    let point = pose.translation.vector + direction * distance;
    (distance < f64::from(view.far)).then(|| (RayHit { distance, ..hit }, point.into(), direction.into()))
}

/// The normal of the surface at a pixel, from four rays a hundredth of a pixel around it; `None` where they do not lie in
/// one plane: there is an edge between them.
fn tangent_plane(
    mut ray: impl FnMut(f64, f64) -> Option<(RayHit, [f64; 3], [f64; 3])>,
) -> Option<nalgebra::Vector3<f64>> {
    const STEP: f64 = 0.01;
    let mut at = |du, dv| ray(du * STEP, dv * STEP).map(|(_, point, _)| nalgebra::Vector3::from(point));
    let (left, right, up, down) = (at(-1.0, 0.0)?, at(1.0, 0.0)?, at(0.0, -1.0)?, at(0.0, 1.0)?);
    let plane = (right - left).cross(&(down - up)).try_normalize(1e-300)?;
    // Both diagonals cross in the plane, up to the curvature, whose effect shrinks with the step.
    let gap = ((left + right) - (up + down)).dot(&plane).abs() / 2.0;
    (gap < 1e-3 * (right - left).norm().min((down - up).norm())).then_some(plane)
}

struct Judged {
    compared: usize,
    differing: usize,
    normals: usize,
    worst_depth: f64,
    worst_normal_deg: f64,
}

/// Compares every pixel that is off silhouettes.
fn judge(data: &Data, eye: [f64; 3], target: [f64; 3], clip: [f64; 2]) -> Judged {
    let visible = kinetoscope::sim::Visible::of_model(data.model());
    let scene = visible.scene();
    let mut poses = vec![PoseF32::IDENTITY; scene.instances().len()];
    let mut lights = scene.lights.clone();
    visible.read(data, &mut poses, &mut lights);
    let (view, pose) = view(eye, target, clip);
    let channels = Channels { depth: true, mask: true, normal: true, position: true, ..Channels::default() };
    let mut frame = Frame::new(SIZE[0], SIZE[1], channels);
    let cfg = RasterCfg { groups: GROUPS, ..RasterCfg::default() };
    Rasterizer::new(cfg).render(scene, &poses, &view, &mut frame).unwrap();
    let (depth, mask) = (frame.depth.unwrap(), frame.mask.unwrap());
    let (normal, position) = (frame.normal.unwrap(), frame.position.unwrap());
    let id_of = |geom: usize| {
        let name = data.model().name(mj::ObjectKind::Geom, geom).unwrap_or_else(|| format!("geom {geom}"));
        visible.ids().iter().find(|id| id.geoms.contains(&name)).unwrap().id
    };
    let mut judged = Judged { compared: 0, differing: 0, normals: 0, worst_depth: 0.0, worst_normal_deg: 0.0 };
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
            let around = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)]
                .map(|(du, dv)| ray(data, &view, &pose, u + du, v + dv));
            let k = y * SIZE[0] + x;
            let middle = ray(data, &view, &pose, u, v);
            let Some((hit, point, direction)) = middle else {
                if around.iter().all(Option::is_none) {
                    judged.compared += 1;
                    judged.differing += usize::from(mask[k] != 0 || depth[k].is_finite());
                }
                continue;
            };
            if !around.iter().all(|a| a.is_some_and(|(h, ..)| h.geom == hit.geom)) {
                continue;
            }
            // The surface around the pixel as a plane: rays must agree with it, or there is an edge.
            let corner = around.map(|a| nalgebra::Vector3::from(a.unwrap().1));
            let (a, b) = (corner[3] - corner[0], corner[2] - corner[1]);
            let Some(plane) = a.cross(&b).try_normalize(1e-300) else { continue };
            let middle = nalgebra::Vector3::from(point);
            let bent = corner.iter().any(|c| (c - middle).dot(&plane).abs() > 0.02 * (c - middle).norm());
            let direction = nalgebra::Vector3::from(direction);
            let grazing = plane.dot(&direction.normalize()).abs() < 0.1;
            if bent || grazing {
                continue;
            }
            judged.compared += 1;
            let error = (f64::from(depth[k]) / hit.distance - 1.0).abs();
            if mask[k] != id_of(hit.geom) || error > 1e-4 {
                judged.differing += 1;
                continue;
            }
            judged.worst_depth = judged.worst_depth.max(error);
            if let Some(plane) = tangent_plane(|du, dv| ray(data, &view, &pose, u + du, v + dv)) {
                let facing = if plane.dot(&direction) > 0.0 { -plane } else { plane };
                let n = nalgebra::Vector3::from_fn(|i, _| f64::from(normal[3 * k + i]));
                let degrees = n.cross(&facing).norm().atan2(n.dot(&facing)).to_degrees();
                judged.worst_normal_deg = judged.worst_normal_deg.max(degrees);
                judged.normals += 1;
            }
            let p = nalgebra::Vector3::from_fn(|i, _| f64::from(position[3 * k + i]));
            assert!((p - middle).norm() < 2e-4 * hit.distance + 1e-6, "position {p} where the ray hits {middle}");
        }
    }
    judged
}

fn check(name: &str, data: &Data, eye: [f64; 3], target: [f64; 3], clip: [f64; 2], least: usize) {
    let judged = judge(data, eye, target, clip);
    let Judged { compared, differing, normals, worst_depth, worst_normal_deg } = judged;
    println!(
        "{name}: {compared} pixels, {differing} differ, depth {worst_depth:.1e}, normals {worst_normal_deg:.2} deg"
    );
    assert!(compared >= least, "{name}: only {compared} pixels to compare");
    assert_eq!(differing, 0, "{name}: pixels differ from mj_ray");
    assert!(normals >= least / 2, "{name}: only {normals} normals to compare");
    assert!(worst_normal_deg < 0.5, "{name}: a normal is {worst_normal_deg} degrees off the surface");
}

fn data_of(xml: &str) -> Data {
    let model = mj::compile(xml, &[]).unwrap().into_model();
    let mut data = Data::new(&model).unwrap();
    data.step1().unwrap();
    data
}

/// Every primitive at random places; cameras outside and inside of shapes; near and far planes far apart.
#[test]
fn random_scenes_of_every_primitive_agree_with_mujocos_rays() {
    let mut seed = 12345u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / f64::from(1u32 << 31)
    };
    for scene in 0..6 {
        let mut bodies = String::new();
        for k in 0..12 {
            let kind = ["sphere", "capsule", "ellipsoid", "cylinder", "box"][k % 5];
            let mut number = |low: f64, high: f64| low + (high - low) * random();
            let [x, y, z] = [(-1.0, 1.0), (-1.0, 1.0), (0.2, 1.4)].map(|(a, b)| number(a, b));
            let [a, b, c] = [0; 3].map(|_| number(0.0, 360.0));
            let [s, t, r] = [0; 3].map(|_| number(0.08, 0.3));
            bodies += &format!(
                "<body pos='{x} {y} {z}' euler='{a} {b} {c}'><freejoint/><geom name='g{k}' type='{kind}' size='{s} {t} {r}'/></body>"
            );
        }
        let xml =
            format!("<mujoco><worldbody><geom name='floor' type='plane' size='5 5 .1'/>{bodies}</worldbody></mujoco>");
        let data = data_of(&xml);
        let mut number = |low: f64, high: f64| low + (high - low) * random();
        let eye = [number(-3.0, 3.0), number(-3.0, -1.5), number(0.5, 2.5)];
        check(&format!("scene {scene}"), &data, eye, [0.0, 0.0, 0.5], [0.01, 50.0], 8000);
        check(&format!("scene {scene}, far apart"), &data, eye, [0.0, 0.0, 0.5], [1e-4, 1e5], 8000);
        // Inside of the first shape, whose centre is where its body is.
        let inside: [f64; 3] = data.xpos()[3..6].try_into().unwrap();
        check(&format!("scene {scene}, inside"), &data, inside, [0.0, 0.3, 0.5], [1e-3, 50.0], 5000);
    }
}

/// MuJoCo's sample models, with height fields, meshes and textures, from two sides.
#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn sample_models_agree_with_mujocos_rays() {
    let models = ["humanoid/humanoid.xml", "slider_crank/slider_crank.xml", "tendon_arm/arm26.xml", "mug/mug.xml"];
    for name in models {
        let path = testkit::needs::sample_model(name);
        // The samples are of 2.2.2; later versions have dropped some elements.
        let Ok(compiled) = mj::compile_file(&path) else {
            assert!(mj::TARGET == mj::Target::V4, "{name}");
            continue;
        };
        let model = compiled.into_model();
        let mut data = Data::new(&model).unwrap();
        data.step1().unwrap();
        let (center, extent) = (model.center(), model.extent());
        for side in [[1.2, 0.7, 0.5], [-0.4, -1.3, 0.9]] {
            let eye = [0, 1, 2].map(|i| center[i] + extent * side[i]);
            check(name, &data, eye, center, [0.01 * extent, 50.0 * extent], 3000);
        }
    }
}

/// A height field and a mesh from text: triangles of both, and the field's walls.
#[test]
fn height_fields_and_meshes_agree_with_mujocos_rays() {
    let rows = 17i32;
    let elevation: Vec<f32> = (0..rows * rows)
        .map(|k| (((k % rows) as f32 * 0.7).sin() * ((k / rows) as f32 * 0.5).cos() + 1.0) / 2.0)
        .collect();
    // MuJoCo's binary format of height fields: rows, columns, then elevations.
    let mut bytes: Vec<u8> = [rows; 2].iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend(elevation.iter().flat_map(|e| e.to_le_bytes()));
    let xml = "<mujoco><asset><hfield name='h' file='terrain.bin' size='1 1 .4 .1'/>
        <mesh name='m' vertex='0 0 0  .5 0 0  0 .5 0  0 0 .5  .3 .3 .4' face='0 2 1  0 1 3  0 3 2  1 2 4  2 3 4  3 1 4'/></asset>
        <worldbody><geom type='hfield' hfield='h'/><body pos='.2 .1 1'><freejoint/><geom type='mesh' mesh='m'/></body>
        </worldbody></mujoco>";
    let assets = [mj::Asset { name: "terrain.bin".into(), bytes }];
    let model = mj::compile(xml, &assets).unwrap().into_model();
    let mut data = Data::new(&model).unwrap();
    data.step1().unwrap();
    for eye in [[1.8, 1.2, 1.4], [-1.6, 0.4, 1.0], [0.3, -2.0, 0.6]] {
        check("terrain", &data, eye, [0.0, 0.0, 0.4], [0.01, 50.0], 4000);
    }
}

/// The control: a camera moved by a centimetre is found out.
#[test]
fn a_camera_in_the_wrong_place_is_found_out() {
    let data = data_of(
        "<mujoco><worldbody><geom type='plane' size='5 5 .1'/><geom type='box' size='.2 .3 .4' pos='0 0 .4'/></worldbody></mujoco>",
    );
    let moved = data_of(
        "<mujoco><worldbody><geom type='plane' size='5 5 .1' pos='0 0 -.01'/><geom type='box' size='.2 .3 .4' pos='0 0 .39'/></worldbody></mujoco>",
    );
    check("in place", &data, [1.0, -1.5, 1.2], [0.0, 0.0, 0.4], [0.01, 50.0], 8000);
    let judged = judge_against(&data, &moved);
    assert!(judged > 1000, "only {judged} pixels tell a centimetre");
}

/// How many pixels of a picture of one scene disagree with rays in another.
fn judge_against(seen: &Data, rays: &Data) -> usize {
    let visible = kinetoscope::sim::Visible::of_model(seen.model());
    let scene = visible.scene();
    let mut poses = vec![PoseF32::IDENTITY; scene.instances().len()];
    visible.read(seen, &mut poses, &mut scene.lights.clone());
    let (view, pose) = view([1.0, -1.5, 1.2], [0.0, 0.0, 0.4], [0.01, 50.0]);
    let mut frame = Frame::new(SIZE[0], SIZE[1], Channels { depth: true, ..Channels::default() });
    Rasterizer::default().render(scene, &poses, &view, &mut frame).unwrap();
    let depth = frame.depth.unwrap();
    let wrong = |k: usize| {
        let (u, v) = ((k % SIZE[0]) as f64 + 0.5, (k / SIZE[0]) as f64 + 0.5);
        ray(rays, &view, &pose, u, v).is_some_and(|(hit, ..)| (f64::from(depth[k]) / hit.distance - 1.0).abs() > 1e-4)
    };
    (0..SIZE[0] * SIZE[1]).filter(|&k| wrong(k)).count()
}
