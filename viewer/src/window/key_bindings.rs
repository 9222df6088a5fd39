//! Key bindings of the window: one table that defines both the actions and the help text.

/// A key, identified by its label.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Key {
    /// A letter in lower case, a digit, a punctuation character, or a space.
    Char(char),
    /// Escape.
    Escape,
    /// Tab.
    Tab,
    /// Backspace.
    Backspace,
    /// Home.
    Home,
    /// The function key F1.
    F1,
    /// The left arrow key.
    Left,
    /// The right arrow key.
    Right,
    /// The up arrow key.
    Up,
    /// The down arrow key.
    Down,
    /// Page up.
    PageUp,
    /// Page down.
    PageDown,
}

/// The effect of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    Pause,
    Steps(u32),
    Slower,
    Faster,
    RealTime,
    FreeSpeed,
    Reset,
    Record,
    NextEnv,
    PreviousEnv,
    AllEnvs,
    NextCamera,
    FreeView,
    Overview,
    Follow,
    Fly([i8; 3]),
    Sensors,
    Contacts,
    Frames,
    JointAxes,
    CentersOfMass,
    Names,
    Trails,
    Collisions,
    Visuals,
    Panel,
    Sliders,
    Help,
    ClearSelection,
}

impl Action {
    /// True if a held key repeats the action: steps, and changes of environment and speed. Toggles do not repeat.
    pub(crate) fn repeats(self) -> bool {
        matches!(self, Self::Steps(_) | Self::NextEnv | Self::PreviousEnv | Self::Slower | Self::Faster)
    }
}

/// A key with its action and help text.
#[derive(Debug)]
pub(crate) struct Binding {
    pub(crate) key: Key,
    pub(crate) action: Action,
    /// Help text; keys with the same action share one line of the help.
    pub(crate) help: &'static str,
}

const fn key(key: Key, action: Action, help: &'static str) -> Binding {
    Binding { key, action, help }
}

/// All key bindings.
pub(crate) const BINDINGS: &[Binding] = &[
    key(Key::F1, Action::Help, "this help"),
    key(Key::Char('h'), Action::Help, "this help"),
    key(Key::Char(' '), Action::Pause, "pause, resume"),
    key(Key::Char('.'), Action::Steps(1), "one step, then pause"),
    key(Key::Char(','), Action::Steps(10), "ten steps, then pause"),
    key(Key::Char('-'), Action::Slower, "half speed"),
    key(Key::Char('='), Action::Faster, "double speed"),
    key(Key::Char('+'), Action::Faster, "double speed"),
    key(Key::Char('1'), Action::RealTime, "real time"),
    key(Key::Char('0'), Action::FreeSpeed, "unlimited speed"),
    key(Key::Backspace, Action::Reset, "reset the shown environments"),
    key(Key::Char('r'), Action::Record, "start or stop recording"),
    key(Key::PageDown, Action::NextEnv, "next environment"),
    key(Key::PageUp, Action::PreviousEnv, "previous environment"),
    key(Key::Char('g'), Action::AllEnvs, "all environments in their grid"),
    key(Key::Char('v'), Action::NextCamera, "look through the next camera sensor"),
    key(Key::Char('b'), Action::FreeView, "back to the free camera"),
    key(Key::Home, Action::Overview, "frame everything"),
    key(Key::Char('x'), Action::Follow, "follow the selection"),
    key(Key::Char('w'), Action::Fly([1, 0, 0]), "fly ahead"),
    key(Key::Char('s'), Action::Fly([-1, 0, 0]), "fly back"),
    key(Key::Char('a'), Action::Fly([0, -1, 0]), "fly to the left"),
    key(Key::Char('d'), Action::Fly([0, 1, 0]), "fly to the right"),
    key(Key::Char('e'), Action::Fly([0, 0, 1]), "fly up"),
    key(Key::Char('q'), Action::Fly([0, 0, -1]), "fly down"),
    key(Key::Up, Action::Fly([1, 0, 0]), "fly ahead"),
    key(Key::Down, Action::Fly([-1, 0, 0]), "fly back"),
    key(Key::Left, Action::Fly([0, -1, 0]), "fly to the left"),
    key(Key::Right, Action::Fly([0, 1, 0]), "fly to the right"),
    key(Key::Char('o'), Action::Sensors, "sensor markers"),
    key(Key::Char('c'), Action::Contacts, "contact forces"),
    key(Key::Char('f'), Action::Frames, "frames of links"),
    key(Key::Char('j'), Action::JointAxes, "axes of joints"),
    key(Key::Char('m'), Action::CentersOfMass, "centers of mass"),
    key(Key::Char('t'), Action::Names, "names"),
    key(Key::Char('l'), Action::Trails, "trails"),
    key(Key::Char('k'), Action::Collisions, "collision shapes"),
    key(Key::Char('u'), Action::Visuals, "visual shapes"),
    key(Key::Char('i'), Action::Panel, "camera: color, depth, mask, normals"),
    key(Key::Tab, Action::Sliders, "joint sliders"),
    key(Key::Escape, Action::ClearSelection, "clear selection, close help"),
];

/// Mouse actions of the help: gesture and effect.
pub(crate) const MOUSE_HELP: &[[&str; 2]] = &[
    ["drag", "orbit"],
    ["right drag", "pan"],
    ["middle drag", "look around"],
    ["wheel", "zoom"],
    ["click", "select"],
    ["Ctrl + drag", "pull a body with a spring"],
];

/// Returns the action of a key.
pub(crate) fn action(key: Key) -> Option<Action> {
    BINDINGS.iter().find(|binding| binding.key == key).map(|binding| binding.action)
}

/// Returns the label of a key.
pub(crate) fn label(key: Key) -> String {
    match key {
        Key::Char(' ') => "Space".into(),
        Key::Char(letter) => letter.to_uppercase().to_string(),
        Key::PageUp => "Page up".into(),
        Key::PageDown => "Page down".into(),
        other => format!("{other:?}"),
    }
}

/// Returns the lines of the help. Keys with the same action share a line.
pub(crate) fn help() -> Vec<[String; 2]> {
    let mut lines: Vec<(Action, [String; 2])> = Vec::new();
    for binding in BINDINGS {
        match lines.iter_mut().find(|(action, _)| *action == binding.action) {
            Some((_, [keys, _])) => *keys += &format!(", {}", label(binding.key)),
            None => lines.push((binding.action, [label(binding.key), binding.help.into()])),
        }
    }
    let mouse = MOUSE_HELP.iter().map(|line| line.map(String::from));
    lines.into_iter().map(|(_, line)| line).chain(mouse).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every key has one action, and the help names it.
    #[test]
    fn table() {
        let keys: std::collections::HashSet<Key> = BINDINGS.iter().map(|binding| binding.key).collect();
        assert_eq!(keys.len(), BINDINGS.len(), "a key is there twice");
        let help = help();
        for binding in BINDINGS {
            let named = |keys: &str| keys.split(", ").any(|key| key == label(binding.key));
            let said = |[keys, text]: &[String; 2]| text == binding.help && named(keys);
            assert!(help.iter().any(said), "{binding:?} is not in the help");
        }
        assert_eq!([' ', '~'].map(|key| action(Key::Char(key))), [Some(Action::Pause), None]);
        // Letters are 6 pixels wide; the columns have 84 and 229 pixels.
        let long = |[keys, text]: &[String; 2]| keys.len() > 13 || text.len() > 37;
        assert!(!help.iter().any(long), "a line does not fit into the help");
    }
}
