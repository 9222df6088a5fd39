//! JSON Schema of scene files.
//!
//! The deserializers of the configurations are asked directly: a [`Probe`] leads to a value inside a configuration and
//! records which type is requested there, which fields and names exist, and which forms are accepted. The schema
//! therefore has the same lists as the reader, and needs no declarations of its own.

use super::SceneCfg;
use super::file::{EXCLUSIONS, PRESETS};
use super::types::EntityTypes;
use crate::simulation_cfg::SimulationManagerCfg;
use serde::Serialize;
use serde::de::value::StrDeserializer;
use serde::de::{
    self, DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Expected, IntoDeserializer, MapAccess,
    SeqAccess, Unexpected, VariantAccess, Visitor,
};
use serde_json::{Map, Value as Json, json};
use std::cell::Cell;
use std::fmt::{self, Display};

impl SceneCfg {
    /// JSON Schema (draft 7) of scene files with the entity types of `types`, for completion and checks in editors. It
    /// has all keys, the names of variants, the types and default values, and the lengths of lists. Ranges of numbers
    /// and references between entities are checked when the scene is built.
    ///
    /// ```
    /// use kinetoscope_sim::{EntityTypes, SceneCfg};
    ///
    /// let schema = SceneCfg::json_schema(&EntityTypes::default());
    /// assert_eq!(schema["definitions"]["imu"]["properties"]["type"]["const"], "imu");
    /// ```
    pub fn json_schema(types: &EntityTypes) -> Json {
        let mut simulation = of::<SimulationManagerCfg>();
        if let Some(properties) = simulation["properties"].as_object_mut() {
            let names: Vec<&str> = PRESETS.iter().map(|(name, _)| *name).collect();
            properties.insert("preset".into(), json!({ "enum": names }));
        }
        let mut definitions = Map::new();
        let mut kinds = Vec::new();
        for (name, mut schema) in types.schemas() {
            if let Some(properties) = schema["properties"].as_object_mut() {
                properties.insert("type".into(), json!({ "const": name }));
            }
            match schema["required"].as_array_mut() {
                Some(required) => required.insert(0, "type".into()),
                None => schema["required"] = json!(["type"]),
            }
            definitions.insert(name.into(), schema);
            kinds.push(json!({ "$ref": format!("#/definitions/{name}") }));
        }
        json!({
            "$schema": "http://json-schema.org/draft-07/schema#",
            "title": "Kinetoscope scene",
            "type": "object",
            "properties": {
                "simulation": simulation,
                "entities": { "type": "object", "additionalProperties": { "oneOf": kinds } },
                EXCLUSIONS: { "type": "array", "items": list(json!({ "type": "string" }), Some(2)) },
            },
            "additionalProperties": false,
            "definitions": definitions,
        })
    }
}

/// Schema of a configuration, with the values of an empty table as defaults.
pub(super) fn of<C: Serialize + DeserializeOwned>() -> Json {
    let run = |probe: Probe<'_>| C::deserialize(probe).map(drop);
    let mut schema = Explorer { run: &run }.value(&mut Vec::new());
    let empty = toml::de::DeTable::parse("").map(|table| table.into_inner()).unwrap_or_default();
    let table = super::value::Value(toml::Spanned::new(0..0, toml::de::DeValue::Table(empty)));
    if let Some(defaults) = C::deserialize(table).ok().and_then(|cfg| serde_json::to_value(cfg).ok()) {
        add_defaults(&mut schema, &defaults);
    }
    schema
}

/// Adds default values to the properties of `schema`, also to those of tables inside it.
fn add_defaults(schema: &mut Json, defaults: &Json) {
    let Some(properties) = schema["properties"].as_object_mut() else { return };
    for (name, property) in properties {
        match &defaults[name] {
            Json::Null => {}
            table @ Json::Object(_) if property.get("properties").is_some() => add_defaults(property, table),
            value => property["default"] = without_null(value),
        }
    }
}

/// The value without the keys of missing values, which files leave out.
fn without_null(value: &Json) -> Json {
    match value {
        Json::Object(table) => {
            let present = table.iter().filter(|(_, value)| !value.is_null());
            present.map(|(name, value)| (name.clone(), without_null(value))).collect::<Map<_, _>>().into()
        }
        Json::Array(items) => items.iter().map(without_null).collect::<Vec<_>>().into(),
        other => other.clone(),
    }
}

