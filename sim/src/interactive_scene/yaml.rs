//! Conversion of YAML scene files to TOML values, so that both formats share readers and error messages.
//!
//! The span of a value is its line, `line..line + 1`.

use kinetoscope_scene::yaml::{Node, Scalar, ScalarKind, Value, YamlError, YamlFeatures};
use std::borrow::Cow;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// YAML dialect of scene files.
pub(super) const DIALECT: YamlFeatures = YamlFeatures { files: "scene files", aliases: true, tags: false };

/// Returns the table of a scene. An empty file is an empty table.
///
/// # Errors
/// The root is a list or a scalar instead of a table, or a value is null.
pub(super) fn table(root: Option<&Node>) -> Result<DeTable<'_>, YamlError> {
    let Some(Node { line, value }) = root else { return Ok(DeTable::new()) };
    match value {
        Value::Table(entries) => entries_of(entries),
        Value::List(_) => Err(error(*line, "a scene is a table of `simulation` and `entities`, not a list".into())),
        Value::Scalar(Scalar { text, kind: ScalarKind::Null }) if text.is_empty() => Ok(DeTable::new()),
        Value::Scalar(Scalar { text, .. }) => {
            Err(error(*line, format!("{text:?} is not a table of `simulation` and `entities`")))
        }
    }
}

fn error(line: usize, message: String) -> YamlError {
    YamlError { line, column: 1, message }
}

fn entries_of(entries: &[(String, Node)]) -> Result<DeTable<'_>, YamlError> {
    let mut table = DeTable::new();
    for (key, node) in entries {
        table.insert(Spanned::new(node.line..node.line + 1, Cow::from(key)), value_of(node)?);
    }
    Ok(table)
}

fn value_of(node: &Node) -> Result<Spanned<DeValue<'_>>, YamlError> {
    let value = match &node.value {
        Value::Table(entries) => DeValue::Table(entries_of(entries)?),
        Value::List(list) => DeValue::Array(list.iter().map(value_of).collect::<Result<_, _>>()?),
        Value::Scalar(Scalar { text, kind }) => match kind {
            ScalarKind::Null => {
                let nothing = "the value is null; leave the key out, or write false to disable a feature";
                return Err(error(node.line, nothing.into()));
            }
            ScalarKind::Bool(yes) => DeValue::Boolean(*yes),
            ScalarKind::Number(number) => {
                DeValue::parse(number).map_err(|e| error(node.line, e.message().into()))?.into_inner()
            }
            ScalarKind::Text => DeValue::String(text.into()),
        },
    };
    Ok(Spanned::new(node.line..node.line + 1, value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::yaml::parse;
    use serde::Deserialize;
    use toml::de::ValueDeserializer as Deserializer;

    fn read(yaml: &str) -> toml::Table {
        let root = parse(yaml, &DIALECT).unwrap();
        let table = table(root.as_ref()).unwrap();
        toml::Table::deserialize(Deserializer::from(Spanned::new(0..1, DeValue::Table(table)))).unwrap()
    }

    #[test]
    fn core_schema() {
        let yaml = "a: 1\nb: -007\nc: 1.5\nd: .5\ne: 1.\nf: 1e3\ng: .inf\nh: -.INF\ni: yes\nj: True\nk: '1'\nl: 0x1F\nm: 0o17\n\
                    n: !!str 5\no: 1_000\np: inf\nq: \"tab\\tquote\\\"\"\nr: +3\ns: nan\nt: 12e03\nu: 0.1\n\"v w\": [1, [2, x], {}]\n";
        let expected = "a = 1\nb = -7\nc = 1.5\nd = 0.5\ne = 1.0\nf = 1000.0\ng = inf\nh = -inf\ni = \"yes\"\nj = true\nk = \"1\"\n\
                        l = 31\nm = 15\nn = \"5\"\no = \"1_000\"\np = \"inf\"\nq = \"tab\\tquote\\\"\"\nr = 3\ns = \"nan\"\n\
                        t = 12000.0\nu = 0.1\n\"v w\" = [1, [2, \"x\"], {}]\n";
        assert_eq!(read(yaml), toml::from_str(expected).unwrap());
        assert!(matches!(read("x: .nan")["x"], toml::Value::Float(x) if x.is_nan()));
        assert_eq!(read("# nothing\n"), toml::Table::new());
    }

    #[test]
    fn nesting_and_aliases() {
        let yaml = "one: &one\n  list:\n    - 1\n    - &two {a: b, c: [d]}\n    - *two\nagain: *one\ntext: |\n  two\n  lines\n";
        let table = "{ list = [1, { a = \"b\", c = [\"d\"] }, { a = \"b\", c = [\"d\"] }] }";
        let expected = format!("one = {table}\nagain = {table}\ntext = \"two\\nlines\\n\"\n");
        assert_eq!(read(yaml), toml::from_str(&expected).unwrap());
    }

    #[test]
    fn spans() {
        let root = parse("a:\n  b: 1\n  c:\n    - 2\n    - x\n", &DIALECT).unwrap();
        let table = table(root.as_ref()).unwrap();
        let (a, inner) = table.get_key_value("a").unwrap();
        let inner = inner.get_ref().as_table().unwrap();
        let (b, one) = inner.get_key_value("b").unwrap();
        let (c, list) = inner.get_key_value("c").unwrap();
        let list = list.get_ref().as_array().unwrap();
        let spans = [a.span(), b.span(), one.span(), c.span(), list[0].span(), list[1].span()];
        assert_eq!(spans, [1..2, 2..3, 2..3, 3..4, 4..5, 5..6]);
    }

    #[test]
    fn refusals() {
        for (yaml, line, needle) in [
            ("a: 1\nb:\n", 2, "the value is null"),
            ("a: 1\nb: ~\n", 2, "the value is null"),
            ("- 1\n", 1, "not a list"),
            ("word\n", 1, "not a table"),
            ("a: !cup 5\n", 1, "scene files do not support the tag !cup"),
        ] {
            let read = |root: Option<Node>| table(root.as_ref()).map(|_| ());
            let error = parse(yaml, &DIALECT).and_then(read).unwrap_err();
            assert!(error.message.contains(needle), "{yaml}: {error:?}");
            assert_eq!(error.line, line, "{yaml}: {error:?}");
        }
    }
}
