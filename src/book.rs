//! Compiles the Rust blocks of the book's pages (`docs/`) as doc tests. `cargo xtask ci` checks that every page with a
//! Rust block is listed.

/// Declares an item with the text of each page as its documentation.
macro_rules! pages {
    ($($(#[$condition:meta])* $name:ident: $page:literal;)*) => {
        $(
            $(#[$condition])*
            #[doc = include_str!($page)]
            struct $name;
        )*
    };
}

pages! {
    Cameras: "../docs/cameras.md";
    ComingFrom: "../docs/coming-from.md";
    Determinism: "../docs/determinism.md";
    FirstCamera: "../docs/first-camera.md";
    FirstRobot: "../docs/first-robot.md";
    Gpu: "../docs/gpu.md";
    #[cfg(feature = "record")]
    Recordings: "../docs/recording.md";
    Robots: "../docs/robots.md";
    Scenes: "../docs/scenes.md";
    #[cfg(feature = "viewer")]
    Seeing: "../docs/seeing.md";
    Sensors: "../docs/sensors.md";
    Tasks: "../docs/tasks.md";
}
