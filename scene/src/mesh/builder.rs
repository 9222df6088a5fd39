//! Conversion of the triangle corners of a file to a welded [`TriMesh`].

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use super::error::ReadContext;
use super::{MeshError, MeshMaterial, Submesh, TriMesh};
use crate::vector::{cross, sub, try_normalize};

/// Largest number of triangles that a file may expand to. It is far above any robot part, and keeps a few malicious
/// lines of instances from filling the memory.
pub(super) const MAX_TRIANGLES: usize = 1 << 24;

/// One corner of a triangle of the file, with its transforms applied.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) position: [f32; 3],
    pub(super) normal: Option<[f32; 3]>,
    pub(super) uv: Option<[f32; 2]>,
}

/// Collects triangles; [`Builder::finish`] welds them.
#[derive(Default)]
pub(super) struct Builder {
    corners: Vec<[Corner; 3]>,
    /// Material of each triangle.
    groups: Vec<Option<usize>>,
    materials: Vec<MeshMaterial>,
}

impl Builder {
    pub(super) fn material(&mut self, material: MeshMaterial) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a triangle. `at` describes its position in the file, for errors.
    pub(super) fn triangle(
        &mut self,
        ctx: &ReadContext<'_>,
        mut corners: [Corner; 3],
        material: Option<usize>,
        at: impl Fn() -> String,
    ) -> Result<(), MeshError> {
        if self.corners.len() >= MAX_TRIANGLES {
            return Err(ctx.too_large("triangles", MAX_TRIANGLES));
        }
        for corner in &mut corners {
            if !corner.position.iter().all(|x| x.is_finite()) {
                return Err(MeshError::NonFinite { path: ctx.path.to_owned(), at: at(), value: corner.position });
            }
            // Adding zero turns -0 into +0, so that equal values have equal bits.
            corner.position = corner.position.map(|x| x + 0.0);
            corner.normal = corner.normal.and_then(unit);
            corner.uv = corner.uv.filter(|uv| uv.iter().all(|x| x.is_finite())).map(|uv| uv.map(|x| x + 0.0));
        }
        self.corners.push(corners);
        self.groups.push(material);
        Ok(())
    }

    /// Groups triangles by material (in order of first use), drops degenerate triangles, merges equal vertices.
    ///
    /// If only some corners have a normal, the others get the normal of their triangle. Missing texture coordinates
    /// become 0 if other corners have some. If every triangle is degenerate, all are kept. No triangles at all is an
    /// error.
    pub(super) fn finish(mut self, ctx: &ReadContext<'_>) -> Result<TriMesh, MeshError> {
        if self.corners.is_empty() {
            return Err(MeshError::Empty { path: ctx.path.to_owned() });
        }
        let good: Vec<bool> = self.corners.iter().map(|c| face_normal(c).is_some()).collect();
        let keep_all = !good.contains(&true);

        // Triangles per material, in order of first use.
        let mut order: Vec<Option<usize>> = Vec::new();
        let mut runs: Vec<Vec<u32>> = Vec::new();
        let mut run_of: HashMap<Option<usize>, usize> = HashMap::new();
        for (t, material) in self.groups.iter().enumerate() {
            if !(keep_all || good[t]) {
                continue;
            }
            let run = *run_of.entry(*material).or_insert_with(|| {
                order.push(*material);
                runs.push(Vec::new());
                runs.len() - 1
            });
            runs[run].push(t as u32);
        }

        let any_normal = self.corners.iter().flatten().any(|c| c.normal.is_some());
        let any_uv = self.corners.iter().flatten().any(|c| c.uv.is_some());
        let count: usize = runs.iter().map(Vec::len).sum();
        let mut welder = Welder::new(any_normal, any_uv, count);
        let mut mesh = TriMesh { triangles: Vec::with_capacity(count), ..TriMesh::default() };
        let mut materials: Vec<Option<MeshMaterial>> = self.materials.drain(..).map(Some).collect();
        for (material, run) in order.into_iter().zip(runs) {
            let start = mesh.triangles.len();
            for t in run {
                let corners = &self.corners[t as usize];
                let flat = if any_normal { face_normal(corners).unwrap_or([0.0, 0.0, 1.0]) } else { [0.0; 3] };
                mesh.triangles.push(corners.map(|c| welder.vertex(&c, flat)));
            }
            let material = material.and_then(|m| materials.get_mut(m).and_then(Option::take)).map(|m| {
                mesh.materials.push(m);
                mesh.materials.len() - 1
            });
            mesh.submeshes.push(Submesh { triangles: start..mesh.triangles.len(), material });
        }
        mesh.positions = welder.positions;
        mesh.normals = any_normal.then_some(welder.normals);
        mesh.uvs = any_uv.then_some(welder.uvs);
        Ok(mesh)
    }
}

/// Vector scaled to unit length; `None` for a vector that is not finite or not longer than 1e-20.
pub(super) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    try_normalize(v.map(f64::from), 1e-20).map(|v| v.map(|x| x as f32 + 0.0))
}

fn face_normal(corners: &[Corner; 3]) -> Option<[f32; 3]> {
    let [a, b, c] = corners.map(|c| c.position.map(f64::from));
    try_normalize(cross(sub(b, a), sub(c, a)), 0.0).map(|n| n.map(|x| x as f32 + 0.0))
}

struct Welder {
    any_normal: bool,
    any_uv: bool,
    seen: HashMap<[u32; 8], u32, BuildHasherDefault<BitsHasher>>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
}

impl Welder {
    fn new(any_normal: bool, any_uv: bool, triangles: usize) -> Self {
        let seen = HashMap::with_capacity_and_hasher(triangles, BuildHasherDefault::default());
        Self { any_normal, any_uv, seen, positions: Vec::new(), normals: Vec::new(), uvs: Vec::new() }
    }

    fn vertex(&mut self, corner: &Corner, flat: [f32; 3]) -> u32 {
        let normal = if self.any_normal { corner.normal.unwrap_or(flat) } else { [0.0; 3] };
        let uv = if self.any_uv { corner.uv.unwrap_or_default() } else { [0.0; 2] };
        let [p, n] = [corner.position, normal].map(|v| v.map(f32::to_bits));
        let key = [p[0], p[1], p[2], n[0], n[1], n[2], uv[0].to_bits(), uv[1].to_bits()];
        *self.seen.entry(key).or_insert_with(|| {
            self.positions.push(corner.position);
            if self.any_normal {
                self.normals.push(normal);
            }
            if self.any_uv {
                self.uvs.push(uv);
            }
            // At most 3 * MAX_TRIANGLES vertices, which fit into a u32.
            (self.positions.len() - 1) as u32
        })
    }
}

/// A fast hash of a few machine words. The default hash costs more than the rest of the welding.
#[derive(Default)]
struct BitsHasher(u64);

impl Hasher for BitsHasher {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0u8; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u32(&mut self, word: u32) {
        self.write_u64(u64::from(word));
    }

    fn write_usize(&mut self, _length: usize) {}

    fn write_u64(&mut self, word: u64) {
        self.0 = (self.0 ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 ^= self.0 >> 29;
    }

    fn finish(&self) -> u64 {
        let h = (self.0 ^ (self.0 >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
        h ^ (h >> 32)
    }
}
