//! Checks of the documentation pages: their commands parse, their links have targets, the book contains all pages, their
//! Rust blocks are compiled as doc tests, and the tests in the table of faults exist.

use crate::Cli;
use crate::faults;
use crate::run::{Repo, XtaskResult, no_findings};
use crate::source_check::files_below;
use clap::Parser;

const README: &str = "README.md";
/// The two commands for new users. CI runs both as they are written.
pub(crate) const README_COMMANDS: [&str; 2] = ["cargo xtask demo", TEST_COMMAND];
pub(crate) const TEST_COMMAND: &str = "cargo xtask test";
const NEEDED: [&str; 4] = [README, "ARCHITECTURE.md", "CONTRIBUTING.md", faults::PAGE];
/// The table of contents of the book.
const SUMMARY: &str = "docs/SUMMARY.md";
/// Files that compile the Rust blocks of pages.
const DOC_TESTS: [&str; 2] = ["src/lib.rs", "src/book.rs"];

pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let mut pages: Vec<String> = files_below(&repo.root).into_iter().filter(|path| is_page(path)).collect();
    pages.extend(NEEDED.map(str::to_string));
    pages.sort();
    pages.dedup();
    let mut findings = Vec::new();
    let chapters = chapters(&repo.read(SUMMARY)?);
    let mut doc_tests = String::new();
    for file in DOC_TESTS {
        doc_tests += &repo.read(file)?;
    }
    for path in &pages {
        let Ok(page) = repo.read(path) else {
            findings.push(format!("{path} does not exist"));
            continue;
        };
        if path == README {
            findings.extend(missing_commands(&page).into_iter().map(|finding| format!("{path}: {finding}")));
        }
        findings.extend(commands_that_do_not_parse(&page).into_iter().map(|finding| format!("{path}: {finding}")));
        if path.starts_with("docs/") && path != SUMMARY && !chapters.contains(path) {
            findings.push(format!("{path} is not a chapter of the book; add it to {SUMMARY}"));
        }
        findings.extend(uncompiled_blocks(path, &page, &doc_tests));
        if path == faults::PAGE {
            findings.extend(faults::findings(&page, |path| repo.read(path).ok()));
        }
        let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
        for link in relative_links(&page) {
            if !repo.root.join(folder).join(&link).exists() {
                findings.push(format!("{path}: the link to `{link}` leads nowhere"));
            }
        }
    }
    no_findings("the documentation is not true", &findings)
}

/// True for pages of the project: those in the root and in docs/. Pages of bundled robots are excluded.
fn is_page(path: &str) -> bool {
    path.ends_with(".md") && (!path.contains('/') || path.starts_with("docs/"))
}

/// Paths of the pages that the table of contents names.
fn chapters(summary: &str) -> Vec<String> {
    relative_links(summary).into_iter().map(|link| format!("docs/{link}")).collect()
}

/// Findings about blocks that rustdoc takes for Rust: pages that no doc test includes, blocks without a language, and
/// ignored blocks.
fn uncompiled_blocks(path: &str, page: &str, doc_tests: &str) -> Vec<String> {
    let mut findings = Vec::new();
    let mut in_block = false;
    let mut has_rust = false;
    for (number, line) in page.lines().enumerate() {
        let Some(language) = line.trim_start().strip_prefix("```") else { continue };
        in_block = !in_block;
        if in_block && language.is_empty() {
            findings.push(format!("{path}:{}: a code block without a language; write ```text, ```sh ...", number + 1));
        }
        let is_rust = language.split(',').next() == Some("rust");
        if in_block && is_rust && language.contains("ignore") {
            findings.push(format!("{path}:{}: an ignored Rust block; write ```rust,no_run", number + 1));
        }
        has_rust |= in_block && is_rust;
    }
    if has_rust && !doc_tests.contains(&format!("\"../{path}\"")) {
        findings.push(format!("{path}: its Rust blocks are not compiled; add the page to src/book.rs"));
    }
    findings
}

fn missing_commands(readme: &str) -> Vec<String> {
    let commands: Vec<&str> = code_lines(readme).filter_map(command).collect();
    let has = |promised: &&&str| commands.contains(*promised);
    README_COMMANDS
        .iter()
        .filter(|promised| !has(promised))
        .map(|c| format!("has no line `{c}` in a code block"))
        .collect()
}

