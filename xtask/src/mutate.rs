//! `cargo xtask mutate`: mutates the code in one place and runs the tests that should fail, for every mutation of the
//! lists (`mutations/`). Mutations are made in a copy of the tree below the target folder. The results are written to
//! `docs/mutations.md`; rows of other mutations are kept.

use crate::mutations::{self, Mutation};
use crate::progress::Progress;
use crate::run::{Failure, Repo, XtaskResult, no_findings};
use crate::setup::{self, MujocoVersion, Requirements};
use crate::source_check::{TextFile, files_below, text_files};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(crate) struct MutateArgs {
    /// Only mutations with this in their name, or with tests in the binary of this name
    filter: Option<String>,
}

/// Test result of a mutation.
#[derive(Debug, PartialEq, Eq)]
enum MutationResult {
    /// Names of the failed tests, and expected name parts without a failed test.
    Caught(Vec<String>, Vec<String>),
    Survived,
    /// The mutated code does not compile, or no test ran.
    NotTried(String),
}

pub(crate) fn run(repo: &Repo, args: &MutateArgs) -> XtaskResult {
    check_search_texts(&repo.root)?;
    let ready = setup::prepare(repo, Requirements { version: Some(MujocoVersion::Debian), extras: &[] })?;
    let folder = repo.target.join("mutate");
    let tree = folder.join("tree");
    copy(&repo.root, &tree)?;
    let is_chosen = |filter: &String, mutation: &Mutation| mutation.name.contains(filter) || mutation.tests.0 == filter;
    let chosen = |mutation: &&Mutation| args.filter.as_ref().is_none_or(|filter| is_chosen(filter, mutation));
    let chosen: Vec<&Mutation> = mutations::all().filter(chosen).collect();
    let (mut findings, mut table) = (Vec::new(), String::new());
    let test = |binary: &str, words: &[&str]| {
        let cargo = ready.cargo().current_dir(&tree).env("CARGO_TARGET_DIR", folder.join("target"));
        cargo.arg("test").args(target(binary)).arg("--").arg("--include-ignored").args(words).success_and_output()
    };
    // A test that fails on the unchanged code would seem to catch every mutation.
    for (binary, words) in binaries(&chosen) {
        let (passed, output) = test(binary, &words)?;
        if verdict(passed, &output, &words) != MutationResult::Survived {
            let what = format!("the tests of `{binary}` fail, or do not run, on code that is not mutated");
            return Err(Failure::new(format!("{what}:\n{output}")));
        }
    }
    let mut progress = Progress::new(chosen.len());
    for mutation in chosen {
        progress.begin(mutation.name);
        let path = tree.join(mutation.file);
        let good = read(&path)?;
        write(&path, &good.replace(mutation.search, mutation.replacement))?;
        let (binary, tests) = mutation.tests;
        let tested = test(binary, tests);
        write(&path, &good)?;
        let (passed, said) = tested?;
        let verdict = verdict(passed, &said, tests);
        let line = match &verdict {
            MutationResult::Caught(by, not_by) if not_by.is_empty() => {
                format!("caught   {}: {}", mutation.name, by.join(", "))
            }
            MutationResult::Caught(by, not_by) => {
                let (by, not_by) = (by.join(", "), not_by.join(", "));
                format!("caught   {}: {by}; not by {not_by}", mutation.name)
            }
            MutationResult::Survived => format!("SURVIVED {} ({})", mutation.name, mutation.file),
            MutationResult::NotTried(why) => format!("ERROR    {} ({}): {why}", mutation.name, mutation.file),
        };
        println!("{line}");
        table.push_str(&format!("{line}\n"));
        let by: &[String] = if let MutationResult::Caught(by, _) = &verdict { by } else { &[] };
        let path = repo.root.join(PAGE);
        write(&path, &page(&read(&path)?, &row(mutation, by)))?;
        // Every named test of a mutation must fail.
        if !matches!(&verdict, MutationResult::Caught(_, not_by) if not_by.is_empty()) {
            findings.push(line);
        }
    }
    if table.is_empty() {
        return Err(Failure::new("no mutation has such a name"));
    }
    progress.end();
    println!("\n{table}");
    no_findings("mutations that no test noticed", &findings)
}

/// The page of the results.
const PAGE: &str = "docs/mutations.md";

/// The page with a new row; rows of other mutations are taken from the old page.
fn page(old: &str, new: &str) -> String {
    let row_of = |mutation: &Mutation| {
        let beginning = beginning(mutation);
        [new].into_iter().chain(old.split_inclusive('\n')).find(|row| row.starts_with(&beginning))
    };
    let rows: Vec<&str> = mutations::all().filter_map(row_of).collect();
    let head = format!(
        "# Mutations\n\nWritten by `cargo xtask mutate`; do not edit. The code is broken in {} places, one by one, on MuJoCo 2.2.2, and \
         tests are run that have to notice: each of these changes made the tests fail that are named behind it. `nothing`: none did.\n\n\
         | what is wrong then | file | caught by |\n|---|---|---|\n",
        rows.len()
    );
    head + &rows.concat()
}

