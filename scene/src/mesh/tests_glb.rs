//! glTF tests with small files of known content.

use kinetoscope_testkit::urdf::TempFiles;
use std::path::Path;

use super::*;
use crate::mesh::tests_robots::faces_up;
use crate::mesh::{MeshOptions, load, load_bytes};

pub(crate) fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let (mut json, mut bin) = (json.as_bytes().to_vec(), bin.to_vec());
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
    for (kind, data) in [(JSON, &json), (BIN, &bin)] {
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(data);
    }
    out
}

/// A unit square in xy. Positions and normals are interleaved (stride 24), uv are normalized u8 (stride 4). Then u16
/// indices of two triangles, u8 indices of a strip and of a fan, and an "image".
pub(crate) fn buffer() -> Vec<u8> {
    let mut bin = Vec::new();
    for p in [[0.0f32, 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]] {
        bin.extend(p.iter().chain(&[0., 0., 1.]).flat_map(|x| x.to_le_bytes()));
    }
    bin.extend([0, 255, 0, 0, 255, 255, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0]);
    bin.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    bin.extend([0, 1, 3, 2, 0, 1, 2, 3]);
    bin.extend(b"PNG!");
    bin
}

pub(crate) const SQUARE: &str = r#"{
 "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
 "nodes": [{"scale": [2, 2, 2], "children": [1, 2]}, {"mesh": 0, "translation": [1, 0, 0]},
  {"mesh": 1, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_1": 2}, "indices": 3, "material": 0}]},
  {"primitives": [{"attributes": {"POSITION": 0}, "indices": 4, "mode": 5, "material": 1},
   {"attributes": {"POSITION": 0}, "indices": 5, "mode": 6}, {"attributes": {"POSITION": 0}, "mode": 0}]}],
 "materials": [{"name": "wood", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 0.5],
   "baseColorTexture": {"index": 0, "texCoord": 1}}},
  {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 0.5]}}],
 "textures": [{"source": 0}], "images": [{"bufferView": 4, "mimeType": "image/png"}],
 "accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
  {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 4, "type": "VEC3"},
  {"bufferView": 1, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2"},
  {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
  {"bufferView": 3, "componentType": 5121, "count": 4, "type": "SCALAR"},
  {"bufferView": 3, "byteOffset": 4, "componentType": 5121, "count": 4, "type": "SCALAR"}],
 "bufferViews": [{"buffer": 0, "byteLength": 96, "byteStride": 24},
  {"buffer": 0, "byteOffset": 96, "byteLength": 16, "byteStride": 4},
  {"buffer": 0, "byteOffset": 112, "byteLength": 12}, {"buffer": 0, "byteOffset": 124, "byteLength": 8},
  {"buffer": 0, "byteOffset": 132, "byteLength": 4}],
 "buffers": [{"byteLength": 136}]}"#;

fn parse(json: &str) -> Result<TriMesh, MeshError> {
    load_bytes(Path::new("dir/part.glb"), &glb(json, &buffer()), &MeshOptions::default())
}

