//! Check of the page of faults (`docs/faults.md`): every row of its table names tests, and they exist.

/// The page with the table.
pub(crate) const PAGE: &str = "docs/faults.md";

/// Mark of a test that another test starts in a process; alone, it passes at once.
const SCENARIO: &str = "#[ignore = \"runs in a process of its own\"]";

/// Findings about the table of a page. `read` returns the text of a file, by its path in the repository.
pub(crate) fn findings(page: &str, read: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with('|')).skip(2).collect();
    let mut findings = Vec::new();
    if rows.is_empty() {
        findings.push(format!("{PAGE}: there is no table"));
    }
    for row in rows {
        let cells: Vec<&str> = row.trim().trim_matches('|').split(" | ").map(str::trim).collect();
        let [fault, promise, injection, tests] = cells[..] else {
            findings.push(format!("{PAGE}: a row has {} cells instead of 4: {row}", cells.len()));
            continue;
        };
        if [fault, promise, injection].iter().any(|cell| cell.is_empty()) {
            findings.push(format!("{PAGE}: a cell is empty: {row}"));
        }
        let tests: Vec<(&str, &str)> = named_tests(tests).collect();
        if tests.len() != row.matches("[`").count() {
            findings.push(format!("{PAGE}: a test of `{fault}` is no link; expected [`name`](../path)"));
        }
        if tests.is_empty() {
            findings.push(format!("{PAGE}: no test for `{fault}`; expected [`name`](../path)"));
        }
        for (name, path) in tests {
            match read(path) {
                None => findings.push(format!("{PAGE}: {path} does not exist")),
                Some(text) if has_test(&text, name) => {}
                Some(_) => findings.push(format!("{PAGE}: there is no test `{name}` in {path}")),
            }
        }
    }
    findings
}

/// Names and paths of links ``[`name`](../path)``.
fn named_tests(cell: &str) -> impl Iterator<Item = (&str, &str)> {
    cell.split("[`").skip(1).filter_map(|rest| {
        let (name, rest) = rest.split_once("`](../")?;
        Some((name, rest.split_once(')')?.0))
    })
}

/// True if the text, of Rust or Python, has a test of this name that checks something on its own.
fn has_test(text: &str, name: &str) -> bool {
    let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
    if name.starts_with("test_") && lines.iter().any(|line| line.starts_with(&format!("def {name}("))) {
        return true;
    }
    let beginning = format!("fn {name}(");
    lines.iter().enumerate().filter(|(_, line)| line.starts_with(&beginning)).any(|(at, _)| {
        let is_above = |line: &&&str| line.starts_with("#[") || line.starts_with("//");
        let above: Vec<&str> = lines[..at].iter().rev().take_while(is_above).copied().collect();
        above.contains(&"#[test]") && !above.contains(&SCENARIO)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "# Faults\n\n| fault | promise | injection | test |\n|---|---|---|---|\n";
    const SOURCE: &str = "    /// A full disk.\n    #[test]\n    #[cfg_attr(not(feature = \"x\"), ignore = \"needs x\")]\n    fn full_disk() {}\n\
        fn helper() {}\n#[test]\n#[ignore = \"runs in a process of its own\"]\nfn scenario() {}\n\
        def test_worker(client):\ndef worker():\n";

    #[test]
    fn rows() {
        let read = |path: &str| (path == "a/b.rs").then(|| SOURCE.to_string());
        for (row, expected) in [
            ("| full disk | an error | a wrapper | [`full_disk`](../a/b.rs) |", &[][..]),
            (
                "| full disk | an error | a wrapper | [`full_disk`](../a/b.rs), [`helper`](../a/b.rs) |",
                &["no test `helper`"],
            ),
            ("| killed | an error | a signal | [`test_worker`](../a/b.rs) |", &[]),
            ("| killed | an error | a signal | [`worker`](../a/b.rs) |", &["no test `worker`"]),
            ("| full disk | an error | a wrapper | [`full_disc`](../a/b.rs) |", &["no test `full_disc` in a/b.rs"]),
            ("| killed | a file | a signal | [`scenario`](../a/b.rs) |", &["no test `scenario`"]),
            ("| full disk | an error | a wrapper | [`full_disk`](../a/c.rs) |", &["a/c.rs does not exist"]),
            ("| full disk | an error | a wrapper | full_disk |", &["no test for `full disk`"]),
            (
                "| full disk | an error | a wrapper | [`full_disk`](../a/b.rs), [`other`](a/b.rs) |",
                &["a test of `full disk` is no link"],
            ),
            ("| full disk |  | a wrapper | [`full_disk`](../a/b.rs) |", &["a cell is empty"]),
            ("| full disk | an error | [`full_disk`](../a/b.rs) |", &["3 cells instead of 4"]),
            ("", &["there is no table"]),
        ] {
            let found = findings(&format!("{HEAD}{row}\n"), read);
            assert_eq!(found.len(), expected.len(), "{row}: {found:?}");
            assert!(found.iter().zip(expected).all(|(found, part)| found.contains(part)), "{row}: {found:?}");
        }
    }
}
