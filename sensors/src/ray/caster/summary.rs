//! The summary of a ray caster.

use super::RayCaster;
use crate::sampling::Sampled;
use crate::summary;
use std::fmt;

impl fmt::Display for RayCaster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (path, pattern, alignment, targets) = self.parts();
        let (sensors, rays) = self.hit_ids().dim();
        let targets = format!("{} ({} of them fixed)", targets.len(), targets.fixed_count());
        summary::write(
            f,
            "Ray-caster",
            path,
            &[
                ("pattern", &pattern),
                ("alignment", &alignment.name()),
                ("update period (s)", &self.sampler().period()),
                ("number of targets", &targets),
                ("number of sensors", &sensors),
                ("number of rays/sensor", &rays),
                ("total number of rays", &(sensors * rays)),
            ],
        )
    }
}
