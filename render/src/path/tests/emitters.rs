//! Emissive objects: sampled as lights and hit by paths.

use super::*;

fn emissive(emission: f32) -> Material {
    Material { emission, ..matt(0.5) }
}

/// A floor below an emissive object.
fn lit_by(shape: Shape, at: PoseF32, floor: Material) -> (RenderScene, [PoseF32; 2]) {
    (on_floor(floor, [Instance::new(shape, emissive(2.0), 2)]), [PoseF32::IDENTITY, at])
}

/// A pose facing down.
fn down(translation: [f32; 3]) -> PoseF32 {
    PoseF32 { rotation: [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]], translation }
}

fn shiny() -> Material {
    Material { specular: 1.0, shininess: 0.3, ..matt(0.3) }
}

/// A box as a mesh.
fn brick(half: [f32; 3]) -> Shape {
    let mesh = Shape::from(Box { half }).tessellate(8);
    kinetoscope_scene::shape::Mesh { mesh: std::sync::Arc::new(kinetoscope_scene::shape::RenderMesh::new(&mesh, 0.1)) }
        .into()
}

/// The light found by both strategies together and by each alone: mean and standard deviation.
fn by_strategies(scene: &RenderScene, poses: &[PoseF32], view: &View, bounces: u32, count: u32) -> [(f64, f64); 3] {
    let studio = TestScene::new(scene, poses, view);
    [MisStrategy::Both, MisStrategy::Light, MisStrategy::Bsdf]
        .map(|strategy| studio.mean_light(&PathTracer { strategy, ..studio.paths(16, bounces, 0) }, count))
}

/// True if the means differ by less than five standard deviations of the difference, and single precision.
fn same((a, da): (f64, f64), (b, db): (f64, f64)) -> bool {
    (a - b).abs() < 5.0 * da.hypot(db) + 1e-6
}

/// Each strategy alone and both together give the same mean, for every shape with sampling, on matte and on shiny
/// floors.
#[test]
fn both_strategies() {
    let upright = PoseF32::from_translation([0.2, 0.1, 0.9]);
    let shapes: [(Shape, PoseF32); 6] = [
        (Plane { half: [0.6, 0.4] }.into(), down([0.2, 0.1, 0.8])),
        (Sphere { radius: 0.3 }.into(), upright),
        (Box { half: [0.3, 0.2, 0.1] }.into(), upright),
        (Cylinder { radius: 0.2, half_length: 0.3 }.into(), upright),
        (brick([0.3, 0.2, 0.1]), upright),
        // Seen from inside.
        (Sphere { radius: 3.0 }.into(), upright),
    ];
    let (images, sent) = (400, 2.0 * albedo(0.5));
    for (floor, (shape, at)) in [matt(0.7), shiny()].iter().flat_map(|floor| shapes.iter().map(move |s| (floor, s))) {
        let (scene, poses) = lit_by(shape.clone(), *at, floor.clone());
        let [both, looking, meeting] =
            by_strategies(&scene, &poses, &one_ray_view([1.2, 0.5, 0.9], [0.0; 3]), 0, images);
        let what = format!("{} over {}: {both:?} {looking:?} {meeting:?}", shape.name(), floor.specular);
        assert!(same(both, looking) && same(both, meeting), "{what}");
        // A path contributes at most the light of the emitter, so the variance of one path is at most that times the
        // mean. A deviation from 400 images is known to 3.5 %: the bound is five of these higher.
        let bound = (sent * both.0 / f64::from(16 * images)).sqrt();
        assert!(meeting.1 < 1.18 * bound, "{what}");
        // Controls: the tolerance separates half of the light from no light, and a tenth less light is detected.
        assert!(5.0 * bound < 0.5 * both.0 && 0.1 * both.0 > 5.0 * both.1, "{what}");
    }
}

