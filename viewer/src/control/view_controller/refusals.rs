//! Refused commands, as reported to viewers.

use crate::control::Command;

/// Group of a command. A mouse spring sends many commands per second, and their success must not clear other refusals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CommandKind {
    Spring,
    Other,
}

impl CommandKind {
    pub(super) fn of(command: &Command) -> Self {
        if matches!(command, Command::Drag { .. } | Command::Release) { Self::Spring } else { Self::Other }
    }
}

/// The last refusal, kept until a later success clears it, and the total count.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    last: Option<(CommandKind, String)>,
    count: u64,
}

impl Refusals {
    /// Records the result of a command. A success of a spring command clears only a refusal of the spring; any other
    /// success clears every refusal.
    pub(super) fn record_result(&mut self, kind: CommandKind, done: Result<(), String>) {
        match done {
            Ok(()) => {
                self.last.take_if(|(of, _)| kind == CommandKind::Other || *of == kind);
            }
            Err(reason) => self.record_refusal(kind, Some(reason)),
        }
    }

    /// Records a refusal if there is a reason.
    pub(super) fn record_refusal(&mut self, kind: CommandKind, reason: Option<String>) {
        if let Some(reason) = reason {
            self.count += 1;
            self.last = Some((kind, reason));
        }
    }

    /// Clears the last refusal, after the last viewer was dropped.
    pub(super) fn clear(&mut self) {
        self.last = None;
    }

    pub(super) fn last_reason(&self) -> Option<String> {
        self.last.as_ref().map(|(_, reason)| reason.clone())
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }
}
