//! Whose joints an error is about.

use std::fmt;

/// A robot or another articulation, as errors call it: `robot "arm"`, `articulation "drawer"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// What it is: `robot` or `articulation`.
    pub what: &'static str,
    /// Its name.
    pub uid: String,
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}", self.what, self.uid)
    }
}

/// A robot.
impl From<&str> for Named {
    fn from(uid: &str) -> Self {
        Self { what: "robot", uid: uid.into() }
    }
}

/// A robot.
impl From<&String> for Named {
    fn from(uid: &String) -> Self {
        uid.as_str().into()
    }
}

/// By its name.
impl PartialEq<str> for Named {
    fn eq(&self, uid: &str) -> bool {
        self.uid == uid
    }
}

/// By its name.
impl PartialEq<&str> for Named {
    fn eq(&self, uid: &&str) -> bool {
        self.uid == *uid
    }
}
