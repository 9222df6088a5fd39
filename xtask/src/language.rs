//! Checks of the project's language: first words of doc comments, invented persons, and retired names.
//!
//! | check | files | rule |
//! |---|---|---|
//! | doc blocks | `.rs` | at most 2 % of a crate's doc blocks start with What, Whose, Where, Whether or Who |
//! | phrases | `.rs`, `.md`, `.toml`, `.js`, `.html`, `.py` | none of [`PHRASES`] in comments, messages and pages |
//! | retired names | the same | none of the words and types of `retired_names.txt` |
//!
//! Spelling is checked by `spelling.rs`. The change log is not checked, because it quotes old names.

use crate::run::{Repo, XtaskResult, no_findings};
use crate::source_check::{TextFile, code_only, text_files};
use std::collections::{BTreeMap, BTreeSet};

/// First words that describe a thing by a question instead of by a noun or a verb.
const QUESTION_WORDS: [&str; 5] = ["What", "Whose", "Where", "Whether", "Who"];
/// Largest share of a crate's doc blocks that start with a question word \[%\].
const MAX_QUESTION_PERCENT: usize = 2;

/// Phrases that hide the subject of a sentence, each with advice.
const PHRASES: [(&str, &str); 7] = [
    ("somebody", "name the caller, the user or the component"),
    ("nobody", "name the component that does not act"),
    ("whoever", "name the caller, the user or the component"),
    ("is none", "repeat the noun: \"is not a ...\", \"has no ...\""),
    ("are none", "repeat the noun: \"there are no ...\", \"has no ...\""),
    ("is told", "write \"is reported to ...\" or \"receives ...\""),
    ("are told", "write \"are reported to ...\" or \"receive ...\""),
];

/// One entry per line, `old -> new`; see the head of the file.
const RETIRED_NAMES: &str = include_str!("retired_names.txt");
/// Accepted uses, one per line, `path: phrase`; see the head of the file.
const EXCEPTIONS: &str = include_str!("language_exceptions.txt");

const CHECKED_EXTENSIONS: [&str; 6] = [".rs", ".md", ".toml", ".js", ".html", ".py"];
/// The change log, and the tables of this check.
const EXCLUDED_FILES: [&str; 2] = ["CHANGELOG.md", "xtask/src/language.rs"];

/// A phrase or name that must not occur, and its replacement.
#[derive(Debug, PartialEq, Eq)]
struct Rule<'a> {
    /// A word, several words in sequence, or a type name in backticks.
    old: &'a str,
    new: &'a str,
}

/// An occurrence of a rule's phrase.
#[derive(Debug, PartialEq, Eq)]
struct Finding {
    path: String,
    line: usize,
    phrase: String,
    message: String,
}

pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let files = text_files(&repo.root);
    let retired = retired_names(RETIRED_NAMES)?;
    let exceptions = parse_exceptions(EXCEPTIONS)?;
    let mut findings = question_words(&files);
    let phrases: Vec<Rule<'_>> = PHRASES.iter().map(|(old, new)| Rule { old, new }).collect();
    let (found, unused) = without_exceptions(uses(&files, &phrases, &retired), &exceptions);
    findings.extend(found.iter().map(|finding| finding.message.clone()));
    for (path, phrase) in unused {
        println!("note: xtask/src/language_exceptions.txt: `{path}: {phrase}` is no longer needed; remove the line");
    }
    no_findings("the text breaks the rules of language", &findings)
}

fn is_checked(path: &str) -> bool {
    CHECKED_EXTENSIONS.iter().any(|extension| path.ends_with(extension)) && !EXCLUDED_FILES.contains(&path)
}

/// The findings of crates with too many doc blocks that start with a question word. A crate is a top folder of the
/// tree.
fn question_words(files: &[TextFile]) -> Vec<String> {
    let mut crates: BTreeMap<&str, (usize, Vec<String>)> = BTreeMap::new();
    for file in files.iter().filter(|file| file.path.ends_with(".rs")) {
        let name = file.path.split('/').next().unwrap_or_default();
        let (count, places) = crates.entry(name).or_default();
        for (line, first) in doc_blocks(&file.text) {
            *count += 1;
            if QUESTION_WORDS.contains(&first) {
                places.push(format!("{}:{line}: the comment starts with `{first}`", file.path));
            }
        }
    }
    let too_many = |count: usize, places: usize| places * 100 > count * MAX_QUESTION_PERCENT;
    crates
        .into_iter()
        .filter(|(_, (count, places))| too_many(*count, places.len()))
        .map(|(name, (count, places))| {
            format!(
                "{name}: {} of {count} doc comments start with {}, allowed are {MAX_QUESTION_PERCENT} %; start with a \
                 noun or a verb (\"Joint positions [rad]\", \"Returns ...\"):\n    {}",
                places.len(),
                QUESTION_WORDS.join(", "),
                places.join("\n    ")
            )
        })
        .collect()
}

