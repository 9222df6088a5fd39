//! `cargo xtask docs`: the book (`docs/`, mdBook) and the API documentation (rustdoc) in one folder.
//!
//! ```text
//! docs/*.md   -> mdbook    -> target/site/*.html
//! crates      -> cargo doc -> target/doc -> target/site/api
//! other files that pages link to         -> target/site/source/*.txt
//! ```
//!
//! Links of the pages are relative paths in the repository. In the site, a link to a page leads to its chapter, a link to
//! a crate leads to its API, and any other linked file is copied as text. A link without a target is an error.

use crate::run::{Cmd, Failure, Repo, XtaskResult, no_findings};
use crate::setup::{self, Requirements};
use crate::source_check::files_below;
use crate::test;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const MDBOOK_VERSION: &str = "0.5.4";
/// Folder of the book in the repository.
const BOOK: &str = "docs";
/// Folders of the site.
const API: &str = "api";
const SOURCE: &str = "source";
/// Front page of the API, which contains the README.
const API_FRONT_PAGE: &str = "api/kinetoscope/index.html";
/// Arguments of cargo for the packages with public documentation. The others switch on features with internals.
pub(crate) const PUBLISHED: [&str; 7] =
    ["--workspace", "--exclude", "kinetoscope-benches", "--exclude", "kinetoscope-testkit", "--exclude", "xtask"];
/// Pages outside of [`BOOK`], and the chapters that include them.
const INCLUDED_PAGES: [(&str, &str); 5] = [
    ("README.md", "introduction.html"),
    ("ARCHITECTURE.md", "architecture.html"),
    ("CONTRIBUTING.md", "contributing.html"),
    ("CHANGELOG.md", "changelog.html"),
    ("benches/RESULTS.md", "results.html"),
];

#[derive(Debug, clap::Args)]
pub(crate) struct DocsArgs {
    /// Only the book, without the API documentation, which needs a build of all crates
    #[arg(long)]
    book_only: bool,
}

pub(crate) fn run(repo: &Repo, args: &DocsArgs) -> XtaskResult {
    let site = repo.target.join("site");
    let mdbook = mdbook(repo)?;
    // mdbook empties the folder first.
    Cmd::new(mdbook).arg("build").arg(repo.root.join(BOOK)).arg("--dest-dir").arg(&site).run()?;
    if !args.book_only {
        api(repo, &site.join(API))?;
    }
    link(repo, &site)?;
    println!("\nwritten to {}; to read it:", site.display());
    println!("  python3 -m http.server --bind 127.0.0.1 --directory {} 8000", site.display());
    Ok(())
}

/// The program mdbook below the target folder, compiled by the first call, which takes some minutes.
fn mdbook(repo: &Repo) -> XtaskResult<PathBuf> {
    let tools = repo.target.join("tools");
    let program = tools.join("bin/mdbook");
    let version = Cmd::new(&program).arg("--version").output().unwrap_or_default();
    if String::from_utf8_lossy(&version).trim().ends_with(&format!("v{MDBOOK_VERSION}")) {
        return Ok(program);
    }
    println!("installing mdbook {MDBOOK_VERSION} below {}; this takes some minutes", tools.display());
    Cmd::new("cargo")
        .args(["install", "mdbook", "--locked", "--version", MDBOOK_VERSION, "--root"])
        .arg(&tools)
        .args(["--no-default-features", "--features", "search"])
        .run()?;
    Ok(program)
}

/// Builds the API documentation and copies it to `to`.
fn api(repo: &Repo, to: &Path) -> XtaskResult {
    let ready = setup::prepare(repo, Requirements::default())?;
    // Pages of an earlier run may be of items that no longer exist.
    let doc = repo.target.join("doc");
    if doc.exists() {
        fs::remove_dir_all(&doc).map_err(|e| Failure::new(format!("{}: {e}", doc.display())))?;
    }
    ready.cargo().args(["doc", "--no-deps"]).args(PUBLISHED).args(test::features(&["--workspace"])).run()?;
    copy_folder(&doc, to)?;
    write(
        &to.join("index.html"),
        "<!DOCTYPE html><meta charset=\"utf-8\"><meta http-equiv=\"refresh\" content=\"0; url=kinetoscope/index.html\">\n\
         <a href=\"kinetoscope/index.html\">API documentation</a>\n",
    )
}

