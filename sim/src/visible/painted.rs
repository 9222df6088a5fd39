//! Surfaces that configurations give to what a model has.

use crate::surface_cfg::SurfaceCfg;
use std::collections::BTreeMap;

/// What surfaces look like, by the name of what they are of: that of an instance.
pub(crate) type Surfaces = BTreeMap<String, SurfaceCfg>;
