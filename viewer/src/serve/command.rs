//! Commands from the page.

use serde::Deserialize;

/// A command from one browser, as JSON: `{"do": "orbit", "dx": 0.1, "dy": 0}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Command {
    /// Acknowledges an image or a state, so that the next one can be sent.
    Seen { what: Seen },
    /// Sets the size of the page's image area \[pixels\]; large images are rendered at lower resolution.
    Size { width: usize, height: usize },
    /// Orbits the camera by fractions of the image height.
    Orbit { dx: f64, dy: f64 },
    /// Pans the camera by fractions of the image height.
    Pan { dx: f64, dy: f64 },
    /// Zooms in by steps of a mouse wheel; negative steps zoom out.
    Zoom { by: f64 },
    /// Returns the camera to its initial pose.
    Home,
    /// Shows one environment, or all for `None`.
    Environment { env: Option<usize> },
    /// Shows the images of a camera sensor; `None` hides them.
    Camera { name: Option<String> },
    /// Enables or disables an overlay.
    Overlay { name: String, on: bool },
    /// Pauses the simulation.
    Pause,
    /// Resumes the simulation.
    Play,
    /// Runs one step, then pauses.
    Step,
    /// Resets the shown environment, or all environments if all are shown.
    Reset,
    /// Seeks to a time of a recording \[s\].
    Seek { time: f64 },
    /// Sets the speed in simulated seconds per second; `None` is as fast as the machine can step.
    Speed { factor: Option<f64> },
    /// Selects the object at an image point, or nothing for the sky. Points are fractions of the image width and
    /// height, from the upper left corner.
    Select { x: f64, y: f64 },
    /// Clears the selection.
    Unselect,
    /// Grabs the body at an image point with a mouse spring, and selects it.
    Grab { x: f64, y: f64 },
    /// Pulls the grabbed body toward an image point, which may be outside the image.
    Pull { x: f64, y: f64 },
    /// Releases the grabbed body.
    Release,
    /// Starts or stops the recording.
    Record { on: bool },
    /// Sets the position target of a joint \[rad or m\] in the shown environment, or in all environments if all are
    /// shown.
    Target { robot: String, joint: String, value: f64 },
}

/// Kind of an acknowledged message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Seen {
    /// An image.
    Picture,
    /// Scene contents or a state.
    State,
}

impl Command {
    /// Parses and validates a command. Returns the reason of a failure as a text.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let command: Self = serde_json::from_str(text).map_err(|error| format!("invalid command: {error}"))?;
        command.check()?;
        Ok(command)
    }

    /// Checks that the numbers are in a sensible range.
    fn check(&self) -> Result<(), String> {
        // A larger mouse motion between two images is implausible.
        const FAR: f64 = 100.0;
        let within = |value: f64, what: &str| {
            if value.abs() <= FAR { Ok(()) } else { Err(format!("{what} is {value}; it must be -{FAR} to {FAR}")) }
        };
        let inside = |value: f64, what: &str| {
            let found = (0.0..=1.0).contains(&value);
            if found { Ok(()) } else { Err(format!("{what} is {value}; it must be 0 to 1")) }
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
            ("", "invalid command"),
            ("pause", "invalid command"),
            ("[]", "invalid command"),
            (&"[".repeat(10_000), ""),
            (r#"{"do":"fly"}"#, "unknown variant `fly`, expected one of `seen`"),
            (r#"{"do":"environment","env":-1}"#, "invalid command"),
            (r#"{"do":"target","robot":"a","joint":"b","value":1e999}"#, "invalid command"),
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
