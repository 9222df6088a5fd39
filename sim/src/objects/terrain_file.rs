//! Terrain in configuration files: with rows of heights, or with a generator of heights.

use super::terrain::TerrainCfg;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_scene::Pose;
use kinetoscope_scene::terrain::TerrainGenerator;
use ndarray::Array2;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::ser::Serializer;
use std::fmt;

/// Table of a terrain in a configuration file.
#[derive(serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct TerrainFile {
    uid: String,
    heights: Heights,
    size: Option<[f64; 2]>,
    thickness: f64,
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    init_pose: Pose,
    friction: Option<[f64; 3]>,
    rgba: [f64; 4],
    surface: SurfaceCfg,
}

/// Heights, or their generator.
enum Heights {
    Rows(Array2<f64>),
    Generated(TerrainGenerator),
}

impl Default for TerrainFile {
    fn default() -> Self {
        let TerrainCfg { uid, heights, size: _, thickness, init_pose, friction, rgba, surface } = TerrainCfg::default();
        Self { uid, heights: Heights::Rows(heights), size: None, thickness, init_pose, friction, rgba, surface }
    }
}

impl TryFrom<TerrainFile> for TerrainCfg {
    type Error = String;

    fn try_from(file: TerrainFile) -> Result<Self, String> {
        let TerrainFile { uid, heights, size, thickness, init_pose, friction, rgba, surface } = file;
        let (heights, size) = match heights {
            Heights::Rows(heights) => (heights, size.unwrap_or(Self::default().size)),
            Heights::Generated(generator) if size.is_none() => {
                (generator.heights().map_err(|error| error.to_string())?, generator.size())
            }
            Heights::Generated(_) => {
                return Err(
                    "a height generator defines the size of the terrain; remove the `size` beside `heights`".into()
                );
            }
        };
        Ok(Self { uid, heights, size, thickness, init_pose, friction, rgba, surface })
    }
}

/// Serializes heights as an array of rows.
pub(super) fn rows<S: Serializer>(heights: &Array2<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(heights.rows().into_iter().map(|row| row.to_vec()))
}

impl<'de> Deserialize<'de> for Heights {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RowsOrGenerator)
    }
}

struct RowsOrGenerator;

impl<'de> Visitor<'de> for RowsOrGenerator {
    type Value = Heights;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("rows of heights, or a table with the name of a generator, such as { rough = { seed = 7 } }")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Heights, A::Error> {
        let rows = Vec::<Vec<f64>>::deserialize(SeqAccessDeserializer::new(seq))?;
        let columns = rows.first().map_or(0, Vec::len);
        if let Some((row, other)) = rows.iter().enumerate().find(|(_, row)| row.len() != columns) {
            let found = other.len();
            return Err(A::Error::custom(format_args!("row {row} has {found} heights, the first one has {columns}")));
        }
        let shape = (rows.len(), columns);
        Array2::from_shape_vec(shape, rows.concat()).map(Heights::Rows).map_err(A::Error::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Heights, A::Error> {
        let mut keys = KeyTracker { map: &mut map, any: false };
        let generator = TerrainGenerator::deserialize(MapAccessDeserializer::new(&mut keys));
        if !keys.any {
            return Err(A::Error::custom(format_args!(
                "`heights` names no generator, such as {{ rough = {{ seed = 7 }} }}; known generators: {}",
                TerrainGenerator::NAMES.join(", ")
            )));
        }
        let generator = generator?;
        match map.next_key::<IgnoredAny>()? {
            None => Ok(Heights::Generated(generator)),
            Some(_) => Err(A::Error::custom("`heights` names two generators; keep one")),
        }
    }
}

/// Map access that records whether the table has any key.
struct KeyTracker<'a, A> {
    map: &'a mut A,
    any: bool,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for KeyTracker<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, A::Error> {
        let key = self.map.next_key_seed(seed);
        // An unknown key counts as well.
        self.any |= !matches!(key, Ok(None));
        key
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.map.next_value_seed(seed)
    }
}
