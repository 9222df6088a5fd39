//! Rules for the text of the tree: places of `unsafe`, length of files, forbidden leftovers.

use crate::run::{Repo, XtaskResult, no_findings};
use serde_json::Value;
use std::path::Path;

/// The only places with unsafe code: generated bindings, the crate that calls them, and the thread pool.
const UNSAFE_ALLOWED_IN: [&str; 3] = ["mujoco-sys/src/lib.rs", "mujoco/src/", "exec/src/workers.rs"];
/// Crates that forbid unsafe code.
const FORBID_UNSAFE: [&str; 10] = [
    "scene/src/lib.rs",
    "look/src/lib.rs",
    "http/src/lib.rs",
    "python/render/src/lib.rs",
    "robot/src/lib.rs",
    "render/src/lib.rs",
    "sensors/src/lib.rs",
    "tasks/src/lib.rs",
    "record/src/lib.rs",
    "viewer/src/lib.rs",
];
/// Sources of the libraries.
const LIBRARIES: [&str; 14] = [
    "src/",
    "exec/src/",
    "http/src/",
    "look/src/",
    "mujoco/src/",
    "plot/src/",
    "record/src/",
    "render/src/",
    "robot/src/",
    "scene/src/",
    "sensors/src/",
    "sim/src/",
    "tasks/src/",
    "viewer/src/",
];
/// Largest number of lines of a file.
const MAX_LINES: usize = 800;
/// Largest number of public methods of `SimulationManager`; further ones belong to its views and handles.
const MAX_MANAGER_METHODS: usize = 45;

/// Largest number of names in the prelude.
const MAX_PRELUDE_NAMES: usize = 45;

/// First folders of absolute paths that exist on one machine only.
const FOREIGN_FOLDERS: [&str; 3] = ["home", "root", "work"];
/// Larger files are data.
const MAX_TEXT_BYTES: u64 = 1 << 20;

/// A text file of the tree; its path is relative to the root, with `/`.
#[derive(Debug)]
pub(crate) struct TextFile {
    pub(crate) path: String,
    pub(crate) text: String,
}

impl TextFile {
    fn is_rust(&self) -> bool {
        self.path.ends_with(".rs")
    }
}

pub(crate) fn run(repo: &Repo) -> XtaskResult {
    let files = text_files(&repo.root);
    let mut findings = misplaced_unsafe(&files);
    findings.extend(missing_forbid(&files));
    findings.extend(long_files(&files));
    findings.extend(stubs(&files));
    findings.extend(foreign_paths(&files));
    findings.extend(large_api(&files));
    findings.extend(wall_clocks(&files));
    findings.extend(dependencies_without_reason(&repo.read("Cargo.toml")?));
    findings.extend(tests_that_never_run(&files, &folders_without_tests(&repo.metadata, &repo.root)));
    no_findings("rules of the tree are broken", &findings)
}

/// All files below `root`, sorted by path, without version control and cargo's target folders.
pub(crate) fn files_below(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let Ok(kind) = entry.file_type() else { continue };
            if kind.is_dir() {
                let skip = entry.file_name() == ".git" || entry.file_name() == "target";
                if !skip && !path.join("CACHEDIR.TAG").exists() {
                    folders.push(path);
                }
            } else if let Ok(relative) = path.strip_prefix(root) {
                found.push(relative.to_string_lossy().replace('\\', "/"));
            }
        }
    }
    found.sort();
    found
}

pub(crate) fn text_files(root: &Path) -> Vec<TextFile> {
    files_below(root)
        .into_iter()
        .filter(|path| path != ".git")
        .filter(|path| std::fs::metadata(root.join(path)).is_ok_and(|data| data.len() <= MAX_TEXT_BYTES))
        .filter_map(|path| Some(TextFile { text: std::fs::read_to_string(root.join(&path)).ok()?, path }))
        .collect()
}

fn may_hold_unsafe(path: &str) -> bool {
    UNSAFE_ALLOWED_IN.iter().any(|allowed| path == *allowed || allowed.ends_with('/') && path.starts_with(allowed))
}

