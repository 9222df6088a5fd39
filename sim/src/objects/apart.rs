//! Pairs of things that never collide.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;

impl SimulationManager {
    /// Lets two things pass through each other from now on, in all environments: objects by their uid, links as `uid/link`,
    /// all links of a robot by its uid, bodies of MJCF parts as `uid/body`, and `world`, which is the ground and all terrains.
    /// Between links of one robot it takes pairs out of its self-collision. A link that a fixed joint holds is one body with
    /// the link that carries it. A robot and itself are all pairs of its links. A pair that is known already changes nothing.
    ///
    /// # Errors
    /// Nothing is called so; the error lists the nearest names. Or both are the same one body.
    pub fn exclude_collision(&mut self, one: &str, other: &str) -> Result<()> {
        let bodies = self.contents.bodies_called(one)?;
        if bodies == self.contents.bodies_called(other)? && bodies.is_none_or(|all| all.len() == 1) {
            let (value, expected) = (format!("{:?}", [one, other]), "the two must be different bodies");
            return Err(Error::Config { field: "exclude_collision", value, expected });
        }
        let known = |[a, b]: &[String; 2]| a == one && b == other || a == other && b == one;
        if self.contents.apart.iter().any(known) {
            return Ok(());
        }
        let mut contents = self.contents.clone();
        contents.apart.push([one.into(), other.into()]);
        self.replace_contents(contents, Vec::new())
    }
}
