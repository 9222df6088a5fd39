//! What viewers are told of commands that were refused.

use crate::control::Command;

/// What a command is about: a spring that is pulled asks many times a second, and says nothing of other commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Spring,
    Other,
}

impl Kind {
    pub(super) fn of(command: &Command) -> Self {
        if matches!(command, Command::Drag { .. } | Command::Release) { Self::Spring } else { Self::Other }
    }
}

/// The last refusal, until something else is done, and how many there were.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    last: Option<(Kind, String)>,
    count: u64,
}

impl Refusals {
    /// A command was done, or refused.
    pub(super) fn answer(&mut self, kind: Kind, done: Result<(), String>) {
        match done {
            Ok(()) => {
                self.last.take_if(|(of, _)| kind == Kind::Other || *of == kind);
            }
            Err(reason) => self.note(kind, Some(reason)),
        }
    }

    /// Something was refused, if there is a reason.
    pub(super) fn note(&mut self, kind: Kind, reason: Option<String>) {
        if let Some(reason) = reason {
            self.count += 1;
            self.last = Some((kind, reason));
        }
    }

    /// Nobody is there any more who was told.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }

    pub(super) fn reason(&self) -> Option<String> {
        self.last.as_ref().map(|(_, reason)| reason.clone())
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }
}