fn misplaced_unsafe(files: &[TextFile]) -> Vec<String> {
    let mut findings = Vec::new();
    for file in files.iter().filter(|file| file.is_rust() && !may_hold_unsafe(&file.path)) {
        let code = code_only(&file.text);
        for (at, word) in words(&code) {
            let allows_unsafe = || {
                let call = code[..at].rfind('(').map(|open| code[..open].trim_end()).unwrap_or_default();
                ["allow", "expect", "warn"].iter().any(|level| call.ends_with(level))
            };
            if word == "unsafe" || word == "unsafe_code" && allows_unsafe() {
                findings.push(format!(
                    "{}:{}: `{word}` outside of {}",
                    file.path,
                    line_of(&code, at),
                    UNSAFE_ALLOWED_IN.join(" and ")
                ));
            }
        }
    }
    findings
}

/// Uses of the wall clock in libraries. It jumps when it is set; the libraries measure time with the monotonic clock.
fn wall_clocks(files: &[TextFile]) -> Vec<String> {
    let is_library = |path: &str| {
        LIBRARIES.iter().any(|folder| path.strip_prefix(folder).is_some_and(|rest| !rest.contains("tests")))
    };
    let mut findings = Vec::new();
    for file in files.iter().filter(|file| file.is_rust() && is_library(&file.path)) {
        let code = code_only(&file.text);
        // Up to the tests at the end of the file.
        let is_tests = |(at, _): &(usize, &str)| code[*at..].lines().nth(1).is_some_and(|line| line.ends_with('{'));
        let tests = code.match_indices("#[cfg(test)]\nmod").find(is_tests).map_or(code.len(), |(at, _)| at);
        let code = &code[..tests];
        let found = words(code).filter(|(_, word)| ["SystemTime", "UNIX_EPOCH"].contains(word));
        findings.extend(found.map(|(at, word)| {
            format!("{}:{}: `{word}` jumps when the clock is set; use `Instant`", file.path, line_of(code, at))
        }));
    }
    findings
}

fn missing_forbid(files: &[TextFile]) -> Vec<String> {
    FORBID_UNSAFE
        .iter()
        .filter(|path| {
            !files.iter().any(|file| {
                let code: String = code_only(&file.text).split_whitespace().collect();
                file.path == **path && code.contains("#![forbid(unsafe_code")
            })
        })
        .map(|path| format!("{path}: must say #![forbid(unsafe_code)]"))
        .collect()
}

fn long_files(files: &[TextFile]) -> Vec<String> {
    files
        .iter()
        .filter(|file| file.is_rust())
        .map(|file| (file, file.text.lines().count()))
        .filter(|(_, lines)| *lines > MAX_LINES)
        .map(|(file, lines)| format!("{}: {lines} lines, the limit is {MAX_LINES}", file.path))
        .collect()
}

/// Reports a manager with too many methods, and a prelude with too many names.
fn large_api(files: &[TextFile]) -> Vec<String> {
    let methods = files.iter().filter(|file| file.path.starts_with("sim/src/")).map(|file| manager_methods(&file.text));
    let names = files.iter().filter(|file| file.path == "src/lib.rs").map(|file| prelude_names(&file.text));
    let limits: [(&str, usize, usize, &str); 2] = [
        ("SimulationManager", methods.sum(), MAX_MANAGER_METHODS, "public methods; move some to its views"),
        ("the prelude in src/lib.rs", names.sum(), MAX_PRELUDE_NAMES, "names; leave out the rarely used ones"),
    ];
    let too_many = limits.into_iter().filter(|(_, count, limit, _)| count > limit);
    too_many.map(|(what, count, limit, advice)| format!("{what} has {count} {advice} (limit {limit})")).collect()
}

/// Number of public methods in the `impl SimulationManager` blocks of a formatted file, without those of `internals`.
fn manager_methods(text: &str) -> usize {
    let (mut inside, mut internal, mut count) = (false, false, 0);
    for line in text.lines() {
        match line {
            "impl SimulationManager {" => inside = true,
            "}" => inside = false,
            _ if line.trim_start().starts_with("#[cfg(feature = \"internals\")]") => internal = true,
            _ if inside && (line.starts_with("    pub fn ") || line.starts_with("    pub unsafe fn ")) => {
                count += usize::from(!std::mem::take(&mut internal));
            }
            _ => internal &= line.trim_start().starts_with(['#', '/']),
        }
    }
    count
}

/// Number of names that `pub mod prelude` of a formatted file exports.
fn prelude_names(text: &str) -> usize {
    let prelude = text.lines().skip_while(|line| *line != "pub mod prelude {").take_while(|line| *line != "}");
    let code = code_only(&prelude.collect::<Vec<_>>().join("\n"));
    let statements = code.split(';').filter_map(|statement| Some(statement.split_once("pub use ")?.1));
    let names =
        statements.map(|path| path.split_once('{').map_or(path, |(_, list)| list.trim_end().trim_end_matches('}')));
    names.flat_map(|list| list.split(',')).filter(|name| !name.trim().is_empty()).count()
}

