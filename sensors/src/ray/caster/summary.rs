//! What a ray caster is, in a few lines.

use super::RayCaster;
use crate::sampling::Sampled;
use std::fmt;

impl fmt::Display for RayCaster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, pattern, alignment, targets) = self.parts();
        let (sensors, rays) = self.hit_ids().dim();
        writeln!(f, "Ray-caster @ {name:?}:")?;
        writeln!(f, "\tpattern              : {pattern}")?;
        writeln!(f, "\talignment            : {}", alignment.name())?;
        writeln!(f, "\tupdate period (s)    : {}", self.sampler().period())?;
        writeln!(f, "\tnumber of targets    : {} ({} of them fixed)", targets.len(), targets.fixed_count())?;
        writeln!(f, "\tnumber of sensors    : {sensors}")?;
        writeln!(f, "\tnumber of rays/sensor: {rays}")?;
        write!(f, "\ttotal number of rays : {}", sensors * rays)
    }
}
