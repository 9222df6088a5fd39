//! Tests of corrupt files: every reader returns an error or a valid mesh within 2 s, and never panics.

use std::path::Path;
use std::time::{Duration, Instant};

use super::tests_robots::TestRng;
use super::{MeshOptions, TriMesh, load_bytes, write_binary_stl, write_obj};

fn small_files() -> Vec<(&'static str, Vec<u8>)> {
    let cube: Vec<[f32; 3]> = (0..8u8).map(|i| [0, 1, 2].map(|axis| f32::from(i >> axis & 1))).collect();
    let cube = super::convex_hull(&cube, &super::HullCfg::default()).unwrap();
    let mut binary = Vec::new();
    write_binary_stl(&cube, &mut binary).unwrap();
    let mut obj = b"mtllib beside.mtl\nusemtl a\n".to_vec();
    let mut full: TriMesh = cube.clone();
    full.normals = Some(vec![[0.0, 0.0, 1.0]; 8]);
    full.uvs = Some(vec![[0.5, 0.25]; 8]);
    write_obj(&full, 0..12, &mut obj).unwrap();
    obj.extend(b"f 1/1/1 2 -3//-1 4/4 5\n");
    let ascii = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
                 facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    use super::dae::tests::{BOUND, MATERIALS, TWO_PARTS, document};
    let dae = document(r#"<unit meter="0.1"/><up_axis>Y_UP</up_axis>"#, MATERIALS, TWO_PARTS, BOUND);
    let (json, buffer) = (super::glb::tests::SQUARE, super::glb::tests::buffer());
    let base64: String = buffer.chunks(3).map(base64_of).collect();
    let inline = format!("{{\"byteLength\": 136, \"uri\": \"data:application/octet-stream;base64,{base64}\"}}");
    let gltf = json.replace("{\"byteLength\": 136}", &inline);
    vec![
        ("a.stl", binary),
        ("b.stl", ascii.into()),
        ("c.obj", obj),
        ("d.dae", dae.into_bytes()),
        ("e.glb", super::glb::tests::glb(json, &buffer)),
        ("f.gltf", gltf.into_bytes()),
    ]
}

fn base64_of(bytes: &[u8]) -> String {
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let word = (0..3).fold(0u32, |w, i| w << 8 | u32::from(bytes.get(i).copied().unwrap_or(0)));
    let digit = |i: usize| char::from(alphabet[(word >> (18 - 6 * i) & 63) as usize]);
    (0..4).map(|i| if i <= bytes.len() { digit(i) } else { '=' }).collect()
}

/// Reads the bytes under the name, and without an extension. Returns true if the named file is valid.
fn feed(folder: &Path, name: &str, bytes: &[u8]) -> bool {
    let start = Instant::now();
    let options = MeshOptions { dae_up_axis: super::DaeUpAxis::Apply };
    let read = |path: &Path| match load_bytes(path, bytes, &options) {
        Ok(mesh) => {
            mesh.validate().unwrap();
            assert!(!mesh.triangles.is_empty());
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    };
    let good = read(&folder.join(name));
    read(&folder.join("unnamed"));
    assert!(start.elapsed() < Duration::from_secs(2), "{name} takes too long");
    good
}

#[test]
fn truncated() {
    let folder = kinetoscope_testkit::urdf::TempFiles::default();
    folder.write("beside.mtl", "newmtl a\nKd 1 0 0\n");
    for (name, bytes) in small_files() {
        assert!(feed(folder.folder(), name, &bytes), "{name} itself must load");
        for length in 0..bytes.len() {
            feed(folder.folder(), name, &bytes[..length]);
        }
    }
}

#[test]
fn damaged() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = TestRng(42);
    for (name, bytes) in small_files() {
        for _ in 0..4000 {
            let mut damaged = bytes.clone();
            for _ in 0..random.next() % 6 + 1 {
                let at = (random.next() % damaged.len() as u64) as usize;
                match random.next() % 4 {
                    0 => damaged[at] ^= 1 << (random.next() % 8),
                    1 => damaged[at] = random.next() as u8,
                    // Digits, signs and brackets reach farther into text formats than random bytes do.
                    2 => damaged[at] = b"0123456789-+.eE/<>\"#[]{} \n"[(random.next() % 26) as usize],
                    _ => {
                        let from = (random.next() % damaged.len() as u64) as usize;
                        damaged[at] = damaged[from];
                    }
                }
            }
            feed(folder.path(), name, &damaged);
        }
    }
}

#[test]
fn damaged_libraries() {
    let lib = b"newmtl a\nKd 1 0.5 0\nd 0.5\nmap_Kd -s 1 1 1 tex.png\nnewmtl b\nTr 0.5\nKd 0 0 0\n";
    let options = MeshOptions::default();
    let mut random = TestRng(1);
    for round in 0..4000usize {
        let mut damaged = lib.to_vec();
        for _ in 0..if round < lib.len() { 0 } else { 3 } {
            let at = (random.next() % damaged.len() as u64) as usize;
            damaged[at] = random.next() as u8;
        }
        damaged.truncate(if round < lib.len() { round } else { lib.len() });
        let path = Path::new("a.mtl");
        let _ = super::mtl::read(path, &super::error::ReadContext { path, options: &options }, &damaged);
    }
}