fn stubs(files: &[TextFile]) -> Vec<String> {
    let mut findings = Vec::new();
    for file in files.iter().filter(|file| file.is_rust()) {
        let code = code_only(&file.text);
        for (at, word) in words(&code) {
            let is_macro = code[at + word.len()..].starts_with('!');
            let is_attribute = code[..at].trim_end().ends_with("#[");
            let in_cfg_attr = || {
                let open = code[..at].rfind("#[").map(|open| &code[open..at]);
                open.is_some_and(|attribute| attribute.contains("cfg_attr") && !attribute.contains(']'))
            };
            let found = match word {
                "todo" | "unimplemented" | "dbg" if is_macro => format!("{word}!"),
                "ignore" if (is_attribute || in_cfg_attr()) && !has_reason(&file.text, &code, at) => {
                    "#[ignore] without the need or the process it waits for".to_string()
                }
                _ => continue,
            };
            findings.push(format!("{}:{}: {found}", file.path, line_of(&code, at)));
        }
    }
    findings
}

/// True if the `ignore` at `at` has an accepted reason: `= "needs ..."` (a test that `cargo xtask test` runs once the
/// requirement is installed) or `= "runs in a process of its own"`.
fn has_reason(text: &str, code: &str, at: usize) -> bool {
    let line = |text: &str| text.lines().nth(line_of(code, at) - 1).unwrap_or_default().to_string();
    ["ignore = \"needs ", "ignore = \"runs in a process of its own\""].iter().any(|reason| line(text).contains(reason))
}

fn foreign_paths(files: &[TextFile]) -> Vec<String> {
    let mut findings = Vec::new();
    for file in files {
        for (number, line) in file.text.lines().enumerate() {
            for folder in FOREIGN_FOLDERS {
                let needle = format!("/{folder}/");
                let is_start = |at: usize| {
                    // Inside a longer path or an address the folder name is harmless; after `file://` it is an absolute
                    // path.
                    line[..at].chars().next_back().is_none_or(|c| !c.is_alphanumeric() && !"._-})$*".contains(c))
                };
                if line.match_indices(&needle).any(|(at, _)| is_start(at)) {
                    findings.push(format!("{}:{}: absolute path {needle}...", file.path, number + 1));
                }
            }
        }
    }
    findings
}

/// Names in `[workspace.dependencies]` that come from a registry, with the text of their entry.
pub(crate) fn workspace_dependencies(cargo_toml: &str) -> Vec<(String, String)> {
    let section = cargo_toml
        .lines()
        .skip_while(|line| line.trim() != "[workspace.dependencies]")
        .skip(1)
        .take_while(|line| !line.starts_with('['));
    let (mut entries, mut entry, mut depth) = (Vec::new(), String::new(), 0i32);
    for line in section {
        let value = line.split('#').next().unwrap_or_default();
        if depth == 0 && value.trim().is_empty() {
            continue;
        }
        entry.push_str(line);
        entry.push('\n');
        depth += value.chars().map(|c| i32::from("[{".contains(c)) - i32::from("]}".contains(c))).sum::<i32>();
        if depth == 0 {
            let name = entry.split('=').next().unwrap_or_default().trim().trim_matches('"').to_string();
            let entry = std::mem::take(&mut entry);
            if !entry.contains("path =") {
                entries.push((name, entry));
            }
        }
    }
    entries
}

fn dependencies_without_reason(cargo_toml: &str) -> Vec<String> {
    workspace_dependencies(cargo_toml)
        .into_iter()
        .filter(|(_, entry)| {
            let comment = |line: &str| line.split_once('#').is_some_and(|(_, reason)| !reason.trim().is_empty());
            !entry.lines().any(comment)
        })
        .map(|(name, _)| format!("Cargo.toml: the dependency `{name}` has no `# reason` behind it"))
        .collect()
}

/// Source folders of packages whose library and programs are not built as tests (`test = false`).
fn folders_without_tests(metadata: &Value, root: &Path) -> Vec<String> {
    let mut folders = Vec::new();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
        let Some(folder) = manifest.parent().map(|folder| folder.join("src")) else { continue };
        let is_tested = |target: &Value| {
            target["test"] == true
                && target["src_path"].as_str().is_some_and(|path| Path::new(path).starts_with(&folder))
        };
        if !package["targets"].as_array().into_iter().flatten().any(is_tested)
            && let Ok(folder) = folder.strip_prefix(root)
        {
            folders.push(format!("{}/", folder.display()));
        }
    }
    folders
}

