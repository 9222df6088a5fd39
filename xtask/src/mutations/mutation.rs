//! [`Mutation`]: one change of one place.

/// One change of one place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mutation {
    /// The mistake, in a few words.
    pub(crate) name: &'static str,
    pub(crate) file: &'static str,
    /// Stands in the file exactly once.
    pub(crate) search: &'static str,
    pub(crate) replacement: &'static str,
    /// The tests that are run: a test of the root package (`api`), of another package (`kinetoscope-record/record`) or the unit
    /// tests of a package (`kinetoscope-scene`); and words in the names of the tests.
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