/// The beginning of a mutation's row.
fn beginning(mutation: &Mutation) -> String {
    format!("| {} | [{}]", mutation.name, mutation.file)
}

fn row(mutation: &Mutation, caught_by: &[String]) -> String {
    let by: Vec<String> = caught_by.iter().map(|name| format!("`{}`", name.trim_end_matches("::holds"))).collect();
    let by = if by.is_empty() { "nothing".into() } else { by.join(", ") };
    format!("{}(../{}) | {} |\n", beginning(mutation), mutation.file, by)
}

/// Checks that the search text of every mutation occurs in its file exactly once.
fn check_search_texts(root: &Path) -> XtaskResult {
    let mut findings = Vec::new();
    for Mutation { name, file, search, replacement, .. } in mutations::all() {
        let times = read(&root.join(file))?.matches(search).count();
        if times != 1 || search == replacement {
            findings.push(format!("{name}: its search text occurs {times} times in {file}, not once: {search:?}"));
        }
    }
    no_findings("mutations that do not fit the code (xtask/src/mutations)", &findings)
}

/// Names of tests in the last column of the page that are in no source file: neither as a function nor, for a law of
/// physics, as a file of the law. Compares only the last parts of a path.
fn missing_tests(page: &str, sources: &[TextFile]) -> Vec<String> {
    let exists = |path: &str| {
        let name = path.rsplit("::").next().unwrap_or(path);
        let law = format!("/{}.rs", path.replace("::", "/"));
        let function = [format!("fn {name}("), format!("fn {name}<")];
        sources.iter().any(|file| file.path.ends_with(&law) || function.iter().any(|start| file.text.contains(start)))
    };
    let column = |row: &str| row.split(" | ").nth(2).map(str::to_string);
    let names = page
        .lines()
        .filter_map(column)
        .flat_map(|tests| tests.split('`').skip(1).step_by(2).map(str::to_string).collect::<Vec<String>>());
    names.filter(|name| !exists(name)).collect()
}

/// Checks that every mutation applies, that the page matches the list, and that the tests it names exist.
pub(crate) fn check(root: &Path) -> XtaskResult {
    check_search_texts(root)?;
    let page = read(&root.join(PAGE))?;
    let sources: Vec<TextFile> = text_files(root).into_iter().filter(|file| file.path.ends_with(".rs")).collect();
    no_findings("tests of docs/mutations.md that do not exist: cargo xtask mutate", &missing_tests(&page, &sources))?;
    let mut findings: Vec<String> =
        mutations::all().filter(|mutation| !page.contains(&beginning(mutation))).map(|m| m.name.to_string()).collect();
    let rows = page.lines().filter(|line| line.starts_with("| ")).count() - 1;
    let count = mutations::all().count();
    if findings.is_empty() && rows != count {
        findings.push(format!("{rows} rows for {count} mutations"));
    }
    no_findings("docs/mutations.md does not match the list of mutations: cargo xtask mutate", &findings)
}

/// Cargo arguments that select the tests of a mutation.
fn target(binary: &str) -> Vec<&str> {
    match binary.split_once('/') {
        Some((package, test)) => vec!["--package", package, "--test", test],
        None if binary.starts_with("kinetoscope-") => vec!["--package", binary, "--lib"],
        None => vec!["--package", "kinetoscope", "--test", binary],
    }
}

/// The test binaries of some mutations, each with all of their test name parts.
fn binaries(mutations: &[&Mutation]) -> BTreeMap<&'static str, Vec<&'static str>> {
    let mut found: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (binary, name_parts) in mutations.iter().map(|mutation| mutation.tests) {
        let all = found.entry(binary).or_default();
        all.extend(name_parts);
        all.sort_unstable();
        all.dedup();
    }
    found
}

fn verdict(passed: bool, said: &str, words: &[&str]) -> MutationResult {
    let failed = |line: &str| Some(line.strip_prefix("test ")?.strip_suffix(" ... FAILED")?.to_string());
    let caught: Vec<String> = said.lines().filter_map(failed).collect();
    // An aborted test binary reports only the test that was running.
    if !caught.is_empty() {
        let misses = |word: &&&str| !caught.iter().any(|name| name.contains(**word));
        let missing = words.iter().filter(misses).map(|word| (*word).to_string()).collect();
        return MutationResult::Caught(caught, missing);
    }
    if !passed {
        return MutationResult::NotTried("no test failed: the change does not compile, or the tests died".into());
    }
    if said.lines().any(|line| line.starts_with("running ") && !line.starts_with("running 0 ")) {
        MutationResult::Survived
    } else {
        MutationResult::NotTried("no test has such a name".into())
    }
}