fn check(mesh: &TriMesh) {
    mesh.validate().unwrap();
    assert_eq!(mesh.triangles.len(), 6);
    let at = |t: usize| mesh.triangles[t].map(|i| mesh.positions[i as usize]);
    assert_eq!(at(0), [[2., 0., 0.], [4., 0., 0.], [4., 2., 0.]]);
    // A quarter turn, 5 up, then twice the size. Strip and fan keep the winding.
    assert_eq!(at(2), [[0., 0., 10.], [0., 2., 10.], [-2., 0., 10.]]);
    assert!((0..6).map(at).all(faces_up));
    assert_eq!(mesh.submeshes.iter().map(|p| p.material).collect::<Vec<_>>(), [Some(0), Some(1), None]);
    // Texture coordinates count from the top in the file, and from the bottom in the mesh.
    assert_eq!(mesh.uvs.as_ref().unwrap()[..4], [[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
    let wood = &mesh.materials[0];
    assert_eq!((wood.name.as_str(), wood.rgba[0], wood.rgba[2], wood.rgba[3]), ("wood", 1.0, 0.0, 1.0));
    assert!((wood.rgba[1] - 0.7354).abs() < 1e-4, "linear 0.5 is 188 of 255 in sRGB");
    assert_eq!((mesh.materials[1].name.as_str(), mesh.materials[1].rgba[3]), ("material 1", 0.5));
}

#[test]
fn square() {
    let mesh = parse(SQUARE).unwrap();
    check(&mesh);
    assert_eq!(mesh.materials[0].texture, Some(TextureSource::Embedded(b"PNG!".to_vec())));
    // Mirrored nodes reverse the winding of triangles.
    let mesh = parse(&SQUARE.replace("\"scale\": [2, 2, 2]", "\"scale\": [-2, 2, 2]")).unwrap();
    assert!(mesh.triangles.iter().all(|t| faces_up(t.map(|i| mesh.positions[i as usize]))));
    assert_eq!(mesh.normals.unwrap()[0], [0., 0., 1.]);
    // The same content in separate files.
    let files = TempFiles::default();
    let data = files.write("my data.bin", buffer());
    let json = SQUARE
        .replace("{\"byteLength\": 136}", "{\"byteLength\": 136, \"uri\": \"my%20data.bin\"}")
        .replace("{\"bufferView\": 4, \"mimeType\": \"image/png\"}", "{\"uri\": \"tex/wood.jpg\"}");
    let path = files.write("part.gltf", &json);
    let mesh = load(&path).unwrap();
    check(&mesh);
    assert_eq!(mesh.materials[0].texture, Some(TextureSource::File(files.folder().join("tex/wood.jpg"))));
    std::fs::remove_file(data).unwrap();
    assert!(matches!(load(&path), Err(MeshError::Io { path, .. }) if path.ends_with("my data.bin")));
}

#[test]
fn errors() {
    let draco = "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], \"scene\"";
    let most = "\"count\": 18446744073709551615";
    let index = "mesh 0, primitive 0, index into accessors: index 9 is out of range; the number of elements is 6";
    let infinite = "mesh 0, primitive 0, triangle 0: vertex position [inf, 0.0, 0.0] is not finite";
    for (from, to, expected) in [
        ("\"scene\"", draco, "the required glTF extension \"KHR_draco_mesh_compression\" is not supported"),
        ("\"count\": 4", "\"count\": 5", "accessor 0 ends early: expected 108 bytes, found 96"),
        ("\"count\": 4", most, "accessor 0 ends early: expected 18446744073709551615 bytes"),
        ("\"byteLength\": 136", "\"byteLength\": 137", "buffer 0 ends early: expected 137 bytes, found 136"),
        ("\"byteOffset\": 112", "\"byteOffset\": 132", "bufferView 2 ends early: expected 144 bytes, found 136"),
        ("\"byteOffset\": 112", "\"byteOffset\": 16", "mesh 0, primitive 0, vertex index: index"),
        ("\"byteStride\": 24", "\"byteStride\": 8", "accessor 0: byteStride 8 is less than the element, 12 bytes"),
        ("\"POSITION\": 0", "\"POSITION\": 9", index),
        ("\"POSITION\": 0", "\"POSITION\": 2", "accessor 2: type \"VEC2\"; expected \"VEC3\""),
        ("\"POSITION\": 0", "\"POSITION\": -1", "mesh 0, primitive 0: \"POSITION\" is not a whole number"),
        ("\"children\": [1, 2]", "\"children\": [0]", "node 0: nodes nest deeper than 64"),
        ("[2, 2, 2]", "[2, 2]", "node 0: \"scale\" must be 3 numbers"),
        ("[2, 2, 2]", "[1e300, 2, 2]", infinite),
        ("\"mode\": 5", "\"mode\": 7", "mesh 1, primitive 0: mode 7; expected 0 to 6"),
        ("\"count\": 6", "\"count\": 5", "mesh 0, primitive 0: 5 indices of triangles; expected a multiple of 3"),
        ("\"asset\"", "asset", "JSON line 2, column 2: not valid JSON"),
        ("\"nodes\": [0]", "\"nodes\": []", "no triangles; a mesh needs at least one"),
    ] {
        let changed = SQUARE.replacen(from, to, 1);
        assert_ne!(changed, SQUARE);
        let error = parse(&changed).unwrap_err().to_string();
        assert!(error.starts_with(&format!("dir/part.glb: {expected}")), "{error}");
    }
    let bytes = glb(SQUARE, &buffer());
    let cut = load_bytes(Path::new("a.glb"), &bytes[..100], &MeshOptions::default()).unwrap_err();
    assert_eq!(cut.to_string(), format!("a.glb: GLB ends early: expected {} bytes, found 100", bytes.len()));
}
