//! Scenes for tests, identical in every run.

use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Hemisphere, Instance, Material, PoseF32, RenderScene, Texture};
use std::sync::Arc;

/// Random numbers (xorshift64*) that are identical in every run, from a seed other than 0.
#[derive(Clone, Debug)]
pub struct TestRng(pub u64);

impl TestRng {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Uniform number in lo..hi.
    pub fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Three uniform numbers in lo..hi.
    pub fn vector(&mut self, lo: f64, hi: f64) -> [f64; 3] {
        [self.within(lo, hi), self.within(lo, hi), self.within(lo, hi)]
    }

    /// Random pose: any rotation, and a position within `reach` of the origin along each axis \[m\].
    pub fn pose(&mut self, reach: f64) -> PoseF32 {
        let q = nalgebra::Quaternion::new(
            self.within(-1., 1.),
            self.within(-1., 1.),
            self.within(-1., 1.),
            self.within(-1., 1.),
        );
        let t = self.vector(-reach, reach);
        let pose = kinetoscope_scene::Pose::from_parts(
            nalgebra::Translation3::new(t[0], t[1], t[2]),
            nalgebra::UnitQuaternion::from_quaternion(q),
        );
        PoseF32::from(&pose)
    }
}

/// A scene with two of every shape, with positions within `reach` of the origin along each axis \[m\], and a checkered
/// plane at z = -1. Returns the scene and the poses of its instances.
pub fn random_scene(random: &mut TestRng, reach: f64) -> (RenderScene, Vec<PoseF32>) {
    let shapes = every_shape().into_iter().chain(every_shape());
    let mut color = || random.within(0.1, 1.0) as f32;
    let mut instances: Vec<Instance> = shapes
        .zip(1..)
        .map(|(shape, id)| Instance::new(shape, Material::from_rgba([color(), color(), color(), 1.0]), id))
        .collect();
    instances.push(checker_plane());
    let mut poses: Vec<PoseF32> = (1..instances.len()).map(|_| random.pose(reach)).collect();
    poses.push(PoseF32::from_translation([0., 0., -1.0]));
    (RenderScene::new(instances).unwrap(), poses)
}

/// An infinite ground plane with a checker texture, mask id 100.
pub fn checker_plane() -> Instance {
    let checker = Texture::checker(64, [110, 120, 130], [140, 150, 160]);
    let material = Material {
        rgba: [1.0; 4],
        texture: Some(Arc::new(checker)),
        tex_repeat: [2.0, 2.0],
        tex_uniform: true,
        specular: 0.1,
        ..Material::default()
    };
    Instance::new(Plane::INFINITE, material, 100)
}

/// A triangle mesh of a bumpy sphere with a mean radius of 0.3 m.
pub fn bumpy_sphere(segments: usize) -> Arc<RenderMesh> {
    let mut mesh = Shape::from(Sphere { radius: 0.3 }).tessellate(segments);
    for p in &mut mesh.positions {
        let k = 1.0 + 0.15 * (20.0 * p[0]).sin() * (17.0 * p[1]).cos() * (15.0 * p[2]).sin();
        *p = p.map(|x| x * k);
    }
    Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE))
}

/// One of every kind of shape.
pub fn every_shape() -> Vec<Shape> {
    let elevation: Vec<f32> = (0..12 * 9).map(|k| ((k * 37 % 23) as f32) / 23.0).collect();
    vec![
        Plane { half: [0.6, 0.4] }.into(),
        Sphere { radius: 0.3 }.into(),
        Capsule { radius: 0.15, half_length: 0.3 }.into(),
        Ellipsoid { radii: [0.4, 0.2, 0.1] }.into(),
        Cylinder { radius: 0.2, half_length: 0.25 }.into(),
        Box { half: [0.2, 0.3, 0.1] }.into(),
        Mesh { mesh: bumpy_sphere(24) }.into(),
        HeightField::new([0.5, 0.4, 0.2, 0.1], 9, 12, &elevation).unwrap().into(),
    ]
}

