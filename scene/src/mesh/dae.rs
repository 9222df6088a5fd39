//! COLLADA reader for the subset that robot meshes use.
//!
//! Node transforms multiply in document order, parent before child. Curves and skinning weights are ignored. Polygons
//! with holes, `<lookat>` and `<skew>` are errors.

use std::borrow::Cow;
use std::collections::HashMap;
use std::rc::Rc;
use std::str::FromStr;

use roxmltree::{Document, Node};

use super::affine::{Affine, IDENTITY, PreparedAffine, product, rotation};
use super::builder::{Builder, Corner};
use super::dae_material::Binding;
use super::error::ReadContext;
use super::format::{Format, begins_with_word};
use super::polygon::triangulate;
use super::{DaeUpAxis, MeshError, TriMesh};

const MAX_DEPTH: usize = 64;
const MAX_NODES: usize = 100_000;

pub(super) struct Dae<'a, 'i> {
    pub(super) ctx: &'a ReadContext<'a>,
    pub(super) builder: Builder,
    /// Material handles by the id of `<material>`.
    pub(super) materials: HashMap<&'a str, Option<usize>>,
    ids: HashMap<&'a str, Node<'a, 'i>>,
    sources: HashMap<&'a str, Rc<Source>>,
    nodes_seen: usize,
}

/// Rows of numbers that an `<accessor>` describes.
struct Source {
    data: Vec<f64>,
    offset: usize,
    stride: usize,
    count: usize,
}

impl Source {
    fn get<const N: usize>(&self, index: usize) -> Option<[f64; N]> {
        let start = (index < self.count).then(|| index * self.stride + self.offset)?;
        self.data.get(start..start + N)?.try_into().ok()
    }
}

/// Origin of a corner's numbers: the column of `<p>` and the source.
struct Input {
    column: usize,
    source: Rc<Source>,
}

struct Inputs {
    position: Input,
    normal: Option<Input>,
    uv: Option<Input>,
    columns: usize,
}

/// The COLLADA format.
pub(super) const FORMAT: Format = Format {
    code: 2,
    extensions: &["dae"],
    is_one_file: true,
    is_certain: |_| false,
    likelihood: |bytes| if begins_with_word(bytes, b"<COLLADA") { 4 } else { 0 },
    read,
};

fn read(ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<TriMesh, MeshError> {
    let text = decoded(ctx, bytes)?;
    let document = Document::parse(&text).map_err(|e| {
        let pos = e.pos();
        ctx.invalid_with_source(format!("line {}, column {}", pos.row, pos.col), format!("not well-formed XML: {e}"), e)
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        let what = format!("root element is <{}>; expected <COLLADA>", root.tag_name().name());
        return Err(ctx.invalid("line 1", what));
    }
    let mut ids = HashMap::new();
    for node in document.descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    let mut dae = Dae {
        ctx,
        builder: Builder::default(),
        materials: HashMap::new(),
        ids,
        sources: HashMap::new(),
        nodes_seen: 0,
    };
    let world = dae.asset_transform(root)?;
    let scene = child(root, "scene").and_then(|s| child(s, "instance_visual_scene"));
    let scene = match scene {
        Some(instance) => Some(dae.target(instance, "url")?),
        None => child(root, "library_visual_scenes").and_then(|l| child(l, "visual_scene")),
    };
    match scene {
        Some(scene) => {
            for node in children(scene, "node") {
                dae.visit(node, &world, 0)?;
            }
        }
        // A file without a scene is a collection of geometries.
        None => {
            for library in children(root, "library_geometries") {
                for geometry in children(library, "geometry") {
                    dae.geometry(geometry, &world, &HashMap::new())?;
                }
            }
        }
    }
    dae.builder.finish(ctx)
}

fn decoded<'b>(ctx: &ReadContext<'_>, bytes: &'b [u8]) -> Result<Cow<'b, str>, MeshError> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(Cow::Borrowed(text)),
        Err(e) => {
            let head = String::from_utf8_lossy(&bytes[..bytes.len().min(100)]).to_ascii_lowercase();
            if head.contains("iso-8859-1") || head.contains("windows-1252") {
                return Ok(Cow::Owned(bytes.iter().map(|&b| char::from(b)).collect()));
            }
            let line = bytes[..e.valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
            Err(ctx.invalid_with_source(format!("line {line}"), "text is not UTF-8", e))
        }
    }
}

pub(super) fn children<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.tag_name().name() == name)
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

