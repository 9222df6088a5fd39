//! Structures written byte by byte, at places that no version of MuJoCo has.

use super::*;
use crate::{HeightFieldArrays, MaterialValues, MeshArrays, TextureArrays, VisualModel};
use kinetoscope_scene::LightKind;
use kinetoscope_scene::shape::Shape;
use std::sync::Arc;

/// A model with one mesh of one triangle, and no textures or materials.
struct OneTriangle;

impl VisualModel for OneTriangle {
    fn mesh(&self, mesh: usize) -> MeshArrays<'_> {
        assert_eq!(mesh, 0);
        MeshArrays {
            positions: &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: &[],
            texcoords: None,
            faces: &[[0, 1, 2]],
            face_normals: &[],
            face_texcoords: &[],
        }
    }

    fn height_field(&self, field: usize) -> HeightFieldArrays<'_> {
        panic!("there is no height field {field}")
    }

    fn ntex(&self) -> usize {
        0
    }

    fn texture(&self, _texture: usize) -> Option<TextureArrays<'_>> {
        None
    }

    fn nmat(&self) -> usize {
        0
    }

    fn material(&self, material: usize) -> MaterialValues {
        panic!("there is no material {material}")
    }
}

const GEOM: GeomLayout = GeomLayout {
    stride: 200,
    kind: 8,
    dataid: 12,
    objtype: 16,
    objid: 20,
    category: 24,
    matid: Some(28),
    texid: None,
    texuniform: None,
    texrepeat: None,
    segid: 32,
    size: 40,
    pos: 52,
    mat: 64,
    rgba: 100,
    emission: 120,
    specular: 124,
    shininess: 128,
    reflectance: 132,
    soft: SoftTypes { skin: Some(106), flex: Some(105) },
    decor: DecorTypes {
        sdf: Some(8),
        arrow: Some(100),
        arrow1: None,
        arrow2: None,
        line: Some(103),
        line_box: Some(104),
        triangle: None,
    },
};

const LIGHT: LightLayout = LightLayout {
    stride: 120,
    pos: 0,
    dir: 12,
    kind: Some(24),
    directional: None,
    attenuation: 28,
    cutoff: 40,
    exponent: 44,
    ambient: 48,
    diffuse: 60,
    specular: 72,
    headlight: 84,
    castshadow: 85,
};

fn put(memory: &mut [u8], at: usize, numbers: &[f32]) {
    for (k, number) in numbers.iter().enumerate() {
        memory[at + 4 * k..at + 4 * k + 4].copy_from_slice(&number.to_ne_bytes());
    }
}

fn put_int(memory: &mut [u8], at: usize, number: i32) {
    memory[at..at + 4].copy_from_slice(&number.to_ne_bytes());
}

