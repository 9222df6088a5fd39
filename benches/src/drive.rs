use crate::row::Row; use crate::{Outcome, Settings};
pub(crate) fn run(_: &Settings) -> Outcome<Vec<Row>> { Ok(Vec::new()) }
pub(crate) fn child(_: &[String]) -> Outcome<()> { Ok(()) }
