//! Surface properties that configurations give to elements of a model.

use crate::surface_cfg::SurfaceCfg;
use std::collections::BTreeMap;

/// Surface properties, by the name of their instance.
pub(crate) type SurfaceOverrides = BTreeMap<String, SurfaceCfg>;
