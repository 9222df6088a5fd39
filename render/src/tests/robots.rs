//! Vendor robots, rendered from their own meshes.

use super::harness::{TestFrame, look_at_view};
use crate::visibility::View;
use kinetoscope_scene::mesh::{TextureSource, load};
use kinetoscope_scene::shape::Mesh;
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::{Instance, Material, Pose, PoseF32, RenderScene, Texture, TextureKind};
use kinetoscope_testkit::scenes::checker_plane;
use std::sync::{Arc, LazyLock};

/// Joint frames of the vendor's SR5 at rest, slightly bent: (mesh, translation and rotation about an axis from the
/// previous link).
const SR5: [(&str, [f64; 3], [f64; 3]); 7] = [
    ("base", [0.; 3], [0.; 3]),
    ("link1", [0., 0., 0.328], [0., 0., 0.4]),
    ("link2", [0.; 3], [0., 0.3, 0.]),
    ("link3", [0.05, 0., 0.4], [0., 1.1, 0.]),
    ("link4", [-0.05, 0., 0.4], [0., 0., 0.3]),
    ("link5", [0., 0.136, 0.], [0., 0.9, 0.]),
    ("link6", [0., 0., 0.1035], [0., 0., 0.]),
];

/// Meshes of the SR5's links, which all tests share.
static SR5_MESHES: LazyLock<[Mesh; 7]> = LazyLock::new(|| {
    let folder = kinetoscope_testkit::test_resources::robot("rokae_description/urdf/SR5.urdf")
        .with_file_name("../meshes/xMateSR5/visual");
    SR5.map(|(name, ..)| {
        let mesh = load(folder.join(format!("xMateSR5_{name}.stl"))).unwrap().scaled([0.001; 3]);
        Mesh { mesh: Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)) }
    })
});

/// Copies of the robot, side by side, on a checkered ground; mask ids count links.
pub(super) fn sr5(copies: usize) -> (RenderScene, Vec<PoseF32>) {
    let white = Material { rgba: [0.92, 0.92, 0.93, 1.0], specular: 0.4, shininess: 0.4, ..Material::default() };
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::IDENTITY];
    let mut world = Pose::identity();
    for (k, ((_, xyz, rpy), mesh)) in SR5.into_iter().zip(&*SR5_MESHES).enumerate() {
        world *= kinetoscope_scene::pose::from_xyz_rpy(xyz, rpy);
        for copy in 0..copies {
            let id = (7 * copy + k) as i32 + 1;
            instances.push(Instance::new(mesh.clone(), white.clone(), id));
            let beside = kinetoscope_scene::pose::from_xyz_rpy([0.1 * copy as f64, 0.45 * copy as f64, 0.], [0.; 3]);
            poses.push(PoseF32::from(&(beside * world)));
        }
    }
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights[0].direction = [0.1, 0.8, -1.0];
    scene.haze = Some(kinetoscope_scene::Haze { color: None, start: 4.0, end: 40.0 });
    (scene, poses)
}

/// A camera that sees all of one or three copies.
pub(super) fn sr5_view(copies: usize, size: [usize; 2]) -> View {
    let y = 0.2 * copies as f32 - 0.1;
    look_at_view(size, 0.7, [1.5 * (copies as f32).sqrt(), -1.1, 1.0], [0.3, y, 0.45])
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_sr5_links() {
    for copies in [1, 3] {
        let image = TestFrame::new(sr5(copies), sr5_view(copies, [640, 480])).draw();
        assert!((1..=7 * copies as i32).all(|id| image.mask().contains(&id)), "every link of {copies} is seen");
    }
}

/// The meshes of ANYmal's base, each with its JPEG texture.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn textures_of_anymal() {
    let meshes = kinetoscope_testkit::test_resources::robot("anymal_c_simple_description/urdf/anymal.urdf")
        .with_file_name("../meshes");
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::IDENTITY];
    let [base, top, bottom, face] =
        ["base", "top_shell", "bottom_shell", "face"].map(|file| load(meshes.join(format!("{file}.dae"))).unwrap());
    let back = (&face, -0.4145, std::f64::consts::PI);
    let parts = [(&base, 0., 0.), (&top, 0., 0.), (&bottom, 0., 0.), (&face, 0.4145, 0.), back];
    for (k, (mesh, x, yaw)) in parts.into_iter().enumerate() {
        for part in &mesh.submeshes {
            let mut material = Material { rgba: [0.7, 0.7, 0.7, 1.0], specular: 0.3, ..Material::default() };
            if let Some(m) = part.material.map(|m| &mesh.materials[m]) {
                material.rgba = m.rgba;
                if let Some(TextureSource::File(path)) = &m.texture {
                    let image = image::open(path).unwrap().to_rgb8();
                    let (w, h) = image.dimensions();
                    let texture = Texture::new(TextureKind::TwoD, w, h, 3, image.as_raw()).unwrap();
                    material.texture = Some(Arc::new(texture));
                }
            }
            let mesh = Arc::new(RenderMesh::from_submesh(mesh, part, RenderMesh::DEFAULT_CREASE_ANGLE));
            instances.push(Instance::new(Mesh { mesh }, material, k as i32 + 1));
            poses.push(PoseF32::from(&kinetoscope_scene::pose::from_xyz_rpy([x, 0., 0.3], [0., 0., yaw])));
        }
    }
    assert!(instances.iter().any(|instance| instance.material.texture.is_some() && instance.mask_id < 100));
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights[0].direction = [0.1, 0.8, -1.0];
    let image = TestFrame::new((scene, poses), look_at_view([640, 480], 0.6, [1.3, -0.9, 0.9], [0.0, 0., 0.3])).draw();
    assert!([1, 2, 4].iter().all(|id| image.mask().contains(id)), "base, shell and face are seen");
}
