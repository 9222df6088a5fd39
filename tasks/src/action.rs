//! Action terms.

use crate::error::{Result, TermKind, TermResult};
use crate::guard::guard;
use crate::space::Space;
use kinetoscope_sim::SimulationManager;
use ndarray::ArrayView2;
use std::fmt;

type Apply = Box<dyn Fn(&mut SimulationManager, ArrayView2<'_, f64>) -> TermResult + Send>;

/// A group of action columns and the function that applies them to the simulation.
pub struct ActionTerm {
    pub(crate) name: String,
    pub(crate) space: Space,
    pub(crate) every_physics_step: bool,
    apply: Apply,
}

impl ActionTerm {
    /// Creates a term with the columns of `space`.
    ///
    /// `apply` gets the clamped actions of all environments, shape (N, columns of the term), and writes them to the
    /// simulation as targets, efforts or wrenches. Unless [`every_physics_step`](Self::every_physics_step) is set, it
    /// is called once per step, before the first physics step.
    pub fn new(
        name: impl Into<String>,
        space: Space,
        apply: impl Fn(&mut SimulationManager, ArrayView2<'_, f64>) -> TermResult + Send + 'static,
    ) -> Self {
        Self { name: name.into(), space, every_physics_step: false, apply: Box::new(apply) }
    }

    /// Applies the columns of the term.
    pub(crate) fn apply(&self, sim: &mut SimulationManager, columns: ArrayView2<'_, f64>) -> Result<()> {
        guard(TermKind::Action, &self.name, || (self.apply)(sim, columns))
    }

    /// Calls `apply` with the same actions before every physics step of a step, for a control law that reads the state.
    #[must_use]
    pub fn every_physics_step(self) -> Self {
        Self { every_physics_step: true, ..self }
    }
}

impl fmt::Debug for ActionTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ActionTerm").field("name", &self.name).field("space", &self.space).finish_non_exhaustive()
    }
}