/// List of items; `length` is `None` for any number of them.
fn list(items: Json, length: Option<usize>) -> Json {
    match length {
        Some(n) => json!({ "type": "array", "items": items, "minItems": n, "maxItems": n }),
        None => json!({ "type": "array", "items": items }),
    }
}

/// A step from a value to a value inside it.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    Key(String),
    Item,
    Variant(&'static str),
    Inner,
}

/// Type that a deserializer requests.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Any,
    Bool,
    Integer { signed: bool },
    Float,
    Text,
    Option,
    Unit,
    List,
    Array(usize),
    Map,
    Table(&'static [&'static str]),
    Enum(&'static [&'static str]),
}

/// Answer of a probe at its value.
#[derive(Debug)]
enum Reply {
    /// An error that stops the deserializer, after the type of the value is recorded.
    Stop,
    Bool(bool),
    Integer,
    Float,
    Text(String),
    /// A list of samples.
    Items(usize),
    /// A table of samples.
    Fields(Vec<&'static str>),
    /// Any valid value of the type.
    Sample,
}

/// Reason why a deserializer stopped.
#[derive(Debug)]
enum Refusal {
    Stopped,
    WrongType,
    WrongLength,
    MissingField(&'static str),
    UnknownField(&'static [&'static str]),
    UnknownVariant(&'static [&'static str]),
    Other(String),
}

impl Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for Refusal {}

impl de::Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        Self::Other(message.to_string())
    }

    fn invalid_type(_: Unexpected<'_>, _: &dyn Expected) -> Self {
        Self::WrongType
    }

    fn invalid_length(_: usize, _: &dyn Expected) -> Self {
        Self::WrongLength
    }

    fn missing_field(field: &'static str) -> Self {
        Self::MissingField(field)
    }

    fn unknown_field(_: &str, known: &'static [&'static str]) -> Self {
        Self::UnknownField(known)
    }

    fn unknown_variant(_: &str, known: &'static [&'static str]) -> Self {
        Self::UnknownVariant(known)
    }
}

/// Name that no list has.
const UNKNOWN: &str = "\u{1}";

/// Longest array of fixed length that is recognized behind a custom deserializer.
const MAX_ARRAY: usize = 16;

/// Asks the deserializer of one configuration type.
struct Explorer<'r> {
    run: &'r dyn Fn(Probe<'_>) -> Result<(), Refusal>,
}

