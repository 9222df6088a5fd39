//! Surfaces that configurations give to what a model has.

use crate::surface_cfg::SurfaceCfg;
use std::collections::BTreeMap;

/// Looks of surfaces, by the name of their instance.
pub(crate) type Surfaces = BTreeMap<String, SurfaceCfg>;
