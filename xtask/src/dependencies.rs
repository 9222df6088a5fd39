//! Compares the dependencies between the workspace's packages with the list in ARCHITECTURE.md.

use crate::run::{Failure, Repo, XtaskResult, no_findings};
use crate::source_check::workspace_dependencies;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

const PAGE: &str = "ARCHITECTURE.md";

/// The package that selects features of crates that others depend on, for a reason of its own.
const WORKSPACE_HACK: &str = "kinetoscope-workspace-hack";

pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let page = repo.read(PAGE)?;
    let written = documented_dependencies(&page).map_err(Failure::new)?;
    let used = actual_dependencies(&repo.metadata);
    let mut findings = differences(&written, &used);
    findings.extend(cycle(&written));
    findings.extend(unlisted_dependencies(&repo.metadata, &repo.read("Cargo.toml")?));
    findings.extend(
        named_paths(&page)
            .into_iter()
            .filter(|path| !repo.root.join(path).exists())
            .map(|path| format!("{PAGE} names `{path}`, which does not exist")),
    );
    no_findings("the tree and ARCHITECTURE.md disagree", &findings)
}

type Dependency = (String, String);

/// The lines `a -> b` of the page's block ```` ```arrows ````; `#` starts a comment.
fn documented_dependencies(page: &str) -> Result<BTreeSet<Dependency>, String> {
    let mut arrows = BTreeSet::new();
    let block = page.lines().skip_while(|line| line.trim() != "```arrows").skip(1);
    for line in block.take_while(|line| line.trim() != "```") {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let (from, to) = line.split_once("->").ok_or_else(|| format!("{PAGE}: `{line}` is not `a -> b`"))?;
        arrows.insert((from.trim().to_string(), to.trim().to_string()));
    }
    if arrows.is_empty() {
        return Err(format!("{PAGE}: no block ```arrows with lines `a -> b` in it"));
    }
    Ok(arrows)
}

/// Dependencies between workspace members with their kind. Dev-dependencies are left out: tests may use any crate.
fn actual_dependencies(metadata: &Value) -> BTreeMap<Dependency, String> {
    let members: BTreeSet<&str> = packages(metadata).filter_map(|package| package["name"].as_str()).collect();
    let mut arrows = BTreeMap::new();
    for (from, dependency) in dependencies(metadata) {
        let Some(to) = dependency["name"].as_str().filter(|name| members.contains(name)) else { continue };
        let kind = dependency["kind"].as_str().unwrap_or("normal").to_string();
        if kind == "dev" {
            continue;
        }
        arrows.insert((from.to_string(), to.to_string()), kind);
    }
    arrows
}

fn packages(metadata: &Value) -> impl Iterator<Item = &Value> {
    metadata["packages"].as_array().into_iter().flatten()
}

fn dependencies(metadata: &Value) -> impl Iterator<Item = (&str, &Value)> {
    packages(metadata).flat_map(|package| {
        let name = package["name"].as_str().unwrap_or_default();
        package["dependencies"].as_array().into_iter().flatten().map(move |dependency| (name, dependency))
    })
}

fn differences(written: &BTreeSet<Dependency>, used: &BTreeMap<Dependency, String>) -> Vec<String> {
    let unwritten = used.iter().filter(|(arrow, _)| !written.contains(*arrow)).map(|((from, to), kind)| {
        format!("{from} -> {to} ({kind} dependency in its Cargo.toml) is not in the `arrows` block of {PAGE}")
    });
    let unused = written.iter().filter(|arrow| !used.contains_key(*arrow)).map(|(from, to)| {
        format!("{from} -> {to} is in the `arrows` block of {PAGE}, but {from} does not depend on {to}")
    });
    unwritten.chain(unused).collect()
}

/// A dependency cycle, if any. Dependencies without a predecessor or without a successor are removed repeatedly; the
/// rest forms cycles.
fn cycle(arrows: &BTreeSet<Dependency>) -> Option<String> {
    let mut left = arrows.clone();
    loop {
        let before = left.len();
        let (starts, ends): (BTreeSet<String>, BTreeSet<String>) = left.iter().cloned().unzip();
        left.retain(|(from, to)| ends.contains(from) && starts.contains(to));
        if left.len() == before {
            break;
        }
    }
    let names: Vec<String> = left.iter().map(|(from, to)| format!("{from} -> {to}")).collect();
    (!names.is_empty()).then(|| format!("dependencies must be acyclic; these form a cycle: {}", names.join(", ")))
}