impl Explorer<'_> {
    /// Deserializes with `reply` at the value at `path`. Returns the type requested there, `None` if the value was not
    /// reached, and the result.
    fn ask(&self, path: &[Step], reply: &Reply) -> (Option<Kind>, Result<(), Refusal>) {
        let reached = Cell::new(None);
        let result = (self.run)(Probe { path, reply, reached: &reached });
        (reached.get(), result)
    }

    /// As [`ask`](Self::ask) for a value inside that at `path`.
    fn ask_inside(&self, path: &mut Vec<Step>, step: Step, reply: &Reply) -> (Option<Kind>, Result<(), Refusal>) {
        path.push(step);
        let answer = self.ask(path, reply);
        path.pop();
        answer
    }

    /// Schema of the value at `path`.
    fn value(&self, path: &mut Vec<Step>) -> Json {
        let (kind, _) = self.ask(path, &Reply::Stop);
        match kind {
            None => json!({}),
            Some(Kind::Bool) => json!({ "type": "boolean" }),
            Some(Kind::Integer { signed: true }) => json!({ "type": "integer" }),
            Some(Kind::Integer { signed: false }) => json!({ "type": "integer", "minimum": 0 }),
            Some(Kind::Float) => json!({ "type": "number" }),
            Some(Kind::Text) => self.text(path).unwrap_or_else(|| json!({ "type": "string" })),
            Some(Kind::Option) => self.inside(path, Step::Inner),
            Some(Kind::Unit) => json!({ "type": "object", "additionalProperties": false }),
            Some(Kind::List) => list(self.inside(path, Step::Item), None),
            Some(Kind::Array(length)) => list(self.inside(path, Step::Item), Some(length)),
            Some(Kind::Table(fields)) => self.table(path, fields),
            Some(Kind::Enum(variants)) => self.variants(path, variants),
            Some(Kind::Map) => self.map(path).unwrap_or_else(|| json!({ "type": "object" })),
            Some(Kind::Any) => self.any(path),
        }
    }

    fn inside(&self, path: &mut Vec<Step>, step: Step) -> Json {
        path.push(step);
        let schema = self.value(path);
        path.pop();
        schema
    }

    /// A table with these keys.
    fn table(&self, path: &mut Vec<Step>, fields: &[&'static str]) -> Json {
        let properties: Map<String, Json> =
            fields.iter().map(|field| (field.to_string(), self.inside(path, Step::Key(field.to_string())))).collect();
        let mut schema = json!({ "type": "object", "properties": properties, "additionalProperties": false });
        let mut required = Vec::new();
        // Each attempt names the first field that is missing.
        while let (_, Err(Refusal::MissingField(field))) = self.ask(path, &Reply::Fields(required.clone())) {
            if !fields.contains(&field) || required.contains(&field) {
                break;
            }
            required.push(field);
        }
        if !required.is_empty() {
            schema["required"] = json!(required);
        }
        schema
    }

    /// A variant: its name alone, or a table whose only key is its name.
    fn variants(&self, path: &mut Vec<Step>, variants: &[&'static str]) -> Json {
        let mut forms = Vec::new();
        let mut plain = Vec::new();
        for &name in variants {
            match self.ask_inside(path, Step::Variant(name), &Reply::Stop) {
                (Some(Kind::Unit), _) => plain.push(name),
                _ => forms.push(only_key(name, self.inside(path, Step::Variant(name)))),
            }
        }
        if !plain.is_empty() {
            forms.insert(0, json!({ "enum": plain }));
        }
        any_of(forms)
    }

    /// A value with a deserializer of its own: all forms that it accepts.
    fn any(&self, path: &mut Vec<Step>) -> Json {
        let accepts = |reply: &Reply| matches!(self.ask(path, reply).1, Ok(()) | Err(Refusal::MissingField(_)));
        let mut forms = Vec::new();
        match [true, false].map(|value| accepts(&Reply::Bool(value))) {
            [true, true] => forms.push(json!({ "type": "boolean" })),
            [true, false] => forms.push(json!({ "const": true })),
            [false, true] => forms.push(json!({ "const": false })),
            [false, false] => {}
        }
        if accepts(&Reply::Float) {
            forms.push(json!({ "type": "number" }));
        } else if accepts(&Reply::Integer) {
            forms.push(json!({ "type": "integer" }));
        }
        forms.extend(self.text(path));
        forms.extend(self.items(path));
        forms.extend(self.map(path));
        any_of(forms)
    }

    /// A text; `None` if the value cannot be one. Names are listed if the deserializer accepts only those.
    fn text(&self, path: &[Step]) -> Option<Json> {
        let ask = |text: &str| self.ask(path, &Reply::Text(text.into())).1;
        match ask(UNKNOWN) {
            Err(Refusal::WrongType) => None,
            Err(Refusal::UnknownVariant(names)) => Some(json!({ "enum": names })),
            Err(Refusal::Other(message)) => {
                let names = names(&message, |name| match ask(name) {
                    Ok(()) | Err(Refusal::MissingField(_)) => Ok(()),
                    Err(refusal) => Err(refusal),
                });
                Some(if names.is_empty() { json!({ "type": "string" }) } else { json!({ "enum": names }) })
            }
            _ => Some(json!({ "type": "string" })),
        }
    }

    /// A list; `None` if the value cannot be one.
    fn items(&self, path: &mut Vec<Step>) -> Option<Json> {
        self.ask_inside(path, Step::Item, &Reply::Stop).0?;
        let fits = |n: usize| !matches!(self.ask(path, &Reply::Items(n)).1, Err(Refusal::WrongLength));
        let length = (0..=MAX_ARRAY).find(|&n| fits(n)).filter(|&n| n > 0);
        Some(list(self.inside(path, Step::Item), length))
    }

    /// A table; `None` if the value cannot be one.
    fn map(&self, path: &mut Vec<Step>) -> Option<Json> {
        let ask = |path: &mut Vec<Step>, key: &str| self.ask_inside(path, Step::Key(key.into()), &Reply::Stop);
        let keys: Vec<String> = match ask(path, UNKNOWN) {
            (Some(_), _) => {
                let values = self.inside(path, Step::Key(UNKNOWN.into()));
                return Some(json!({ "type": "object", "additionalProperties": values }));
            }
            (None, Err(Refusal::UnknownField(fields))) => return Some(self.table(path, fields)),
            (None, Err(Refusal::UnknownVariant(variants))) => variants.iter().map(ToString::to_string).collect(),
            (None, Err(Refusal::Other(message))) => names(&message, |name| match ask(path, name) {
                (Some(_), _) => Ok(()),
                (None, Err(refusal)) => Err(refusal),
                (None, Ok(())) => Err(Refusal::WrongType),
            }),
            (None, _) => return None,
        };
        let keys =
            keys.into_iter().filter(|key| !matches!(ask(path, key).0, None | Some(Kind::Unit))).collect::<Vec<_>>();
        let forms = keys.iter().map(|key| only_key(key, self.inside(path, Step::Key(key.clone())))).collect::<Vec<_>>();
        (!forms.is_empty()).then(|| any_of(forms))
    }
}

/// Names for which `accepts` succeeds, of those quoted in the message of a refusal and in messages about similar names.
fn names(message: &str, mut accepts: impl FnMut(&str) -> Result<(), Refusal>) -> Vec<String> {
    let mut known: Vec<String> = Vec::new();
    let mut messages = vec![message.to_owned()];
    while let Some(message) = messages.pop() {
        for name in message.split('"').skip(1).step_by(2) {
            if known.iter().any(|other| other == name) || accepts(name).is_err() {
                continue;
            }
            known.push(name.to_owned());
            // Messages list the most similar names.
            if let Err(Refusal::Other(message)) = accepts(&format!("{name}{name}")) {
                messages.push(message);
            }
        }
    }
    known.sort();
    known
}

/// A table with one key.
fn only_key(name: &str, content: Json) -> Json {
    json!({ "type": "object", "properties": { name: content }, "required": [name], "additionalProperties": false })
}

fn any_of(mut forms: Vec<Json>) -> Json {
    if forms.len() == 1 { forms.remove(0) } else { json!({ "anyOf": forms }) }
}

/// A deserializer that leads to the value at `path` and answers there with `reply`.
#[derive(Clone, Copy)]
struct Probe<'a> {
    path: &'a [Step],
    reply: &'a Reply,
    reached: &'a Cell<Option<Kind>>,
}

