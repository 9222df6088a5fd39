//! Files that examples write, read back by the rules of their formats.

use kinetoscope::ndarray::{Array, Dimension, arr1, arr2, arr3};
use testkit::urdf::Files;

#[path = "../../../examples/launcher/npy.rs"]
mod npy;
#[path = "../../../examples/launcher/cloud.rs"]
#[allow(dead_code, reason = "examples use the rest")]
mod ply;

/// The type that the `super` of `ply` has in examples.
type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A point \[m\] and its colour.
type Vertex = ([f32; 3], [u8; 3]);

/// Reads the vertices of a binary PLY file, by the names, types and order that its header gives; `None` for other files.
/// Source: Greg Turk, The PLY Polygon File Format, 1994.
fn read(bytes: &[u8]) -> Option<Vec<Vertex>> {
    let end = b"end_header\n";
    let header = bytes.windows(end.len()).position(|window| window == end)? + end.len();
    let lines: Vec<Vec<&str>> =
        std::str::from_utf8(&bytes[..header]).ok()?.lines().map(|line| line.split(' ').collect()).collect();
    if lines.first()?.as_slice() != ["ply"] || lines.get(1)?.as_slice() != ["format", "binary_little_endian", "1.0"] {
        return None;
    }
    let (mut count, mut properties) = (0usize, Vec::new());
    for line in &lines[2..lines.len() - 1] {
        match line.as_slice() {
            ["element", "vertex", n] => count = n.parse().ok()?,
            ["property", kind, name] => properties.push((*kind, *name)),
            _ => return None,
        }
    }
    let mut rest = &bytes[header..];
    let mut vertices = Vec::new();
    for _ in 0..count {
        let mut vertex: Vertex = ([f32::NAN; 3], [0; 3]);
        for (kind, name) in &properties {
            let axis = ["x", "y", "z"].iter().position(|axis| axis == name);
            let channel = ["red", "green", "blue"].iter().position(|channel| channel == name);
            match (*kind, axis, channel) {
                ("float", Some(axis), None) => {
                    let (number, tail) = rest.split_first_chunk::<4>()?;
                    (vertex.0[axis], rest) = (f32::from_le_bytes(*number), tail);
                }
                ("uchar", None, Some(channel)) => (vertex.1[channel], rest) = (*rest.first()?, &rest[1..]),
                _ => return None,
            }
        }
        vertices.push(vertex);
    }
    rest.is_empty().then_some(vertices)
}

#[test]
fn ply_round_trip() {
    let point = |k: i32| {
        let x = k as f32;
        ([0.1 * x, -1.0 / (x + 1.0), x.sin()], [k as u8, (k / 3) as u8, 255 - k as u8])
    };
    let points: Vec<Vertex> = (0..1000).map(point).collect();
    let folder = Files::default();
    for points in [&points[..], &points[..1], &[]] {
        let path = folder.folder().join("points.ply");
        ply::write_ply(&path, points).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(read(&bytes).as_deref(), Some(points));
        // Controls: a byte more or less is another file.
        assert_eq!(read(&[bytes.as_slice(), &[0]].concat()), None);
        assert!(points.is_empty() || read(&bytes[..bytes.len() - 1]).is_none());
    }
    let nowhere = ply::write_ply(&folder.folder().join("no/such/folder.ply"), &points).unwrap_err();
    assert!(nowhere.to_string().contains("folder.ply"), "{nowhere}");
}

/// Compares an array with the bytes that `numpy.save` (2.x) writes for it: the dictionary is filled up with spaces to byte
/// 127, and ended with a line feed.
#[track_caller]
fn check_npy<S: npy::Element, D: Dimension>(array: &Array<S, D>, [kind, shape]: [&str; 2], data: &[u8]) {
    let dictionary = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let mut expected = b"\x93NUMPY\x01\x00v\x00".to_vec();
    expected.extend_from_slice(format!("{dictionary:<117}\n").as_bytes());
    expected.extend_from_slice(data);
    let mut written = Vec::new();
    npy::write(&mut written, array).unwrap();
    assert_eq!(written, expected);
}

#[test]
fn npy_as_numpy_writes() {
    let data = b"\x00\x00\x00\x00\x00\x00\x80?\x00\x00\x00@\x00\x00@@\x00\x00\x80@\x00\x00\xa0@";
    check_npy(&arr2(&[[0.0_f32, 1.0, 2.0], [3.0, 4.0, 5.0]]), ["<f4", "2, 3"], data);
    check_npy(&arr1(&[1_i32, -2]), ["<i4", "2,"], b"\x01\x00\x00\x00\xfe\xff\xff\xff");
    check_npy(&arr3(&[[[255_u8]]]), ["|u1", "1, 1, 1"], b"\xff");
    check_npy(&arr2::<u8, 4>(&[]), ["|u1", "0, 4"], b"");
    check_npy(&arr1(&[-2.5_f64]), ["<f8", "1,"], b"\x00\x00\x00\x00\x00\x00\x04\xc0");
    // An array in Fortran order in memory is written in C order.
    let turned = arr2(&[[0, 2], [1, 3]]).reversed_axes();
    assert!(!turned.is_standard_layout());
    check_npy(&turned, ["<i4", "2, 2"], b"\x00\x00\x00\x00\x01\x00\x00\x00\x02\x00\x00\x00\x03\x00\x00\x00");
}
