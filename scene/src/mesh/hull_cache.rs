//! Disk cache of convex hulls of mesh files.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::format::Format;
use super::load::{format_of, read};
use super::{DaeUpAxis, HullCfg, MeshError, MeshOptions, TriMesh, convex_hull, hull, load_bytes};
use crate::atomic_file::AtomicFile;

/// Version of the readers. It changes whenever they give other vertices for the same file.
const READERS_VERSION: u32 = 1;
const MAGIC: &[u8; 12] = b"kshull\r\n\x00\x01\x00\x00";
pub(super) const KEY_BYTES: usize = 32;
const HEADER_BYTES: usize = MAGIC.len() + KEY_BYTES + 8;

/// Disk cache of convex hulls, in one folder. The [`Default`] is disabled.
///
/// A problem with the folder or a file in it costs time but is never an error: the hull is computed again, and written
/// again if possible. Hulls of plain glTF files, whose vertices are in other files, are not cached.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HullCache {
    dir: Option<PathBuf>,
}

impl HullCache {
    /// Cache in `$KINETOSCOPE_CACHE`, else `$XDG_CACHE_HOME/kinetoscope`, else `$HOME/.cache/kinetoscope`, else
    /// disabled. An empty variable counts as unset.
    pub fn default_location() -> Self {
        Self::from_env(|name| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from))
    }

    fn from_env(var: impl Fn(&str) -> Option<PathBuf>) -> Self {
        let dir = var("KINETOSCOPE_CACHE")
            .or_else(|| var("XDG_CACHE_HOME").map(|d| d.join("kinetoscope")))
            .or_else(|| var("HOME").map(|d| d.join(".cache").join("kinetoscope")));
        Self { dir }
    }

    /// Cache in a folder, which is created when the first hull is written.
    pub fn at(dir: impl Into<PathBuf>) -> Self {
        Self { dir: Some(dir.into()) }
    }

    /// A disabled cache: every hull is computed.
    pub fn disabled() -> Self {
        Self { dir: None }
    }

    /// Folder of the cache; `None` if the cache is disabled.
    pub fn dir(&self) -> Option<&Path> {
        self.dir.as_deref()
    }

    /// Returns the convex hull of the vertices of a mesh file, scaled along its axes (the `scale` of URDF).
    ///
    /// # Errors
    /// A factor of the scale is 0 or not finite, the configuration is out of range, the file cannot be read, or its
    /// vertices have no hull.
    pub fn hull_of_file(&self, path: &Path, scale: [f64; 3], cfg: &HullCfg) -> Result<TriMesh, MeshError> {
        self.hull_of_file_with(path, &MeshOptions::default(), scale, cfg)
    }

    /// Returns the hull as [`HullCache::hull_of_file`] does, with options of the mesh reader.
    ///
    /// # Errors
    /// As [`HullCache::hull_of_file`].
    pub fn hull_of_file_with(
        &self,
        path: &Path,
        options: &MeshOptions,
        scale: [f64; 3],
        cfg: &HullCfg,
    ) -> Result<TriMesh, MeshError> {
        if scale.iter().any(|s| !s.is_finite() || *s == 0.0) {
            return Err(MeshError::Invalid {
                path: path.to_owned(),
                at: format!("scale {scale:?}"),
                what: "expected finite factors other than 0".to_owned(),
                source: None,
            });
        }
        let bytes = read(path)?;
        // The vertices of a plain glTF are in other files, which the key does not cover.
        let format = format_of(path, &bytes).filter(|format| format.is_one_file);
        let entry = self.dir.as_ref().zip(format).map(|(dir, format)| {
            let key = key(&bytes, format, options, scale, cfg);
            let mut name = String::with_capacity(2 * KEY_BYTES + 5);
            for byte in key {
                // Writing to a string cannot fail.
                let _ = write!(name, "{byte:02x}");
            }
            (dir.join(name + ".hull"), key)
        });
        if let Some(hull) = entry.as_ref().and_then(|(file, key)| decoded(&std::fs::read(file).ok()?, key)) {
            return Ok(hull);
        }
        let mesh = load_bytes(path, &bytes, options)?.scaled(scale);
        let hull =
            convex_hull(&mesh.positions, cfg).map_err(|source| MeshError::Hull { path: path.to_owned(), source })?;
        if let Some((file, key)) = entry {
            // A failed write is ignored: the hull is valid without it.
            let _ = store(&file, &encoded(&hull, &key));
        }
        Ok(hull)
    }
}

