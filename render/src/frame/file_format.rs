//! Serialization of channels in configuration files.

use super::Channels;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Serializes as a list of names: `["depth", "mask"]`.
impl Serialize for Channels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.names().serialize(serializer)
    }
}

/// Deserializes from a list of names or aliases: `["rgb", "distance_to_image_plane"]`.
impl<'de> Deserialize<'de> for Channels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let names = Vec::<String>::deserialize(deserializer)?;
        Self::from_names(&names).map_err(serde::de::Error::custom)
    }
}
