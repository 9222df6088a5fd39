//! Rigid objects: shapes, masses, motion, friction, bounces and welds.

mod bounces;
mod concave;
mod groups;
mod masses;
mod meshes;
mod moved;
mod refused;
mod welds;

use kinetoscope::prelude::*;
use kinetoscope::scene::mesh::{TriMesh, write_obj};
use kinetoscope::sim::{RigidObjectId, WrenchFrame};
use kinetoscope_testkit::tolerance::{Tolerance, assert_number};
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{ball, cube, empty_cfg, fixed, object, row, sim, weightless_cfg};
use std::path::PathBuf;

const SECOND: &[EnvId] = &[EnvId(1)];
/// MuJoCo's contacts are soft: with the default reference a body sinks in by at most (1 - d) g / (d k) = 0.1 g / (0.9 ·
/// 2770 /s²) = 0.4 mm (k = 1 / (0.95 · 0.02 s)²).
const SOFT: Tolerance = Tolerance::absolute(5e-4, "depth of a soft contact at rest, 0.4 mm at most");

/// An empty scene with a time step of a millisecond.
fn empty(num_envs: usize) -> SimulationManager {
    sim(SimulationManagerCfg { physics_dt: 1e-3, ..empty_cfg(num_envs) })
}

/// As [`empty`], without gravity.
fn weightless(num_envs: usize) -> SimulationManager {
    sim(SimulationManagerCfg { physics_dt: 1e-3, ..weightless_cfg(num_envs) })
}

fn kinematic(cfg: RigidObjectCfg) -> RigidObjectCfg {
    RigidObjectCfg { body_type: BodyType::Kinematic, ..cfg }
}

/// Sets a force \[N\] and a torque \[N m\] in world axes, in all environments.
fn set_wrench(sim: &mut SimulationManager, id: RigidObjectId, force: [f64; 3], torque: [f64; 3]) {
    sim.rigid_object_mut(id).set_external_wrench(&row(force), &row(torque), WrenchFrame::World, None).unwrap();
}

fn obj(files: &TempFiles, name: &str, mesh: &TriMesh) -> PathBuf {
    let mut text = Vec::new();
    write_obj(mesh, 0..mesh.triangles.len(), &mut text).unwrap();
    files.write(name, text)
}

/// A box mesh with the side lengths `size` and its minimum corner at `corner`.
fn brick(size: [f32; 3], corner: [f32; 3]) -> TriMesh {
    let at = |k: u32| std::array::from_fn(|i| corner[i] + if k >> i & 1 == 1 { size[i] } else { 0.0 });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh::from_triangles((0..8).map(at).collect(), faces)
}

/// A prism along y over a counterclockwise outline in x and z, which `cut` divides into triangles; from -0.5 to 0.5, in
/// `parts` sections.
fn prism(outline: &[[f32; 2]], cut: &[[u32; 3]], parts: u32) -> TriMesh {
    let n = outline.len() as u32;
    let ring = |k: u32| outline.iter().map(move |&[x, z]| [x, k as f32 / parts as f32 - 0.5, z]);
    let back = cut.iter().map(|&[a, b, c]| [a + n * parts, c + n * parts, b + n * parts]);
    let rim = (0..parts * n).flat_map(|k| {
        let (here, next) = (k, k / n * n + (k + 1) % n);
        [[here, here + n, next + n], [here, next + n, next]]
    });
    let triangles = cut.iter().copied().chain(back).chain(rim).collect();
    TriMesh::from_triangles((0..=parts).flat_map(ring).collect(), triangles)
}

/// A channel along y: a floor from 0 to 0.1 m and walls up to 0.5 m, 1 m wide and long, with a hollow 0.6 m wide.
fn channel() -> TriMesh {
    let outline = [[-0.5, 0.0], [0.5, 0.0], [0.5, 0.5], [0.3, 0.5], [0.3, 0.1], [-0.3, 0.1], [-0.3, 0.5], [-0.5, 0.5]];
    prism(&outline, &[[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 7]], 1)
}
