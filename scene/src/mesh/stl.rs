//! STL reader, binary and ASCII.
//!
//! Normals in the file are ignored: correct normals repeat the winding, and without normals a vertex that several
//! triangles share is one vertex.
//!
//! The `stl_io` crate, version 0.11.0, decides by the first six bytes alone. To see it, pass these files to its `read_stl`:
//! `"SOLID a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"`, and
//! the same with `"solid\n"` as its first line. Both are read as binary files, and end too early.

use super::builder::{Builder, Corner};
use super::error::ReadContext;
use super::format::{Format, begins_with_word};
use super::{MeshError, TriMesh};

/// The STL format.
pub(super) const FORMAT: Format = Format {
    code: 0,
    extensions: &["stl", "stlb"],
    is_one_file: true,
    is_certain: |_| false,
    likelihood: |bytes| match () {
        () if binary_length(bytes) == Some(bytes.len() as u64) => 5,
        () if bytes.starts_with(b"solid") && begins_with_word(bytes, b"facet") => 2,
        () => 0,
    },
    read,
};

const HEADER: u64 = 84;
const RECORD: u64 = 50;

/// Length of a binary STL file with the triangle count in `bytes`; `None` without a complete header.
fn binary_length(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(80..84)?;
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
    Some(HEADER + RECORD * u64::from(count))
}