/// A large emitter over a sharp highlight is easy to hit and hard to sample; a small one over a matte floor is easy to
/// sample and hard to hit. Both strategies together have less variance than either over both scenes, as in Veach and
/// Guibas 1995, figure 8.
#[test]
fn multiple_importance_sampling() {
    let sharp = Material { specular: 1.0, shininess: 1.0, ..matt(0.05) };
    let scenes = [
        (lit_by(Plane { half: [0.8, 0.8] }.into(), down([-0.8, 0.0, 0.6]), sharp.clone()), [1.0, 0.0, 0.6]),
        (lit_by(Plane { half: [0.1, 0.1] }.into(), down([0.2, 0.1, 0.8]), matt(0.7)), [1.2, 0.5, 0.9]),
        (lit_by(Plane { half: [0.3, 0.3] }.into(), down([-0.8, 0.0, 0.6]), sharp), [1.0, 0.0, 0.6]),
    ];
    let mut variances = [0.0; 3];
    for ((scene, poses), eye) in &scenes {
        let light = by_strategies(scene, poses, &one_ray_view(*eye, [0.0; 3]), 0, 400);
        for (variance, (mean, deviation)) in variances.iter_mut().zip(light) {
            // Relative: the scenes differ in brightness.
            *variance += (deviation / mean).powi(2);
            assert!(same((mean, deviation), light[0]), "{light:?}");
        }
    }
    let [both, looking, meeting] = variances;
    // A variance from 400 images is known to 7 %.
    assert!(both < 0.5 * looking && both < 0.5 * meeting, "{both} {looking} {meeting}");
}

/// Form factors of rectangles (Howell, B-3) and of balls of radius r at the distance d, (r / d)² (Howell, B-43).
#[test]
fn form_factors() {
    let expected = |factor: f64| albedo(0.7) * 2.0 * albedo(0.5) * factor;
    for (half, height, eye, samples, known) in
        [([0.6f32, 0.4], 0.8f32, [2.0, 0.5, 0.4], 1024, 0.01), ([0.3, 0.2], 1.2, [2.0, 0.5, 0.4], 64, 0.005)]
    {
        let (scene, poses) = lit_by(Plane { half }.into(), down([0., 0., height]), matt(0.7));
        let [a, b] = half.map(|half| f64::from(half) / f64::from(height));
        let (light, expected) =
            (mean_light(&scene, &poses, &one_ray_view(eye, [0.0; 3]), samples, 0), expected(form_factor(a, b)));
        assert!(agrees(light, expected), "{light:?}, not {expected}");
        assert!(
            light.1 < known * expected && !agrees(light, (1.0 + 10.0 * known) * expected),
            "the control: {light:?}"
        );
        // The rectangle is invisible from behind.
        assert_eq!(mean_light(&scene, &floor_and_object(height), &one_ray_view(eye, [0.0; 3]), 64, 0).0, 0.0);
    }
    for (radius, distance) in [(0.3f32, 1.0f32), (0.05, 2.0), (0.9, 1.0)] {
        let (scene, poses) = lit_by(Sphere { radius }.into(), floor_and_object(distance)[1], matt(0.7));
        let expected = expected(f64::from(radius / distance).powi(2));
        // Few paths in many images. With 256 paths in 16 images, equally many paths fell into the ball's cone in each
        // image, up to one; images that are all off by the same fraction of a path do not show the error.
        let studio = TestScene::new(&scene, &poses, &one_ray_view([0.4, 0.02, 0.05], [0.0; 3]));
        let light = studio.mean_light(&studio.paths(16, 0, 0), 1024);
        assert!(agrees(light, expected), "{radius} {distance}: {light:?}, not {expected}");
        assert!(light.1 < 0.01 * expected, "{light:?}");
    }
}

/// An emitter of alpha 0.5 sends half as much, and an object between takes its alpha once, in each strategy alone.
#[test]
fn alpha() {
    let view = one_ray_view([1.2, 0.5, 0.4], [0.0; 3]);
    let (scene, poses) = lit_by(Plane { half: [0.3; 2] }.into(), down([0., 0., 0.8]), matt(0.7));
    let whole = mean_light(&scene, &poses, &view, 256, 0);
    let mut instances = scene.instances().to_vec();
    instances[1].material.rgba[3] = 0.5;
    let half = mean_light(&dark(instances.clone()), &poses, &view, 256, 0);
    assert!((half.0 - 0.5 * whole.0).abs() < 5.0 * half.1.hypot(whole.1), "{half:?} of {whole:?}");
    instances[1].material.rgba[3] = 1.0;
    instances.push(Instance::new(Plane { half: [2.0; 2] }, glass_of(0.3), 3));
    let scene = dark(instances);
    // Its back is invisible, and paths and shadow rays come from below.
    let veiled = mean_light(&scene, &[poses[0], poses[1], PoseF32::from_translation([0., 0., 0.5])], &view, 256, 0);
    assert!((veiled.0 - whole.0).abs() < 5.0 * veiled.1.hypot(whole.1), "{veiled:?}, {whole:?}");
    // Turned over, it takes its alpha once.
    let part = 1.0 - f64::from(0.3f32);
    for light in by_strategies(&scene, &[poses[0], poses[1], down([0., 0., 0.5])], &view, 0, 400) {
        let off = 5.0 * light.1.hypot(part * whole.1);
        assert!((light.0 - part * whole.0).abs() < off, "{light:?}, {part} of {whole:?}");
        // Controls: light that is not absorbed, and light that is absorbed twice, are detected.
        assert!(off < 0.15 * whole.0 && part - part * part > 0.2, "{light:?}, {whole:?}");
    }
}

