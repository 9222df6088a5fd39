//! Reading of messages of any type that a file describes: their numbers, by name.

use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest depth of nested types. A deeper nesting is a cycle.
const MAX_DEPTH: usize = 12;

/// A message type.
#[derive(Clone, Debug)]
pub(crate) struct MessageType {
    /// Fields by type name. The name of the message type itself is empty.
    types: BTreeMap<String, Vec<Field>>,
}

#[derive(Clone, Debug)]
struct Field {
    name: Arc<str>,
    kind: FieldType,
    many: Multiplicity,
}

#[derive(Clone, Debug, PartialEq)]
enum FieldType {
    Number(Primitive),
    Text,
    Other(String),
}

/// Primitive number types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Primitive {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// Multiplicity of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Multiplicity {
    One,
    Fixed(usize),
    List,
}

/// A value in a message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Number(f64),
    Numbers(Vec<f64>),
    Text(String),
    Texts(Vec<String>),
    /// Array of bytes or booleans, such as the data of an image, which is not read as numbers.
    Bytes,
    Struct(Vec<(Arc<str>, Value)>),
    List(Vec<Value>),
}

impl Primitive {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "bool" => Self::Bool,
            "int8" => Self::I8,
            "byte" | "char" | "uint8" => Self::U8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl MessageType {
    /// Parses a ROS message definition (`ros2msg`): fields, then those of nested types after a line of `=`. `None` for
    /// an invalid definition.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let mut types = BTreeMap::new();
        let mut name = String::new();
        let mut fields = Vec::new();
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if let Some(other) = line.strip_prefix("MSG:") {
                types.insert(std::mem::replace(&mut name, short_type_name(other.trim())), std::mem::take(&mut fields));
            } else if !line.is_empty() && !line.starts_with("==") && !is_constant(line) {
                fields.push(Field::parse(line)?);
            }
        }
        types.insert(name, fields);
        Some(Self { types })
    }

    /// Reads a message in little-endian CDR; `None` if it does not match the type.
    pub(crate) fn read(&self, message: &[u8]) -> Option<Value> {
        // Encoding and options, as every ROS 2 writes them on present machines.
        let ([0, 1, _, _], rest) = message.split_first_chunk::<4>()? else { return None };
        let mut bytes = CdrReader { all: rest, at: 0 };
        self.read_struct(&mut bytes, self.types.get("")?, 0)
    }

    fn read_struct(&self, bytes: &mut CdrReader<'_>, fields: &[Field], depth: usize) -> Option<Value> {
        if depth > MAX_DEPTH {
            return None;
        }
        let mut values = Vec::with_capacity(fields.len());
        for field in fields {
            values.push((Arc::clone(&field.name), self.read_value(bytes, field, depth)?));
        }
        Some(Value::Struct(values))
    }

    fn read_value(&self, bytes: &mut CdrReader<'_>, field: &Field, depth: usize) -> Option<Value> {
        let count = match field.many {
            Multiplicity::One => None,
            Multiplicity::Fixed(count) => Some(count),
            Multiplicity::List => Some(bytes.count()?),
        };
        // Each element takes at least one byte, which is checked below for nested types. Thus no message can request
        // more memory than its own size.
        if count.is_some_and(|count| count > bytes.left()) {
            return None;
        }
        match (&field.kind, count) {
            (FieldType::Number(number), None) => bytes.number(*number).map(Value::Number),
            (FieldType::Number(number), Some(count)) if number.size() == 1 => bytes.skip(count).map(|()| Value::Bytes),
            (FieldType::Number(number), Some(count)) => {
                (0..count).map(|_| bytes.number(*number)).collect::<Option<_>>().map(Value::Numbers)
            }
            (FieldType::Text, None) => bytes.text().map(Value::Text),
            (FieldType::Text, Some(count)) => (0..count).map(|_| bytes.text()).collect::<Option<_>>().map(Value::Texts),
            (FieldType::Other(name), count) => {
                let fields = self.fields_of(name)?;
                // Rejects a type without bytes, of which a message could have any number.
                let mut each = || {
                    let begin = bytes.at;
                    self.read_struct(bytes, fields, depth + 1).filter(|_| bytes.at > begin)
                };
                match count {
                    None => each(),
                    Some(count) => (0..count).map(|_| each()).collect::<Option<_>>().map(Value::List),
                }
            }
        }
    }

    /// Fields of a type, whose name may lack its package; `None` for an unknown type.
    fn fields_of(&self, name: &str) -> Option<&[Field]> {
        let name = short_type_name(name);
        let own = self.types.get(&name).or_else(|| {
            let end = format!("/{name}");
            self.types.iter().find(|(known, _)| known.ends_with(&end)).map(|(_, fields)| fields)
        });
        own.map(Vec::as_slice)
    }
}