impl<'a> Probe<'a> {
    /// The probe of the next value on the path.
    fn next(self) -> Self {
        Self { path: self.path.get(1..).unwrap_or_default(), ..self }
    }

    /// The probe of a value beside the path.
    fn sample(self) -> Self {
        Self { path: &[], reply: &Reply::Sample, ..self }
    }

    /// Answers to a request of type `kind`.
    fn answer<'de, V: Visitor<'de>>(self, kind: Kind, visitor: V) -> Result<V::Value, Refusal> {
        match self.path.first() {
            Some(Step::Key(_)) => return visitor.visit_map(Entries { probe: self, keys: &[], on_path: true }),
            Some(Step::Item) => {
                // Only arrays need the items after the first one.
                let samples = if let Kind::Array(length) = kind { length } else { 0 };
                return visitor.visit_seq(Items { first: Some(self.next()), samples, probe: self });
            }
            Some(Step::Variant(_)) => return visitor.visit_enum(self),
            Some(Step::Inner) => return visitor.visit_some(self.next()),
            None => {}
        }
        if !matches!(self.reply, Reply::Sample) {
            self.reached.set(Some(kind));
        }
        match self.reply {
            Reply::Stop => Err(Refusal::Stopped),
            Reply::Bool(value) => visitor.visit_bool(*value),
            Reply::Integer => visitor.visit_i64(1),
            Reply::Float => visitor.visit_f64(1.0),
            Reply::Text(text) => visitor.visit_str(text),
            Reply::Items(n) => visitor.visit_seq(Items { first: None, samples: *n, probe: self }),
            Reply::Fields(keys) => visitor.visit_map(Entries { probe: self.sample(), keys, on_path: false }),
            Reply::Sample => match kind {
                Kind::Bool => visitor.visit_bool(false),
                Kind::Integer { .. } => visitor.visit_u64(1),
                Kind::Float | Kind::Any => visitor.visit_f64(1.0),
                Kind::Text => visitor.visit_str("x"),
                Kind::Option => visitor.visit_none(),
                Kind::Unit => visitor.visit_unit(),
                Kind::List => visitor.visit_seq(Items { first: None, samples: 0, probe: self }),
                Kind::Array(n) => visitor.visit_seq(Items { first: None, samples: n, probe: self }),
                Kind::Map => visitor.visit_map(Entries { probe: self, keys: &[], on_path: false }),
                Kind::Table(keys) => visitor.visit_map(Entries { probe: self, keys, on_path: false }),
                Kind::Enum(_) => visitor.visit_enum(self),
            },
        }
    }
}

