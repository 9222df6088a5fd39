//! How types of this crate stand in configuration files where a derive would not read well.

use super::Channels;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A list of names: `["depth", "mask"]`.
impl Serialize for Channels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.names().serialize(serializer)
    }
}

/// A list of names, which may be those of others: `["rgb", "distance_to_image_plane"]`.
impl<'de> Deserialize<'de> for Channels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let names = Vec::<String>::deserialize(deserializer)?;
        Self::from_names(&names).map_err(serde::de::Error::custom)
    }
}