pub(super) fn key(
    bytes: &[u8],
    format: &Format,
    options: &MeshOptions,
    scale: [f64; 3],
    cfg: &HullCfg,
) -> [u8; KEY_BYTES] {
    let HullCfg { max_vertices, tolerance, min_thickness } = *cfg;
    let MeshOptions { dae_up_axis } = *options;
    let mut hasher = Sha256::new();
    hasher.update(MAGIC);
    hasher.update(hull::ALGORITHM_VERSION.to_le_bytes());
    hasher.update(READERS_VERSION.to_le_bytes());
    hasher.update([format.code, u8::from(dae_up_axis == DaeUpAxis::Apply), u8::from(min_thickness.is_some())]);
    for number in scale.into_iter().chain([tolerance, min_thickness.unwrap_or(0.0)]) {
        hasher.update(number.to_bits().to_le_bytes());
    }
    hasher.update((max_vertices as u64).to_le_bytes());
    hasher.update(bytes);
    hasher.finalize().into()
}

/// Encodes a hull: magic, key, counts, positions, triangles, and the SHA-256 of all of these.
pub(super) fn encoded(hull: &TriMesh, key: &[u8; KEY_BYTES]) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    out.extend(key);
    out.extend((hull.positions.len() as u32).to_le_bytes());
    out.extend((hull.triangles.len() as u32).to_le_bytes());
    out.extend(hull.positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    out.extend(hull.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
    let sum = Sha256::digest(&out);
    out.extend(sum);
    out
}

pub(super) fn decoded(bytes: &[u8], key: &[u8; KEY_BYTES]) -> Option<TriMesh> {
    let (content, sum) = bytes.split_at_checked(bytes.len().checked_sub(KEY_BYTES)?)?;
    let (head, body) = content.split_at_checked(HEADER_BYTES)?;
    let (magic, rest) = head.split_at(MAGIC.len());
    if magic != MAGIC || rest[..KEY_BYTES] != key[..] || Sha256::digest(content)[..] != *sum {
        return None;
    }
    let word = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let (vertices, faces) = (word(&rest[KEY_BYTES..]) as usize, word(&rest[KEY_BYTES + 4..]) as usize);
    if body.len() as u64 != 12 * (vertices as u64 + faces as u64) {
        return None;
    }
    let mut rows = body.chunks_exact(12).map(|r| [word(r), word(&r[4..]), word(&r[8..])]);
    let positions = rows.by_ref().take(vertices).map(|r| r.map(f32::from_bits)).collect();
    let hull = TriMesh::from_triangles(positions, rows.collect());
    hull.validate().is_ok().then_some(hull)
}

/// Writes a file of the cache, and creates its folder if it is missing.
pub(super) fn store(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if let Some(dir) = file.parent() {
        std::fs::create_dir_all(dir)?;
    }
    AtomicFile::write(file, bytes)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::process::Stdio;

    use kinetoscope_testkit::process;

    use super::*;
    use crate::mesh::dae::tests::document;
    use crate::mesh::{obj, stl, write_binary_stl};
    use crate::vector::sub;

    const TETRAHEDRON: &str = r##"<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
        <p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>"##;

    fn cube(dir: &Path) -> PathBuf {
        let points: Vec<[f32; 3]> = (0..8u8).map(|i| [0, 1, 2].map(|axis| f32::from(i >> axis & 1))).collect();
        let path = dir.join("cube.stl");
        let hull = convex_hull(&points, &HullCfg::default()).unwrap();
        write_binary_stl(&hull, fs::File::create(&path).unwrap()).unwrap();
        path
    }

    fn only_file(dir: &Path) -> PathBuf {
        let files: Vec<_> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
        assert_eq!(files.len(), 1, "{files:?}");
        files[0].clone()
    }

    #[test]
    fn hits_and_damage() {
        let scratch = tempfile::tempdir().unwrap();
        let (mesh, cache) = (cube(scratch.path()), HullCache::at(scratch.path().join("a/cache")));
        let (scale, cfg) = ([1.0, -2.0, 3.0], HullCfg::default());
        let fresh = HullCache::disabled().hull_of_file(&mesh, scale, &cfg).unwrap();
        assert!((fresh.signed_volume() - 6.0).abs() < 1e-9);
        assert_eq!(cache.hull_of_file(&mesh, scale, &cfg).unwrap(), fresh);
        let file = only_file(cache.dir().unwrap());
        let good = fs::read(&file).unwrap();
        assert_eq!(cache.hull_of_file(&mesh, scale, &cfg).unwrap(), fresh);
        // A hit does not compute the hull again: a hull planted under the right key is returned.
        let key: [u8; KEY_BYTES] = good[MAGIC.len()..][..KEY_BYTES].try_into().unwrap();
        let planted = fresh.scaled([2.0; 3]);
        fs::write(&file, encoded(&planted, &key)).unwrap();
        assert_eq!(cache.hull_of_file(&mesh, scale, &cfg).unwrap(), planted);
        for cut in 0..good.len() {
            assert_eq!(decoded(&good[..cut], &key), None);
            let mut flipped = good.clone();
            flipped[cut] ^= 0x10;
            assert_eq!(decoded(&flipped, &key), None);
        }
        fs::write(&file, &good[..good.len() / 2]).unwrap();
        assert_eq!(cache.hull_of_file(&mesh, scale, &cfg).unwrap(), fresh);
        assert_eq!(fs::read(only_file(cache.dir().unwrap())).unwrap(), good);
    }

    /// A tetrahedron along y in a file with y up: the hull is oriented by the option, and each option has its own file.
    #[test]
    fn reader_options() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("prism.dae");
        let node = r##"<node><matrix>1 0 0 0 0 3 0 0 0 0 2 0 0 0 0 1</matrix><instance_geometry url="#g"/></node>"##;
        let text = document("<up_axis>Y_UP</up_axis>", "", TETRAHEDRON, node).replace("1 1 0<", "0 0 1<");
        fs::write(&path, text).unwrap();
        let cache = HullCache::at(scratch.path().join("cache"));
        let size = |dae_up_axis| {
            let cfg = HullCfg::default();
            let hull = cache.hull_of_file_with(&path, &MeshOptions { dae_up_axis }, [1.0, 1.0, 2.0], &cfg).unwrap();
            assert!((hull.signed_volume() - 2.0).abs() < 1e-6, "1 x 3 x 2 / 6, doubled along z");
            let (lo, hi) = hull.bounds().unwrap();
            sub(hi, lo)
        };
        for _ in 0..2 {
            // `Ignore` keeps the axes of the file. `Apply` makes its y axis the z axis, which is doubled.
            for (option, expected) in [(DaeUpAxis::Ignore, [1.0, 3.0, 4.0]), (DaeUpAxis::Apply, [1.0, 2.0, 6.0])] {
                let found: [f32; 3] = size(option);
                assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-5), "{option:?}: {found:?}");
            }
        }
        assert_eq!(fs::read_dir(cache.dir().unwrap()).unwrap().count(), 2);
    }

    /// Set in child processes only: the folder of the mesh and of the cache.
    const FOLDER: &str = "KINETOSCOPE_TEST_CACHE";

    /// Four processes read, write, delete and damage the same entry: each of them gets the right hull every time, and no
    /// temporary file remains.
    #[test]
    fn several_processes() {
        let scratch = tempfile::tempdir().unwrap();
        cube(scratch.path());
        let start = |_| {
            let mut command = process::command(module_path!(), "scenario_shared_entry");
            command.env(FOLDER, scratch.path()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
        };
        let children: Vec<_> = (0..4).map(start).collect();
        for child in children {
            let output = child.wait_with_output().unwrap();
            let all = format!("{}{}", process::text(&output.stdout), process::text(&output.stderr));
            assert!(output.status.success() && all.contains("1 passed"), "{all}");
        }
        let file = only_file(&scratch.path().join("cache"));
        assert!(file.extension().is_some_and(|end| end == "hull"), "{}", file.display());
    }

    #[test]
    #[ignore = "runs in a process of its own"]
    fn scenario_shared_entry() {
        let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
        let (mesh, cache) = (folder.join("cube.stl"), HullCache::at(folder.join("cache")));
        let (scale, cfg) = ([1.0, 2.0, 3.0], HullCfg::default());
        let fresh = HullCache::disabled().hull_of_file(&mesh, scale, &cfg).unwrap();
        for round in 0..300 {
            assert_eq!(cache.hull_of_file(&mesh, scale, &cfg).unwrap(), fresh, "round {round}");
            let entries = fs::read_dir(cache.dir().unwrap()).unwrap().map(|entry| entry.unwrap().path());
            let entry = entries.into_iter().find(|path| path.extension().is_some_and(|end| end == "hull"));
            match (round % 5, entry) {
                // Another process may have deleted the file.
                (1, Some(entry)) => drop(fs::remove_file(entry)),
                // Half of a file, as of a disk that was full.
                (3, Some(entry)) => {
                    if let Ok(bytes) = fs::read(&entry) {
                        fs::write(&entry, &bytes[..bytes.len() / 2]).unwrap();
                    }
                }
                _ => {}
            }
        }
        assert_eq!(cache.hull_of_file(&mesh, scale, &cfg).unwrap(), fresh);
    }

    #[test]
    fn keys() {
        let base = HullCfg::default();
        let configurations = [
            base,
            HullCfg { max_vertices: 5, ..base },
            HullCfg { tolerance: 2e-4, ..base },
            HullCfg { min_thickness: None, ..base },
            HullCfg { min_thickness: Some(2e-3), ..base },
        ];
        let mut keys = std::collections::BTreeSet::new();
        let [ignore, apply] = [DaeUpAxis::Ignore, DaeUpAxis::Apply].map(|dae_up_axis| MeshOptions { dae_up_axis });
        for (bytes, format, options, scale) in [
            (&b"a"[..], &stl::FORMAT, &ignore, [1.0; 3]),
            (b"b", &stl::FORMAT, &ignore, [1.0; 3]),
            (b"a", &obj::FORMAT, &ignore, [1.0; 3]),
            (b"a", &stl::FORMAT, &apply, [1.0; 3]),
            (b"a", &stl::FORMAT, &ignore, [1.0, 1.0, -1.0]),
        ] {
            keys.extend(configurations.map(|cfg| key(bytes, format, options, scale, &cfg)));
        }
        assert_eq!(keys.len(), 25);
    }

    #[test]
    fn impossible_folder() {
        let scratch = tempfile::tempdir().unwrap();
        let mesh = cube(scratch.path());
        // The folder would have to be inside a file.
        let cache = HullCache::at(mesh.join("cache"));
        assert_eq!(cache.hull_of_file(&mesh, [1.0; 3], &HullCfg::default()).unwrap().triangles.len(), 12);
        let error = cache.hull_of_file(&mesh, [0.0, 1.0, 1.0], &HullCfg::default()).unwrap_err();
        assert!(error.to_string().ends_with("scale [0.0, 1.0, 1.0]: expected finite factors other than 0"));
    }

    #[test]
    fn default_place() {
        // The default folder follows from the first of the three variables that is set.
        let of = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let expected = match (of("KINETOSCOPE_CACHE"), of("XDG_CACHE_HOME"), of("HOME")) {
            (Some(dir), ..) => Some(dir),
            (None, Some(dir), _) => Some(dir.join("kinetoscope")),
            (None, None, home) => home.map(|dir| dir.join(".cache/kinetoscope")),
        };
        assert_eq!(HullCache::default_location().dir(), expected.as_deref());
        let all = ["KINETOSCOPE_CACHE", "XDG_CACHE_HOME", "HOME"];
        let located = |set: &[&'static str]| {
            let set = set.to_vec();
            HullCache::from_env(move |name| set.contains(&name).then(|| Path::new("/").join(name)))
        };
        assert_eq!(located(&all), HullCache::at("/KINETOSCOPE_CACHE"));
        assert_eq!(located(&all[1..]), HullCache::at("/XDG_CACHE_HOME/kinetoscope"));
        assert_eq!(located(&all[2..]), HullCache::at("/HOME/.cache/kinetoscope"));
        assert_eq!(located(&[]), HullCache::disabled());
    }
}
