//! Disk cache of convex pieces of mesh files.

use super::hull_cache::{KEY_BYTES, decoded, encoded, key, store};
use super::load::{format_of, read};
use super::{
    ConvexDecomposition, ConvexDecompositionCfg, HullCache, HullCfg, MeshError, MeshOptions, convex_decomposition,
    load_bytes,
};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::path::Path;

impl HullCache {
    /// Returns the [convex pieces](convex_decomposition) of a mesh file, scaled along its axes.
    ///
    /// Pieces are cached like the hulls of [`hull_of_file`](Self::hull_of_file).
    ///
    /// # Errors
    /// The file cannot be read, a scale is 0 or not finite, or a configuration is out of range. Also if the mesh has no
    /// hull, or more than 50000 triangles.
    pub fn decomposition_of_file(
        &self,
        path: &Path,
        scale: [f64; 3],
        hull: &HullCfg,
        cfg: &ConvexDecompositionCfg,
    ) -> Result<ConvexDecomposition, MeshError> {
        // This call checks the scale.
        self.hull_of_file(path, scale, hull)?;
        let (bytes, options) = (read(path)?, MeshOptions::default());
        let format = format_of(path, &bytes).filter(|format| format.is_one_file);
        let entry = self.dir().zip(format).map(|(dir, format)| {
            let key = pieces_key(&key(&bytes, format, &options, scale, hull), cfg);
            let mut name = String::with_capacity(2 * KEY_BYTES + 7);
            for byte in key {
                // Writing to a string cannot fail.
                let _ = write!(name, "{byte:02x}");
            }
            (dir.join(name + ".pieces"), key)
        });
        if let Some(known) = entry.as_ref().and_then(|(file, key)| decoded_pieces(&std::fs::read(file).ok()?, key)) {
            return Ok(known);
        }
        let mesh = load_bytes(path, &bytes, &options)?.scaled(scale);
        let pieces = convex_decomposition(&mesh, hull, cfg)
            .map_err(|source| MeshError::Hull { path: path.to_owned(), source })?;
        if let Some((file, key)) = entry {
            // A failed write is ignored: the pieces are valid without it.
            let _ = store(&file, &encoded_pieces(&pieces, &key));
        }
        Ok(pieces)
    }
}

fn pieces_key(hull: &[u8; KEY_BYTES], cfg: &ConvexDecompositionCfg) -> [u8; KEY_BYTES] {
    let ConvexDecompositionCfg { max_pieces, tolerance } = *cfg;
    let mut hasher = Sha256::new();
    hasher.update(b"pieces");
    hasher.update(convex_decomposition::ALGORITHM_VERSION.to_le_bytes());
    hasher.update((max_pieces as u64).to_le_bytes());
    hasher.update(tolerance.to_bits().to_le_bytes());
    hasher.update(hull);
    hasher.finalize().into()
}

/// Encodes pieces: the depth, the number of hulls, each encoded hull after its length, and the SHA-256 of all of these.
fn encoded_pieces(pieces: &ConvexDecomposition, key: &[u8; KEY_BYTES]) -> Vec<u8> {
    let mut out = pieces.depth.to_le_bytes().to_vec();
    out.extend((pieces.hulls.len() as u64).to_le_bytes());
    for hull in &pieces.hulls {
        let hull = encoded(hull, key);
        out.extend((hull.len() as u64).to_le_bytes());
        out.extend(hull);
    }
    let sum = Sha256::digest(&out);
    out.extend(sum);
    out
}

fn decoded_pieces(bytes: &[u8], key: &[u8; KEY_BYTES]) -> Option<ConvexDecomposition> {
    let (content, sum) = bytes.split_at_checked(bytes.len().checked_sub(KEY_BYTES)?)?;
    if Sha256::digest(content)[..] != *sum {
        return None;
    }
    let (depth, rest) = content.split_first_chunk::<8>()?;
    let (count, mut rest) = rest.split_first_chunk::<8>()?;
    let mut hulls = Vec::new();
    for _ in 0..u64::from_le_bytes(*count) {
        let (length, after) = rest.split_first_chunk::<8>()?;
        let (hull, after) = after.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        hulls.push(decoded(hull, key)?);
        rest = after;
    }
    rest.is_empty().then_some(ConvexDecomposition { hulls, depth: f64::from_le_bytes(*depth) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriMesh, write_binary_stl};
    use std::fs;

    /// Two tetrahedra that meet in a corner, which give two pieces.
    fn bow_tie() -> TriMesh {
        let corners = |s: f32| [[0.0, 0.0, 0.0], [s, 0.0, 0.0], [s, s, 0.0], [s, 0.0, s.abs()]];
        let faces = |o: u32| [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]].map(|face| face.map(|k: u32| o + k));
        let triangles = faces(0).into_iter().chain(faces(4)).collect();
        TriMesh::from_triangles(corners(1.0).into_iter().chain(corners(-1.0)).collect(), triangles)
    }

    #[test]
    fn hits_and_damage() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("tie.stl");
        write_binary_stl(&bow_tie(), fs::File::create(&path).unwrap()).unwrap();
        let cache = HullCache::at(scratch.path().join("cache"));
        let (hull, cfg) = (HullCfg::default(), ConvexDecompositionCfg::default());
        let of = |cache: &HullCache, cfg: &ConvexDecompositionCfg| {
            cache.decomposition_of_file(&path, [1.0, 2.0, 1.0], &hull, cfg).unwrap()
        };
        let fresh = of(&HullCache::disabled(), &cfg);
        assert!(fresh.hulls.len() > 1, "{}", fresh.depth);
        assert_eq!((of(&cache, &cfg), of(&cache, &cfg)), (fresh.clone(), fresh.clone()));
        let files = || fs::read_dir(cache.dir().unwrap()).unwrap().map(|entry| entry.unwrap().path());
        let file = files().find(|file| file.extension().is_some_and(|end| end == "pieces")).unwrap();
        let good = fs::read(&file).unwrap();
        // A hit does not decompose the mesh again: pieces planted under the right key are returned.
        let base =
            key(&read(&path).unwrap(), &crate::mesh::stl::FORMAT, &MeshOptions::default(), [1.0, 2.0, 1.0], &hull);
        let key = pieces_key(&base, &cfg);
        let planted = ConvexDecomposition { hulls: fresh.hulls[..1].to_vec(), depth: 0.25 };
        fs::write(&file, encoded_pieces(&planted, &key)).unwrap();
        assert_eq!(of(&cache, &cfg), planted);
        for cut in 0..good.len() {
            assert_eq!(decoded_pieces(&good[..cut], &key), None);
            let mut flipped = good.clone();
            flipped[cut] ^= 0x10;
            assert_eq!(decoded_pieces(&flipped, &key), None);
        }
        fs::write(&file, &good[..good.len() / 2]).unwrap();
        assert_eq!(of(&cache, &cfg), fresh);
        assert_eq!(fs::read(&file).unwrap(), good);
        // Another configuration has its own entry.
        let one = of(&cache, &ConvexDecompositionCfg { max_pieces: 1, ..cfg });
        assert_eq!(one.hulls.len(), 1);
        assert_eq!(files().filter(|file| file.extension().is_some_and(|end| end == "pieces")).count(), 2);
        assert_eq!(of(&cache, &cfg), fresh);
    }
}
