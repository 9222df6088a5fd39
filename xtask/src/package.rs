//! Checks that all crates can be published: their manifests, the content of the packages, and the documentation as
//! docs.rs builds it.

use crate::run::{Failure, Repo, XtaskResult, in_ci, no_findings};
use crate::setup::{self, Prepared, Requirements};
use crate::test;
use serde_json::Value;
use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// The package that users depend on.
const FACADE: &str = "kinetoscope";
/// Folder of the committed declarations of MuJoCo 2.2.2.
const DECLARATIONS: &str = "mujoco-sys/docs_rs";

/// The command `cargo xtask package`: makes all packages and compiles each from its archive.
pub(crate) fn compile_all(repo: &Repo) -> XtaskResult {
    make(repo, &setup::prepare(repo, Requirements::default())?, &[])
}

/// The stage `package` of CI: checks the manifests and makes all packages, without compiling them again.
pub(crate) fn run(repo: &Repo, ready: &Prepared) -> XtaskResult {
    make(repo, ready, &["--no-verify", "--quiet"])
}

fn make(repo: &Repo, ready: &Prepared, options: &[&str]) -> XtaskResult {
    let packages = published(&repo.metadata);
    if !packages.iter().any(|package| package["name"] == FACADE) {
        return Err(Failure::new(format!("{FACADE} is not published: its manifest says `publish = false`")));
    }
    let findings: Vec<String> = packages.iter().flat_map(|package| mistakes(package)).collect();
    no_findings("manifests are not ready for publication", &findings)?;
    let mut cargo = ready.cargo_once().args(["package", "--allow-dirty"]).args(options);
    for name in packages.iter().filter_map(|package| package["name"].as_str()) {
        cargo = cargo.args(["--package", name]);
    }
    cargo.run()
}

/// Documents the facade as docs.rs does: without MuJoCo's headers, with the committed declarations. Checks first that
/// these are the declarations that the build generates. `ready` has MuJoCo 2.2.2.
pub(crate) fn docs_rs(repo: &Repo, ready: &Prepared) -> XtaskResult {
    let check = ["check", "--package", "kinetoscope-mujoco-sys", "--message-format", "json"];
    let messages = ready.cargo().args(check).args(test::SHARED_FEATURES).output()?;
    let messages = String::from_utf8_lossy(&messages).into_owned();
    let out = out_dir(&messages, &repo.root.join("mujoco-sys"))
        .ok_or_else(|| Failure::new("cargo did not name the folder of mujoco-sys's build script"))?;
    let what = format!("the declarations in {DECLARATIONS} are not those that its build generates");
    no_findings(&what, &outdated(&repo.root.join(DECLARATIONS), &out))?;
    // CI shares the compiled dependencies with other stages. Elsewhere, the pages would replace those of `cargo doc`.
    let folder = if in_ci() { repo.target.clone() } else { repo.target.join("docs-rs") };
    let cargo = ready.cargo().env("DOCS_RS", "1").env("MUJOCO_DIR", repo.target.join("without-mujoco"));
    let cargo = cargo.env("CARGO_TARGET_DIR", &folder).env("RUSTDOCFLAGS", "-D warnings --cfg docsrs");
    let cargo = cargo.env("RUSTDOC", rustdoc_as_nightly(&folder)?);
    let features: Vec<String> =
        docs_rs_features(&repo.metadata)?.iter().map(|name| format!("{FACADE}/{name}")).collect();
    cargo
        .args(["doc", "--no-deps", "--package", FACADE])
        .args(test::SHARED_FEATURES)
        .args(["--features", &features.join(",")])
        .run()
}

/// A program that calls rustdoc with the unstable features that docs.rs has, such as the names of features beside items.
/// Only rustdoc gets the variable for them: build scripts would choose other features, and compile the dependencies again.
fn rustdoc_as_nightly(folder: &Path) -> XtaskResult<PathBuf> {
    let program = folder.join("rustdoc-as-nightly");
    let fail = |e: io::Error| Failure::new(format!("{}: {e}", program.display()));
    fs::create_dir_all(folder).map_err(fail)?;
    fs::write(&program, "#!/bin/sh\nRUSTC_BOOTSTRAP=1 exec rustdoc \"$@\"\n").map_err(fail)?;
    fs::set_permissions(&program, Permissions::from_mode(0o755)).map_err(fail)?;
    Ok(program)
}