macro_rules! requests {
    ($($method:ident $kind:expr,)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
            self.answer($kind, visitor)
        })*
    };
}

impl<'de> Deserializer<'de> for Probe<'_> {
    type Error = Refusal;

    requests! {
        deserialize_any Kind::Any,
        deserialize_bool Kind::Bool,
        deserialize_i8 Kind::Integer { signed: true },
        deserialize_i16 Kind::Integer { signed: true },
        deserialize_i32 Kind::Integer { signed: true },
        deserialize_i64 Kind::Integer { signed: true },
        deserialize_i128 Kind::Integer { signed: true },
        deserialize_u8 Kind::Integer { signed: false },
        deserialize_u16 Kind::Integer { signed: false },
        deserialize_u32 Kind::Integer { signed: false },
        deserialize_u64 Kind::Integer { signed: false },
        deserialize_u128 Kind::Integer { signed: false },
        deserialize_f32 Kind::Float,
        deserialize_f64 Kind::Float,
        deserialize_char Kind::Text,
        deserialize_str Kind::Text,
        deserialize_string Kind::Text,
        deserialize_bytes Kind::Any,
        deserialize_byte_buf Kind::Any,
        deserialize_option Kind::Option,
        deserialize_unit Kind::Unit,
        deserialize_seq Kind::List,
        deserialize_map Kind::Map,
        deserialize_identifier Kind::Text,
        deserialize_ignored_any Kind::Any,
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Refusal> {
        self.answer(Kind::Unit, visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Refusal> {
        self.answer(Kind::Array(length), visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        self.answer(Kind::Array(length), visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        self.answer(Kind::Table(fields), visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        // A sample is the first variant.
        if self.path.is_empty() && matches!(self.reply, Reply::Sample) {
            let path = [Step::Variant(variants.first().copied().unwrap_or_default())];
            return visitor.visit_enum(Probe { path: &path, ..self });
        }
        self.answer(Kind::Enum(variants), visitor)
    }
}

/// Entries of a table: that of the path, or samples.
struct Entries<'a> {
    probe: Probe<'a>,
    keys: &'a [&'static str],
    on_path: bool,
}

impl<'de> MapAccess<'de> for Entries<'_> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Refusal> {
        let key: &str = match (self.probe.path.first(), self.keys) {
            (Some(Step::Key(key)), _) if self.on_path => key,
            (_, [key, ..]) => key,
            _ => return Ok(None),
        };
        let key: StrDeserializer<'_, Refusal> = key.into_deserializer();
        seed.deserialize(key).map(Some)
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Refusal> {
        if std::mem::take(&mut self.on_path) {
            let inside = self.probe.next();
            self.probe = self.probe.sample();
            return seed.deserialize(inside);
        }
        self.keys = self.keys.get(1..).unwrap_or_default();
        seed.deserialize(self.probe)
    }
}

/// Items of a list: the first one is on the path, the others are samples.
struct Items<'a> {
    first: Option<Probe<'a>>,
    samples: usize,
    probe: Probe<'a>,
}

impl<'de> SeqAccess<'de> for Items<'_> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Refusal> {
        if let Some(first) = self.first.take() {
            // Lists of any length end here; arrays of a fixed length ask for the rest.
            return seed.deserialize(first).map(Some);
        }
        if self.samples == 0 {
            return Ok(None);
        }
        self.samples -= 1;
        seed.deserialize(self.probe.sample()).map(Some)
    }
}

impl<'de, 'a> EnumAccess<'de> for Probe<'a> {
    type Error = Refusal;
    type Variant = Self;

    fn variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<(T::Value, Self), Refusal> {
        let Some(Step::Variant(name)) = self.path.first() else { return Err(Refusal::WrongType) };
        let name: StrDeserializer<'_, Refusal> = name.into_deserializer();
        let content = Probe { path: self.path.get(1..).unwrap_or_default(), ..self };
        seed.deserialize(name).map(|variant| (variant, content))
    }
}

impl<'de> VariantAccess<'de> for Probe<'_> {
    type Error = Refusal;

    fn unit_variant(self) -> Result<(), Refusal> {
        if matches!(self.reply, Reply::Sample) {
            return Ok(());
        }
        self.reached.set(Some(Kind::Unit));
        Err(Refusal::Stopped)
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Refusal> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Refusal> {
        self.answer(Kind::Array(length), visitor)
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Refusal> {
        self.answer(Kind::Table(fields), visitor)
    }
}