pub(super) fn line(node: Node<'_, '_>) -> String {
    format!("line {}, <{}>", node.document().text_pos_at(node.range().start).row, node.tag_name().name())
}

impl<'a, 'i> Dae<'a, 'i> {
    fn asset_transform(&self, root: Node<'a, 'i>) -> Result<Affine, MeshError> {
        let asset = child(root, "asset");
        let unit = match asset.and_then(|a| child(a, "unit")) {
            Some(node) => match node.attribute("meter").map(str::trim).map(f64::from_str) {
                None => 1.0,
                Some(Ok(meter)) if meter > 0.0 && meter.is_finite() => meter,
                Some(_) => return Err(self.ctx.invalid(line(node), "meter is not a positive number")),
            },
            None => 1.0,
        };
        let up = asset.and_then(|a| child(a, "up_axis")).and_then(|n| n.text()).map(str::trim);
        let turn = match (self.ctx.options.dae_up_axis, up) {
            (DaeUpAxis::Ignore, _) | (DaeUpAxis::Apply, Some("Z_UP")) => IDENTITY,
            (DaeUpAxis::Apply, Some("X_UP")) => [[0., -1., 0., 0.], [0., 0., -1., 0.], [1., 0., 0., 0.]],
            (DaeUpAxis::Apply, Some("Y_UP") | None) => [[1., 0., 0., 0.], [0., 0., -1., 0.], [0., 1., 0., 0.]],
            (DaeUpAxis::Apply, Some(other)) => {
                return Err(self.ctx.invalid("<up_axis>", format!("{other:?}; expected X_UP, Y_UP or Z_UP")));
            }
        };
        Ok(turn.map(|row| row.map(|x| x * unit)))
    }

    /// Element that a `#id` attribute of `node` refers to; an error if the attribute or the element is missing.
    pub(super) fn target(&self, node: Node<'a, 'i>, attribute: &str) -> Result<Node<'a, 'i>, MeshError> {
        let url = node
            .attribute(attribute)
            .ok_or_else(|| self.ctx.invalid(line(node), format!("no {attribute} attribute")))?;
        let Some(id) = url.trim().strip_prefix('#') else {
            return Err(self.ctx.unsupported(format!("{}: reference {url:?} into another document", line(node))));
        };
        self.by_id(id).ok_or_else(|| self.ctx.invalid(line(node), format!("no element of this file has the id {id:?}")))
    }

    pub(super) fn by_id(&self, id: &str) -> Option<Node<'a, 'i>> {
        self.ids.get(id).copied()
    }

