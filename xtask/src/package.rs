//! Checks that all crates can be published: their manifests, the content of the packages, and the documentation as
//! docs.rs builds it.

use crate::run::{Repo, XtaskResult, in_ci, no_findings};
use crate::setup::Prepared;
use crate::test;
use serde_json::Value;

/// Checks the manifests and makes all packages, without compiling them again.
pub(crate) fn run(repo: &Repo, ready: &Prepared) -> XtaskResult {
    let packages = published(&repo.metadata);
    let findings: Vec<String> = packages.iter().flat_map(|package| mistakes(package)).collect();
    no_findings("manifests are not ready for publication", &findings)?;
    let mut cargo = ready.cargo().args(["package", "--no-verify", "--allow-dirty", "--quiet"]);
    for name in packages.iter().filter_map(|package| package["name"].as_str()) {
        cargo = cargo.args(["--package", name]);
    }
    cargo.run()
}

/// Documents the facade as docs.rs does: without MuJoCo's headers, with the committed declarations.
pub(crate) fn docs_rs(repo: &Repo, ready: &Prepared) -> XtaskResult {
    // CI shares the compiled dependencies with other stages. Elsewhere, the pages would replace those of `cargo doc`.
    let folder = if in_ci() { repo.target.clone() } else { repo.target.join("docs-rs") };
    let cargo = ready.cargo().env("DOCS_RS", "1").env("MUJOCO_DIR", repo.target.join("without-mujoco"));
    let cargo = cargo.env("CARGO_TARGET_DIR", &folder).env("RUSTDOCFLAGS", "-D warnings");
    let features = ["download", "lerobot", "relocated-assets"].map(|name| format!("kinetoscope/{name}"));
    cargo
        .args(["doc", "--no-deps", "--package", "kinetoscope"])
        .args(test::SHARED_FEATURES)
        .args(["--features", &features.join(",")])
        .run()
}

/// Members of the workspace that are published.
fn published(metadata: &Value) -> Vec<&Value> {
    let packages = metadata["packages"].as_array().into_iter().flatten();
    packages.filter(|package| package["publish"].is_null()).collect()
}

/// Missing requirements of the publication of a package.
fn mistakes(package: &Value) -> Vec<String> {
    let name = package["name"].as_str().unwrap_or_default();
    let missing = ["description", "license", "readme", "rust_version"]
        .into_iter()
        .filter(|field| package[field].as_str().is_none_or(str::is_empty));
    let mut found: Vec<String> = missing.map(|field| format!("{name} has no {field}")).collect();
    for (field, most) in [("keywords", 5), ("categories", 5)] {
        let count = package[field].as_array().map_or(0, Vec::len);
        if !(1..=most).contains(&count) {
            found.push(format!("{name} has {count} {field}; crates.io takes 1 to {most}"));
        }
    }
    for dependency in package["dependencies"].as_array().into_iter().flatten().filter(|one| one["path"].is_string()) {
        let (other, req) = (dependency["name"].as_str().unwrap_or_default(), dependency["req"].as_str());
        let (is_dev, has_version) = (dependency["kind"] == "dev", req.is_some_and(|req| req != "*"));
        match (is_dev, has_version) {
            (false, false) => found.push(format!("{name} depends on {other} by path alone; add its version")),
            // Packages are published one after the other, and those of tests may come later.
            (true, true) => found.push(format!("{name} names a version of {other} for tests; write the path alone")),
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn manifests() {
        let good = json!({
            "name": "sim", "publish": null, "description": "d", "license": "MIT", "readme": "README.md",
            "rust_version": "1.95", "keywords": ["a"], "categories": ["simulation"],
            "dependencies": [
                {"name": "scene", "kind": null, "path": "/scene", "req": "^0.1.0"},
                {"name": "testkit", "kind": "dev", "path": "/testkit", "req": "*"},
                {"name": "regex", "kind": null, "path": null, "req": "*"},
            ],
        });
        assert!(mistakes(&good).is_empty(), "{:?}", mistakes(&good));
        for (field, value, named) in [
            ("description", json!(null), "description"),
            ("readme", json!(""), "readme"),
            ("keywords", json!(["a", "b", "c", "d", "e", "f"]), "6 keywords"),
            ("categories", json!([]), "0 categories"),
            ("dependencies", json!([{"name": "scene", "kind": "build", "path": "/s", "req": "*"}]), "path alone"),
            ("dependencies", json!([{"name": "kit", "kind": "dev", "path": "/s", "req": "^0.1.0"}]), "for tests"),
        ] {
            let mut bad = good.clone();
            bad[field] = value;
            let found = mistakes(&bad);
            assert!(found.len() == 1 && found[0].contains(named), "{named}: {found:?}");
        }
        let unpublished = json!({"packages": [good, {"name": "xtask", "publish": []}]});
        assert_eq!(published(&unpublished).len(), 1);
    }
}