/// Rewrites the links of the book's pages to targets in the site.
fn link(repo: &Repo, site: &Path) -> XtaskResult {
    let crates = crates(repo);
    let resolver = Resolver { root: &repo.root, site, crates: &crates };
    let mut copied = BTreeSet::new();
    let mut findings = Vec::new();
    // 404.html is served at any address, so mdbook writes its links in another form.
    let is_page = |file: &String| {
        file == API_FRONT_PAGE || file.ends_with(".html") && file != "404.html" && !file.starts_with(API)
    };
    let pages: Vec<String> = files_below(site).into_iter().filter(is_page).collect();
    let read = |page: &str| {
        let path = site.join(page);
        fs::read_to_string(&path).map_err(|e| Failure::new(format!("{}: {e}", path.display())))
    };
    for page in &pages {
        let (path, html) = (site.join(page), read(page)?);
        let html = rewrite_links(&html, |link| match resolver.target(page, link) {
            Target::InPlace => Some(link.to_string()),
            Target::Page(target) => Some(relative(page, &target) + anchor(link)),
            Target::File(file) => {
                let target = format!("{SOURCE}/{file}.txt");
                copied.insert(file);
                Some(relative(page, &target))
            }
            Target::Folder => None,
            Target::Missing => {
                findings.push(format!("{page}: the link to `{link}` leads nowhere"));
                Some(link.to_string())
            }
        });
        write(&path, &html)?;
    }
    for file in copied {
        copy(&repo.root.join(&file), &site.join(format!("{SOURCE}/{file}.txt")))?;
    }
    // The page for printing has all chapters in one file, with other headings.
    for page in pages.iter().filter(|page| *page != "print.html") {
        for (target, id) in anchors(page, &read(page)?) {
            if pages.contains(&target) && !read(&target)?.contains(&format!(" id=\"{id}\"")) {
                findings.push(format!("{page}: {target} has no heading `#{id}`"));
            }
        }
    }
    no_findings("the book has links without a target", &findings)
}

/// The pages and ids that a page's links with `#` lead to.
fn anchors(page: &str, html: &str) -> BTreeSet<(String, String)> {
    let folder = page.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut found = BTreeSet::new();
    rewrite_links(html, |link| {
        if let Some((path, id)) = link.split_once('#').filter(|(path, id)| !path.contains(':') && !id.is_empty()) {
            let target = if path.is_empty() { Some(page.to_string()) } else { normalized(folder, path) };
            found.extend(target.map(|target| (target, id.to_string())));
        }
        None
    });
    found
}

/// The folder of each package in the repository, with the name of its library; the facade's folder is empty.
fn crates(repo: &Repo) -> BTreeMap<String, String> {
    let packages = repo.metadata["packages"].as_array().into_iter().flatten();
    packages
        .filter_map(|package| {
            let folder = Path::new(package["manifest_path"].as_str()?).parent()?.strip_prefix(&repo.root).ok()?;
            Some((folder.to_string_lossy().into_owned(), package["name"].as_str()?.replace('-', "_")))
        })
        .collect()
}

/// The target of a link.
#[derive(Debug, PartialEq, Eq)]
enum Target {
    /// The link is right as it is.
    InPlace,
    /// A page or file of the site.
    Page(String),
    /// A file of the repository.
    File(String),
    /// A folder of the repository; it has no page.
    Folder,
    Missing,
}

/// Finds the targets of links in the site and in the repository.
struct Resolver<'a> {
    root: &'a Path,
    site: &'a Path,
    crates: &'a BTreeMap<String, String>,
}

