//! Flags that examples without a moment to watch refuse in words.

use super::Result;
use std::path::PathBuf;

/// `--serve`, `--record` and `--headless` of examples that look at a model and step nothing, or end at once.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct StillFlags {
    /// Not for this example, in which nothing moves: `kinetoscope view FILE --serve` shows a model in browsers
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", hide_short_help = true)]
    serve: Option<String>,
    /// Not for this example, in which nothing moves: `kinetoscope view FILE --record FILE` records
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    record: Option<PathBuf>,
    /// As every example has it; this one never opens a window
    #[arg(long, hide_short_help = true)]
    headless: bool,
}

impl StillFlags {
    /// Refuses what cannot be done.
    ///
    /// # Errors
    /// `--serve` or `--record` was given.
    pub(crate) fn check(&self) -> Result {
        refuse(self.serve.is_some(), self.record.is_some())
    }
}

/// Refuses to serve and to record.
///
/// # Errors
/// One of them is asked for.
pub(crate) fn refuse(serve: bool, record: bool) -> Result {
    for (asked, flag) in [(serve, "--serve"), (record, "--record")] {
        if asked {
            return Err(format!(
                "{flag} is not for this example: it ends with what it has drawn or printed, and nobody could watch it; \
                 create_robot and create_sensor move, and `kinetoscope view FILE {flag}` takes any model"
            )
            .into());
        }
    }
    Ok(())
}
