//! The vendors' robots, where they are present.

use super::pictures::{report, report_threads, save};
use super::scenes::checker_plane;
use crate::visibility::View;
use scene::mesh::load;
use scene::shape::Mesh;
use scene::{Instance, Material, Pose, PoseF32, RenderMesh, RenderScene, Texture, TextureKind};
use std::sync::Arc;

/// So many of the vendor's SR5, one beside the other, on a checkered ground; mask ids count links.
pub(super) fn sr5(copies: usize) -> (RenderScene, Vec<PoseF32>) {
    let meshes = testkit::needs::robot("rokae_description/urdf/SR5.urdf").join("../../meshes/xMateSR5/visual");
    // The joint frames at rest, bent a little: (mesh, translation and rotation about an axis from the link before).
    let links: [(&str, [f64; 3], [f64; 3]); 7] = [
        ("base", [0.; 3], [0.; 3]),
        ("link1", [0., 0., 0.328], [0., 0., 0.4]),
        ("link2", [0.; 3], [0., 0.3, 0.]),
        ("link3", [0.05, 0., 0.4], [0., 1.1, 0.]),
        ("link4", [-0.05, 0., 0.4], [0., 0., 0.3]),
        ("link5", [0., 0.136, 0.], [0., 0.9, 0.]),
        ("link6", [0., 0., 0.1035], [0., 0., 0.]),
    ];
    let white = Material { rgba: [0.92, 0.92, 0.93, 1.0], specular: 0.4, shininess: 0.4, ..Material::default() };
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::IDENTITY];
    let mut world = Pose::identity();
    for (k, (name, xyz, rpy)) in links.into_iter().enumerate() {
        world *= scene::pose::from_xyz_rpy(xyz, rpy);
        let mesh = load(&meshes.join(format!("xMateSR5_{name}.stl"))).unwrap().scaled([0.001; 3]);
        let mesh = Arc::new(RenderMesh::new(&mesh, RenderMesh::CREASE));
        let closed = mesh.clusters().iter().filter(|c| c.closed).count();
        println!("{name}: {} triangles, {closed} of {} clusters closed", mesh.triangles().len(), mesh.clusters().len());
        for copy in 0..copies {
            let id = (7 * copy + k) as i32 + 1;
            instances.push(Instance::new(Mesh { mesh: Arc::clone(&mesh) }, white.clone(), id));
            let beside = scene::pose::from_xyz_rpy([0.1 * copy as f64, 0.45 * copy as f64, 0.], [0.; 3]);
            poses.push(PoseF32::from(&(beside * world)));
        }
    }
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights[0].direction = [0.1, 0.8, -1.0];
    scene.haze = Some(scene::Haze { color: None, start: 4.0, end: 40.0 });
    (scene, poses)
}

/// A camera that sees one of them, or three.
pub(super) fn sr5_view(copies: usize, size: [usize; 2]) -> View {
    let y = 0.2 * copies as f32 - 0.1;
    View::look_at(size, 0.7, [1.5 * (copies as f32).sqrt(), -1.1, 1.0], [0.3, y, 0.45], [0., 0., 1.]).unwrap()
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn sr5_is_drawn_from_its_own_meshes() {
    let (scene, poses) = sr5(1);
    let view = sr5_view(1, [640, 480]);
    let frame = save("sr5", &scene, &poses, &view);
    let mask = frame.mask.unwrap();
    assert!((1..=7).all(|id| mask.contains(&id)), "every link is seen");
    report("SR5", &scene, &poses, &view);
    report("SR5", &scene, &poses, &sr5_view(1, [64, 64]));
    report_threads("SR5", &scene, &poses, &view);
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn three_sr5_are_drawn_from_their_own_meshes() {
    let (scene, poses) = sr5(3);
    let view = sr5_view(3, [640, 480]);
    let frame = save("three-sr5", &scene, &poses, &view);
    let mask = frame.mask.unwrap();
    assert!((1..=21).all(|id| mask.contains(&id)), "every link is seen");
    report("three SR5", &scene, &poses, &view);
    report("three SR5", &scene, &poses, &sr5_view(3, [64, 64]));
}

/// The meshes of ANYmal's base, each with its JPEG texture.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn anymal_is_drawn_with_its_textures() {
    let meshes = testkit::needs::robot("anymal_c_simple_description/urdf/anymal.urdf").join("../../meshes");
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::IDENTITY];
    let parts: [(&str, [f64; 3], [f64; 3]); 5] = [
        ("base.dae", [0.; 3], [0.; 3]),
        ("top_shell.dae", [0.; 3], [0.; 3]),
        ("bottom_shell.dae", [0.; 3], [0.; 3]),
        ("face.dae", [0.4145, 0., 0.], [0.; 3]),
        ("face.dae", [-0.4145, 0., 0.], [0., 0., std::f64::consts::PI]),
    ];
    for (k, (file, xyz, rpy)) in parts.into_iter().enumerate() {
        let mesh = load(&meshes.join(file)).unwrap();
        for part in &mesh.parts {
            let mut material = Material { rgba: [0.7, 0.7, 0.7, 1.0], specular: 0.3, ..Material::default() };
            if let Some(m) = part.material.map(|m| &mesh.materials[m]) {
                material.rgba = m.rgba;
                if let Some(scene::mesh::TextureSource::File(path)) = &m.texture {
                    let image = image::open(path).unwrap().to_rgb8();
                    let (w, h) = image.dimensions();
                    material.texture =
                        Some(Arc::new(Texture::new(TextureKind::TwoD, w, h, 3, image.as_raw()).unwrap()));
                }
            }
            let mesh = Arc::new(RenderMesh::of_part(&mesh, part, RenderMesh::CREASE));
            instances.push(Instance::new(Mesh { mesh }, material, k as i32 + 1));
            poses.push(PoseF32::from(&scene::pose::from_xyz_rpy([xyz[0], xyz[1], xyz[2] + 0.3], rpy)));
        }
    }
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights[0].direction = [0.1, 0.8, -1.0];
    let view = View::look_at([640, 480], 0.6, [1.3, -0.9, 0.9], [0.0, 0., 0.3], [0., 0., 1.]).unwrap();
    save("anymal", &scene, &poses, &view);
    report("ANYmal base", &scene, &poses, &view);
}