/// Shortens `package/msg/Type` to `package/Type`.
fn short_type_name(name: &str) -> String {
    name.replace("/msg/", "/")
}

/// True for a constant such as `uint8 FLOAT32=7`, which is no field.
fn is_constant(line: &str) -> bool {
    line.split_once(char::is_whitespace)
        .is_some_and(|(_, rest)| rest.split(['"', '\'']).next().is_some_and(|rest| rest.contains('=')))
}

impl Field {
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split_whitespace();
        let (kind, name) = (words.next()?, words.next()?);
        let (kind, many) = match kind.split_once('[') {
            None => (kind, Multiplicity::One),
            Some((kind, count)) => {
                let count = count.strip_suffix(']')?;
                let bounded = count.is_empty() || count.starts_with("<=");
                (kind, if bounded { Multiplicity::List } else { Multiplicity::Fixed(count.parse().ok()?) })
            }
        };
        // A string may have a maximum length.
        let word = kind.split("<=").next()?;
        let kind = match Primitive::of(word) {
            Some(number) => FieldType::Number(number),
            None if word == "string" => FieldType::Text,
            None => FieldType::Other(word.into()),
        };
        Some(Self { name: name.into(), kind, many })
    }
}

/// The bytes after the header, and the reading position.
struct CdrReader<'b> {
    all: &'b [u8],
    at: usize,
}

impl CdrReader<'_> {
    fn left(&self) -> usize {
        self.all.len() - self.at.min(self.all.len())
    }

    fn skip(&mut self, count: usize) -> Option<()> {
        self.at = self.at.checked_add(count).filter(|at| *at <= self.all.len())?;
        Some(())
    }

    /// Reads bytes at the next multiple of their count; `None` at the end of the data.
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let at = self.at.checked_next_multiple_of(N)?;
        let array = *self.all.get(at..)?.first_chunk::<N>()?;
        self.at = at + N;
        Some(array)
    }

    fn number(&mut self, kind: Primitive) -> Option<f64> {
        Some(match kind {
            Primitive::Bool | Primitive::U8 => f64::from(u8::from_le_bytes(self.array()?)),
            Primitive::I8 => f64::from(i8::from_le_bytes(self.array()?)),
            Primitive::I16 => f64::from(i16::from_le_bytes(self.array()?)),
            Primitive::U16 => f64::from(u16::from_le_bytes(self.array()?)),
            Primitive::I32 => f64::from(i32::from_le_bytes(self.array()?)),
            Primitive::U32 => f64::from(u32::from_le_bytes(self.array()?)),
            Primitive::I64 => i64::from_le_bytes(self.array()?) as f64,
            Primitive::U64 => u64::from_le_bytes(self.array()?) as f64,
            Primitive::F32 => f64::from(f32::from_le_bytes(self.array()?)),
            Primitive::F64 => f64::from_le_bytes(self.array()?),
        })
    }

    fn count(&mut self) -> Option<usize> {
        usize::try_from(u32::from_le_bytes(self.array()?)).ok()
    }

    /// Reads a string; `None` for invalid data. Its count includes the terminating zero.
    fn text(&mut self) -> Option<String> {
        let count = self.count()?;
        let bytes = self.all.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(String::from_utf8_lossy(bytes.strip_suffix(&[0]).unwrap_or(bytes)).into_owned())
    }
}

impl Value {
    pub(crate) fn field(&self, name: &str) -> Option<&Self> {
        let Self::Struct(fields) = self else { return None };
        fields.iter().find(|(known, _)| **known == *name).map(|(_, value)| value)
    }

    /// Name of an element in a list of structures: its `child_frame_id` or `name`; `None` without one.
    fn element_name(&self) -> Option<&str> {
        let named = self.field("child_frame_id").or_else(|| self.field("name"))?;
        if let Self::Text(name) = named { Some(name) } else { None }
    }

    fn sibling_names(&self, count: usize) -> Option<&[String]> {
        match self.field("name") {
            Some(Self::Texts(names)) if names.len() == count => Some(names),
            _ => None,
        }
    }