/// Line number and first word of each doc comment. Adjacent lines of one kind (`///` or `//!`) are one comment.
fn doc_blocks(text: &str) -> Vec<(usize, &str)> {
    let mut blocks = Vec::new();
    let mut previous = None;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim_start();
        let doc = ["///", "//!"].into_iter().find(|start| line.starts_with(start) && !line.starts_with("////"));
        if let Some(start) = doc
            && previous != doc
        {
            let words = line[start.len()..].split(|c: char| !c.is_alphanumeric());
            blocks.push((number + 1, words.into_iter().find(|word| !word.is_empty()).unwrap_or_default()));
        }
        previous = doc;
    }
    blocks
}

/// The entries of the table of retired names.
fn retired_names(table: &str) -> XtaskResult<Vec<Rule<'_>>> {
    let mut rules = Vec::new();
    for line in table.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (old, new) = line
            .split_once(" -> ")
            .ok_or_else(|| format!("xtask/src/retired_names.txt: `{line}` is not `old name -> new name`"))?;
        rules.push(Rule { old: old.trim(), new: new.trim() });
    }
    Ok(rules)
}

/// Uses of phrases and retired names in comments, messages, pages and, for type names, code.
fn uses(files: &[TextFile], phrases: &[Rule<'_>], retired: &[Rule<'_>]) -> Vec<Finding> {
    let is_type = |rule: &&Rule<'_>| rule.old.starts_with('`');
    let types: BTreeMap<&str, &str> =
        retired.iter().filter(is_type).map(|rule| (rule.old.trim_matches('`'), rule.new)).collect();
    // By first word.
    let mut prose_rules: BTreeMap<String, Vec<(Vec<&str>, String)>> = BTreeMap::new();
    let advice = phrases.iter().map(|rule| (rule.old, format!("`{}`: {}", rule.old, rule.new)));
    let names = retired.iter().filter(|rule| !is_type(rule));
    let names = names.map(|rule| (rule.old, format!("`{}` is a retired name: write `{}`", rule.old, rule.new)));
    for (old, advice) in advice.chain(names) {
        let phrase: Vec<&str> = old.split(' ').collect();
        prose_rules.entry(without_capital(phrase[0])).or_default().push((phrase, advice));
    }
    let mut findings = Vec::new();
    for file in files.iter().filter(|file| is_checked(&file.path)) {
        let mut add = |line: usize, phrase: &str, advice: &str| {
            let message = format!("{}:{line}: {advice}", file.path);
            findings.push(Finding { path: file.path.clone(), line, phrase: phrase.to_string(), message });
        };
        let is_rust = file.path.ends_with(".rs");
        let code = if is_rust { code_only(&file.text) } else { String::new() };
        let prose = if is_rust { prose_only(&file.text, &code) } else { file.text.clone() };
        let words = words(&prose);
        for (at, word) in words.iter().enumerate() {
            for (phrase, advice) in prose_rules.get(&without_capital(word.text)).into_iter().flatten() {
                if starts_with_phrase(&words[at..], phrase) {
                    add(word.line, &phrase.join(" "), advice);
                }
            }
        }
        for (line, name) in type_names(&code).into_iter().chain(names_in_backticks(&prose)) {
            if let Some(new) = types.get(name) {
                add(line, name, &format!("`{name}` is a retired name: write `{new}`"));
            }
        }
    }
    findings
}

/// Comments and literals of Rust text; code is replaced by spaces. `code` is the result of [`code_only`].
fn prose_only(text: &str, code: &str) -> String {
    text.chars().zip(code.chars()).map(|(c, code)| if c == '\n' || c != code { c } else { ' ' }).collect()
}

/// A word of a text, with the number of its line.
#[derive(Debug)]
struct Word<'a> {
    line: usize,
    text: &'a str,
    /// True if only white space and comment markers separate the word from the previous one.
    follows: bool,
}