/// Updates `to` with the files below `from`, and removes other files from it. Unchanged files keep their time stamps,
/// so that cargo builds only changed code.
fn copy(from: &Path, to: &Path) -> XtaskResult {
    let wanted = files_below(from);
    for file in &wanted {
        let (source, copy): (PathBuf, PathBuf) = (from.join(file), to.join(file));
        let fail = |e: std::io::Error| Failure::new(format!("{}: {e}", copy.display()));
        let bytes = fs::read(&source).map_err(fail)?;
        if fs::read(&copy).is_ok_and(|old| old == bytes) {
            continue;
        }
        if let Some(folder) = copy.parent() {
            fs::create_dir_all(folder).map_err(fail)?;
        }
        fs::write(&copy, bytes).map_err(fail)?;
    }
    for file in files_below(to).into_iter().filter(|file| wanted.binary_search(file).is_err()) {
        let path = to.join(file);
        fs::remove_file(&path).map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
    }
    Ok(())
}

fn read(path: &Path) -> XtaskResult<String> {
    fs::read_to_string(path).map_err(|e| Failure::new(format!("{}: {e}", path.display())))
}

fn write(path: &Path, text: &str) -> XtaskResult {
    fs::write(path, text).map_err(|e| Failure::new(format!("{}: {e}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_enough_and_each_fits() {
        let all: Vec<&Mutation> = mutations::all().collect();
        assert!(all.len() >= 80);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        check_search_texts(&root).expect("every search text occurs once");
        for (k, mutation) in all.iter().enumerate() {
            assert!(all[..k].iter().all(|other| other.name != mutation.name), "{}", mutation.name);
            assert!(!mutation.tests.1.is_empty(), "{}", mutation.name);
        }
    }

    #[test]
    fn what_tests_say_is_understood() {
        let failed = "running 2 tests\ntest a::holds ... FAILED\ntest b::holds ... ok\n";
        assert_eq!(verdict(false, failed, &["a"]), MutationResult::Caught(vec!["a::holds".into()], Vec::new()));
        let partly = MutationResult::Caught(vec!["a::holds".into()], vec!["b".into()]);
        assert_eq!(verdict(false, failed, &["a", "b"]), partly);
        assert_eq!(verdict(true, "running 1 test\ntest a ... ok\n", &["a"]), MutationResult::Survived);
        assert!(matches!(verdict(false, "", &["a"]), MutationResult::NotTried(_)));
        assert!(matches!(verdict(true, "running 0 tests\n", &["a"]), MutationResult::NotTried(_)));
    }

    #[test]
    fn targets_of_cargo() {
        assert_eq!(target("api").join(" "), "--package kinetoscope --test api");
        assert_eq!(target("kinetoscope-scene").join(" "), "--package kinetoscope-scene --lib");
        assert_eq!(target("kinetoscope-cli/cli").join(" "), "--package kinetoscope-cli --test cli");
    }

    #[test]
    fn binaries_of_a_mutation() {
        let all = binaries(&mutations::all().collect::<Vec<_>>());
        for mutation in mutations::all() {
            let (binary, words) = mutation.tests;
            assert!(words.iter().all(|word| all[binary].contains(word)), "{}", mutation.name);
        }
        assert!(all["physics"].windows(2).all(|pair| pair[0] != pair[1]), "{all:?}");
    }

    #[test]
    fn pages() {
        let [first, second] = [0, 1].map(|k| mutations::all().nth(k).expect("there are two"));
        let old = page(&page("", &row(second, &["old".into()])), &row(first, &[]));
        assert!(old.contains("in 2 places") && old.ends_with("| `old` |\n"), "{old}");
        let new = page(&old, &row(second, &["new::holds".into()]));
        assert!(new.ends_with(&(row(first, &[]) + &row(second, &["new".into()]))), "{new}");
    }

    #[test]
    fn tests_that_do_not_exist() {
        let file = |path: &str, text: &str| TextFile { path: path.into(), text: text.into() };
        let sources = [file("tests/api/a.rs", "#[test]\nfn holds() {}"), file("tests/physics/drives/law.rs", "")];
        let page =
            "| what | file | caught by |\n|---|---|---|\n| x | [f](../f) | `a::holds`, `drives::law`, `a::hold` |\n";
        assert_eq!(missing_tests(page, &sources), ["a::hold"]);
    }

    #[test]
    fn a_copy_follows_the_tree() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let [from, to] = ["from", "to"].map(|name| dir.path().join(name));
        fs::create_dir_all(from.join("a")).expect("writable");
        for (file, text) in [("a/b.rs", "1"), ("c.rs", "2")] {
            fs::write(from.join(file), text).expect("writable");
        }
        copy(&from, &to).expect("copied");
        let time = || fs::metadata(to.join("a/b.rs")).and_then(|data| data.modified()).expect("a file");
        let before = time();
        fs::remove_file(from.join("c.rs")).expect("there");
        fs::write(from.join("d.rs"), "3").expect("writable");
        copy(&from, &to).expect("copied");
        assert_eq!(files_below(&to), ["a/b.rs", "d.rs"]);
        assert_eq!(time(), before);
    }
}