    /// Appends the names of all numbers, such as `position[J1]` or `orientation.w`.
    pub(crate) fn fields(&self, before: &str, out: &mut Vec<String>) {
        let Self::Struct(fields) = self else { return };
        for (name, value) in fields {
            let name = if before.is_empty() { name.to_string() } else { format!("{before}.{name}") };
            match value {
                Self::Number(_) => out.push(name),
                Self::Numbers(numbers) => match self.sibling_names(numbers.len()) {
                    Some(names) => out.extend(names.iter().map(|of| format!("{name}[{of}]"))),
                    None => out.extend((0..numbers.len()).map(|k| format!("{name}[{k}]"))),
                },
                Self::Struct(_) => value.fields(&name, out),
                Self::List(values) => {
                    for (k, value) in values.iter().enumerate() {
                        let of = value.element_name().map_or_else(|| k.to_string(), String::from);
                        value.fields(&format!("{name}[{of}]"), out);
                    }
                }
                Self::Text(_) | Self::Texts(_) | Self::Bytes => {}
            }
        }
    }

    /// True if [`fields`](Self::fields) of both messages, of one type, are equal: lengths of arrays and names of elements.
    pub(crate) fn has_fields_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Struct(fields), Self::Struct(others)) => {
                fields.len() == others.len()
                    && fields.iter().zip(others).all(|((name, value), (other_name, other_value))| {
                        name == other_name
                            && match (value, other_value) {
                                (Self::Numbers(a), Self::Numbers(b)) => {
                                    a.len() == b.len() && self.sibling_names(a.len()) == other.sibling_names(b.len())
                                }
                                _ => value.has_fields_of(other_value),
                            }
                    })
            }
            (Self::List(values), Self::List(others)) => {
                values.len() == others.len()
                    && values
                        .iter()
                        .zip(others)
                        .all(|(a, b)| a.element_name() == b.element_name() && a.has_fields_of(b))
            }
            _ => std::mem::discriminant(self) == std::mem::discriminant(other),
        }
    }

    /// The number at a path of [`fields`](Self::fields); `None` if this message does not contain it.
    pub(crate) fn number(&self, path: &[PathSegment]) -> Option<f64> {
        let (first, rest) = path.split_first()?;
        let value = self.field(&first.name)?;
        let Some(key) = &first.key else {
            return match value {
                Self::Number(number) if rest.is_empty() => Some(*number),
                other => other.number(rest),
            };
        };
        let index = |count: usize| key.parse::<usize>().ok().filter(|index| *index < count);
        match value {
            Self::Numbers(numbers) if rest.is_empty() => {
                let place = match self.sibling_names(numbers.len()) {
                    Some(names) => names.iter().position(|name| name == key),
                    None => index(numbers.len()),
                };
                numbers.get(place?).copied()
            }
            Self::List(values) => {
                let named = values.iter().find(|value| value.element_name() == Some(key));
                named
                    .or_else(|| values.get(index(values.len())?).filter(|value| value.element_name().is_none()))?
                    .number(rest)
            }
            _ => None,
        }
    }
}

/// Component of a field path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PathSegment {
    name: String,
    /// Content of the brackets after the name; `None` without brackets.
    key: Option<String>,
}