impl Resolver<'_> {
    fn target(&self, page: &str, link: &str) -> Target {
        let path = &link[..link.len() - anchor(link).len()];
        let is_relative = !path.is_empty() && !path.contains(':') && !path.starts_with('/');
        let folder = page.rsplit_once('/').map_or("", |(folder, _)| folder);
        if !is_relative || normalized(folder, path).is_some_and(|path| self.site.join(path).is_file()) {
            return Target::InPlace;
        }
        // Included pages have links relative to the root of the repository.
        for base in [format!("{BOOK}/{folder}"), String::new()] {
            let Some(file) = normalized(&base, path) else { continue };
            // mdbook replaces the extension of pages.
            let source = file.strip_suffix(".html").map(|stem| format!("{stem}.md"));
            if let Some(found) = [Some(file), source].into_iter().flatten().find(|file| self.root.join(file).exists()) {
                return self.target_in_repository(found);
            }
        }
        Target::Missing
    }

    fn target_in_repository(&self, file: String) -> Target {
        let in_site = |path: String| self.site.join(&path).is_file().then_some(Target::Page(path));
        let included = INCLUDED_PAGES.iter().find(|(page, _)| *page == file).map(|(_, chapter)| chapter.to_string());
        let in_book = file.strip_prefix(&format!("{BOOK}/")).map(|path| match path.strip_suffix(".md") {
            Some(stem) => format!("{stem}.html"),
            None => path.to_string(),
        });
        let index = in_book.as_ref().map(|path| format!("{}/index.html", path.trim_end_matches('/')));
        let library = file.strip_suffix("src/lib.rs").unwrap_or(&file).trim_end_matches('/');
        let api = self.crates.get(library).map(|name| format!("{API}/{name}/index.html"));
        if let Some(target) = [included, in_book, index, api].into_iter().flatten().find_map(in_site) {
            return target;
        }
        if self.root.join(&file).is_file() { Target::File(file) } else { Target::Folder }
    }
}

/// The part of a link from `#` or `?` on.
fn anchor(link: &str) -> &str {
    &link[link.find(['#', '?']).unwrap_or(link.len())..]
}

