//! Import cycles: files of a crate that use each other, directly or through other files.
//!
//! An edge leads from a file to the file that defines an item named by one of its paths (`use crate::..`, `super::..`,
//! or a path in code). Re-exports are followed to the definition, and are not edges themselves. Tests are ignored.

use crate::run::{Repo, XtaskResult, no_findings};
use crate::source_check::{TextFile, code_only, text_files};
use std::collections::{BTreeMap, BTreeSet};

/// Number of files in the largest allowed cycle.
const MAX_CYCLE_FILES: usize = 5;

type Path = Vec<String>;

pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let findings: Vec<String> = import_cycles(&text_files(&repo.root))
        .into_iter()
        .filter(|cycle| cycle.len() > MAX_CYCLE_FILES)
        .map(|cycle| format!("{} files import each other: {}", cycle.len(), cycle.join(", ")))
        .collect();
    no_findings("import cycles of more than 5 files; move the shared items into a separate file", &findings)
}

/// All cycles, the largest first.
fn import_cycles(files: &[TextFile]) -> Vec<Vec<String>> {
    let mut crates: BTreeMap<&str, Vec<&TextFile>> = BTreeMap::new();
    for file in files.iter().filter(|file| file.path.ends_with(".rs") && !is_test(&file.path)) {
        let Some((name, _)) = file.path.split_once("src/") else { continue };
        if name.is_empty() || name.matches('/').count() == 1 {
            crates.entry(name).or_default().push(file);
        }
    }
    let mut found: Vec<Vec<String>> = crates.values().flat_map(|files| Crate::new(files).import_cycles()).collect();
    found.sort_by_key(|cycle| std::cmp::Reverse(cycle.len()));
    found
}

fn is_test(path: &str) -> bool {
    path.split('/').any(|part| part == "tests" || part.starts_with("tests_") || part == "tests.rs")
}

/// The files of a crate by module, and the names that each module imports.
struct Crate {
    files: BTreeMap<Path, String>,
    uses: BTreeMap<Path, Vec<Use>>,
    paths: BTreeMap<Path, Vec<Path>>,
}

/// One name of a `use` item.
struct Use {
    path: Path,
    name: String,
    public: bool,
}

impl Crate {
    fn new(files: &[&TextFile]) -> Self {
        let mut this = Self { files: BTreeMap::new(), uses: BTreeMap::new(), paths: BTreeMap::new() };
        for file in files {
            let (module, code) = (module_of(&file.path), without_tests(&code_only(&file.text)));
            let (uses, paths) = scan(&code);
            this.files.insert(module.clone(), file.path.clone());
            this.uses.insert(module.clone(), uses);
            this.paths.insert(module, paths);
        }
        this
    }

    /// The module and item of a written path, from the root of the crate; `None` for a path that begins with neither a
    /// keyword nor a child module, such as one of another crate.
    fn resolve(&self, module: &Path, written: &[String]) -> Option<Path> {
        let mut base = module.clone();
        let mut rest = written;
        match written.first()?.as_str() {
            "crate" => (base, rest) = (Vec::new(), &written[1..]),
            "self" => rest = &written[1..],
            "super" => {
                while rest.first().is_some_and(|part| part == "super") {
                    base.pop()?;
                    rest = &rest[1..];
                }
            }
            first => {
                let child: Path = module.iter().cloned().chain([first.to_owned()]).collect();
                if !self.files.contains_key(&child) {
                    return None;
                }
            }
        }
        base.extend(rest.iter().cloned());
        Some(base)
    }

    /// The path with re-exports replaced by their targets.
    fn follow_reexports(&self, path: Path, depth: usize) -> Path {
        for split in 0..path.len() {
            let (module, name) = (path[..split].to_vec(), &path[split]);
            let is_module = self.files.contains_key(&path[..=split]);
            let Some(uses) = self.uses.get(&module).filter(|_| !is_module && depth < 12) else { continue };
            if let Some(import) = uses.iter().find(|import| import.name == *name)
                && let Some(mut target) = self.resolve(&module, &import.path)
            {
                target.extend(path[split + 1..].iter().cloned());
                return self.follow_reexports(target, depth + 1);
            }
        }
        path
    }

    fn file_of(&self, path: &[String]) -> Option<&String> {
        (0..=path.len()).rev().find_map(|length| self.files.get(&path[..length]))
    }

    fn import_cycles(&self) -> Vec<Vec<String>> {
        let mut edges: BTreeMap<&String, BTreeSet<&String>> = BTreeMap::new();
        for (module, file) in &self.files {
            let used = self.uses[module].iter().filter(|import| !import.public).map(|import| &import.path);
            let targets = used.chain(&self.paths[module]).filter_map(|written| {
                let path = self.follow_reexports(self.resolve(module, written)?, 0);
                self.file_of(&path).filter(|target| *target != file)
            });
            edges.entry(file).or_default().extend(targets);
        }
        // Files that reach each other form a cycle.
        let reach: BTreeMap<&String, BTreeSet<&String>> =
            edges.keys().map(|file| (*file, reached(file, &edges))).collect();
        let mut found: BTreeSet<Vec<String>> = BTreeSet::new();
        for (file, ahead) in &reach {
            let cycle: Vec<String> =
                ahead.iter().filter(|other| reach[**other].contains(file)).map(|s| (*s).clone()).collect();
            if cycle.len() > 1 {
                found.insert(cycle);
            }
        }
        found.into_iter().collect()
    }
}

