//! Commands of independent random numbers.

use super::check_range;
use crate::command::CommandTerm;
use crate::error::{EnvError, Result, TermKind};

/// Creates a command with a column for each of `ranges` \[low, high\], uniformly distributed and independent of each
/// other: a target velocity, or the coordinates of a goal.
///
/// # Errors
/// There is no column, or the ends of a range are not finite or not in order.
pub fn uniform_command<N: Into<String>>(
    name: &str,
    ranges: impl IntoIterator<Item = (N, [f64; 2])>,
) -> Result<CommandTerm> {
    let columns: Vec<(String, [f64; 2])> = ranges.into_iter().map(|(column, range)| (column.into(), range)).collect();
    if columns.is_empty() {
        let field = format!("columns of the command term {name:?}");
        return Err(EnvError::Config { field, value: "empty".into(), expected: "a command has at least one column" });
    }
    for (column, range) in &columns {
        check_range(TermKind::Command, name, column, *range)?;
    }
    Ok(CommandTerm::uniform(name, columns))
}
