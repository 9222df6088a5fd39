//! Deserializer for values of a scene file, whose errors name the position and the possible values.
//!
//! The deserializer of the `toml` crate does not list the variants of an enum when one must be selected; this one does.

use serde::de::value::StrDeserializer;
use serde::de::{
    self, DeserializeSeed, Deserializer, EnumAccess, IntoDeserializer, MapAccess, SeqAccess, VariantAccess, Visitor,
};
use std::fmt::{self, Display};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// A value of a file with its span.
pub(super) struct Value<'a>(pub Spanned<DeValue<'a>>);

impl<'a> Value<'a> {
    /// Reads the value; an error found after the deserialization is also reported at the span of the value.
    fn read<T: DeserializeSeed<'a>>(self, seed: T) -> Result<T::Value, ValueError> {
        let span = self.0.span();
        seed.deserialize(self).map_err(|error| error.at(&span))
    }
}

/// Error in a value, with its position.
#[derive(Clone, Debug)]
pub(super) struct ValueError {
    pub message: String,
    /// `None` if the value has no position in the file.
    pub span: Option<Range<usize>>,
}

impl ValueError {
    /// Sets the position if the error has none.
    fn at(mut self, span: &Range<usize>) -> Self {
        self.span = self.span.or_else(|| Some(span.clone()).filter(|span| !span.is_empty()));
        self
    }
}

impl Display for ValueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for ValueError {}

impl de::Error for ValueError {
    fn custom<T: Display>(message: T) -> Self {
        Self { message: message.to_string(), span: None }
    }
}

/// Formats as `` `a`, `b` ``; empty for an empty list.
fn quoted(names: &[&str]) -> String {
    if names.is_empty() { String::new() } else { format!("`{}`", names.join("`, `")) }
}

/// Description of a value in TOML's terms.
fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("string {text:?}"),
        DeValue::Integer(number) => format!("integer `{number}`"),
        DeValue::Float(number) => format!("float `{number}`"),
        DeValue::Boolean(yes) => format!("boolean `{yes}`"),
        DeValue::Datetime(when) => format!("date `{when}`"),
        DeValue::Array(_) | DeValue::Table(_) => value.type_str().to_string(),
    }
}

/// A value as serde's visitors take it.
enum Content<'a> {
    String(String),
    Integer(i64),
    /// Above the largest `i64`.
    LargeInteger(u64),
    Float(f64),
    Boolean(bool),
    Array(ArrayItems<'a>),
    Table(TableEntries<'a>),
}

// The parts that do not depend on the type to read. The other functions are compiled for each of a hundred types, and
// took a fifth of this crate's code when they contained these parts.
impl<'a> Value<'a> {
    fn content(self) -> Result<Content<'a>, ValueError> {
        let out_of_range = |number: &str| de::Error::custom(format!("the number {number} is out of range"));
        Ok(match self.0.into_inner() {
            DeValue::String(text) => Content::String(text.into_owned()),
            DeValue::Integer(number) => {
                let (digits, radix) = (number.as_str(), number.radix());
                match (i64::from_str_radix(digits, radix), u64::from_str_radix(digits, radix)) {
                    (Ok(number), _) => Content::Integer(number),
                    (Err(_), Ok(number)) => Content::LargeInteger(number),
                    (Err(_), Err(_)) => return Err(out_of_range(digits)),
                }
            }
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(x) if x.is_finite() || number.as_str().contains("inf") || x.is_nan() => Content::Float(x),
                _ => return Err(out_of_range(number.as_str())),
            },
            DeValue::Boolean(yes) => Content::Boolean(yes),
            DeValue::Datetime(when) => {
                return Err(de::Error::custom(format!("unexpected date `{when}`; scene files have no dates")));
            }
            DeValue::Array(array) => Content::Array(ArrayItems(array.into_iter())),
            DeValue::Table(table) => Content::Table(TableEntries::new(table)),
        })
    }

    /// The variant of an enum that the value selects, and the span of its name if the value is a table.
    fn variant(self, variants: &[&str]) -> Result<(EnumVariant<'a>, Option<Range<usize>>), ValueError> {
        let wrong = |found: String| Err(de::Error::custom(format!("{found}, expected one of {}", quoted(variants))));
        match self.0.into_inner() {
            DeValue::String(name) => Ok((EnumVariant { name: name.into_owned(), content: None }, None)),
            DeValue::Table(table) => {
                let names: Vec<String> = table.keys().map(|key| key.get_ref().to_string()).collect();
                let mut content = table.into_iter();
                match (content.next(), content.next()) {
                    (Some((name, content)), None) => {
                        let at = name.span();
                        let chosen = EnumVariant { name: name.get_ref().to_string(), content: Some(Value(content)) };
                        Ok((chosen, Some(at)))
                    }
                    (None, _) => wrong("empty table".into()),
                    _ => wrong(format!("{} keys (`{}`)", names.len(), names.join("`, `"))),
                }
            }
            other => wrong(format!("invalid type: {}", describe(&other))),
        }
    }

    fn expect_table(&self, fields: &[&str]) -> Result<(), ValueError> {
        if matches!(self.0.get_ref(), DeValue::Table(_)) {
            return Ok(());
        }
        let message = format!("invalid type: {}, expected a table of {}", describe(self.0.get_ref()), quoted(fields));
        Err(ValueError { message, span: Some(self.0.span()) })
    }
}