/// All files that a file uses, directly or indirectly.
fn reached<'a>(from: &'a String, arrows: &BTreeMap<&'a String, BTreeSet<&'a String>>) -> BTreeSet<&'a String> {
    let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
    while let Some(file) = next.pop() {
        for target in arrows.get(file).into_iter().flatten() {
            if seen.insert(*target) {
                next.push(target);
            }
        }
    }
    seen
}

/// The module of a file: `sim/src/mjcf/mod.rs` is `mjcf`.
fn module_of(path: &str) -> Path {
    let inside = path.split_once("src/").map_or(path, |(_, inside)| inside).trim_end_matches(".rs");
    let mut parts: Path = inside.split('/').map(String::from).collect();
    if matches!(parts.last().map(String::as_str), Some("mod")) || matches!(inside, "lib" | "main") {
        parts.pop();
    }
    parts
}

/// The code before its first module of unit tests.
fn without_tests(code: &str) -> String {
    let mut from = 0;
    while let Some(at) = code[from..].find("#[cfg(test)]").map(|at| from + at) {
        let after = code[at + "#[cfg(test)]".len()..].trim_start();
        let after = if after.starts_with("#[") {
            after.split_once(']').map_or("", |(_, rest)| rest).trim_start()
        } else {
            after
        };
        if after.starts_with("mod ")
            && after.split_once(['{', ';']).is_some_and(|(head, _)| after[head.len()..].starts_with('{'))
        {
            return code[..at].to_owned();
        }
        from = at + 1;
    }
    code.to_owned()
}

/// The `use` items and other paths of a file.
fn scan(code: &str) -> (Vec<Use>, Vec<Path>) {
    let tokens = tokens(code);
    let (mut uses, mut paths, mut at) = (Vec::new(), Vec::new(), 0);
    while at < tokens.len() {
        let before = at.checked_sub(1).map_or("", |k| tokens[k]);
        if tokens[at] == "use" && (matches!(before, "" | ";" | "{" | "}" | "]" | "pub" | ")")) {
            let public = matches!(before, "pub" | ")");
            at = tree(&tokens, at + 1, &[], public, &mut uses);
        } else if is_name(tokens[at]) && before != "::" && tokens.get(at + 1) == Some(&"::") {
            let mut path = vec![tokens[at].to_owned()];
            while tokens.get(at + 1) == Some(&"::") && tokens.get(at + 2).is_some_and(|next| is_name(next)) {
                path.push(tokens[at + 2].to_owned());
                at += 2;
            }
            paths.push(path);
            at += 1;
        } else {
            at += 1;
        }
    }
    (uses, paths)
}

/// Reads a `use` tree from `at`; returns its end.
fn tree(tokens: &[&str], mut at: usize, prefix: &[String], public: bool, uses: &mut Vec<Use>) -> usize {
    let mut path = prefix.to_vec();
    loop {
        match tokens.get(at) {
            Some(&"{") => {
                at += 1;
                while tokens.get(at).is_some_and(|token| *token != "}") {
                    at = tree(tokens, at, &path, public, uses);
                    at += usize::from(tokens.get(at) == Some(&","));
                }
                return at + 1;
            }
            Some(&"::") => at += 1,
            Some(name) if is_name(name) => {
                if *name != "self" || path.is_empty() {
                    path.push((*name).to_owned());
                }
                at += 1;
                if tokens.get(at) != Some(&"::") {
                    let mut name = path.last().cloned().unwrap_or_default();
                    if tokens.get(at) == Some(&"as") {
                        name = tokens.get(at + 1).map_or(name, |alias| (*alias).to_owned());
                        at += 2;
                    }
                    uses.push(Use { path, name, public });
                    return at;
                }
            }
            // A glob, or the end.
            _ => return at + 1,
        }
    }
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_') && token != "as"
}

/// Names, `::` and single characters.
fn tokens(code: &str) -> Vec<&str> {
    let (mut out, mut rest) = (Vec::new(), code);
    while let Some(first) = rest.chars().next() {
        let length = if first.is_alphanumeric() || first == '_' {
            rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        if !first.is_whitespace() {
            out.push(&rest[..length]);
        }
        rest = &rest[length..];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(texts: &[(&str, &str)]) -> Vec<TextFile> {
        texts.iter().map(|(path, text)| TextFile { path: (*path).into(), text: (*text).into() }).collect()
    }

    /// A cycle through a re-export and a path in code. Tests, comments and other crates add no edges.
    #[test]
    fn circles_of_files() {
        let tree = files(&[
            ("a/src/lib.rs", "mod x; mod y; mod z; pub use x::X;"),
            ("a/src/x.rs", "use super::{y::Y, other};\nstruct X;"),
            ("a/src/y/mod.rs", "mod inner; fn f() { inner::g() } // crate::z::Z"),
            ("a/src/y/inner.rs", "fn g(_: crate::X) {}"),
            ("a/src/z.rs", "use crate::x::X;\n#[cfg(test)]\nmod tests { use crate::w::W; }"),
            ("a/src/w.rs", "use crate::z::Z;"),
            ("b/src/lib.rs", "use a::x::X;"),
        ]);
        assert_eq!(import_cycles(&tree), [["a/src/x.rs", "a/src/y/inner.rs", "a/src/y/mod.rs"]]);
        // Control: without the path in `y` there is no cycle.
        let mut open = tree;
        open[2].text = "mod inner;".into();
        assert!(import_cycles(&open).is_empty());
    }
}
