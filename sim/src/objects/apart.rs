//! Pairs of things that never collide.

use crate::error::Result;
use crate::manager::SimulationManager;

impl SimulationManager {
    /// Lets two things pass through each other from now on, in all environments: objects by their uid, links as `uid/link`,
    /// all links of a robot by its uid, bodies of MJCF parts as `uid/body`, and `world`, which is the ground and all terrains.
    /// Between links of one robot it takes pairs out of its self-collision. A link that a fixed joint holds is one body with
    /// the link that carries it.
    ///
    /// # Errors
    /// Nothing is called so; the error lists the nearest names.
    pub fn exclude_collision(&mut self, one: &str, other: &str) -> Result<()> {
        for name in [one, other] {
            self.contents.bodies_called(name)?;
        }
        let mut contents = self.contents.clone();
        contents.apart.push([one.into(), other.into()]);
        self.replace_contents(contents, Vec::new())
    }
}
