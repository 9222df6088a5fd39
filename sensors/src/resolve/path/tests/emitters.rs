//! Light of what glows, looked for and met.

use super::*;

/// A shiny floor below what glows.
fn lit_by(glow: Shape, at: PoseF32, floor: Material) -> (RenderScene, [PoseF32; 2]) {
    let emitter = Material { emission: 2.0, ..matt(0.5) };
    let scene = dark(vec![Instance::new(Plane::INFINITE, floor, 1), Instance::new(glow, emitter, 2)]);
    (scene, [PoseF32::IDENTITY, at])
}

/// Face down.
fn down(translation: [f32; 3]) -> PoseF32 {
    PoseF32 { rotation: [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]], translation }
}

fn shiny() -> Material {
    Material { specular: 1.0, shininess: 0.3, ..matt(0.3) }
}

/// A box as a mesh.
fn brick(half: [f32; 3]) -> Shape {
    let mesh = Shape::from(Box { half }).tessellate(8);
    scene::shape::Mesh { mesh: std::sync::Arc::new(scene::RenderMesh::new(&mesh, 0.1)) }.into()
}

/// What each way finds of light, alone and together: mean and standard deviation.
fn by_ways(scene: &RenderScene, poses: &[PoseF32], view: &View, bounces: u32, count: u32) -> [(f64, f64); 3] {
    let studio = Studio::new(scene, poses, view);
    [Ways::Both, Ways::Looking, Ways::Meeting].map(|ways| {
        let paths = Paths { ways, ..studio.paths(16, bounces, 0) };
        studio.seen(&paths, count)
    })
}

/// The same mean by each way alone and by both, of every shape whose points are chosen, on matt and on shiny floors.
#[test]
fn both_ways_find_the_same_light() {
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
    let (pictures, sent) = (400, 2.0 * albedo(0.5));
    for floor in [matt(0.7), shiny()] {
        for (shape, at) in &shapes {
            let (scene, poses) = lit_by(shape.clone(), *at, floor.clone());
            let view = looking([1.2, 0.5, 0.9], [0.0; 3]);
            let [both, looking, meeting] = by_ways(&scene, &poses, &view, 0, pictures);
            let what = format!("{} over {}: {both:?} {looking:?} {meeting:?}", shape.name(), floor.specular);
            for one in [looking, meeting] {
                // Five standard deviations of the difference, and single precision.
                let off = 5.0 * both.1.hypot(one.1);
                assert!((both.0 - one.0).abs() < off + 1e-6, "{what}");
            }
            // A path brings at most what glows sends, so the variance of one is at most that times the mean. Of 400 pictures
            // a deviation is known to 3.5 %: five of these more.
            let bound = (sent * both.0 / f64::from(16 * pictures)).sqrt();
            assert!(meeting.1 < 1.18 * bound, "{what}");
            // That tells half of the light from none, where there is as much light as this takes.
            assert!(5.0 * bound < 0.5 * both.0, "{what}");
            // A control: a tenth less light would be found out of what is looked for and met.
            assert!(0.1 * both.0 > 5.0 * both.1, "{what}");
        }
    }
}

/// A large lamp over a sharp highlight is met by paths and hard to look for; a small one over a matt floor is looked for, and
/// hard to meet. Both ways together have less variance than either over both, as in Veach and Guibas 1995, figure 8.
#[test]
fn both_ways_together_have_less_noise_than_either() {
    let sharp = Material { specular: 1.0, shininess: 1.0, ..matt(0.05) };
    let scenes = [
        (lit_by(Plane { half: [0.8, 0.8] }.into(), down([-0.8, 0.0, 0.6]), sharp.clone()), [1.0, 0.0, 0.6]),
        (lit_by(Plane { half: [0.1, 0.1] }.into(), down([0.2, 0.1, 0.8]), matt(0.7)), [1.2, 0.5, 0.9]),
        (lit_by(Plane { half: [0.3, 0.3] }.into(), down([-0.8, 0.0, 0.6]), sharp), [1.0, 0.0, 0.6]),
    ];
    let mut variances = [0.0; 3];
    for ((scene, poses), eye) in &scenes {
        let light = by_ways(scene, poses, &looking(*eye, [0.0; 3]), 0, 400);
        println!("both {:?}, looking {:?}, meeting {:?}", light[0], light[1], light[2]);
        for (variance, (mean, deviation)) in variances.iter_mut().zip(light) {
            // Relative: the scenes are not as bright as each other.
            *variance += (deviation / mean).powi(2);
            assert!((mean - light[0].0).abs() < 5.0 * deviation.hypot(light[0].1));
        }
    }
    let [both, looking, meeting] = variances;
    // Of 400 pictures a variance is known to 7 %.
    assert!(both < 0.5 * looking && both < 0.5 * meeting, "{both} {looking} {meeting}");
}

