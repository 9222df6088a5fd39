//! The browser view without a browser: who is let in, what viewers get and may do, and what those with bad manners cannot.

mod door;
mod hostile;
mod pictures;
mod recordings;
pub(crate) mod running;
mod selecting;
mod several;
mod steering;
mod visitor;