/// Dependencies from a registry that bypass the table in the root's Cargo.toml, which gives the reasons.
fn unlisted_dependencies(metadata: &Value, cargo_toml: &str) -> Vec<String> {
    let listed = workspace_dependencies(cargo_toml);
    let is_listed =
        |name: &str| listed.iter().any(|(key, entry)| key == name || entry.contains(&format!("package = \"{name}\"")));
    dependencies(metadata)
        .filter(|(_, dependency)| dependency["source"].is_string())
        .filter_map(|(from, dependency)| Some((from, dependency["name"].as_str()?)))
        .filter(|(from, name)| *from != WORKSPACE_HACK && !is_listed(name))
        .map(|(from, name)| format!("{from} depends on {name}, which is not in [workspace.dependencies] of Cargo.toml"))
        .collect()
}

/// Inline code that looks like a path of the tree: it contains `/` or is a file name with a known extension.
fn named_paths(page: &str) -> Vec<String> {
    let mut in_block = false;
    let mut paths = Vec::new();
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
        } else if !in_block {
            // Every second part between backquotes is code.
            paths.extend(line.split('`').skip(1).step_by(2).filter(|code| is_path(code)).map(str::to_string));
        }
    }
    paths
}

fn is_path(code: &str) -> bool {
    let plain = code.chars().all(|c| c.is_ascii_alphanumeric() || "-_./".contains(c));
    let is_file = [".rs", ".md", ".toml", ".json", ".xml", ".urdf"].iter().any(|end| code.ends_with(end));
    plain && !code.starts_with(['/', '.']) && !code.starts_with("target/") && (code.contains('/') || is_file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn metadata() -> Value {
        json!({"packages": [
            {"name": "sim", "dependencies": [
                {"name": "scene", "kind": null, "source": null},
                {"name": "regex", "kind": null, "source": "registry"},
            ]},
            {"name": "scene", "dependencies": [{"name": "tempfile", "kind": "dev", "source": "registry"}]},
            {"name": "tests", "dependencies": [
                {"name": "sim", "kind": "build", "source": null},
                {"name": "scene", "kind": "dev", "source": null},
            ]},
        ]})
    }

    fn page(arrows: &str) -> String {
        format!("# A\n\n```arrows\n{arrows}\n```\n\n```text\nx -> y\n```\n")
    }

    fn findings(arrows: &str) -> Vec<String> {
        differences(&documented_dependencies(&page(arrows)).expect("a block"), &actual_dependencies(&metadata()))
    }

    /// Dependencies missing on either side are reported.
    #[test]
    fn both_sides() {
        for (arrows, named) in [
            ("sim -> scene  # poses\ntests -> sim", None),
            ("sim -> scene", Some("tests -> sim (build dependency")),
            ("sim -> scene\ntests -> sim\nscene -> sim", Some("scene -> sim is in the `arrows` block")),
        ] {
            let found = findings(arrows);
            assert_eq!(found.len(), usize::from(named.is_some()), "{found:?}");
            assert!(found.iter().all(|text| text.starts_with(named.unwrap_or_default())), "{found:?}");
        }
    }

    #[test]
    fn broken_pages() {
        assert!(documented_dependencies("# A\n").is_err());
        assert!(documented_dependencies(&page("sim => scene")).is_err());
    }

    #[test]
    fn circle() {
        let arrows = |text: &str| documented_dependencies(&page(text)).expect("a block");
        assert_eq!(cycle(&arrows("a -> b\nb -> c\na -> c")), None);
        assert!(cycle(&arrows("a -> b\nb -> c\nc -> b")).is_some_and(|text| text.contains("c -> b")));
    }

    #[test]
    fn unlisted() {
        let toml = "[workspace.dependencies]\nregex = \"1\" # patterns\n";
        let found = unlisted_dependencies(&metadata(), toml);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("scene depends on tempfile"), "{}", found[0]);
    }

    #[test]
    fn paths() {
        let page = "`sim/src/lib.rs`, `Cargo.toml` and `docs/`, but `sim::mj`, `a -> b`, `x/y z`, `cargo xtask ci`, \
                    `target/wheels`\n```text\n`no/where`\n```\n";
        assert_eq!(named_paths(page), ["sim/src/lib.rs", "Cargo.toml", "docs/"]);
    }
}