/// The path from `base`, without `.` and `..`; `None` if it leaves the root.
fn normalized(base: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = Vec::new();
    for part in base.split('/').chain(path.split('/')) {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            _ => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// The path of `target` relative to the folder of `page`; both are relative to the site.
fn relative(page: &str, target: &str) -> String {
    "../".repeat(page.matches('/').count()) + target
}

/// Replaces the values of `href` and `src`; without a new value the attribute is removed.
fn rewrite_links(html: &str, mut new: impl FnMut(&str) -> Option<String>) -> String {
    let mut out = String::with_capacity(html.len());
    let mut rest = html;
    loop {
        let found = [" href=\"", " src=\""].iter().filter_map(|name| Some((rest.find(name)?, *name))).min();
        let Some((at, name)) = found else { break };
        let value = &rest[at + name.len()..];
        let Some(end) = value.find('"') else { break };
        out.push_str(&rest[..at]);
        if let Some(value) = new(&value[..end]) {
            out.push_str(&format!("{name}{value}\""));
        }
        rest = &value[end + 1..];
    }
    out + rest
}

fn write(path: &Path, text: &str) -> XtaskResult {
    fs::write(path, text).map_err(|e| Failure::new(format!("{}: {e}", path.display())))
}

fn copy(from: &Path, to: &Path) -> XtaskResult {
    let fail = |e: std::io::Error| Failure::new(format!("{} to {}: {e}", from.display(), to.display()));
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(fail)?;
    }
    fs::copy(from, to).map(|_| ()).map_err(fail)
}

/// Copies a folder with everything in it.
fn copy_folder(from: &Path, to: &Path) -> XtaskResult {
    let fail = |e: std::io::Error| Failure::new(format!("{}: {e}", from.display()));
    for entry in fs::read_dir(from).map_err(fail)? {
        let entry = entry.map_err(fail)?;
        let target = to.join(entry.file_name());
        if entry.file_type().map_err(fail)?.is_dir() {
            copy_folder(&entry.path(), &target)?;
        } else {
            copy(&entry.path(), &target)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Folders with names that other checks skip are copied, too.
    #[test]
    fn copied_folder() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        for file in ["from/a.html", "from/target/b.html"] {
            crate::wheel::tests::write(&dir.path().join(file), "");
        }
        assert!(copy_folder(&dir.path().join("from"), &dir.path().join("to")).is_ok());
        assert!(dir.path().join("to/a.html").is_file() && dir.path().join("to/target/b.html").is_file());
        assert!(copy_folder(&dir.path().join("gone"), &dir.path().join("to")).is_err());
    }

    #[test]
    fn paths() {
        assert_eq!(normalized("docs/decisions", "../../sim/./src").as_deref(), Some("sim/src"));
        assert_eq!(normalized("", "../x"), None);
        assert_eq!(relative("decisions/a.html", "cameras.html"), "../cameras.html");
        assert_eq!((anchor("a.html#b"), anchor("a.html")), ("#b", ""));
    }

    #[test]
    fn attributes() {
        let html = r#"<a class="x" href="a">1</a> href="b" <img src="c"><a href="d">"#;
        let changed = rewrite_links(html, |link| (link != "d").then(|| link.to_uppercase()));
        assert_eq!(changed, r#"<a class="x" href="A">1</a> href="B" <img src="C"><a>"#);
    }

    #[test]
    fn headings() {
        let html = "<a href=\"#a\"></a> <a href=\"../b.html#c\"></a> <a href=\"https://x.org/#d\"></a> <a href=\"e.html\"></a>";
        let found: Vec<(String, String)> = anchors("decisions/p.html", html).into_iter().collect();
        let expected =
            [("b.html", "c"), ("decisions/p.html", "a")].map(|(page, id)| (page.to_string(), id.to_string()));
        assert_eq!(found, expected);
    }

    /// The targets of all kinds of links, in a repository and a site of a few files.
    #[test]
    fn targets() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let (root, site) = (dir.path().join("repo"), dir.path().join("site"));
        for file in [
            "README.md",
            "CONTRIBUTING.md",
            "docs/cameras.md",
            "docs/decisions/0001-a.md",
            "docs/decisions/README.md",
            "docs/pictures/a.png",
            "sim/src/lib.rs",
            "sim/src/drive.rs",
            "tests/api/main.rs",
        ] {
            crate::wheel::tests::write(&root.join(file), "");
        }
        for file in [
            "introduction.html",
            "contributing.html",
            "cameras.html",
            "decisions/0001-a.html",
            "decisions/index.html",
            "pictures/a.png",
            "api/kinetoscope_sim/index.html",
        ] {
            crate::wheel::tests::write(&site.join(file), "");
        }
        let crates = BTreeMap::from([("sim".to_string(), "kinetoscope_sim".to_string())]);
        let resolver = Resolver { root: &root, site: &site, crates: &crates };
        let page = |path: &str| Target::Page(path.to_string());
        let file = |path: &str| Target::File(path.to_string());
        for (from, link, target) in [
            ("cameras.html", "https://example.org/a", Target::InPlace),
            ("cameras.html", "#part", Target::InPlace),
            ("cameras.html", "decisions/0001-a.html#part", Target::InPlace),
            ("decisions/0001-a.html", "../cameras.html", Target::InPlace),
            // Links of an included page are relative to the root of the repository.
            ("contributing.html", "docs/cameras.html#part", page("cameras.html")),
            ("contributing.html", "docs/pictures/a.png", page("pictures/a.png")),
            ("contributing.html", "docs/decisions", page("decisions/index.html")),
            ("contributing.html", "README.html", page("introduction.html")),
            ("cameras.html", "../CONTRIBUTING.html", page("contributing.html")),
            ("contributing.html", "sim", page("api/kinetoscope_sim/index.html")),
            ("cameras.html", "../sim/src/lib.rs", page("api/kinetoscope_sim/index.html")),
            ("cameras.html", "../sim/src/drive.rs", file("sim/src/drive.rs")),
            ("decisions/0001-a.html", "../../sim/src/drive.rs#L3", file("sim/src/drive.rs")),
            ("contributing.html", "tests/api", Target::Folder),
            ("cameras.html", "../sim/src/gone.rs", Target::Missing),
            ("cameras.html", "gone.html", Target::Missing),
            ("cameras.html", "../../outside.md", Target::Missing),
        ] {
            assert_eq!(resolver.target(from, link), target, "{from}: {link}");
        }
    }
}