fn commands_that_do_not_parse(page: &str) -> Vec<String> {
    code_lines(page)
        .filter_map(command)
        .filter(|line| line.starts_with("cargo xtask "))
        .filter_map(|line| match parse(line) {
            Ok(_) => None,
            Err(e) => Some(format!("`{line}` is not a command: {}", e.to_string().lines().next().unwrap_or_default())),
        })
        .collect()
}

/// The command in a line of a code block, without prompt and comment.
fn command(line: &str) -> Option<&str> {
    let line = line.trim();
    let line = line.strip_prefix("$ ").unwrap_or(line);
    let line = line.split(" #").next().unwrap_or(line).trim();
    (!line.is_empty()).then_some(line)
}

/// The parsed form of a line `cargo xtask ...`.
pub(crate) fn parse(line: &str) -> Result<Cli, clap::Error> {
    // For clap, `cargo xtask` is one word: the name of the program.
    let words = line.trim_start_matches("cargo xtask").split_whitespace();
    Cli::try_parse_from(std::iter::once("cargo xtask").chain(words))
}

/// Lines inside fenced blocks.
fn code_lines(page: &str) -> impl Iterator<Item = &str> {
    let mut in_block = false;
    page.lines().filter(move |line| {
        let is_fence = line.trim_start().starts_with("```");
        in_block ^= is_fence;
        in_block && !is_fence
    })
}

/// Targets of `[text](target)` outside of code, without anchors, titles and web addresses.
fn relative_links(page: &str) -> Vec<String> {
    let mut in_block = false;
    let mut links = Vec::new();
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
            continue;
        }
        if in_block {
            continue;
        }
        let prose: String = line.split('`').step_by(2).collect::<Vec<_>>().join("``");
        for (at, _) in prose.match_indices("](") {
            let target = prose[at + 2..].split([')', ' ']).next().unwrap_or_default();
            let target = target.split('#').next().unwrap_or_default();
            if !target.is_empty() && !target.contains("://") && !target.starts_with("mailto:") {
                links.push(target.to_string());
            }
        }
    }
    links
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn promised_commands() {
        assert_eq!(missing_commands("```sh\n$ cargo xtask demo\ncargo xtask test   # all\n```\n"), [""; 0]);
        assert_eq!(missing_commands("Run cargo xtask demo.\n```sh\ncargo xtask test\n```\n").len(), 1);
        assert_eq!(missing_commands("").len(), 2);
    }

    #[test]
    fn commands() {
        for (text, bad) in [
            ("```\ncargo xtask test --mujoco 4\ncargo build\n```", 0),
            ("```\ncargo xtask fly\n```", 1),
            ("```\ncargo xtask test --mujoco 9\n```", 1),
        ] {
            assert_eq!(commands_that_do_not_parse(text).len(), bad, "{text}");
        }
        assert!(parse(TEST_COMMAND).is_ok());
    }

    #[test]
    fn links() {
        let page = "[a](docs/a.md#part) ![b](b.png \"title\") [c](https://example.org/x) [d](#part) `[e](e.md)`\n\
                    ```\n[f](f.md)\n```\n[g](g.md)";
        assert_eq!(relative_links(page), ["docs/a.md", "b.png", "g.md"]);
    }

    #[test]
    fn chapters_of_the_book() {
        let summary = "# Summary\n\n- [A](a.md)\n    - [B](decisions/b.md)\n";
        assert_eq!(chapters(summary), ["docs/a.md", "docs/decisions/b.md"]);
    }

    #[test]
    fn blocks_that_are_not_compiled() {
        let doc_tests = "#[doc = include_str!(\"../docs/a.md\")]";
        for (path, page, count) in [
            ("docs/a.md", "```rust,no_run\nf();\n```\n```sh\nls\n```", 0),
            ("docs/b.md", "```sh\nls\n```", 0),
            ("docs/b.md", "```rust\nf();\n```", 1),
            ("docs/a.md", "```\nf();\n```", 1),
            ("docs/a.md", "```rust,ignore\nf();\n```", 1),
        ] {
            assert_eq!(uncompiled_blocks(path, page, doc_tests).len(), count, "{path}: {page}");
        }
    }

    #[test]
    fn pages() {
        assert!(is_page("README.md") && is_page("docs/decisions/0001-a.md"));
        assert!(!is_page("assets/arm/README.md") && !is_page("docs/a.png"));
    }
}