/// Each of several emitters is sampled in proportion to its power: the sum is that of all emitters alone.
#[test]
fn sums() {
    let emitter = |x: f32, emission: f32, half: f32| {
        (Instance::new(Plane { half: [half; 2] }, emissive(emission), 2), down([x, 0.2, 0.8]))
    };
    let all = [emitter(-0.5, 1.0, 0.1), emitter(0.4, 4.0, 0.15), emitter(1.0, 0.5, 0.3)];
    let light = |lights: &[(Instance, PoseF32)]| {
        let (instances, mut poses): (Vec<_>, Vec<_>) = lights.iter().cloned().unzip();
        poses.insert(0, PoseF32::IDENTITY);
        mean_light(&on_floor(matt(0.7), instances), &poses, &one_ray_view([1.2, 0.5, 0.4], [0.0; 3]), 512, 0)
    };
    let together = light(&all);
    let alone = all.each_ref().map(|emitter| light(std::slice::from_ref(emitter)));
    let (sum, square) = alone.iter().fold((0.0, 0.0), |(sum, square), (mean, d)| (sum + mean, square + d * d));
    let off = 5.0 * (together.1.powi(2) + square).sqrt();
    assert!((together.0 - sum).abs() < off, "{together:?}, not {sum}");
    // A control: without the faintest it is less.
    assert!((together.0 - (sum - alone[0].0)).abs() > off);
}

/// A square panel of half side `half` as a mesh, offset by `aside` from its frame, facing down (or up).
fn panel(half: f32, aside: f32, up: bool) -> Shape {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions = corners.map(|[x, y]| [aside + half * x, half * y, 0.0f32]).to_vec();
    let triangles = if up { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] };
    mesh(positions, triangles, 0.1)
}