impl<'de> Deserializer<'de> for Value<'de> {
    type Error = ValueError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueError> {
        let span = self.0.span();
        let read = self.content().and_then(|content| match content {
            Content::String(text) => visitor.visit_string(text),
            Content::Integer(number) => visitor.visit_i64(number),
            Content::LargeInteger(number) => visitor.visit_u64(number),
            Content::Float(number) => visitor.visit_f64(number),
            Content::Boolean(yes) => visitor.visit_bool(yes),
            Content::Array(mut items) => {
                let length = items.0.len();
                let value = visitor.visit_seq(&mut items)?;
                items.expect_end(length).map(|()| value)
            }
            Content::Table(entries) => visitor.visit_map(entries),
        });
        read.map_err(|error| error.at(&span))
    }

    /// A value that is present is `Some`: TOML has no null.
    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ValueError> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, ValueError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ValueError> {
        self.expect_table(fields)?;
        self.deserialize_any(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ValueError> {
        let span = self.0.span();
        let read = self.variant(variants).and_then(|(chosen, name)| {
            let read = visitor.visit_enum(chosen);
            if let Some(name) = name { read.map_err(|error| error.at(&name)) } else { read }
        });
        read.map_err(|error| error.at(&span))
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

impl<'de> IntoDeserializer<'de, ValueError> for Value<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

/// Iterator over an array.
struct ArrayItems<'a>(<DeArray<'a> as IntoIterator>::IntoIter);

impl ArrayItems<'_> {
    /// Refuses an array of `length` items of which some were not read.
    fn expect_end(&self, length: usize) -> Result<(), ValueError> {
        match self.0.len() {
            0 => Ok(()),
            rest => {
                let expected = format!("an array of length {}", length - rest);
                Err(de::Error::invalid_length(length, &expected.as_str()))
            }
        }
    }
}

impl<'de> SeqAccess<'de> for ArrayItems<'de> {
    type Error = ValueError;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, ValueError> {
        self.0.next().map(|item| Value(item).read(seed)).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

/// Iterator over a table.
struct TableEntries<'a> {
    rest: <DeTable<'a> as IntoIterator>::IntoIter,
    value: Option<Value<'a>>,
}

impl<'a> TableEntries<'a> {
    fn new(table: DeTable<'a>) -> Self {
        Self { rest: table.into_iter(), value: None }
    }
}

impl<'de> MapAccess<'de> for TableEntries<'de> {
    type Error = ValueError;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, ValueError> {
        let Some((key, value)) = self.rest.next() else { return Ok(None) };
        self.value = Some(Value(value));
        let name: StrDeserializer<'_, ValueError> = key.get_ref().as_ref().into_deserializer();
        seed.deserialize(name).map(Some).map_err(|error| error.at(&key.span()))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, ValueError> {
        // serde reads a value only after its key.
        let value = self.value.take().ok_or_else(|| de::Error::custom("a value without a key"))?;
        value.read(seed)
    }
}

/// A variant of an enum: its name and its content.
struct EnumVariant<'a> {
    name: String,
    content: Option<Value<'a>>,
}

impl<'de> EnumAccess<'de> for EnumVariant<'de> {
    type Error = ValueError;
    type Variant = VariantContent<'de>;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, VariantContent<'de>), ValueError> {
        let name: StrDeserializer<'_, ValueError> = self.name.as_str().into_deserializer();
        let variant = seed.deserialize(name)?;
        Ok((variant, VariantContent { name: self.name, value: self.content }))
    }
}

/// Content of a variant.
struct VariantContent<'a> {
    name: String,
    value: Option<Value<'a>>,
}

impl<'a> VariantContent<'a> {
    /// Content of a variant that must have one.
    fn value(self) -> Result<Value<'a>, ValueError> {
        let name = self.name;
        self.value
            .ok_or_else(|| de::Error::custom(format!("`{name}` needs a value, expected a table: {{ {name} = ... }}")))
    }
}

impl<'de> VariantAccess<'de> for VariantContent<'de> {
    type Error = ValueError;

    fn unit_variant(self) -> Result<(), ValueError> {
        let Some(Value(value)) = self.value else { return Ok(()) };
        if matches!(value.get_ref(), DeValue::Table(table) if table.is_empty()) {
            return Ok(());
        }
        let message = format!("`{}` has no fields, expected its name alone", self.name);
        Err(ValueError { message, span: Some(value.span()) })
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, ValueError> {
        self.value()?.read(seed)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _len: usize, visitor: V) -> Result<V::Value, ValueError> {
        self.value()?.deserialize_any(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ValueError> {
        self.value()?.deserialize_struct("", fields, visitor)
    }
}