fn tests_that_never_run(files: &[TextFile], folders: &[String]) -> Vec<String> {
    // Files that a test binary includes as its own modules.
    let included: Vec<String> = files.iter().filter(|file| file.is_rust()).flat_map(included_files).collect();
    let is_there = |file: &&TextFile| {
        let is_below = |folder: &String| file.path.starts_with(folder);
        file.is_rust() && folders.iter().any(is_below) && !included.contains(&file.path)
    };
    let has_test = |file: &&TextFile| code_only(&file.text).contains("#[test]");
    let files = files.iter().filter(is_there).filter(has_test);
    files.map(|file| format!("{}: this test never runs: its package has `test = false`", file.path)).collect()
}

/// Files that the attributes `#[path = ".."]` of a file name.
fn included_files(file: &TextFile) -> Vec<String> {
    let names = file.text.split("#[path = \"").skip(1).filter_map(|rest| rest.split('"').next());
    let folder: Vec<&str> = file.path.split('/').collect();
    let resolve = |name: &str| {
        let mut parts = folder[..folder.len() - 1].to_vec();
        for part in name.split('/') {
            if part == ".." {
                parts.pop();
            } else {
                parts.push(part);
            }
        }
        parts.join("/")
    };
    names.map(resolve).collect()
}

fn line_of(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}

/// Identifiers and keywords with their byte offsets.
fn words(code: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    code.split(move |c| !is_word(c))
        .filter(|word| !word.is_empty())
        .map(|word| (word.as_ptr() as usize - code.as_ptr() as usize, word))
}

/// Rust text with comments and literals replaced by spaces; line breaks are kept.
pub(crate) fn code_only(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    while at < chars.len() {
        match comment_or_literal_end(&chars, at) {
            Some(end) => {
                out.extend(chars[at..end].iter().map(|c| if *c == '\n' { '\n' } else { ' ' }));
                at = end;
            }
            None => {
                out.push(chars[at]);
                at += 1;
            }
        }
    }
    out
}

/// The end of the comment or literal that starts at `at`, if any.
fn comment_or_literal_end(chars: &[char], at: usize) -> Option<usize> {
    let next = |offset: usize| chars.get(at + offset).copied();
    let find = |from: usize, pattern: &[char]| {
        let rest = chars.get(from..).unwrap_or_default();
        let found = rest.windows(pattern.len()).position(|window| window == pattern);
        found.map_or(chars.len(), |offset| from + offset + pattern.len())
    };
    let in_word = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
    match chars[at] {
        '/' if next(1) == Some('/') => Some((at..chars.len()).find(|i| chars[*i] == '\n').unwrap_or(chars.len())),
        '/' if next(1) == Some('*') => Some(block_comment_end(chars, at)),
        '"' => Some(quoted_end(chars, at + 1, '"')),
        '\'' if next(1) == Some('\\') => Some(quoted_end(chars, at + 1, '\'')),
        '\'' if next(2) == Some('\'') => Some(at + 3),
        'r' | 'b' | 'c' if !in_word => {
            let prefix = usize::from(chars[at] != 'r');
            let hashes = chars[at..].iter().skip(prefix + 1).take_while(|c| **c == '#').count();
            let is_raw = next(prefix) == Some('r') && next(prefix + 1 + hashes) == Some('"');
            let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
            is_raw.then(|| find(at + prefix + 2 + hashes, &end))
        }
        _ => None,
    }
}

fn block_comment_end(chars: &[char], start: usize) -> usize {
    let (mut depth, mut at) = (0, start);
    while at < chars.len() {
        match (chars[at], chars.get(at + 1)) {
            ('/', Some('*')) => (depth, at) = (depth + 1, at + 2),
            ('*', Some('/')) => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return at;
        }
    }
    chars.len()
}