/// A rectangle that is looked for, against its form factor, at a few paths: what paths met by chance needed 64 times as many.
#[test]
fn area_lamps_light_by_their_form_factor() {
    let half = [0.3f32, 0.2];
    let (scene, poses) = lit_by(Plane { half }.into(), down([0., 0., 1.2]), matt(0.7));
    let view = looking([2.0, 0.5, 0.4], [0.0; 3]);
    let factor = form_factor(f64::from(half[0]) / 1.2, f64::from(half[1]) / 1.2);
    let expected = albedo(0.7) * 2.0 * albedo(0.5) * factor;
    let light = seen(&scene, &poses, &view, 64, 0);
    assert!(agrees(light, expected), "{light:?}, not {expected}");
    assert!(light.1 < 0.005 * expected && !agrees(light, 1.05 * expected), "it can tell a twentieth: {light:?}");
}

/// Below a ball of radius r at the distance d: the form factor is (r / d)². Source: Howell, B-43.
#[test]
fn balls_light_by_the_square_of_radius_over_distance() {
    for (radius, distance) in [(0.3f32, 1.0f32), (0.05, 2.0), (0.9, 1.0)] {
        let at = PoseF32::from_translation([0.0, 0.0, distance]);
        let (scene, poses) = lit_by(Sphere { radius }.into(), at, matt(0.7));
        let view = looking([0.4, 0.02, 0.05], [0.0; 3]);
        let expected = albedo(0.7) * 2.0 * albedo(0.5) * f64::from(radius / distance).powi(2);
        // Of few paths in many pictures: of 256 paths in 16 pictures as many fell into the ball's cone every time up to one, and
        // pictures that are all off by the same part of one path do not show how far they are off.
        let studio = Studio::new(&scene, &poses, &view);
        let light = studio.seen(&studio.paths(16, 0, 0), 1024);
        assert!(agrees(light, expected), "{radius} {distance}: {light:?}, not {expected}");
        assert!(light.1 < 0.01 * expected, "{light:?}");
    }
}

/// A lamp of alpha 0.5 sends half as much, and what is between takes its part.
#[test]
fn what_is_not_opaque_glows_by_its_alpha() {
    let view = looking([1.2, 0.5, 0.4], [0.0; 3]);
    let (scene, poses) = lit_by(Plane { half: [0.3; 2] }.into(), down([0., 0., 0.8]), matt(0.7));
    let whole = seen(&scene, &poses, &view, 256, 0);
    let mut instances = scene.instances().to_vec();
    instances[1].material.rgba[3] = 0.5;
    let half = seen(&dark(instances.clone()), &poses, &view, 256, 0);
    assert!((half.0 - 0.5 * whole.0).abs() < 5.0 * half.1.hypot(whole.1), "{half:?} of {whole:?}");
    instances[1].material.rgba[3] = 1.0;
    let mut glass = matt(0.0);
    glass.rgba[3] = 0.3;
    instances.push(Instance::new(Plane { half: [2.0; 2] }, glass, 3));
    let poses = [poses[0], poses[1], PoseF32::from_translation([0., 0., 0.5])];
    // It is seen from above only, and lamps shine from above: rays of paths and shadow rays come from below.
    let scene = dark(instances);
    let veiled = seen(&scene, &poses, &view, 256, 0);
    assert!((veiled.0 - whole.0).abs() < 5.0 * veiled.1.hypot(whole.1), "backs are not seen: {veiled:?}, {whole:?}");
    // Turned over, it takes its alpha once, of light that is looked for and of light that is met: 1 - 0.3, by each way alone.
    let poses = [poses[0], poses[1], down([0., 0., 0.5])];
    let part = 1.0 - f64::from(0.3f32);
    for light in by_ways(&scene, &poses, &view, 0, 400) {
        let off = 5.0 * light.1.hypot(part * whole.1);
        assert!((light.0 - part * whole.0).abs() < off, "{light:?}, {part} of {whole:?}");
        // Controls: light that is not taken, and light that is taken twice, would be found out.
        assert!(off < 0.15 * whole.0 && part - part * part > 0.2, "{light:?}, {whole:?}");
    }
}