/// An emitter close above a floor, both rotated and 40 m away from the frames of their meshes. A rotation in single
/// precision is inexact: forward and back is an offset of 1e-7 of 40 m, forty times the offset of ray origins at an
/// emitter 0.1 m away. So emitters would shade themselves, and floors too. The form factor does not depend on the
/// rotation.
#[test]
fn far_from_own_frame() {
    let (aside, height) = (40.0f32, 0.1f32);
    let factor = form_factor(3.0, 3.0);
    let expected = albedo(0.7) * 2.0 * albedo(0.5) * factor;
    let floor = Instance::new(panel(4.0, aside, true), matt(0.7), 1);
    let mut scene = dark(vec![floor, Instance::new(panel(0.3, aside, false), emissive(2.0), 2)]);
    for angles in [[0.3, -0.8, 2.1], [1.1, 0.4, -0.7], [-2.3, 1.2, 0.2], [0.7, 0.7, 0.7], [2.9, -0.2, 1.3]] {
        let turned = PoseF32::from(&kinetoscope_scene::pose::from_xyz_rpy([0.0; 3], angles));
        let there = |local: [f32; 3]| turned.rotation.map(|r| r[0] * local[0] + r[1] * local[1] + r[2] * local[2]);
        let place = |local: [f32; 3]| PoseF32 { translation: there(local), ..turned };
        let poses = [place([-aside, 0.0, 0.0]), place([-aside, 0.0, height])];
        let view = one_ray_view(there([0.9, 0.2, 0.05]), [0.0; 3]);
        scene.lights.clear();
        let studio = TestScene::new(&scene, &poses, &view);
        for strategy in [MisStrategy::Both, MisStrategy::Light] {
            let light = studio.mean_light(&PathTracer { strategy, ..studio.paths(256, 0, 0) }, 128);
            let far = Tolerance::absolute(
                5.0 * light.1 + 4e-5 * expected,
                "five deviations; translations of 40 m are rounded to 4e-6 m: 4e-5 of the height and of the form factor",
            );
            assert_number(&format!("{angles:?} {strategy:?}"), light.0, expected, far);
            assert!(light.1 < 0.01 * expected, "the control: a difference of a twentieth is detected: {light:?}");
        }
        // A light without a size lights the floor, whatever the floor's frame; the panel is not between.
        let normal = there([0.0, 0.0, 1.0]);
        let shine = scale(to_f64(there([0.8, 0.0, 0.6])), -1.0);
        scene.lights = vec![light(LightKind::Directional, [0.; 3], shine.map(|x| x as f32))];
        let beside = there([2.0, 0.3, 0.0]);
        let view = one_ray_view([0, 1, 2].map(|k| beside[k] + there([0.9, 0.2, 0.5])[k]), beside);
        let light = |scene: &RenderScene, count| {
            let studio = TestScene::new(scene, &poses, &view);
            studio.mean_light(&PathTracer { strategy: MisStrategy::Light, ..studio.paths(1, 0, 0) }, count).0
        };
        let cosine = -dot(to_f64(normal), shine);
        let sun = albedo(0.7) * f64::from(0.9f32) * cosine;
        // The same without the emission of the panel.
        let mut instances = scene.instances().to_vec();
        instances[1].material.emission = 0.0;
        let mut alone = dark(instances);
        alone.lights.clone_from(&scene.lights);
        let [lit, without] = [light(&scene, 1024), light(&alone, 16)];
        assert_number(&format!("{angles:?}"), without, sun, Tolerance::relative(1e-5, SINGLE.derivation));
        assert!(lit > without, "{angles:?}: {lit}, of which {without} is the light's");
    }
}

/// An emitter that faces away from the visible floor: its light arrives via a wall only, at later bounces. Compared
/// with BSDF sampling alone, over walls of every kind.
#[test]
fn both_strategies_after_bounces() {
    // The columns are the axes of a plane: the wall's normal is +x, the emitter's -x.
    let wall = PoseF32 { rotation: [[0., 0., 1.], [1., 0., 0.], [0., 1., 0.]], translation: [-0.5, 0.0, 0.0] };
    let emitter = PoseF32 { rotation: [[0., 0., -1.], [1., 0., 0.], [0., -1., 0.]], translation: [0.1, 0.0, 0.7] };
    let (poses, view) = ([PoseF32::IDENTITY, wall, emitter], one_ray_view([1.5, 0.4, 0.9], [0.6, 0.0, 0.0]));
    let sharp = Material { specular: 1.0, shininess: 0.6, ..matt(0.05) };
    let mirror = Material { reflectance: 0.5, ..matt(0.5) };
    for material in [matt(0.8), shiny(), sharp, mirror] {
        let wall = Instance::new(Plane { half: [2.0; 2] }, material.clone(), 2);
        let light = Instance::new(Plane { half: [0.5; 2] }, emissive(4.0), 3);
        let scene = on_floor(Material { specular: 0.5, shininess: 0.2, ..matt(0.7) }, [wall, light]);
        // A control: the floor itself does not see the emitter.
        assert_eq!(by_strategies(&scene, &poses, &view, 0, 4)[1].0, 0.0);
        let mut last = 0.0;
        for bounces in [1, 3] {
            let [both, looking, meeting] = by_strategies(&scene, &poses, &view, bounces, 1200);
            let what = format!("{material:?}, {bounces} bounces: {both:?} {looking:?} {meeting:?}");
            for one in [both, looking] {
                let off = 5.0 * meeting.1.hypot(one.1);
                assert!((meeting.0 - one.0).abs() < off, "{what}");
                // Controls: a light counted twice, or a missing MIS weight, is detected.
                assert!(off < 0.3 * meeting.0, "{what}");
            }
            assert!(both.0 > last, "{what}");
            last = both.0;
        }
    }
}