/// Features that docs.rs enables for the facade.
///
/// # Errors
/// The manifest names none: the items behind them would have no documentation.
fn docs_rs_features(metadata: &Value) -> XtaskResult<Vec<&str>> {
    let mut packages = metadata["packages"].as_array().into_iter().flatten();
    let facade = packages.find(|package| package["name"] == FACADE).unwrap_or(&Value::Null);
    let features = facade["metadata"]["docs"]["rs"]["features"].as_array().into_iter().flatten();
    let features: Vec<&str> = features.filter_map(Value::as_str).collect();
    let declared = facade["features"].as_object().into_iter().flatten().map(|(name, _)| name.as_str());
    let is_default =
        |name: &str| facade["features"]["default"].as_array().is_some_and(|all| all.iter().any(|d| d == name));
    // `internals` is for tests of this workspace.
    let documented = declared.filter(|name| !["default", "internals"].contains(name) && !is_default(name));
    let missing: Vec<&str> = documented.filter(|name| !features.contains(name)).collect();
    if features.is_empty() || !missing.is_empty() {
        let message = format!("[package.metadata.docs.rs] of {FACADE} has features {features:?}, not {missing:?}");
        return Err(Failure::new(message));
    }
    Ok(features)
}

/// The output folder of the build script of the package in `folder`, from cargo's messages.
fn out_dir(messages: &str, folder: &Path) -> Option<PathBuf> {
    let is_of = |message: &Value| {
        let id = message["package_id"].as_str().unwrap_or_default();
        message["reason"] == "build-script-executed" && id.contains(&format!("{}#", folder.display()))
    };
    let mut messages = messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    messages.find(is_of).and_then(|message| message["out_dir"].as_str().map(PathBuf::from))
}

/// Committed files (`NAME.txt`) that differ from the generated ones (`NAME` in `out`).
fn outdated(committed: &Path, out: &Path) -> Vec<String> {
    let differs = |name: &&str| {
        let [old, new] = [committed.join(format!("{name}.txt")), out.join(name)].map(std::fs::read);
        !matches!((old, new), (Ok(old), Ok(new)) if old == new)
    };
    let names = ["bindings.rs", "fields.rs"].into_iter().filter(differs);
    names
        .map(|name| format!("cp {} {}", out.join(name).display(), committed.join(format!("{name}.txt")).display()))
        .collect()
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

    /// An old, a missing and an empty declaration are reported with the command that replaces it.
    #[test]
    fn outdated_declarations() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let (committed, out) = (dir.path().join("docs_rs"), dir.path().join("out"));
        let write = |path: PathBuf, text| crate::wheel::tests::write(&path, text);
        for name in ["bindings.rs", "fields.rs"] {
            write(out.join(name), "new");
            write(committed.join(format!("{name}.txt")), "new");
        }
        assert!(outdated(&committed, &out).is_empty());
        write(committed.join("fields.rs.txt"), "old");
        let found = outdated(&committed, &out);
        assert!(found.len() == 1 && found[0].starts_with("cp ") && found[0].ends_with("fields.rs.txt"), "{found:?}");
        std::fs::remove_file(out.join("bindings.rs")).expect("removable");
        assert_eq!(outdated(&committed, &out).len(), 2);
    }

    #[test]
    fn output_folder() {
        let message = |folder: &str, out: &str| {
            json!({"reason": "build-script-executed", "package_id": format!("path+file:///a/{folder}#x@1"), "out_dir": out})
                .to_string()
        };
        let other = json!({"reason": "compiler-artifact", "package_id": "path+file:///a/sys#x@1"}).to_string();
        let messages = [other, message("look", "/out/1"), message("sys", "/out/2")].join("\n");
        assert_eq!(out_dir(&messages, Path::new("/a/sys")), Some(PathBuf::from("/out/2")));
        assert_eq!(out_dir(&messages, Path::new("/a/robot")), None);
    }

    #[test]
    fn features_of_docs_rs() {
        let with = |features: Value| {
            let declared =
                json!({"default": ["record", "viewer"], "record": [], "viewer": [], "lerobot": [], "internals": []});
            json!({"packages": [
                {"name": "other"},
                {"name": FACADE, "features": declared, "metadata": {"docs": {"rs": {"features": features}}}},
            ]})
        };
        assert_eq!(docs_rs_features(&with(json!(["lerobot"]))).expect("complete"), ["lerobot"]);
        for features in [json!([]), json!(null), json!(["download"])] {
            let failure = docs_rs_features(&with(features)).expect_err("the feature lerobot is missing");
            assert!(failure.message.contains("not [\"lerobot\"]"), "{failure}");
        }
        assert!(docs_rs_features(&json!({"packages": []})).is_err());
    }

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