/// Of several lamps, each is chosen as often as it is bright: the sum is that of each alone.
#[test]
fn lamps_add_up() {
    let view = looking([1.2, 0.5, 0.4], [0.0; 3]);
    let lamp = |x: f32, emission: f32, half: f32| {
        (Instance::new(Plane { half: [half; 2] }, Material { emission, ..matt(0.5) }, 2), down([x, 0.2, 0.8]))
    };
    let all = [lamp(-0.5, 1.0, 0.1), lamp(0.4, 4.0, 0.15), lamp(1.0, 0.5, 0.3)];
    let light = |lamps: &[(Instance, PoseF32)]| {
        let floor = (Instance::new(Plane::INFINITE, matt(0.7), 1), PoseF32::IDENTITY);
        let (instances, poses): (Vec<_>, Vec<_>) = std::iter::once(floor).chain(lamps.iter().cloned()).unzip();
        seen(&dark(instances), &poses, &view, 512, 0)
    };
    let together = light(&all);
    let alone = all.each_ref().map(|lamp| light(std::slice::from_ref(lamp)));
    let (sum, square) = alone.iter().fold((0.0, 0.0), |(sum, square), (mean, d)| (sum + mean, square + d * d));
    assert!((together.0 - sum).abs() < 5.0 * (together.1.powi(2) + square).sqrt(), "{together:?}, not {sum}");
    // A control: without the faintest it is less.
    assert!((together.0 - (sum - alone[0].0)).abs() > 5.0 * (together.1.powi(2) + square).sqrt());
}

/// A panel of a mesh, 2 half sides wide, `aside` from where its instance is, that looks down (or up).
fn panel(half: f32, aside: f32, up: bool) -> Shape {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions = corners.map(|[x, y]| [aside + half * x, half * y, 0.0f32]).to_vec();
    let triangles = if up { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] };
    let mesh = scene::mesh::TriMesh::from_triangles(positions, triangles);
    scene::shape::Mesh { mesh: std::sync::Arc::new(scene::RenderMesh::new(&mesh, 0.1)) }.into()
}

