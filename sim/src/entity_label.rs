//! Label of an entity in error messages.

use std::fmt;

/// Label of a robot, passive articulation or attached MJCF file in error messages: `robot "arm"`, `articulation
/// "drawer"`, `MJCF part "gripper"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EntityLabel {
    /// Type of the entity: `robot`, `articulation` or `MJCF part`.
    pub kind: &'static str,
    /// Uid of the entity.
    pub uid: String,
}

impl fmt::Display for EntityLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}", self.kind, self.uid)
    }
}

/// Labels a robot.
impl From<&str> for EntityLabel {
    fn from(uid: &str) -> Self {
        Self { kind: "robot", uid: uid.into() }
    }
}

/// Labels a robot.
impl From<&String> for EntityLabel {
    fn from(uid: &String) -> Self {
        uid.as_str().into()
    }
}

/// Compares the uid only, not the kind.
impl PartialEq<str> for EntityLabel {
    fn eq(&self, uid: &str) -> bool {
        self.uid == uid
    }
}

/// Compares the uid only, not the kind.
impl PartialEq<&str> for EntityLabel {
    fn eq(&self, uid: &&str) -> bool {
        self.uid == *uid
    }
}
