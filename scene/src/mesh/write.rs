//! Writers of mesh files.

use std::collections::HashMap;
use std::io::{Error, ErrorKind, Result, Write};
use std::ops::Range;

use super::TriMesh;
use crate::vector::{cross, norm, sub};

/// Writes all triangles as binary STL with face normals. Vertex normals, texture coordinates, submeshes and materials
/// are lost.
///
/// # Errors
/// `out` fails, or the mesh has more than 4294967295 triangles.
pub fn write_binary_stl(mesh: &TriMesh, mut out: impl Write) -> Result<()> {
    let count = u32::try_from(mesh.triangles.len())
        .map_err(|_| Error::new(ErrorKind::InvalidInput, "STL holds at most 4294967295 triangles"))?;
    // Not "solid", by which some readers detect ASCII.
    let mut buffer = b"binary STL".to_vec();
    buffer.resize(80, b' ');
    buffer.extend(count.to_le_bytes());
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.positions[i as usize]);
        let [a, b, c] = corners.map(|p| p.map(f64::from));
        let n = cross(sub(b, a), sub(c, a));
        let length = norm(n);
        let normal = n.map(|x| if length > 0.0 { (x / length) as f32 } else { 0.0 });
        for x in std::iter::once(normal).chain(corners).flatten() {
            buffer.extend(x.to_le_bytes());
        }
        buffer.extend([0, 0]);
        if buffer.len() > 1 << 16 {
            out.write_all(&buffer)?;
            buffer.clear();
        }
    }
    out.write_all(&buffer)?;
    out.flush()
}

/// Writes a range of triangles (one [`super::Submesh`], or `0..mesh.triangles.len()`) as OBJ.
///
/// The file has the normals and texture coordinates of the mesh, and only the vertices of the range. Numbers are the
/// shortest that read back as the same `f32`. Materials are not written.
///
/// # Errors
/// `out` fails, or the range exceeds the triangles of the mesh.
pub fn write_obj(mesh: &TriMesh, triangles: Range<usize>, mut out: impl Write) -> Result<()> {
    let Some(run) = mesh.triangles.get(triangles.clone()) else {
        let what = format!("triangles {triangles:?} of a mesh with {}", mesh.triangles.len());
        return Err(Error::new(ErrorKind::InvalidInput, what));
    };
    let mut used: Vec<usize> = Vec::new();
    let mut number: HashMap<u32, usize> = HashMap::new();
    for &vertex in run.iter().flatten() {
        number.entry(vertex).or_insert_with(|| {
            used.push(vertex as usize);
            used.len()
        });
    }
    let mut out = std::io::BufWriter::new(&mut out);
    for &i in &used {
        let [x, y, z] = mesh.positions[i];
        writeln!(out, "v {x:?} {y:?} {z:?}")?;
    }
    if let Some(uvs) = &mesh.uvs {
        for &i in &used {
            let [u, v] = uvs[i];
            writeln!(out, "vt {u:?} {v:?}")?;
        }
    }
    if let Some(normals) = &mesh.normals {
        for &i in &used {
            let [x, y, z] = normals[i];
            writeln!(out, "vn {x:?} {y:?} {z:?}")?;
        }
    }
    for triangle in run {
        write!(out, "f")?;
        for vertex in triangle {
            let n = number[vertex];
            match (mesh.uvs.is_some(), mesh.normals.is_some()) {
                (false, false) => write!(out, " {n}")?,
                (true, false) => write!(out, " {n}/{n}")?,
                (false, true) => write!(out, " {n}//{n}")?,
                (true, true) => write!(out, " {n}/{n}/{n}")?,
            }
        }
        writeln!(out)?;
    }
    out.flush()
}
