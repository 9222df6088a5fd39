//! Label of an entity in error messages.

use std::fmt;

/// A robot or passive articulation in error messages: `robot "arm"`, `articulation "drawer"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Type of the entity: `robot` or `articulation`.
    pub what: &'static str,
    /// Uid of the entity.
    pub uid: String,
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}", self.what, self.uid)
    }
}

/// Labels a robot.
impl From<&str> for Named {
    fn from(uid: &str) -> Self {
        Self { what: "robot", uid: uid.into() }
    }
}

/// Labels a robot.
impl From<&String> for Named {
    fn from(uid: &String) -> Self {
        uid.as_str().into()
    }
}

/// Compares the uid.
impl PartialEq<str> for Named {
    fn eq(&self, uid: &str) -> bool {
        self.uid == uid
    }
}

/// Compares the uid.
impl PartialEq<&str> for Named {
    fn eq(&self, uid: &&str) -> bool {
        self.uid == *uid
    }
}