/// A geom of type `kind` at (1, 2, 3), turned by 90 degrees about z, in red.
fn geom(kind: i32, dataid: i32, size: [f32; 3], segid: i32) -> Vec<u8> {
    let mut row = vec![0xEE; GEOM.stride];
    for (at, number) in
        [(GEOM.kind, kind), (GEOM.dataid, dataid), (GEOM.objtype, 5), (GEOM.objid, 40 + segid), (GEOM.segid, segid)]
    {
        put_int(&mut row, at, number);
    }
    put_int(&mut row, 28, -1);
    put(&mut row, GEOM.size, &size);
    put(&mut row, GEOM.pos, &[1.0, 2.0, 3.0]);
    put(&mut row, GEOM.mat, &[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    put(&mut row, GEOM.rgba, &[1.0, 0.0, 0.0, 1.0]);
    put(&mut row, GEOM.emission, &[0.1, 0.2, 0.3, 0.4]);
    row
}

fn reader() -> MjvReader<OneTriangle> {
    MjvReader::new(OneTriangle, vec![skin()], GEOM, LIGHT).expect("valid layouts")
}

/// A skin of one triangle, after five vertices of other skins.
fn skin() -> SkinFaces {
    SkinFaces { first_vertex: 5, vertices: 3, faces: vec![[0, 1, 2]], texcoords: Vec::new() }
}

fn memory(geoms: &[u8]) -> MjvMemory<'_> {
    MjvMemory { geoms, ..MjvMemory::default() }
}

/// Vertices of skins and flexes are in the world, whatever the pose of their geom, and move in a scene of their own.
#[test]
fn skins_and_flexes() {
    let mut rows = [geom(106, -1, [0.0; 3], 0), geom(105, -1, [0.0; 3], 1)].concat();
    for at in [GEOM.objid, GEOM.stride + GEOM.objid] {
        put_int(&mut rows, at, 0);
    }
    let triangle = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    let up = [[0.0, 0.0, 1.0]; 8];
    let mut reader = reader();
    let mut bounds = |x: f32| {
        let skins = [&[[0.0; 3]; 5][..], &triangle(x)].concat();
        let flexes = [&[[0.0; 3]; 3][..], &triangle(-x)].concat();
        let memory = MjvMemory {
            skin_positions: &skins,
            skin_normals: &up,
            flex_positions: &flexes,
            flex_normals: &up[..6],
            flex_first_faces: &[1],
            flex_faces: &[1],
            ..memory(&rows)
        };
        let frame = reader.read(&memory, Background::default()).expect("whole structures");
        assert_eq!(frame.poses, [kinetoscope_scene::PoseF32::IDENTITY; 2]);
        [0, 1].map(|k| frame.scene.instances()[k].mesh().expect("a mesh").bounds()[0][0])
    };
    assert_eq!(bounds(3.0), [3.0, -3.0]);
    assert_eq!(bounds(4.0), [4.0, -4.0], "the same meshes, moved");
}

/// The visualizer has the half length of a cylinder as its third size, and numbers meshes by pairs. Mask ids count all
/// geoms, those of unknown types too.
#[test]
fn shapes_poses_and_ids() {
    let rows = [geom(5, -1, [0.1, 0.1, 0.7], 0), geom(1000, -1, [1.0; 3], 1), geom(7, 1, [0.0; 3], 2)].concat();
    let mut reader = reader();
    let frame = reader.read(&memory(&rows), Background::default()).expect("whole structures");
    assert_eq!(reader.omitted(), ["geoms of type 1000 are not rendered: neither shapes nor skins nor flexes"]);
    let [cylinder, mesh] = frame.scene.instances() else { panic!("two instances") };
    let Shape::Cylinder(shape) = &cylinder.shape else { panic!("a cylinder") };
    assert_eq!((shape.radius, shape.half_length), (0.1, 0.7));
    assert_eq!(mesh.mesh().map(|mesh| mesh.triangles().len()), Some(1));
    assert_eq!([cylinder.mask_id, mesh.mask_id], [1, 3]);
    let material = &cylinder.material;
    assert_eq!((material.rgba, material.emission, material.shininess), ([1.0, 0.0, 0.0, 1.0], 0.1, 0.3));
    assert_eq!(material.reflectance, 0.0, "only planes and boxes reflect");
    // x of the geom is y of the world.
    assert_eq!(frame.poses[0].apply([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0]);
    let object = |id, segment| MjvObject { id, kind: 5, segment };
    assert_eq!(frame.objects, [MjvObject::NONE, object(40, 0), object(41, 1), object(42, 2)]);
}

/// Frames that differ in poses only share their scene.
#[test]
fn shared_scenes() {
    let mut reader = reader();
    let mut row = geom(2, -1, [0.5; 3], 0);
    let mut read = |row: &[u8]| reader.read(&memory(row), Background::default()).expect("whole structures");
    let first = read(&row);
    put(&mut row, GEOM.pos, &[9.0, 9.0, 9.0]);
    let moved = read(&row);
    assert!(Arc::ptr_eq(&first.scene, &moved.scene));
    assert_eq!(moved.poses[0].translation, [9.0; 3]);
    put(&mut row, GEOM.rgba, &[0.0, 1.0, 0.0, 1.0]);
    let green = read(&row);
    assert!(!Arc::ptr_eq(&first.scene, &green.scene));
    assert_eq!(green.scene.instances()[0].material.rgba, [0.0, 1.0, 0.0, 1.0]);
}

/// A plane has a back, turned around x, of 0.3 times the opacity, which is drawn twice.
///
/// Regression: backs were opaque, and infinite planes had none.
#[test]
fn backs_of_planes() {
    let rows = [geom(0, -1, [2.0, 3.0, 0.1], 0), geom(0, -1, [0.0; 3], 1)].concat();
    let frame = reader().read(&memory(&rows), Background::default()).expect("whole structures");
    let instances = frame.scene.instances();
    assert_eq!(instances.iter().map(|plane| plane.mask_id).collect::<Vec<_>>(), [1, 1, 2, 2]);
    for (front, back) in [(0, 1), (2, 3)] {
        assert_eq!(frame.poses[front].rotate([0.0, 0.0, 1.0]), [0.0, 0.0, 1.0]);
        assert_eq!(frame.poses[back].rotate([0.0, 0.0, 1.0]), [0.0, 0.0, -1.0]);
        assert_eq!(frame.poses[front].rotate([1.0, 0.0, 0.0]), frame.poses[back].rotate([1.0, 0.0, 0.0]));
        let opacity = [front, back].map(|k| instances[k].material.rgba[3]);
        assert!(opacity[0] == 1.0 && (opacity[1] - (1.0 - 0.7 * 0.7)).abs() < 1e-6, "{opacity:?}");
    }
    assert!(frame.poses.iter().all(kinetoscope_scene::PoseF32::is_rigid));
}

/// Geoms without a segmentation id are visible in color only.
#[test]
fn geom_without_segment() {
    let rows = [geom(2, -1, [0.5; 3], -1), geom(2, -1, [0.5; 3], 0)].concat();
    let frame = reader().read(&memory(&rows), Background::default()).expect("whole structures");
    let visible = |scene: &kinetoscope_scene::RenderScene| {
        scene.instances().iter().map(|instance| instance.visible).collect::<Vec<_>>()
    };
    assert_eq!(visible(&frame.scene), [true, true]);
    assert_eq!(visible(frame.segment_scene()), [false, true]);
    assert_eq!(frame.objects[1], MjvObject::NONE);
}

#[test]
fn lights() {
    let mut row = vec![0; LIGHT.stride];
    put(&mut row, LIGHT.pos, &[0.0, 0.0, 4.0, 0.0, 0.0, -1.0]);
    put_int(&mut row, 24, 1);
    put(&mut row, LIGHT.attenuation, &[1.0, 0.5, 0.0, 60.0, 10.0]);
    put(&mut row, LIGHT.ambient, &[0.1, 0.1, 0.1, 0.5, 0.6, 0.7, 0.2, 0.2, 0.2]);
    row[LIGHT.castshadow] = 1;
    let mut headlight = row.clone();
    headlight[LIGHT.headlight] = 1;
    put(&mut headlight, LIGHT.dir, &[0.0; 3]);
    let lights = [row, headlight].concat();
    let memory = MjvMemory { lights: &lights, forward: [0.6, 0.8, 0.0], ..MjvMemory::default() };
    let frame = reader().read(&memory, Background::default()).expect("whole structures");
    let [sun, head] = &frame.lights[..] else { panic!("two lights") };
    assert_eq!((sun.kind, sun.cast_shadow, sun.diffuse), (LightKind::Directional, true, [0.5, 0.6, 0.7]));
    assert_eq!((head.kind, head.cast_shadow), (LightKind::Directional, false));
    assert_eq!((sun.direction, head.direction), ([0.0, 0.0, -1.0], [0.6, 0.8, 0.0]));
}

/// Point lights and image lights are not drawn by MuJoCo's renderer, which adds ambient light to scenes without lights.
#[test]
fn lights_that_are_not_drawn() {
    let light = |kind: i32| {
        let mut row = vec![0; LIGHT.stride];
        put(&mut row, LIGHT.dir, &[0.0, 0.0, -1.0]);
        put_int(&mut row, 24, kind);
        row
    };
    let mut reader = reader();
    let ball = geom(2, -1, [0.5; 3], 0);
    let mut read = |lights: &[u8]| {
        let memory = MjvMemory { lights, ..memory(&ball) };
        let frame = reader.read(&memory, Background::default()).expect("whole structures");
        (frame.lights.iter().map(|light| light.active).collect::<Vec<_>>(), frame.scene.ambient.sky)
    };
    assert_eq!(read(&[light(2), light(3)].concat()), (vec![false, false], [0.3; 3]));
    assert_eq!(read(&[light(2), light(0)].concat()), (vec![false, true], [0.0; 3]), "the scene is built anew");
    assert_eq!(read(&light(1)), (vec![true], [0.0; 3]));
    assert_eq!(read(&[]), (Vec::new(), [0.3; 3]));
    let message = |kind| format!("lights of type {kind} are not rendered: only directional and spot lights are");
    assert_eq!(reader.omitted(), [message(2), message(3)]);
}

/// A geom whose pose is not rigid is left out, alone, and comes back with a rigid pose.
#[test]
fn poses_that_are_not_rigid() {
    let good = geom(2, -1, [0.5; 3], 0);
    let mut reader = reader();
    for matrix in [[2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0], [0.0; 9], [f32::NAN; 9]] {
        let mut bad = geom(6, -1, [0.5; 3], 1);
        put(&mut bad, GEOM.mat, &matrix);
        let mut count = |row: &[u8]| {
            let rows = [&good[..], row].concat();
            reader.read(&memory(&rows), Background::default()).expect("whole structures").poses.len()
        };
        assert_eq!([count(&bad), count(&geom(6, -1, [0.5; 3], 1))], [1, 2]);
    }
    assert_eq!(reader.omitted(), ["geoms of type 6 are not rendered: a pose is not a rotation and a position"]);
}

#[test]
fn invalid_layouts_and_memory() {
    let outside = GeomLayout { mat: GEOM.stride - 35, ..GEOM };
    let error = LayoutError::Outside { field: "mat", offset: GEOM.stride - 35, stride: GEOM.stride };
    assert_eq!(outside.validate(), Err(error));
    assert_eq!(GeomLayout { mat: GEOM.stride - 36, ..GEOM }.validate(), Ok(()));
    assert!(LightLayout { castshadow: usize::MAX, ..LIGHT }.validate().is_err());
    let half = reader().read(&memory(&[0; 100]), Background::default());
    assert_eq!(half.err(), Some(LayoutError::Length { bytes: 100, stride: GEOM.stride }));
}

/// A vertical field of view f has the focal length h / (2 tan(f / 2)); a frustum whose center is moved by the fraction
/// s of its half width moves the principal point by s half images.
#[test]
fn cameras() {
    let half = (0.5f64 * 0.8).tan() * 0.01;
    let camera = MjvCamera {
        orthographic: false,
        position: [1.0, 2.0, 3.0],
        forward: [1.0, 0.0, 0.0],
        up: [0.0, 0.0, 1.0],
        center: 0.25 * half * 4.0 / 3.0,
        half_width: 0.0,
        bottom: -half,
        top: half,
        near: 0.01,
        far: 10.0,
    };
    let [fx, fy, cx, cy] = camera.intrinsics(640, 480).expect("a frustum");
    let focal = 240.0 / 0.4f64.tan();
    for (found, expected) in [(fx, focal), (fy, focal), (cx, 320.0 - 0.25 * 320.0), (cy, 240.0)] {
        assert!((f64::from(found) - expected).abs() < 1e-3, "{found} {expected}");
    }
    let pose = camera.world_from_camera().expect("axes");
    // Depth is along x of the world, the right of the image along -y.
    assert_eq!(pose.apply([0.0, 0.0, 2.0]), [3.0, 2.0, 3.0]);
    assert_eq!(pose.apply([1.0, 0.0, 0.0]), [1.0, 1.0, 3.0]);
    // A half width of its own sets the horizontal focal length: half the width of square pixels, twice the length.
    let wide = MjvCamera { half_width: 0.5 * half * 4.0 / 3.0, ..camera };
    let [wide_fx, wide_fy, wide_cx, _] = wide.intrinsics(640, 480).expect("a frustum");
    for (found, expected) in [(wide_fx, 2.0 * focal), (wide_fy, focal), (wide_cx, 320.0 - 0.5 * 320.0)] {
        assert!((f64::from(found) - expected).abs() < 1e-3, "{found} {expected}");
    }
    assert!(MjvCamera { up: [2.0, 0.0, 0.0], ..camera }.world_from_camera().is_err());
    assert!(MjvCamera { top: -half, ..camera }.intrinsics(640, 480).is_err());
}
