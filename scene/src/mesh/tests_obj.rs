//! Tests of OBJ and MTL files, and of files from [`crate::mesh::write_obj`].

use kinetoscope_testkit::urdf::TempFiles;
use std::path::Path;

use super::*;
use crate::mesh::{MeshOptions, TextureSource, load, load_bytes, write_binary_stl, write_obj};

fn parse(text: &str) -> Result<TriMesh, MeshError> {
    load_bytes(Path::new("part.Obj"), text.as_bytes(), &MeshOptions::default())
}

const SQUARE: &str = "# a square and a triangle\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0 0.5 0.5 0.5\nvt 0 0\nvt 1 0 0\n\
                      vt 1 1\nvt 0 1\nvn 0 0 2\nusemtl red\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl blue\nf -4//1 -3//-1 \\\n\
                      -1//-1\n";

#[test]
fn faces() {
    let mesh = parse(SQUARE).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 4, 5]]);
    assert_eq!(mesh.positions.len(), 6);
    assert_eq!(mesh.normals.as_ref().unwrap()[3], [0.0, 0.0, 1.0]);
    assert_eq!(mesh.uvs.as_ref().unwrap()[..4], [[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
    // Without a library, both materials are unknown, which gives one part without a material.
    assert_eq!((mesh.submeshes.len(), mesh.materials.len()), (1, 0));
    mesh.validate().unwrap();
    // A face with two corners is a line. Regression: pybullet's monastery has such faces and was rejected.
    assert_eq!(parse(&format!("{SQUARE}f 1 2\n")).unwrap(), mesh);
}

#[test]
fn libraries() {
    let files = TempFiles::default();
    let lib = "newmtl unused\nKd 1 1 0\nnewmtl blue\nKd 0 0 1\nmap_Kd tex/blue.png\nnewmtl red\nKd 1 0 0\n";
    files.write("my colors.mtl", lib);
    let text = format!("mtllib missing.mtl\nmtllib my colors.mtl\n{SQUARE}usemtl red\nf 2 3 4\n");
    let mesh = load(files.write("part.obj", text)).unwrap();
    assert_eq!(mesh.submeshes.len(), 2);
    assert_eq!((mesh.submeshes[0].triangles.clone(), mesh.submeshes[1].triangles.clone()), (0..3, 3..4));
    assert_eq!(mesh.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["red", "blue"]);
    assert_eq!(mesh.materials[1].texture, Some(TextureSource::File(files.folder().join("tex/blue.png"))));
}

#[test]
fn errors() {
    for (text, expected) in [
        ("v 0 0\n", "line 1: expected 3 numbers"),
        ("v 0 0 x\n", "line 1: \"x\" is not a number"),
        ("v 0 0 0\nv 1 0 0\nf 1\n", "line 3: face with 1 corners; expected 3 or more"),
        ("v 0 0 0\nv 1 0 0\nf 1 2\n", "no triangles; a mesh needs at least one"),
        ("v 0 0 0\nv 1 0 0\nf 1 3\n", "line 3, v index: index 3 is out of range; the number of elements is 2"),
        ("v 0 0 0\nf 1 1 2\n", "line 2, v index: index 2 is out of range; the number of elements is 1"),
        ("v 0 0 0\nf 1 1 0\n", "line 2, v index: index 0 is out of range; the number of elements is 1"),
        ("v 0 0 0\nf 1 1 -2\n", "line 2, v index: index -2 is out of range; the number of elements is 1"),
        ("v 0 0 0\nf 1/9 1 1\n", "line 2, vt index: index 9 is out of range; the number of elements is 0"),
        ("v 0 0 0\nf 1//-9223372036854775808 1 1\n", "line 2, vn index: index -9223372036854775808 is out"),
        ("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "line 4: vertex position [0.0, NaN, 0.0] is not finite"),
        ("v 0 0 0\n", "no triangles; a mesh needs at least one"),
    ] {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.starts_with(&format!("part.Obj: {expected}")), "{error}");
    }
}

#[test]
fn tobj() {
    // All face corners of a random file in order. The comparison resolves the single indices of both readers.
    let mut random = crate::mesh::tests_robots::TestRng(9);
    let mut text = String::new();
    for _ in 0..60 {
        let mut x = || random.unit();
        text += &format!("v {} {} {}\nvt {} {}\nvn {} {} {}\n", x(), x(), x(), x(), x(), x(), x(), x());
    }
    for i in 0..200 {
        let mut number = || random.next() % 60 + 1;
        let mut corner = || format!("{}/{}/-{}", number(), number(), number());
        text += &format!("f {} {} {}\n", corner(), corner(), corner());
        if i == 100 {
            text += "g second\n";
        }
    }
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok(Default::default())).unwrap();
    let corners = |mesh: &tobj::Mesh| -> Vec<([f32; 3], [f32; 2])> {
        let at = |&i: &u32| {
            let (p, t) = (&mesh.positions[3 * i as usize..], &mesh.texcoords[2 * i as usize..]);
            ([p[0], p[1], p[2]], [t[0], t[1]])
        };
        mesh.indices.iter().map(at).collect()
    };
    let theirs: Vec<_> = models.iter().flat_map(|model| corners(&model.mesh)).collect();
    // This reader drops triangles with two corners at one position, because they have no area.
    let theirs: Vec<_> =
        theirs.chunks(3).filter(|t| t[0].0 != t[1].0 && t[1].0 != t[2].0 && t[2].0 != t[0].0).flatten().collect();
    let ours = parse(&text).unwrap();
    let uvs = ours.uvs.as_ref().unwrap();
    let ours: Vec<_> =
        ours.triangles.iter().flatten().map(|&i| (ours.positions[i as usize], uvs[i as usize])).collect();
    assert_eq!(ours.iter().collect::<Vec<_>>(), theirs);
}

#[test]
fn round_trip() {
    let mut mesh = parse(SQUARE).unwrap().scaled([1e-3, 1e10, 0.1]);
    mesh.positions[1][2] = 1e-30;
    let mut text = Vec::new();
    write_obj(&mesh, 0..3, &mut text).unwrap();
    let back = parse(std::str::from_utf8(&text).unwrap()).unwrap();
    assert_eq!((&back.positions, &back.uvs, &back.triangles), (&mesh.positions, &mesh.uvs, &mesh.triangles));
    for (a, b) in back.normals.iter().flatten().flatten().zip(mesh.normals.iter().flatten().flatten()) {
        assert!((a - b).abs() < 1e-6);
    }
    // A part has only its own vertices.
    let mut text = Vec::new();
    write_obj(&mesh, 2..3, &mut text).unwrap();
    assert_eq!(parse(std::str::from_utf8(&text).unwrap()).unwrap().positions.len(), 3);
    assert!(write_obj(&mesh, 2..9, &mut text).is_err());

    let mut stl = Vec::new();
    write_binary_stl(&mesh, &mut stl).unwrap();
    assert_eq!(stl.len(), 84 + 3 * 50);
    let back = load_bytes(Path::new("x.stl"), &stl, &MeshOptions::default()).unwrap();
    let soup = |m: &TriMesh| m.triangles.iter().flatten().map(|&i| m.positions[i as usize]).collect::<Vec<_>>();
    assert_eq!(soup(&back), soup(&mesh));
}