    fn visit(&mut self, node: Node<'a, 'i>, parent: &Affine, depth: usize) -> Result<(), MeshError> {
        if depth > MAX_DEPTH {
            return Err(self.ctx.invalid(line(node), format!("nodes nest deeper than {MAX_DEPTH}, or in a cycle")));
        }
        self.nodes_seen += 1;
        if self.nodes_seen > MAX_NODES {
            return Err(self.ctx.too_large("nodes", MAX_NODES));
        }
        let mut here = *parent;
        for step in node.children().filter(Node::is_element) {
            if let Some(step) = self.element_transform(step)? {
                here = product(&here, &step);
            }
        }
        for part in node.children() {
            match part.tag_name().name() {
                "node" => self.visit(part, &here, depth + 1)?,
                "instance_node" => {
                    let target = self.target(part, "url")?;
                    self.visit(target, &here, depth + 1)?;
                }
                "instance_geometry" => {
                    let geometry = self.target(part, "url")?;
                    self.geometry(geometry, &here, &Binding::of_instance(part))?;
                }
                // The mesh of a skin, in its bind pose.
                "instance_controller" => {
                    let controller = self.target(part, "url")?;
                    if let Some(skin) = child(controller, "skin") {
                        let bind = child(skin, "bind_shape_matrix");
                        let bind = bind.map(|m| self.matrix(m)).transpose()?.unwrap_or(IDENTITY);
                        let geometry = self.target(skin, "source")?;
                        self.geometry(geometry, &product(&here, &bind), &Binding::of_instance(part))?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Transform of a child element of a node; `None` for an element that is not a transform. `lookat` and `skew` are
    /// errors.
    fn element_transform(&self, node: Node<'a, 'i>) -> Result<Option<Affine>, MeshError> {
        Ok(Some(match node.tag_name().name() {
            "matrix" => self.matrix(node)?,
            "translate" => {
                let [x, y, z] = self.exactly(node)?;
                [[1., 0., 0., x], [0., 1., 0., y], [0., 0., 1., z]]
            }
            "scale" => {
                let [x, y, z] = self.exactly(node)?;
                [[x, 0., 0., 0.], [0., y, 0., 0.], [0., 0., z, 0.]]
            }
            "rotate" => {
                let [x, y, z, degrees] = self.exactly(node)?;
                let length = (x * x + y * y + z * z).sqrt();
                if length > 0.0 {
                    rotation([x / length, y / length, z / length], degrees.to_radians())
                } else {
                    IDENTITY
                }
            }
            name @ ("lookat" | "skew") => {
                return Err(self.ctx.unsupported(format!("{}: the transform <{name}>", line(node))));
            }
            _ => return Ok(None),
        }))
    }

    fn matrix(&self, node: Node<'a, 'i>) -> Result<Affine, MeshError> {
        let m: [f64; 16] = self.exactly(node)?;
        Ok([[m[0], m[1], m[2], m[3]], [m[4], m[5], m[6], m[7]], [m[8], m[9], m[10], m[11]]])
    }

    pub(super) fn exactly<const N: usize>(&self, node: Node<'a, 'i>) -> Result<[f64; N], MeshError> {
        let numbers: Vec<f64> = self.numbers(node)?;
        let found = numbers.len();
        numbers.try_into().map_err(|_| self.ctx.invalid(line(node), format!("{found} numbers; expected {N}")))
    }

    fn numbers<T: FromStr>(&self, node: Node<'a, 'i>) -> Result<Vec<T>, MeshError>
    where
        T::Err: std::error::Error + Send + Sync + 'static,
    {
        // Comments may separate the numbers.
        let texts = node.children().filter(Node::is_text).filter_map(|t| t.text());
        let mut out = Vec::with_capacity(node.range().len() / 8);
        for word in texts.flat_map(str::split_ascii_whitespace) {
            let shown = || word.chars().take(32).collect::<String>();
            out.push(
                word.parse().map_err(|e| {
                    self.ctx.invalid_with_source(line(node), format!("{:?} is not a number", shown()), e)
                })?,
            );
        }
        Ok(out)
    }

    fn source(&mut self, node: Node<'a, 'i>) -> Result<Rc<Source>, MeshError> {
        let id = node.attribute("id").unwrap_or_default();
        if let Some(source) = self.sources.get(id) {
            return Ok(Rc::clone(source));
        }
        let accessor = child(node, "technique_common").and_then(|t| child(t, "accessor"));
        let array = match accessor {
            Some(accessor) => self.target(accessor, "source")?,
            None => child(node, "float_array")
                .ok_or_else(|| self.ctx.invalid(line(node), "neither <accessor> nor <float_array>"))?,
        };
        let attribute = |name: &str, default: usize| match accessor.and_then(|a| a.attribute(name)) {
            Some(text) => text.trim().parse::<u32>().map(|n| n as usize).map_err(|e| {
                self.ctx.invalid_with_source(
                    line(node),
                    format!("{name}={text:?} of the accessor is not a whole number"),
                    e,
                )
            }),
            None => Ok(default),
        };
        let (offset, stride) = (attribute("offset", 0)?, attribute("stride", if accessor.is_some() { 1 } else { 3 })?);
        let data: Vec<f64> = self.numbers(array)?;
        if stride == 0 {
            return Err(self.ctx.invalid(line(node), "accessor with stride 0"));
        }
        let there = data.len().saturating_sub(offset).div_ceil(stride);
        let count = attribute("count", there)?;
        if count > there {
            let what = format!("accessor of {count} rows of {stride}, but the array has {} numbers", data.len());
            return Err(self.ctx.invalid(line(node), what));
        }
        let source = Rc::new(Source { data, offset, stride, count });
        self.sources.insert(id, Rc::clone(&source));
        Ok(source)
    }

    fn inputs(&mut self, primitive: Node<'a, 'i>, uv_set: Option<u32>) -> Result<Inputs, MeshError> {
        let (mut position, mut normal) = (None, None);
        // Texture coordinates in order of preference: the requested set, set 0, the first set.
        let mut uvs: Vec<(u32, Input)> = Vec::new();
        let mut columns = 0;
        for input in children(primitive, "input") {
            let number = |name: &str| {
                let text = input.attribute(name).unwrap_or("0");
                let number = text.trim().parse::<u32>();
                number.map_err(|e| {
                    self.ctx.invalid_with_source(line(input), format!("{name}={text:?} is not a whole number"), e)
                })
            };
            let (column, set) = (number("offset")? as usize, number("set")?);
            columns = columns.max(column + 1);
            let target = self.target(input, "source")?;
            let inner: Vec<_> = match input.attribute("semantic") {
                Some("VERTEX") => children(target, "input").collect(),
                _ => vec![input],
            };
            for input in inner {
                let semantic = input.attribute("semantic").unwrap_or_default();
                if !matches!(semantic, "POSITION" | "NORMAL" | "TEXCOORD") {
                    continue;
                }
                let source = self.target(input, "source")?;
                let input = Input { column, source: self.source(source)? };
                match semantic {
                    "POSITION" => position = Some(input),
                    "NORMAL" => normal = Some(input),
                    _ => uvs.push((set, input)),
                }
            }
        }
        let position = position.ok_or_else(|| self.ctx.invalid(line(primitive), "no input POSITION"))?;
        let has = |set| uvs.iter().position(|(s, _)| *s == set);
        let pick = uv_set.and_then(has).or_else(|| has(0)).unwrap_or(0);
        let uv = (pick < uvs.len()).then(|| uvs.swap_remove(pick).1);
        Ok(Inputs { position, normal, uv, columns })
    }

    fn geometry(
        &mut self,
        geometry: Node<'a, 'i>,
        to_world: &Affine,
        bindings: &HashMap<&'a str, Binding<'a, 'i>>,
    ) -> Result<(), MeshError> {
        let Some(mesh) = child(geometry, "mesh") else { return Ok(()) };
        let place = PreparedAffine::new(to_world);
        for primitive in mesh.children() {
            let kind = primitive.tag_name().name();
            if !matches!(kind, "triangles" | "polylist" | "polygons" | "tristrips" | "trifans") {
                continue;
            }
            let (material, uv_set) = self.material_of(primitive, bindings)?;
            let inputs = self.inputs(primitive, uv_set)?;
            let columns = inputs.columns;
            if child(primitive, "ph").is_some() {
                return Err(self.ctx.unsupported(format!("{}: a polygon with holes <ph>", line(primitive))));
            }
            let mut counts: Vec<u32> = Vec::new();
            if let Some(vcount) = child(primitive, "vcount") {
                counts = self.numbers(vcount)?;
            }
            for p in children(primitive, "p") {
                let p: Vec<u32> = self.numbers(p)?;
                if !p.len().is_multiple_of(columns) {
                    let what = format!("{} indices in <p>; expected a multiple of {columns}", p.len());
                    return Err(self.ctx.invalid(line(primitive), what));
                }
                let corners: Vec<_> = p
                    .chunks_exact(columns)
                    .map(|row| self.corner(primitive, &inputs, row, &place))
                    .collect::<Result<_, _>>()?;
                let n = corners.len();
                let mut faces: Vec<[usize; 3]> = Vec::with_capacity(n);
                match kind {
                    "triangles" if !n.is_multiple_of(3) => {
                        let what = format!("{n} corners in <p>; expected a multiple of 3");
                        return Err(self.ctx.invalid(line(primitive), what));
                    }
                    "triangles" => faces.extend((0..n / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2])),
                    "tristrips" => {
                        faces.extend((2..n).map(|i| if i % 2 == 0 { [i - 2, i - 1, i] } else { [i - 1, i - 2, i] }));
                    }
                    "trifans" => faces.extend((2..n).map(|i| [0, i - 1, i])),
                    "polygons" => polygon(&corners, 0..n, &mut faces),
                    _ => {
                        let mut start = 0usize;
                        for &count in &counts {
                            let end = start.saturating_add(count as usize);
                            if end > n {
                                break;
                            }
                            polygon(&corners, start..end, &mut faces);
                            start = end;
                        }
                        let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
                        if total != n as u64 {
                            let what = format!("<vcount> sums to {total} corners, <p> has {n}");
                            return Err(self.ctx.invalid(line(primitive), what));
                        }
                    }
                }
                for mut face in faces {
                    if place.mirrored {
                        face.swap(1, 2);
                    }
                    self.builder.triangle(self.ctx, face.map(|i| corners[i].1), material, || line(primitive))?;
                }
            }
        }
        Ok(())
    }

    /// Corner of one row of `<p>`: its position before rounding, and the corner for the mesh.
    fn corner(
        &self,
        primitive: Node<'a, 'i>,
        inputs: &Inputs,
        row: &[u32],
        place: &PreparedAffine,
    ) -> Result<([f64; 3], Corner), MeshError> {
        let bad = |input: &Input, what: &str| {
            let at = format!("{}, {what} index", line(primitive));
            self.ctx.index(at, i64::from(row[input.column]), input.source.count)
        };
        let position = inputs.position.source.get::<3>(row[inputs.position.column] as usize);
        let position = position.ok_or_else(|| bad(&inputs.position, "POSITION"))?;
        let position = place.point(position);
        let normal = match &inputs.normal {
            Some(input) => {
                let normal = input.source.get::<3>(row[input.column] as usize);
                place.normal(normal.ok_or_else(|| bad(input, "NORMAL"))?)
            }
            None => None,
        };
        let uv = match &inputs.uv {
            Some(input) => {
                let uv = input.source.get::<2>(row[input.column] as usize);
                Some(uv.ok_or_else(|| bad(input, "TEXCOORD"))?.map(|x| x as f32))
            }
            None => None,
        };
        Ok((position, Corner { position: position.map(|x| x as f32), normal, uv }))
    }
}

fn polygon(corners: &[([f64; 3], Corner)], range: std::ops::Range<usize>, faces: &mut Vec<[usize; 3]>) {
    let start = range.start;
    if range.len() == 3 {
        faces.push([start, start + 1, start + 2]);
        return;
    }
    let points: Vec<[f64; 3]> = corners[range].iter().map(|c| c.0).collect();
    faces.extend(triangulate(&points).into_iter().map(|t| t.map(|i| i + start)));
}

#[cfg(test)]
#[path = "tests_dae.rs"]
pub(super) mod tests;
