//! Binary data of glTF: buffers, buffer views, accessors. Every offset is checked before its use.

use std::borrow::Cow;

use serde_json::Value;

use super::MeshError;
use super::error::{ReadContext, percent_decoded};
use super::load::read;

/// A glTF file that is read: its JSON and its buffers.
pub(super) struct Gltf<'a> {
    pub(super) ctx: &'a ReadContext<'a>,
    pub(super) json: &'a Value,
    /// Buffers by index, read when first needed.
    buffers: Vec<Option<Cow<'a, [u8]>>>,
    bin: Option<&'a [u8]>,
}

/// Location and element type of an accessor's bytes.
struct Layout {
    buffer: usize,
    start: usize,
    stride: usize,
    count: usize,
    component: u64,
    normalized: bool,
}

/// Array element by name and index; `None` if either is missing.
pub(super) fn item<'j>(json: &'j Value, array: &str, index: usize) -> Option<&'j Value> {
    json.get(array)?.as_array()?.get(index)
}

pub(super) fn len(json: &Value, array: &str) -> usize {
    json.get(array).and_then(Value::as_array).map_or(0, Vec::len)
}

impl<'a> Gltf<'a> {
    pub(super) fn new(ctx: &'a ReadContext<'a>, json: &'a Value, bin: Option<&'a [u8]>) -> Self {
        let buffers = (0..len(json, "buffers")).map(|_| None).collect();
        Self { ctx, json, buffers, bin }
    }

    /// Returns the whole number `key` of `value`; an error if it is missing. `at` names the element in errors.
    pub(super) fn number(&self, value: &Value, key: &str, at: &str) -> Result<usize, MeshError> {
        self.optional(value, key, at)?.ok_or_else(|| self.ctx.invalid(at, format!("{key:?} is missing")))
    }

    /// An optional whole number, `None` if the key is missing. Any other value is an error.
    pub(super) fn optional(&self, value: &Value, key: &str, at: &str) -> Result<Option<usize>, MeshError> {
        let Some(found) = value.get(key) else { return Ok(None) };
        let number = found.as_u64().and_then(|n| usize::try_from(n).ok());
        number.map(Some).ok_or_else(|| self.ctx.invalid(at, format!("{key:?} is not a whole number")))
    }

