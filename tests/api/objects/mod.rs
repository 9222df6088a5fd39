//! Rigid objects: their shapes, what they weigh, how they move and rub, what holds them together.

mod apart;
mod concave;
mod groups;
mod kinematic;
mod masses;
mod meshes;
mod properties;
mod refused;
mod restitution;
mod standing;
mod welds;

use kinetoscope::prelude::*;
use kinetoscope::scene::mesh::{TriMesh, write_obj};
use std::path::PathBuf;

/// Nothing but what is added, in `num_envs` environments; steps of a millisecond.
fn empty(num_envs: usize) -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs, ground: None, physics_dt: 1e-3, ..Default::default() };
    SimulationManager::new(cfg).unwrap()
}

/// As [`empty`], without gravity.
fn weightless(num_envs: usize) -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs, ground: None, physics_dt: 1e-3, ..Default::default() };
    SimulationManager::new(SimulationManagerCfg { gravity: [0.0; 3].into(), ..cfg }).unwrap()
}

fn object(uid: &str, shape: ObjectShape, at: [f64; 3]) -> RigidObjectCfg {
    let init_pose = Pose::translation(at[0], at[1], at[2]);
    RigidObjectCfg { uid: uid.into(), shape, init_pose, ..Default::default() }
}

/// Files that go away with it.
struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn obj(&self, name: &str, mesh: &TriMesh) -> PathBuf {
        let path = self.0.path().join(name);
        let out = std::fs::File::create(&path).unwrap();
        write_obj(mesh, 0..mesh.triangles.len(), out).unwrap();
        path
    }
}

/// A brick whose sides are `size` long, with its least corner in `corner`.
fn brick(size: [f32; 3], corner: [f32; 3]) -> TriMesh {
    let at = |k: u32| std::array::from_fn(|i| corner[i] + if k >> i & 1 == 1 { size[i] } else { 0.0 });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh::from_triangles((0..8).map(at).collect(), faces)
}

/// A channel along y: a floor from 0 to 0.1 m and walls up to 0.5 m, 1 m wide and long, the hollow 0.6 m wide.
fn channel() -> TriMesh {
    let outline = [[-0.5, 0.0], [0.5, 0.0], [0.5, 0.5], [0.3, 0.5], [0.3, 0.1], [-0.3, 0.1], [-0.3, 0.5], [-0.5, 0.5]];
    let end = |y: f32| outline.iter().map(move |&[x, z]| [x, y, z]);
    let positions = end(-0.5).chain(end(0.5)).collect();
    // Triangles of the outline, counter-clockwise in x and z.
    let cut = [[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 7]];
    let front = cut;
    let back = cut.map(|[a, b, c]| [a + 8, c + 8, b + 8]);
    let rim = (0..8_u32).flat_map(|k| {
        let next = (k + 1) % 8;
        [[k, k + 8, next + 8], [k, next + 8, next]]
    });
    TriMesh::from_triangles(positions, front.into_iter().chain(back).chain(rim).collect())
}
