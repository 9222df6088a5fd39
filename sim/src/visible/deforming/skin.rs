//! Vertices of skins: each is the weighted mean of the positions that its bodies give it.
//!
//! Source: `mjv_updateActiveSkin` of `engine_vis_visualize.c`, from the bind pose of the bodies to their current pose.
//! Sums are of single precision in MuJoCo's order.

use super::Scratch;
use kinetoscope_mujoco::{Data, SkinArrays};
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::smooth_normals;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Mesh of a skin in its bind pose.
pub(super) fn bind_pose(skin: &SkinArrays<'_>) -> TriMesh {
    let mut mesh = TriMesh::from_triangles(skin.positions.to_vec(), triangles(skin).collect());
    // MuJoCo's v axis points down the image.
    mesh.uvs = (!skin.texcoords.is_empty()).then(|| skin.texcoords.iter().map(|&[u, v]| [u, 1.0 - v]).collect());
    mesh
}

/// Triangles of a skin, without those that refer to missing vertices.
fn triangles(skin: &SkinArrays<'_>) -> impl Iterator<Item = [u32; 3]> {
    let count = skin.positions.len();
    let exists = move |t: &[u32; 3]| t.iter().all(|&vertex| (vertex as usize) < count);
    skin.faces.iter().map(|face| face.map(|vertex| u32::try_from(vertex).unwrap_or(u32::MAX))).filter(exists)
}

/// Computes positions and normals of the vertices of a skin.
pub(super) fn vertices(data: &Data, skin: usize, scratch: &mut Scratch) {
    let skin = data.model().skin(skin);
    let Scratch { positions, normals, triangles: faces, .. } = scratch;
    positions.clear();
    positions.resize(skin.positions.len(), [0.0; 3]);
    normals.resize(skin.positions.len(), [0.0; 3]);
    faces.clear();
    faces.extend(triangles(&skin));
    let (places, turns) = (data.xpos().as_chunks::<3>().0, data.xquat().as_chunks::<4>().0);
    for bone in skin.bones() {
        let quaternion = |[w, x, y, z]: [f64; 4]| UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        let turn = quaternion(turns[bone.body]) * quaternion(bone.orientation.map(f64::from)).inverse();
        let rotation = turn.to_rotation_matrix();
        let moved = Vector3::from(places[bone.body]) - rotation * Vector3::from(bone.position.map(f64::from));
        for (&vertex, &weight) in bone.vertices.iter().zip(bone.weights) {
            let Some(bound) = skin.positions.get(vertex as usize) else { continue };
            let at = rotation * Vector3::from(bound.map(f64::from)) + moved;
            let sum = &mut positions[vertex as usize];
            *sum = [0, 1, 2].map(|k| sum[k] + weight * at[k] as f32);
        }
    }
    smooth_normals(positions, faces, normals);
    if skin.inflate != 0.0 {
        for (position, normal) in positions.iter_mut().zip(normals.iter()) {
            *position = [0, 1, 2].map(|k| position[k] + skin.inflate * normal[k]);
        }
    }
}