fn quoted_end(chars: &[char], start: usize, quote: char) -> usize {
    let mut at = start;
    while at < chars.len() {
        match chars[at] {
            '\\' => at += 2,
            c if c == quote => return at + 1,
            _ => at += 1,
        }
    }
    chars.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, text: &str) -> Vec<TextFile> {
        vec![TextFile { path: path.into(), text: text.into() }]
    }

    #[test]
    fn code() {
        let text =
            "let a = \"unsafe \\\" x\"; // unsafe\n/* unsafe /* b */ unsafe */ let c = r#\"unsafe \"# ; let q = '\"';";
        let code = code_only(text);
        assert!(!code.contains("unsafe"), "{code}");
        assert!(code.contains("let c ="), "{code}");
        assert!(code.contains("let q ="), "{code}");
        assert_eq!(code.chars().count(), text.chars().count());
        assert_eq!(code_only("fn f<'a>(x: &'a str) -> &'a str { x }"), "fn f<'a>(x: &'a str) -> &'a str { x }");
        assert_eq!(code_only("b'\\'' x br\"y\" z").split_whitespace().collect::<Vec<_>>(), ["b", "x", "z"]);
    }

    /// Unsafe code is allowed in the crates of MuJoCo, in comments and in other files.
    #[test]
    fn unsafe_code() {
        let text = "unsafe fn f() {}";
        for (path, text, found) in [
            ("sim/src/batch.rs", "fn f() {\n    unsafe { g() }\n}", 1),
            ("sim/src/lib.rs", "unsafe impl Send for A {}", 1),
            ("sim/src/lib.rs", "#![allow(unsafe_code)]", 1),
            ("sim/src/lib.rs", "#[allow(dead_code, unsafe_code)] mod a;", 1),
            ("sim/src/mjcf.rs", text, 1),
            ("mujoco-sys/src/lib.rs", text, 0),
            ("mujoco/src/data.rs", text, 0),
            ("a.rs", "#![forbid(unsafe_code)] // unsafe {\n", 0),
            ("README.md", text, 0),
        ] {
            assert_eq!(misplaced_unsafe(&file(path, text)).len(), found, "{path}: {text}");
        }
        let place = misplaced_unsafe(&file("sim/src/batch.rs", "fn f() {\n    unsafe { g() }\n}"));
        assert!(place[0].starts_with("sim/src/batch.rs:2:"), "{place:?}");
    }

    #[test]
    fn forbidden_unsafe_code() {
        assert_eq!(missing_forbid(&[]).len(), FORBID_UNSAFE.len());
        let mut files = file("scene/src/lib.rs", "//! Doc.\n#![forbid(unsafe_code)]\n");
        files.extend(file("sensors/src/lib.rs", "// #![forbid(unsafe_code)]\n"));
        let others = FORBID_UNSAFE.iter().filter(|path| !["scene/src/lib.rs", "sensors/src/lib.rs"].contains(path));
        for path in others {
            files.extend(file(path, "#![forbid(unsafe_code)]\n"));
        }
        assert_eq!(missing_forbid(&files), ["sensors/src/lib.rs: must say #![forbid(unsafe_code)]"]);
    }

    #[test]
    fn wall_clock() {
        let code = "use std::time::SystemTime;\nlet now = SystemTime::now();";
        for (path, text, found) in [
            ("record/src/clock.rs", code, 2),
            ("src/lib.rs", "let t = std::time::UNIX_EPOCH;", 1),
            ("record/src/tests/kill.rs", code, 0),
            ("cli/src/main.rs", code, 0),
            ("sim/src/a.rs", "// SystemTime\nlet now = Instant::now();", 0),
            ("sim/src/a.rs", "fn f() {}\n#[cfg(test)]\nmod tests {\n use std::time::SystemTime;\n}", 0),
            ("sim/src/a.rs", "#[cfg(test)]\nmod tests;\nuse std::time::SystemTime;", 1),
        ] {
            assert_eq!(wall_clocks(&file(path, text)).len(), found, "{path}: {text}");
        }
    }

    #[test]
    fn length() {
        assert!(long_files(&file("a.rs", &"\n".repeat(800))).is_empty());
        assert_eq!(long_files(&file("a.rs", &"\n".repeat(801))).len(), 1);
        assert!(long_files(&file("a.xml", &"\n".repeat(801))).is_empty());
    }

    #[test]
    fn api_size() {
        let method = |k: usize| format!("    pub fn method_{k}(&self) {{}}\n");
        let manager = |count: usize, more: &str| {
            let methods: String = (0..count).map(method).collect();
            file("sim/src/manager.rs", &format!("impl SimulationManager {{\n{methods}{more}}}\npub fn free() {{}}\n"))
        };
        assert!(large_api(&manager(45, "    fn private() {}\n")).is_empty());
        assert!(large_api(&manager(45, "    #[cfg(feature = \"internals\")]\n    pub fn batch() {}\n")).is_empty());
        assert_eq!(large_api(&manager(45, &method(46))).len(), 1);
        let prelude = |count: usize| {
            let names: Vec<String> = (2..count).map(|k| format!("Name{k}")).collect();
            let text = format!(
                "pub mod prelude {{\n    pub use crate::a;\n    pub use b::C;\n    pub use d::{{{}}};\n}}",
                names.join(", ")
            );
            file("src/lib.rs", &text)
        };
        assert!(large_api(&prelude(45)).is_empty());
        assert_eq!(large_api(&prelude(46)).len(), 1);
    }

    #[test]
    fn stubs_in_code() {
        for (text, found) in [
            ("fn f() { todo!() }", 1),
            ("unimplemented!(\"x\")", 1),
            ("dbg!(a);", 1),
            ("#[ignore]", 1),
            ("#[ignore = \"slow\"]", 1),
            ("#[cfg_attr(miri, ignore)]", 1),
            ("fn a() {}\n#[ignore = \"needs Xvfb: cargo xtask test\"]\nfn b() {}", 0),
            ("fn a() {}\n#[ignore = \"runs in a process of its own\"]\nfn b() {}", 0),
            ("// todo!()\nlet ignore = \"dbg!\"; fn todo() {} if ignore != a[0] {}", 0),
        ] {
            assert_eq!(stubs(&file("a.rs", text)).len(), found, "{text}");
        }
    }

    #[test]
    fn absolute_paths() {
        for folder in FOREIGN_FOLDERS {
            assert_eq!(foreign_paths(&file("a.md", &format!("see /{folder}/x"))).len(), 1);
            assert_eq!(foreign_paths(&file("a.md", &format!("file:///{folder}/x"))).len(), 1);
            assert!(foreign_paths(&file("a.md", &format!("example.org/{folder}/x and ../{folder}/y"))).is_empty());
            assert!(foreign_paths(&file("a.md", &format!("{{out}}/{folder}/"))).is_empty());
        }
    }

    #[test]
    fn reasons() {
        let toml = "[workspace.dependencies]\n# Crates.\nscene = { path = \"scene\" }\n\
            clap = { version = \"4\", features = [\n  \"derive\",\n] } # flags\nserde = \"1\"\nregex = \"1\" #\n\
            [workspace.lints.rust]\nfoo = 1\n";
        let findings = dependencies_without_reason(toml);
        assert_eq!(findings.len(), 2, "{findings:?}");
        assert!(findings[0].contains("`serde`") && findings[1].contains("`regex`"), "{findings:?}");
        let names: Vec<String> = workspace_dependencies(toml).into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["clap", "serde", "regex"]);
    }

    #[test]
    fn packages_without_tests() {
        let target = |test: bool, path: &str| serde_json::json!({"test": test, "src_path": path});
        let package = |folder: &str, targets: &[Value]| serde_json::json!({"manifest_path": format!("/tree/{folder}Cargo.toml"), "targets": targets});
        let metadata = serde_json::json!({"packages": [
            package("", &[target(false, "/tree/src/lib.rs"), target(true, "/tree/tests/api/main.rs")]),
            package("cli/", &[target(false, "/tree/cli/src/main.rs")]),
            package("sim/", &[target(true, "/tree/sim/src/lib.rs")]),
        ]});
        let folders = folders_without_tests(&metadata, Path::new("/tree"));
        assert_eq!(folders, ["src/", "cli/src/"]);
        let test = "#[test]\nfn f() {}";
        for (path, text, found) in [
            ("src/a.rs", test, 1),
            ("cli/src/a.rs", test, 1),
            ("sim/src/a.rs", test, 0),
            ("tests/api/a.rs", test, 0),
            ("src/a.rs", "// #[test]", 0),
        ] {
            assert_eq!(tests_that_never_run(&file(path, text), &folders).len(), found, "{path}");
        }
        let mut files = file("cli/src/a.rs", test);
        files.extend(file("cli/tests/cli/main.rs", "#[path = \"../../src/a.rs\"]\nmod a;"));
        assert!(tests_that_never_run(&files, &folders).is_empty());
    }

    #[test]
    fn skipped_folders() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        for path in ["a/b.rs", "target/c.rs", "other-target/CACHEDIR.TAG", "other-target/d.rs", ".git/e"] {
            crate::wheel::tests::write(&dir.path().join(path), "");
        }
        assert_eq!(files_below(dir.path()), ["a/b.rs"]);
    }
}
