//! [`Mutation`]: one change of the code.

/// One change of the code.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mutation {
    /// Short description of the mistake.
    pub(crate) name: &'static str,
    pub(crate) file: &'static str,
    /// Replaced text, which occurs in the file exactly once.
    pub(crate) search: &'static str,
    pub(crate) replacement: &'static str,
    /// The test binary, and parts of the names of its tests. The binary is a test of the root package (`api`), a test
    /// of another package (`kinetoscope-record/record`), or the unit tests of a package (`kinetoscope-scene`).
    pub(crate) tests: (&'static str, &'static [&'static str]),
}

impl Mutation {
    pub(super) const fn of(
        binary: &'static str,
        name: &'static str,
        file: &'static str,
        [search, replacement]: [&'static str; 2],
        tests: &'static [&'static str],
    ) -> Self {
        Self { name, file, search, replacement, tests: (binary, tests) }
    }
}
