//! Point clouds that examples write, read back by the rules of the PLY format.
//! Source: Greg Turk, The PLY Polygon File Format, 1994.

#[path = "../../../examples/launcher/cloud.rs"]
#[allow(dead_code, reason = "examples use the rest")]
mod writer;

/// What the writer's `super` has in examples.
type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A point \[m\] and its colour.
type Vertex = ([f32; 3], [u8; 3]);

/// Reads the vertices of a binary file: by the names, types and order that its header gives. `None` where it is no such file.
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
                ("uchar", None, Some(channel)) => {
                    let (byte, tail) = rest.split_first()?;
                    (vertex.1[channel], rest) = (*byte, tail);
                }
                _ => return None,
            }
        }
        vertices.push(vertex);
    }
    rest.is_empty().then_some(vertices)
}

#[test]
fn what_was_written_is_read_again() {
    let points: Vec<Vertex> = (0..1000)
        .map(|k| {
            let x = k as f32;
            ([0.1 * x, -1.0 / (x + 1.0), x.sin()], [k as u8, (k / 3) as u8, 255 - k as u8])
        })
        .collect();
    let folder = tempfile::tempdir().unwrap();
    for points in [&points[..], &points[..1], &[]] {
        let path = folder.path().join("points.ply");
        writer::write_ply(&path, points).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(read(&bytes).as_deref(), Some(points));
        // Controls: a byte more or less is another file.
        assert_eq!(read(&[bytes.as_slice(), &[0]].concat()), None);
        assert!(points.is_empty() || read(&bytes[..bytes.len() - 1]).is_none());
    }
    let nowhere = writer::write_ply(&folder.path().join("no/such/folder.ply"), &points).unwrap_err();
    assert!(nowhere.to_string().contains("folder.ply"), "{nowhere}");
}
