//! Collision exclusions between bodies.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;

impl SimulationManager {
    /// Excludes collisions between two entities from now on, in all environments.
    ///
    /// Names are those of objects (`uid`, also `group.object`), links (`uid/link`), all links of a robot or
    /// articulation (`uid`), bodies of MJCF parts (`uid/body`), and `world` for the ground, all terrains and geoms
    /// directly in the world of an MJCF part. Between links of one robot, this removes pairs from its self-collision. A
    /// link behind a fixed joint is one body with its parent link. A robot with itself stands for all pairs of its
    /// links. A pair that is excluded already changes nothing.
    ///
    /// # Errors
    /// A name is unknown (the error lists the nearest names), or both names are the same single body.
    pub fn exclude_collision(&mut self, one: &str, other: &str) -> Result<()> {
        let bodies = self.entities.find_bodies(one)?;
        if bodies == self.entities.find_bodies(other)? && bodies.is_none_or(|all| all.len() == 1) {
            let (value, expected) = (format!("{:?}", [one, other]), "the two must be different bodies");
            return Err(Error::Config { field: "exclude_collision", value, expected });
        }
        let known = |[a, b]: &[String; 2]| a == one && b == other || a == other && b == one;
        if self.entities.collision_exclusions.iter().any(known) {
            return Ok(());
        }
        let mut contents = self.entities.clone();
        contents.collision_exclusions.push([one.into(), other.into()]);
        self.recompile_with(contents, Vec::new())
    }
}