/// Words of letters, digits, `_` and `-`. Flags, keys and file names with a dash (`--lamp-radius`) are one word.
fn words(text: &str) -> Vec<Word<'_>> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    let mut words = Vec::new();
    let mut follows = false;
    for (number, line) in text.lines().enumerate() {
        let mut rest = line;
        while let Some(start) = rest.find(is_word) {
            follows &= rest[..start].chars().all(|c| c.is_whitespace() || "/!*#\\".contains(c));
            rest = &rest[start..];
            let end = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            words.push(Word { line: number + 1, text: rest[..end].trim_matches('-'), follows });
            (rest, follows) = (&rest[end..], true);
        }
        follows &= rest.chars().all(|c| c.is_whitespace() || "/!*#\\".contains(c));
    }
    words
}

/// True if the words begin with the phrase. The first letter may be a capital.
fn starts_with_phrase(words: &[Word<'_>], phrase: &[&str]) -> bool {
    words.len() >= phrase.len()
        && phrase.iter().zip(words).enumerate().all(|(at, (wanted, word))| match at {
            0 => *wanted == word.text || *wanted == without_capital(word.text),
            _ => word.follows && *wanted == word.text,
        })
}

/// The word with its first letter in lower case.
fn without_capital(word: &str) -> String {
    let mut chars = word.chars();
    chars.next().map(|first| first.to_lowercase().chain(chars).collect()).unwrap_or_default()
}

/// Identifiers that start with a capital letter, with their line numbers.
fn type_names(code: &str) -> Vec<(usize, &str)> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let lines = code.lines().enumerate();
    lines
        .flat_map(|(number, line)| line.split(move |c| !is_name(c)).map(move |name| (number + 1, name)))
        .filter(|(_, name)| name.starts_with(char::is_uppercase))
        .collect()
}

/// Type names in backticks and in code blocks of pages and comments, with their line numbers. Comments inside of code
/// blocks are left out.
fn names_in_backticks(prose: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut in_block = false;
    for (number, line) in prose.lines().enumerate() {
        let line = line.trim_start();
        let line =
            ["///", "//!", "//"].iter().find_map(|marker| line.strip_prefix(marker)).unwrap_or(line).trim_start();
        if line.starts_with("```") {
            in_block = !in_block;
            continue;
        }
        let line = if in_block { line.split("//").next().unwrap_or_default() } else { line };
        let spans = line.split('`').enumerate().filter(|(at, _)| in_block || at % 2 == 1);
        found.extend(spans.flat_map(|(_, span)| type_names(span)).map(|(_, name)| (number + 1, name)));
    }
    found
}

/// Pairs of a path and a phrase.
fn parse_exceptions(table: &str) -> XtaskResult<BTreeSet<(String, String)>> {
    let mut pairs = BTreeSet::new();
    for line in table.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (path, phrase) = line
            .split_once(": ")
            .ok_or_else(|| format!("xtask/src/language_exceptions.txt: `{line}` is not `path: phrase`"))?;
        pairs.insert((path.trim().to_string(), phrase.trim().to_string()));
    }
    Ok(pairs)
}