/// A figure of 22 primitives in human shape and three objects, on a checkered ground. Returns the scene and the poses
/// of its instances.
pub fn humanoid() -> (RenderScene, Vec<PoseF32>) {
    let skin = Material { rgba: [0.8, 0.6, 0.4, 1.0], ..Material::default() };
    let mut instances = vec![checker_plane()];
    let mut poses = vec![PoseF32::IDENTITY];
    let mut add = |shape: Shape, from: [f64; 3], to: [f64; 3]| {
        let (a, b) = (nalgebra::Vector3::from(from), nalgebra::Vector3::from(to));
        let along = b - a;
        let rotation = nalgebra::UnitQuaternion::rotation_between(&nalgebra::Vector3::z(), &along)
            .unwrap_or_else(nalgebra::UnitQuaternion::identity);
        let middle = (a + b) / 2.0;
        instances.push(Instance::new(shape, skin.clone(), instances.len() as i32));
        poses.push(PoseF32::from(&kinetoscope_scene::Pose::from_parts(middle.into(), rotation)));
    };
    let limb = |r: f32, a: [f64; 3], b: [f64; 3]| -> Shape {
        let length = (nalgebra::Vector3::from(b) - nalgebra::Vector3::from(a)).norm();
        Capsule { radius: r, half_length: 0.5 * length as f32 }.into()
    };
    let ball = |r: f32| -> Shape { Sphere { radius: r }.into() };
    add(ball(0.09), [0., 0., 1.6], [0., 0., 1.6001]);
    for (r, z) in [(0.07, 1.36), (0.07, 1.28), (0.06, 1.15), (0.06, 1.05), (0.09, 0.95)] {
        let (a, b) = ([0., -0.07, z], [0., 0.07, z]);
        add(limb(r, a, b), a, b);
    }
    for side in [-1.0, 1.0] {
        let at = |x: f64, y: f64, z: f64| [x, side * y, z];
        let joints = [
            (0.06, at(0., 0.1, 0.9), at(0.03, 0.12, 0.5)),
            (0.049, at(0.03, 0.12, 0.47), at(0., 0.12, 0.12)),
            (0.027, at(-0.04, 0.11, 0.03), at(0.14, 0.09, 0.03)),
            (0.027, at(-0.04, 0.13, 0.03), at(0.14, 0.14, 0.03)),
            (0.04, at(0., 0.18, 1.36), at(0.1, 0.34, 1.2)),
            (0.031, at(0.11, 0.34, 1.2), at(0.25, 0.2, 1.28)),
        ];
        for (r, a, b) in joints {
            add(limb(r, a, b), a, b);
        }
        add(ball(0.04), at(0.27, 0.19, 1.29), at(0.27, 0.19, 1.2901));
        add(ball(0.05), at(0., 0.17, 1.37), at(0., 0.17, 1.3701));
    }
    for k in 0..3 {
        let (x, y) = (0.5 + 0.2 * k as f64, -0.5 + 0.4 * k as f64);
        let shape: Shape = match k {
            0 => Box { half: [0.1, 0.1, 0.1] }.into(),
            1 => Cylinder { radius: 0.08, half_length: 0.1 }.into(),
            _ => Ellipsoid { radii: [0.14, 0.1, 0.1] }.into(),
        };
        add(shape, [x, y, 0.1], [x, y, 0.1001]);
    }
    let mut scene = RenderScene::new(instances).unwrap();
    scene.lights[0].direction = [0.3, 0.7, -1.0];
    (scene, poses)
}

/// A pose without rotation \[m\].
pub fn translation(x: f32, y: f32, z: f32) -> PoseF32 {
    PoseF32::from_translation([x, y, z])
}

/// A scene of instances with mask ids from 1 on, and their poses.
pub fn instances(all: impl IntoIterator<Item = (impl Into<Shape>, Material, PoseF32)>) -> (RenderScene, Vec<PoseF32>) {
    let thing =
        |((shape, material, pose), id): ((_, Material, PoseF32), i32)| (Instance::new(shape, material, id), pose);
    let (instances, poses) = all.into_iter().zip(1..).map(thing).unzip();
    (RenderScene::new(instances).unwrap(), poses)
}

/// The scene without lights and ambient light. The sky is kept.
pub fn unlit(mut scene: RenderScene) -> RenderScene {
    scene.lights.clear();
    scene.headlight.active = false;
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    scene
}

/// A material without highlights.
pub fn matte([r, g, b]: [f32; 3]) -> Material {
    Material { specular: 0.0, ..Material::from_rgba([r, g, b, 1.0]) }
}