/// A lamp close above a floor, both turned anyhow and 40 m away from the frames of their meshes. A rotation in single
/// precision is none: there and back is 1e-7 of 40 m aside, forty times what is left out of the way to a lamp 0.1 m away, so
/// lamps would shade themselves, and floors too. The form factor does not turn.
#[test]
fn what_is_far_from_its_own_frame_does_not_shade_itself() {
    let (aside, height) = (40.0f32, 0.1f32);
    let factor = form_factor(3.0, 3.0);
    let expected = albedo(0.7) * 2.0 * albedo(0.5) * factor;
    let glow = Material { emission: 2.0, ..matt(0.5) };
    let instances =
        vec![Instance::new(panel(4.0, aside, true), matt(0.7), 1), Instance::new(panel(0.3, aside, false), glow, 2)];
    let mut scene = dark(instances);
    for angles in [[0.3, -0.8, 2.1], [1.1, 0.4, -0.7], [-2.3, 1.2, 0.2], [0.7, 0.7, 0.7], [2.9, -0.2, 1.3]] {
        let turned = PoseF32::from(&scene::pose::from_xyz_rpy([0.0; 3], angles));
        let there = |local: [f32; 3]| turned.rotation.map(|r| r[0] * local[0] + r[1] * local[1] + r[2] * local[2]);
        let place = |local: [f32; 3]| PoseF32 { translation: there(local), ..turned };
        let poses = [place([-aside, 0.0, 0.0]), place([-aside, 0.0, height])];
        let view = looking(there([0.9, 0.2, 0.05]), [0.0; 3]);
        scene.lights.clear();
        let studio = Studio::new(&scene, &poses, &view);
        for ways in [Ways::Both, Ways::Looking] {
            let light = studio.seen(&Paths { ways, ..studio.paths(256, 0, 0) }, 128);
            // Translations of 40 m are rounded to 4e-6 m: 4e-5 of the height, as much of the form factor at most.
            assert!(
                (light.0 - expected).abs() < 5.0 * light.1 + 4e-5 * expected,
                "{angles:?} {ways:?}: {light:?}, not {expected}"
            );
            assert!(light.1 < 0.01 * expected, "it can tell a twentieth: {light:?}");
        }
        // A lamp without a size lights the floor wherever the floor's frame is; the glowing panel is not between.
        let normal = there([0.0, 0.0, 1.0]);
        let shine = scale(to_f64(there([0.8, 0.0, 0.6])), -1.0);
        scene.lights = vec![lamp(LightKind::Directional, [0.; 3], shine.map(|x| x as f32))];
        let beside = there([2.0, 0.3, 0.0]);
        let view = looking([0, 1, 2].map(|k| beside[k] + there([0.9, 0.2, 0.5])[k]), beside);
        let studio = Studio::new(&scene, &poses, &view);
        let lit = studio.seen(&Paths { ways: Ways::Looking, ..studio.paths(1, 0, 0) }, 1024).0;
        let cosine = -dot(to_f64(normal), shine);
        let sun = albedo(0.7) * f64::from(0.9f32) * cosine;
        // The panel glows still: that part is known from above, but for where it is seen from.
        let dark_panel = |instance: &Instance| {
            let material = Material { emission: 0.0, ..instance.material.clone() };
            Instance { material, ..instance.clone() }
        };
        let mut alone = dark(scene.instances().iter().map(dark_panel).collect());
        alone.lights = scene.lights.clone();
        let studio = Studio::new(&alone, &poses, &view);
        let without = studio.seen(&Paths { ways: Ways::Looking, ..studio.paths(1, 0, 0) }, 16).0;
        assert!((without - sun).abs() < 1e-5 * sun, "{angles:?}: {without}, not {sun}");
        assert!(lit > without, "{angles:?}: {lit}, of which {without} is the lamp's");
    }
}

/// Where light comes by a wall only, at later bounces: a lamp that looks away from what the camera sees, so that it is looked
/// for and met at the wall and from there on. Judged by paths that only meet it, without any looking for it, over walls of
/// every kind.
#[test]
fn both_ways_find_the_same_light_after_bounces() {
    // Columns are the axes of a plane: the wall's normal is +x, the lamp's -x.
    let wall = PoseF32 { rotation: [[0., 0., 1.], [1., 0., 0.], [0., 1., 0.]], translation: [-0.5, 0.0, 0.0] };
    let lamp = PoseF32 { rotation: [[0., 0., -1.], [1., 0., 0.], [0., -1., 0.]], translation: [0.1, 0.0, 0.7] };
    let sharp = Material { specular: 1.0, shininess: 0.6, ..matt(0.05) };
    let mirror = Material { reflectance: 0.5, ..matt(0.5) };
    let view = looking([1.5, 0.4, 0.9], [0.6, 0.0, 0.0]);
    for material in [matt(0.8), shiny(), sharp, mirror] {
        let instances = vec![
            Instance::new(Plane::INFINITE, Material { specular: 0.5, shininess: 0.2, ..matt(0.7) }, 1),
            Instance::new(Plane { half: [2.0; 2] }, material.clone(), 2),
            Instance::new(Plane { half: [0.5; 2] }, Material { emission: 4.0, ..matt(0.5) }, 3),
        ];
        let (scene, poses) = (dark(instances), [PoseF32::IDENTITY, wall, lamp]);
        // A control: the floor itself does not see the lamp.
        let bare = by_ways(&scene, &poses, &view, 0, 4)[1].0;
        assert_eq!(bare, 0.0);
        let mut last = 0.0;
        for bounces in [1, 3] {
            let [both, looking, meeting] = by_ways(&scene, &poses, &view, bounces, 1200);
            let what = format!("{material:?}, {bounces} bounces: {both:?} {looking:?} {meeting:?}");
            for one in [both, looking] {
                let off = 5.0 * meeting.1.hypot(one.1);
                assert!((meeting.0 - one.0).abs() < off, "{what}");
                // Controls: a light counted twice, or its share forgotten, would be found out.
                assert!(off < 0.3 * meeting.0, "{what}");
            }
            assert!(both.0 > last, "{what}");
            last = both.0;
        }
    }
}
