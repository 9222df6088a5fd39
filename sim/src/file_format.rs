//! Serde formats for configuration types whose derived form would be hard to read.

use crate::drive::PerJoint;
use crate::objects::mjcf_file::MjcfFile;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::file_format::pairs;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use serde::ser::{Serialize, Serializer};
use std::fmt;

/// Serializes to a number, or a table of numbers by joint pattern or control part.
impl Serialize for PerJoint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All(value) => serializer.serialize_f64(*value),
            Self::By(entries) => pairs::serialize(entries, serializer),
        }
    }
}

/// Deserializes from a number, or a table of numbers by joint pattern or control part.
impl<'de> Deserialize<'de> for PerJoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrTable;

        impl<'de> Visitor<'de> for NumberOrTable {
            type Value = PerJoint;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number for all joints, or a table of numbers by joint pattern or control part")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<PerJoint, E> {
                Ok(PerJoint::All(value))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<PerJoint, E> {
                Ok(PerJoint::All(value as f64))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<PerJoint, E> {
                Ok(PerJoint::All(value as f64))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<PerJoint, A::Error> {
                pairs::deserialize(MapAccessDeserializer::new(map)).map(PerJoint::By)
            }
        }

        deserializer.deserialize_any(NumberOrTable)
    }
}

/// Deserializes the MJCF of a robot from a file path or the table of [`MjcfFile`]; `None` for a null value.
pub(crate) fn mjcf_file<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<MjcfFile>, D::Error> {
    struct FileOrTable;

    impl<'de> Visitor<'de> for FileOrTable {
        type Value = Option<MjcfFile>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the path of an MJCF file, or a table with `path` or `text`")
        }

        fn visit_str<E: Error>(self, path: &str) -> Result<Self::Value, E> {
            Ok(Some(MjcfFile::new(path)))
        }

        fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
            Ok(None)
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            MjcfFile::deserialize(MapAccessDeserializer::new(map)).map(Some)
        }
    }

    deserializer.deserialize_any(FileOrTable)
}

/// Deserializes the URDF of a robot from the path of a single file or the table of [`UrdfCfg`].
pub(crate) fn file_or_table<'de, D: Deserializer<'de>>(deserializer: D) -> Result<UrdfCfg, D::Error> {
    struct FileOrTable;

    impl<'de> Visitor<'de> for FileOrTable {
        type Value = UrdfCfg;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the path of a URDF file, or a table of components")
        }

        fn visit_str<E: Error>(self, path: &str) -> Result<UrdfCfg, E> {
            Ok(UrdfCfg::single(path))
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<UrdfCfg, A::Error> {
            UrdfCfg::deserialize(MapAccessDeserializer::new(map))
        }
    }

    deserializer.deserialize_any(FileOrTable)
}