/// The findings that no exception accepts, and the exceptions that accept none.
fn without_exceptions(
    findings: Vec<Finding>,
    exceptions: &BTreeSet<(String, String)>,
) -> (Vec<Finding>, Vec<(String, String)>) {
    let (mut left, mut used) = (Vec::new(), BTreeSet::new());
    for finding in findings {
        let pair = (finding.path.clone(), finding.phrase.clone());
        if exceptions.contains(&pair) {
            used.insert(pair);
        } else {
            left.push(finding);
        }
    }
    (left, exceptions.difference(&used).cloned().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, text: &str) -> TextFile {
        TextFile { path: path.into(), text: text.into() }
    }

    fn found(path: &str, text: &str) -> Vec<String> {
        let phrases = PHRASES.map(|(old, new)| Rule { old, new });
        let retired = retired_names("lamp -> light\nline of MuJoCo -> MuJoCo version\n`Crew` -> ThreadPool").unwrap();
        uses(&[file(path, text)], &phrases, &retired).into_iter().map(|finding| finding.message).collect()
    }

    #[test]
    fn first_words_of_doc_comments() {
        let text = "//! Whether a.\n//! Who.\n\n/// Returns b.\n/// Where c.\nfn b() {}\n//// no doc\n    ///   What d\nfn d()";
        assert_eq!(doc_blocks(text), [(1, "Whether"), (4, "Returns"), (8, "What")]);
        // A separate doc comment starts after code or an empty line.
        assert_eq!(doc_blocks("/// A.\n\n/// B.\n//! C."), [(1, "A"), (3, "B"), (4, "C")]);
    }

    /// 1 of 50 comments is accepted, 1 of 49 is not.
    #[test]
    fn share_of_question_words() {
        let text = |good: usize| "/// Returns a.\nfn a();\n".repeat(good) + "/// What b.\nfn b();\n";
        assert_eq!(question_words(&[file("a/src/lib.rs", &text(49)), file("a/b.md", "/// What")]), [""; 0]);
        let findings = question_words(&[file("a/src/lib.rs", &text(48)), file("b/src/lib.rs", &text(49))]);
        assert_eq!(findings.len(), 1);
        for part in ["a: 1 of 49", "allowed are 2 %", "a/src/lib.rs:97: the comment starts with `What`"] {
            assert!(findings[0].contains(part), "{findings:?}");
        }
    }

    #[test]
    fn phrases() {
        for (path, text, count) in [
            ("a.rs", "// Somebody writes.", 1),
            ("a.rs", "let a = \"a file that is none\";", 1),
            ("a.rs", "/// Sensors that are\n/// none.", 1),
            ("a.md", "Observers are told of resets.", 1),
            ("a.md", "It is\ntold.", 1),
            ("a.toml", "# whoever", 1),
            ("a.js", "// nobody", 1),
            ("a.py", "assert a, \"nobody\"", 1),
            ("a.rs", "let nobody = NoBody; // NoBody", 0),
            ("a.py", "if a is None: # None are there", 0),
            ("a.md", "It is. None of them.", 0),
            ("a.svg", "nobody", 0),
            ("CHANGELOG.md", "nobody", 0),
        ] {
            assert_eq!(found(path, text).len(), count, "{path}: {text}");
        }
        let message = &found("a/b.rs", "\n/// Nobody waits.")[0];
        assert_eq!(message, "a/b.rs:2: `nobody`: name the component that does not act");
    }

    #[test]
    fn retired_words_and_types() {
        for (path, text, count) in [
            ("a.rs", "// Lamp.", 1),
            ("a.rs", "let a = \"a lamp\";", 1),
            ("a.rs", "let lamp = clamp(lamps); // clamp lamps --lamp-radius lamp_radius", 0),
            ("a.md", "On both a line of MuJoCo and another", 1),
            ("a.md", "a line of mujoco", 0),
            ("a.rs", "struct Crew;", 1),
            ("a.rs", "/// See [`Crew`]. Crew is a word here.", 1),
            ("a.rs", "/// ```\n/// Crew::new(); // Crew\n/// // Crew\n/// ```", 1),
            ("a.md", "Crew, `x::Crew`", 1),
            ("a.md", "Crew", 0),
        ] {
            assert_eq!(found(path, text).len(), count, "{path}: {text}");
        }
        assert_eq!(found("a.rs", "struct Crew;"), ["a.rs:1: `Crew` is a retired name: write `ThreadPool`"]);
        assert_eq!(found("a.md", "\na lamp"), ["a.md:2: `lamp` is a retired name: write `light`"]);
    }

    /// Each retired name and each phrase is found in a text that contains it.
    #[test]
    fn table_of_retired_names() {
        let retired = retired_names(RETIRED_NAMES).unwrap();
        assert!(retired.len() > 20);
        for rule in &retired {
            assert!(!rule.new.is_empty() && retired.iter().filter(|other| other.old == rule.old).count() == 1);
            let text = format!("a {} b", rule.old);
            let found = uses(&[file("a.md", &text)], &[], &retired);
            assert!(found.iter().any(|finding| finding.phrase == rule.old.trim_matches('`')), "{rule:?}");
        }
        assert!(retired_names("lamp light").is_err());
    }

    #[test]
    fn exceptions() {
        let exceptions = parse_exceptions("# comment\na.md: nobody\nb.md: lamp\n").unwrap();
        let phrases = [Rule { old: "nobody", new: "a name" }];
        let files = [file("a.md", "nobody, nobody"), file("b.md", "nobody")];
        let (left, unused) = without_exceptions(uses(&files, &phrases, &[]), &exceptions);
        assert_eq!(left.iter().map(|finding| finding.path.as_str()).collect::<Vec<_>>(), ["b.md"]);
        assert_eq!(unused, [("b.md".to_string(), "lamp".to_string())]);
        assert!(parse_exceptions("a.md nobody").is_err());
    }
}
