//! No code: the package selects features of third-party crates, as its Cargo.toml explains.