fn read(ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<TriMesh, MeshError> {
    let found = bytes.len() as u64;
    let announced = binary_length(bytes);
    // Many exporters begin binary files with "solid", so the length is checked before the words.
    if announced != Some(found) && is_text(bytes) {
        return ascii(ctx, bytes);
    }
    match announced {
        None => Err(ctx.truncated("binary STL header", HEADER, found)),
        Some(expected) if expected > found => Err(ctx.truncated("binary STL", expected, found)),
        // Bytes after the last triangle are ignored.
        Some(expected) => binary(ctx, &bytes[HEADER as usize..expected as usize]),
    }
}

fn is_text(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    begins && !text.iter().take(512).any(|&b| b < 0x20 && !b.is_ascii_whitespace())
}

fn binary(ctx: &ReadContext<'_>, records: &[u8]) -> Result<TriMesh, MeshError> {
    let mut builder = Builder::default();
    for (index, record) in records.chunks_exact(RECORD as usize).enumerate() {
        let float = |i: usize| f32::from_le_bytes([record[i], record[i + 1], record[i + 2], record[i + 3]]);
        let corner = |i: usize| position([float(i), float(i + 4), float(i + 8)]);
        builder.triangle(ctx, [corner(12), corner(24), corner(36)], None, || format!("triangle {index}"))?;
    }
    builder.finish(ctx)
}

fn position(position: [f32; 3]) -> Corner {
    Corner { position, normal: None, uv: None }
}

fn ascii(ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<TriMesh, MeshError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut builder = Builder::default();
    let mut facet: Option<Vec<Corner>> = None;
    let mut open = false;
    let mut last = 0;
    for (index, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let number = index + 1;
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else { continue };
        last = number;
        let at = || format!("line {number}");
        match word.to_ascii_lowercase().as_str() {
            "solid" => open = true,
            "endsolid" => open = false,
            "facet" if facet.is_some() => return Err(ctx.invalid(at(), "facet inside a facet; expected \"endfacet\"")),
            "facet" => facet = Some(Vec::with_capacity(3)),
            "outer" | "endloop" => {}
            "vertex" => {
                let corners =
                    facet.as_mut().ok_or_else(|| ctx.invalid(at(), "vertex outside a facet; expected \"facet\""))?;
                let mut xyz = [0.0f32; 3];
                for x in &mut xyz {
                    let word = words.next().ok_or_else(|| ctx.invalid(at(), "vertex needs three numbers"))?;
                    *x = word
                        .parse()
                        .map_err(|e| ctx.invalid_with_source(at(), format!("{word:?} is not a number"), e))?;
                }
                if corners.len() == 3 {
                    return Err(ctx.invalid(at(), "fourth vertex of a facet; a facet has three"));
                }
                corners.push(position(xyz));
            }
            "endfacet" => match facet.take().as_deref() {
                Some(&[a, b, c]) => {
                    builder.triangle(ctx, [a, b, c], None, || format!("facet that ends at {}", at()))?
                }
                Some(corners) => {
                    return Err(ctx.invalid(at(), format!("facet with {} vertices; expected 3", corners.len())));
                }
                None => return Err(ctx.invalid(at(), "endfacet without a facet")),
            },
            other => {
                let shown: String = other.chars().take(32).collect();
                let what = format!(
                    "unknown keyword {shown:?}; expected solid, facet, outer, vertex, endloop, endfacet or endsolid"
                );
                return Err(ctx.invalid(at(), what));
            }
        }
    }
    if open || facet.is_some() {
        let what = if open { "the file ends without \"endsolid\"" } else { "the file ends inside a facet" };
        return Err(ctx.invalid(format!("line {last}"), what));
    }
    builder.finish(ctx)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::mesh::{MeshOptions, load_bytes, write_binary_stl};

    fn load(bytes: &[u8]) -> Result<TriMesh, MeshError> {
        load_bytes(Path::new("part.STL"), bytes, &MeshOptions::default())
    }

    const TEXT: &str = "solid part\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   \
                        VERTEX 0 1e0 -0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 1 0 0\n   \
                        vertex 1 1 0\n   vertex 0 1 0\n  endloop\n endfacet\nendsolid part\n";

    #[test]
    fn ascii() {
        let mesh = load(TEXT.as_bytes()).unwrap();
        assert_eq!(mesh.positions, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!((mesh.submeshes.len(), mesh.normals, mesh.uvs), (1, None, None));
        assert_eq!(load(TEXT.replace('\n', "\r\n").as_bytes()).unwrap().triangles.len(), 2);
        // Degenerate triangles are removed unless they are alone.
        let flat = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 1\nvertex 2 2 2\nendloop\nendfacet\n";
        let with = TEXT.replacen("solid part\n", &format!("solid part\n{flat}"), 1);
        assert_eq!(load(with.as_bytes()).unwrap(), load(TEXT.as_bytes()).unwrap());
        assert_eq!(load(format!("solid\n{flat}endsolid").as_bytes()).unwrap().triangles.len(), 1);
    }

    #[test]
    fn binary() {
        let mut bytes = Vec::new();
        write_binary_stl(&load(TEXT.as_bytes()).unwrap(), &mut bytes).unwrap();
        // A header that begins like an ASCII file.
        bytes[..12].copy_from_slice(b"solid facet ");
        assert_eq!(load(&bytes).unwrap().triangles.len(), 2);
        bytes.extend(b"trailing");
        bytes[20] = 0;
        assert_eq!(load(&bytes).unwrap().triangles.len(), 2);
        let mut bytes = vec![0u8; 84];
        assert!(matches!(load(&bytes), Err(MeshError::Empty { .. })));
        bytes[80..].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = load(&bytes).unwrap_err();
        assert_eq!(error.to_string(), "part.STL: binary STL ends early: expected 214748364834 bytes, found 84");
        assert!(matches!(load(&[]), Err(MeshError::Truncated { expected: 84, found: 0, .. })));
    }

    #[test]
    fn errors() {
        for (from, to, expected) in [
            ("1e0", "1o0", "line 6: \"1o0\" is not a number"),
            ("VERTEX 0 1e0 -0", "VERTEX 0 1e0", "line 6: vertex needs three numbers"),
            ("VERTEX 0 1e0 -0", "", "line 8: facet with 2 vertices; expected 3"),
            ("1e0", "inf", "facet that ends at line 8: vertex position [0.0, inf, -0.0] is not finite"),
            ("endsolid part", "", "line 15: the file ends without \"endsolid\""),
            ("VERTEX", "vortex", "line 6: unknown keyword \"vortex\""),
        ] {
            let error = load(TEXT.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with(&format!("part.STL: {expected}")), "{error}");
        }
    }
}