    /// Element of a top-level array of the document that an index refers to; an error if it is missing.
    pub(super) fn element_at(&self, array: &str, index: usize, at: &str) -> Result<&'a Value, MeshError> {
        let found = item(self.json, array, index);
        found.ok_or_else(|| self.ctx.index(format!("{at}, index into {array}"), index as i64, len(self.json, array)))
    }

    fn load_buffer(&mut self, index: usize, at: &str) -> Result<(), MeshError> {
        let buffer = self.element_at("buffers", index, at)?;
        if self.buffers[index].is_some() {
            return Ok(());
        }
        let name = format!("buffer {index}");
        let expected = self.number(buffer, "byteLength", &name)?;
        let bytes: Cow<'a, [u8]> = match (buffer.get("uri").and_then(Value::as_str), self.bin) {
            (Some(uri), _) => Cow::Owned(self.uri_bytes(uri, &name)?),
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            (None, _) => return Err(self.ctx.invalid(name, "\"uri\" is missing, and the file has no binary chunk")),
        };
        if bytes.len() < expected {
            return Err(self.ctx.truncated(name, expected as u64, bytes.len() as u64));
        }
        self.buffers[index] = Some(bytes);
        Ok(())
    }

    /// Bytes of a `data:` URI, or of a file beside this one.
    fn uri_bytes(&self, uri: &str, at: &str) -> Result<Vec<u8>, MeshError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let text = data.split_once(";base64,").map(|(_, text)| text);
            return text
                .and_then(base64)
                .ok_or_else(|| self.ctx.invalid(at, "the data: URI is not valid base64 after \";base64,\""));
        }
        read(&self.ctx.beside(&percent_decoded(uri)))
    }

    /// Bytes of a buffer view (an embedded image).
    pub(super) fn view(&mut self, index: usize, at: &str) -> Result<Vec<u8>, MeshError> {
        let (buffer, start, length, _) = self.view_range(index, at)?;
        Ok(self.bytes(buffer)[start..start + length].to_vec())
    }

    /// Bytes of a `data:` URI; `None` for other URIs.
    pub(super) fn embedded(&self, uri: &str, at: &str) -> Result<Option<Vec<u8>>, MeshError> {
        if uri.starts_with("data:") { self.uri_bytes(uri, at).map(Some) } else { Ok(None) }
    }

    fn bytes(&self, buffer: usize) -> &[u8] {
        self.buffers.get(buffer).and_then(|b| b.as_deref()).unwrap_or_default()
    }

    /// Buffer, start, length and stride of a view, checked against its buffer.
    fn view_range(&mut self, index: usize, at: &str) -> Result<(usize, usize, usize, Option<usize>), MeshError> {
        let view = self.element_at("bufferViews", index, at)?;
        let name = format!("bufferView {index}");
        let buffer = self.number(view, "buffer", &name)?;
        self.load_buffer(buffer, &name)?;
        let start = self.optional(view, "byteOffset", &name)?.unwrap_or(0);
        let length = self.number(view, "byteLength", &name)?;
        let there = self.bytes(buffer).len();
        match start.checked_add(length) {
            Some(end) if end <= there => Ok((buffer, start, length, self.optional(view, "byteStride", &name)?)),
            _ => Err(self.ctx.truncated(name, start.saturating_add(length) as u64, there as u64)),
        }
    }

    fn layout(&mut self, index: usize, kind: &str, at: &str) -> Result<Layout, MeshError> {
        let accessor = self.element_at("accessors", index, at)?;
        let name = format!("accessor {index}");
        if accessor.get("sparse").is_some() {
            return Err(self.ctx.unsupported(format!("{name}: a sparse accessor")));
        }
        let found = accessor.get("type").and_then(Value::as_str).unwrap_or_default();
        if found != kind {
            return Err(self.ctx.invalid(name, format!("type {found:?}; expected {kind:?}")));
        }
        let components = match kind {
            "VEC3" => 3,
            "VEC2" => 2,
            _ => 1,
        };
        let component = self.number(accessor, "componentType", &name)? as u64;
        let size = match component {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            other => {
                let what = format!("componentType {other}; expected one of 5120, 5121, 5122, 5123, 5125, 5126");
                return Err(self.ctx.invalid(name, what));
            }
        };
        let count = self.number(accessor, "count", &name)?;
        let offset = self.optional(accessor, "byteOffset", &name)?.unwrap_or(0);
        let view = self.number(accessor, "bufferView", &name)?;
        let (buffer, view_start, length, stride) = self.view_range(view, &name)?;
        let element = size * components;
        let stride = stride.unwrap_or(element);
        if stride < element {
            return Err(self
                .ctx
                .invalid(name, format!("byteStride {stride} is less than the element, {element} bytes")));
        }
        let needed = match count {
            0 => Some(0),
            n => (n - 1).checked_mul(stride).and_then(|x| x.checked_add(element)).and_then(|x| x.checked_add(offset)),
        };
        match needed {
            Some(needed) if needed <= length => {
                let normalized = accessor.get("normalized").and_then(Value::as_bool).unwrap_or(false);
                Ok(Layout { buffer, start: view_start + offset, stride, count, component, normalized })
            }
            _ => Err(self.ctx.truncated(name, needed.unwrap_or(usize::MAX) as u64, length as u64)),
        }
    }

    /// Reads an accessor of `VEC2` or `VEC3`. Integers that are marked normalized are divided by their largest value,
    /// so they are 0..=1 or -1..=1.
    pub(super) fn vectors<const N: usize>(&mut self, index: usize, at: &str) -> Result<Vec<[f64; N]>, MeshError> {
        let layout = self.layout(index, if N == 3 { "VEC3" } else { "VEC2" }, at)?;
        let bytes = self.bytes(layout.buffer);
        let size = component_size(layout.component);
        let row = |i: usize| {
            let start = layout.start + i * layout.stride;
            std::array::from_fn(|k| component(&bytes[start + k * size..][..size], layout.component, layout.normalized))
        };
        Ok((0..layout.count).map(row).collect())
    }

    /// Reads an accessor of vertex indices.
    pub(super) fn indices(&mut self, index: usize, at: &str) -> Result<Vec<u32>, MeshError> {
        let layout = self.layout(index, "SCALAR", at)?;
        if !matches!(layout.component, 5121 | 5123 | 5125) {
            let what = format!("componentType {} of indices; expected 5121, 5123 or 5125", layout.component);
            return Err(self.ctx.invalid(format!("accessor {index}"), what));
        }
        let bytes = self.bytes(layout.buffer);
        let size = component_size(layout.component);
        let one = |i: usize| bytes[layout.start + i * layout.stride..][..size].iter().rev();
        Ok((0..layout.count).map(|i| one(i).fold(0u32, |n, &b| n << 8 | u32::from(b))).collect())
    }
}

fn component_size(component: u64) -> usize {
    match component {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        _ => 4,
    }
}

fn component(b: &[u8], component: u64, normalized: bool) -> f64 {
    let (value, largest) = match component {
        5120 => (f64::from(i8::from_le_bytes([b[0]])), 127.0),
        5121 => (f64::from(b[0]), 255.0),
        5122 => (f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
        5123 => (f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
        5125 => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), 4_294_967_295.0),
        _ => return f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}

/// Decodes standard base64 up to the padding, if any; white space is skipped. `None` for other characters.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for b in text.bytes().filter(|b| !b.is_ascii_whitespace()) {
        let six = match b {
            b'A'..=b'Z' => b - b'A',
            b'a'..=b'z' => b - b'a' + 26,
            b'0'..=b'9' => b - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => break,
            _ => return None,
        };
        bits = bits << 6 | u32::from(six);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_vectors() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9v\nYmFy", "foobar")] {
            assert_eq!(base64(text).as_deref(), Some(bytes.as_bytes()));
        }
        assert_eq!(base64("Zm9*"), None);
    }
}