impl PathSegment {
    /// Splits a path such as `transforms[env_0/arm/link].transform.translation.x`. Brackets may contain dots.
    pub(crate) fn parse_path(field: &str) -> Vec<Self> {
        let (mut steps, mut depth, mut from) = (Vec::new(), 0_usize, 0);
        let mut push = |text: &str| {
            let key = text.split_once('[').and_then(|(name, key)| Some((name, key.strip_suffix(']')?)));
            steps.push(match key {
                Some((name, key)) => Self { name: name.into(), key: Some(key.into()) },
                None => Self { name: text.into(), key: None },
            });
        };
        for (at, letter) in field.char_indices() {
            match letter {
                '[' => depth += 1,
                ']' => depth = depth.saturating_sub(1),
                '.' if depth == 0 => {
                    push(&field[from..at]);
                    from = at + 1;
                }
                _ => {}
            }
        }
        push(&field[from..]);
        steps
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::{
        CdrWriter, RayHits, RosHeader, Schema, float64_multi_array, imu, joint_state, point_cloud, transforms,
    };
    use super::*;

    const STAMP: RosHeader<'_> = RosHeader { nanos: 1_500_000_000, frame: "env_0" };

    fn read(schema: Schema, write: impl FnOnce(&mut CdrWriter)) -> Value {
        let mut cdr = CdrWriter::default();
        cdr.begin();
        write(&mut cdr);
        MessageType::parse(&schema.text()).unwrap().read(cdr.bytes()).unwrap()
    }

    fn number(value: &Value, field: &str) -> Option<f64> {
        value.number(&PathSegment::parse_path(field))
    }

    #[test]
    fn names() {
        let names = ["J1".to_string(), "J.2".to_string()];
        let joints = read(Schema::JointState, |cdr| joint_state(cdr, STAMP, &names, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        let mut fields = Vec::new();
        joints.fields("", &mut fields);
        let expected = "header.stamp.sec header.stamp.nanosec position[J1] position[J.2] velocity[J1] velocity[J.2] \
                        effort[J1] effort[J.2]";
        assert_eq!(fields.join(" "), expected);
        let of =
            |names: &[String], state: &[f64]| read(Schema::JointState, |cdr| joint_state(cdr, STAMP, names, state));
        let other_names = ["J1".to_string(), "J3".to_string()];
        assert!(joints.has_fields_of(&of(&names, &[0.0; 6])) && !joints.has_fields_of(&of(&names[..1], &[0.0; 3])));
        assert!(!joints.has_fields_of(&of(&other_names, &[0.0; 6])));
        let values = fields.iter().map(|field| number(&joints, field).unwrap()).collect::<Vec<_>>();
        assert_eq!(values, [1.0, 500_000_000.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let unknown = "position[J3] position position[0] header header.stamp x.y[ header.stamp.sec.x";
        for unknown in unknown.split(' ').chain([""]) {
            assert_eq!(number(&joints, unknown), None, "{unknown}");
        }
    }

    #[test]
    fn structures() {
        let frames = ["a".to_string(), "b/c".to_string()];
        let poses: Vec<f64> = (0..14).map(f64::from).collect();
        let value = read(Schema::TfMessage, |cdr| transforms(cdr, STAMP, "env_0/", &frames, &poses));
        let renamed = ["a".to_string(), "c".to_string()];
        let other = read(Schema::TfMessage, |cdr| transforms(cdr, STAMP, "env_0/", &renamed, &poses));
        assert!(value.has_fields_of(&value.clone()) && !value.has_fields_of(&other));
        assert_eq!(number(&value, "transforms[env_0/b/c].transform.translation.y"), Some(8.0));
        // ROS has w last.
        assert_eq!(number(&value, "transforms[env_0/a].transform.rotation.w"), Some(3.0));
        assert_eq!(number(&value, "transforms[0].transform.rotation.w"), None);
    }

    #[test]
    fn lists() {
        let value = read(Schema::Imu, |cdr| imu(cdr, STAMP, &[0.1, 0.2, 0.3, 0.4], &[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0]));
        assert_eq!(number(&value, "linear_acceleration.z"), Some(6.0));
        assert_eq!(number(&value, "orientation_covariance[8]"), Some(0.0));
        assert_eq!(number(&value, "orientation_covariance[9]"), None);
        let value =
            read(Schema::Float64MultiArray, |cdr| float64_multi_array(cdr, "forces", &[2, 2], &[1.0, 2.0, 3.0, 4.0]));
        assert_eq!(number(&value, "data[3]"), Some(4.0));
        assert_eq!(number(&value, "layout.dim[1].size"), Some(2.0));
        // One of two rays hit a surface.
        let hits = RayHits {
            points: &[1.0, 2.0, 3.0, f64::INFINITY, f64::INFINITY, f64::INFINITY],
            distances: &[4.0, f64::INFINITY],
            normals: &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            ids: &[7.0, 0.0],
        };
        let value = read(Schema::PointCloud2, |cdr| point_cloud(cdr, STAMP, hits));
        assert_eq!((number(&value, "width"), number(&value, "is_dense")), (Some(1.0), Some(1.0)));
    }

    #[test]
    fn damage() {
        let kind = MessageType::parse(&Schema::JointState.text()).unwrap();
        let mut cdr = CdrWriter::default();
        cdr.begin();
        joint_state(&mut cdr, STAMP, &["J".to_string()], &[1.0, 2.0, 3.0]);
        let whole = cdr.bytes().to_vec();
        assert!(kind.read(&whole).is_some());
        for end in 0..whole.len() {
            assert_eq!(kind.read(&whole[..end]), None, "{end}");
        }
        // A count of 2^32 - 1.
        let mut absurd = whole.clone();
        absurd[24..28].fill(0xff);
        assert_eq!(kind.read(&absurd), None);
        // A type that contains itself.
        let circle = MessageType::parse("A a\n====\nMSG: p/A\np/A a\n").unwrap();
        assert_eq!(circle.read(&whole), None);
        // 10^12 elements of a type that takes no byte.
        let schema = "B[1000000] b\n====\nMSG: p/B\nC[1000000] c\n====\nMSG: p/C\n";
        assert_eq!(MessageType::parse(schema).unwrap().read(&vec![0; 1 << 21]), None);
        assert!(MessageType::parse("float64").is_none());
        assert!(MessageType::parse("uint8 X=7 # a constant\nstring<=5 s 'a=b'\nfloat64[<=3] x\n").is_some());
    }
}
