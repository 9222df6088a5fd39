//! Wavefront OBJ reader.
//!
//! The `tobj` crate is a reference in the tests only: version 4.0.5 panics in `load_mtl_buf` of `"newmtl a\nKd 1\n"`, and its
//! errors do not name the line. If only some corners have texture coordinates, it loses their places: of
//! `"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nf 1 2/1 3\n"`, it returns three positions and one texture coordinate.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use super::builder::{Builder, Corner};
use super::error::{ReadContext, beside};
use super::format::{Format, begins_with_word};
use super::polygon::triangulate;
use super::{MeshError, TriMesh, mtl};
use crate::input_file::{self, MAX_TEXT};

/// The Wavefront OBJ format.
pub(super) const FORMAT: Format = Format {
    code: 1,
    extensions: &["obj"],
    is_one_file: true,
    is_certain: |_| false,
    likelihood: |bytes| u8::from(bytes.starts_with(b"v ") || begins_with_word(bytes, b"\nv ")),
    read,
};

#[derive(Default)]
struct Reader {
    v: Vec<[f32; 3]>,
    vt: Vec<[f32; 2]>,
    vn: Vec<[f32; 3]>,
    builder: Builder,
    /// Materials of all libraries read so far, by name.
    known: HashMap<String, usize>,
    /// Files of these libraries; a file that is named again adds nothing.
    libraries: HashSet<PathBuf>,
    material: Option<usize>,
}

fn read(ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<TriMesh, MeshError> {
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let mut reader = Reader::default();
    let mut lines = text.lines().enumerate();
    while let Some((index, line)) = lines.next() {
        if !line.trim_end().ends_with('\\') {
            reader.line(ctx, index + 1, line)?;
            continue;
        }
        // A backslash at the end joins the next line to this one.
        let mut joined = line.trim_end().trim_end_matches('\\').to_owned();
        for (_, next) in lines.by_ref() {
            joined.push(' ');
            joined.push_str(next.trim_end().trim_end_matches('\\'));
            if !next.trim_end().ends_with('\\') {
                break;
            }
        }
        reader.line(ctx, index + 1, &joined)?;
    }
    reader.builder.finish(ctx)
}

impl Reader {
    fn line(&mut self, ctx: &ReadContext<'_>, number: usize, line: &str) -> Result<(), MeshError> {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match word {
            // A fourth number is a weight or the first component of a color. Neither moves the point.
            "v" => self.v.push(floats(ctx, number, rest)?),
            "vn" => self.vn.push(floats(ctx, number, rest)?),
            // One number is a coordinate of a 1D texture.
            "vt" if rest.split_whitespace().count() == 1 => {
                let [u] = floats(ctx, number, rest)?;
                self.vt.push([u, 0.0]);
            }
            "vt" => self.vt.push(floats(ctx, number, rest)?),
            "f" => self.face(ctx, number, rest)?,
            "usemtl" => self.material = self.known.get(rest.trim()).copied(),
            "mtllib" => self.library(ctx, rest.trim())?,
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, ctx: &ReadContext<'_>, number: usize, rest: &str) -> Result<(), MeshError> {
        let mut corners = Vec::with_capacity(4);
        for word in rest.split_whitespace().take_while(|w| !w.starts_with('#')) {
            let mut fields = word.split('/');
            let mut next = || fields.next().filter(|f| !f.is_empty());
            let (v, vt, vn) = (next(), next(), next());
            let v = v.ok_or_else(|| ctx.invalid(format!("line {number}"), "face corner without a vertex index"))?;
            corners.push(Corner {
                position: look_up(ctx, number, v, &self.v, "v")?,
                uv: vt.map(|i| look_up(ctx, number, i, &self.vt, "vt")).transpose()?,
                normal: vn.map(|i| look_up(ctx, number, i, &self.vn, "vn")).transpose()?,
            });
        }
        // A line element has no area and is dropped, like a degenerate triangle.
        if corners.len() == 2 {
            return Ok(());
        }
        if corners.len() < 3 {
            let what = format!("face with {} corners; expected 3 or more", corners.len());
            return Err(ctx.invalid(format!("line {number}"), what));
        }
        let points: Vec<[f64; 3]> = corners.iter().map(|c| c.position.map(f64::from)).collect();
        for triangle in triangulate(&points) {
            self.builder.triangle(ctx, triangle.map(|i| corners[i]), self.material, || format!("line {number}"))?;
        }
        Ok(())
    }

    /// Reads the libraries of one `mtllib` line: the line is one file name if that file exists, else a list of names.
    /// Missing files are skipped.
    fn library(&mut self, ctx: &ReadContext<'_>, names: &str) -> Result<(), MeshError> {
        // `names` is either one name with spaces or several names.
        let candidates =
            if beside(ctx.path, names).is_file() { vec![names] } else { names.split_whitespace().collect() };
        for name in candidates {
            let path = beside(ctx.path, name);
            let is_new = std::fs::canonicalize(&path).is_ok_and(|file| self.libraries.insert(file));
            if !is_new {
                continue;
            }
            let Ok(bytes) = input_file::read_referenced(&path, MAX_TEXT) else { continue };
            for material in mtl::read(&path, ctx, &bytes)? {
                let name = material.name.clone();
                let id = self.builder.material(material);
                self.known.entry(name).or_insert(id);
            }
        }
        Ok(())
    }
}

fn floats<const N: usize>(ctx: &ReadContext<'_>, number: usize, rest: &str) -> Result<[f32; N], MeshError> {
    let mut words = rest.split_whitespace();
    let mut out = [0.0; N];
    for x in &mut out {
        let at = || format!("line {number}");
        let word = words.next().ok_or_else(|| ctx.invalid(at(), format!("expected {N} numbers")))?;
        *x = word.parse().map_err(|e| ctx.invalid_with_source(at(), format!("{word:?} is not a number"), e))?;
    }
    Ok(out)
}

/// Element at an OBJ index: counted from 1, or backwards from the newest element if negative. 0 and missing elements
/// are errors.
fn look_up<T: Copy>(ctx: &ReadContext<'_>, number: usize, word: &str, all: &[T], what: &str) -> Result<T, MeshError> {
    let at = || format!("line {number}, {what} index");
    let index: i64 =
        word.parse().map_err(|e| ctx.invalid_with_source(at(), format!("{word:?} is not a whole number"), e))?;
    let from_zero =
        if index > 0 { Some(index - 1) } else { (all.len() as i64).checked_add(index).filter(|_| index < 0) };
    let found = from_zero.and_then(|i| usize::try_from(i).ok()).and_then(|i| all.get(i));
    found.copied().ok_or_else(|| ctx.index(at(), index, all.len()))
}

#[cfg(test)]
#[path = "tests_obj.rs"]
mod tests;
