//! What a page may ask for.

use serde::Deserialize;

/// A command of one viewer, as JSON: `{"do": "orbit", "dx": 0.1, "dy": 0}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Command {
    /// A picture or a state has arrived: the next may come.
    Seen { what: Seen },
    /// Pictures are to be so large \[pixels\].
    Size { width: usize, height: usize },
    /// Turns the view, in heights of the picture.
    Orbit { dx: f64, dy: f64 },
    /// Moves the view, in heights of the picture.
    Pan { dx: f64, dy: f64 },
    /// Comes nearer, in notches of a wheel.
    Zoom { by: f64 },
    /// Looks from where it began.
    Home,
    /// Looks at one environment, or at all.
    Environment { env: Option<usize> },
    /// Shows what a camera sensor sees, or none.
    Camera { name: Option<String> },
    /// Shows or hides something.
    Overlay { name: String, on: bool },
    /// Holds the simulation.
    Pause,
    /// Goes on.
    Play,
    /// Does one step, and holds then.
    Step,
    /// Resets the environment that is looked at, or all.
    Reset,
    /// Goes to a time of what was recorded \[s\].
    Seek { time: f64 },
    /// Simulated seconds per second; without bound where there is none.
    Speed { factor: Option<f64> },
    /// Selects what is seen at a point of the picture; nothing where that is the sky. Points are in parts of the picture's
    /// width and height, from its upper left.
    Select { x: f64, y: f64 },
    /// Selects nothing.
    Unselect,
    /// Takes hold of the body at a point of the picture, and selects it.
    Grab { x: f64, y: f64 },
    /// Pulls what is held to a point of the picture, or beside it, with a spring.
    Pull { x: f64, y: f64 },
    /// Lets go of it.
    Release,
    /// Begins to record, or ends it.
    Record { on: bool },
    /// Moves a joint's target \[rad or m\] in the environment that is looked at, or in all.
    Target { robot: String, joint: String, value: f64 },
}

/// What has arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Seen {
    /// A picture.
    Picture,
    /// Contents or a state.
    State,
}

impl Command {
    /// Reads a command; what is wrong with it is said in words.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let command: Self = serde_json::from_str(text).map_err(|error| format!("not understood: {error}"))?;
        command.check()?;
        Ok(command)
    }

    /// Numbers that mean something.
    fn check(&self) -> Result<(), String> {
        // A hand does not move further between two pictures.
        const FAR: f64 = 100.0;
        let within = |value: f64, what: &str| {
            if value.abs() <= FAR { Ok(()) } else { Err(format!("{what} is {value}: -{FAR} to {FAR} would do")) }
        };
        let inside = |value: f64, what: &str| {
            let found = (0.0..=1.0).contains(&value);
            if found { Ok(()) } else { Err(format!("{what} is {value}: the picture goes from 0 to 1")) }
        };
        match self {
            Self::Select { x, y } | Self::Grab { x, y } => inside(*x, "x").and_then(|()| inside(*y, "y")),
            Self::Pull { x, y } => within(*x, "x").and_then(|()| within(*y, "y")),
            Self::Orbit { dx, dy } | Self::Pan { dx, dy } => within(*dx, "dx").and_then(|()| within(*dy, "dy")),
            Self::Zoom { by } => within(*by, "by"),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse() {
        let (robot, joint) = ("sr5".into(), "J1".into());
        for (text, expected) in [
            (r#"{"do":"pause"}"#, Command::Pause),
            (r#"{"do":"seen","what":"picture"}"#, Command::Seen { what: Seen::Picture }),
            (r#"{"do":"environment","env":null}"#, Command::Environment { env: None }),
            (r#"{"do":"environment","env":3}"#, Command::Environment { env: Some(3) }),
            (r#"{"do":"zoom","by":-1.5}"#, Command::Zoom { by: -1.5 }),
            (r#"{"do":"select","x":0.25,"y":1}"#, Command::Select { x: 0.25, y: 1.0 }),
            (r#"{"do":"pull","x":-0.5,"y":2}"#, Command::Pull { x: -0.5, y: 2.0 }),
            (r#"{"do":"record","on":true}"#, Command::Record { on: true }),
            (r#"{"do":"seek","time":1.5}"#, Command::Seek { time: 1.5 }),
            (r#"{"do":"speed","factor":2}"#, Command::Speed { factor: Some(2.0) }),
            (r#"{"do":"target","robot":"sr5","joint":"J1","value":0.5}"#, Command::Target { robot, joint, value: 0.5 }),
        ] {
            assert_eq!(Command::parse(text), Ok(expected), "{text}");
        }
        for (text, says) in [
            ("", "not understood"),
            ("pause", "not understood"),
            ("[]", "not understood"),
            (&"[".repeat(10_000), ""),
            (r#"{"do":"fly"}"#, "unknown variant `fly`, expected one of `seen`"),
            (r#"{"do":"environment","env":-1}"#, "not understood"),
            (r#"{"do":"target","robot":"a","joint":"b","value":1e999}"#, "not understood"),
            (r#"{"do":"target","robot":"a","joint":"b"}"#, "missing field `value`"),
            (r#"{"do":"orbit","dx":1e300,"dy":0}"#, "dx is"),
            (r#"{"do":"zoom","by":-101}"#, "by is -101"),
            (r#"{"do":"select","x":1.5,"y":0}"#, "x is 1.5"),
            (r#"{"do":"grab","x":0.5,"y":-0.1}"#, "y is -0.1"),
            (r#"{"do":"pull","x":0.5,"y":1e5}"#, "y is 100000"),
            (r#"{"do":"record"}"#, "missing field `on`"),
        ] {
            let reason = Command::parse(text).expect_err(text);
            assert!(reason.contains(says), "{text}: {reason}");
        }
    }
}
