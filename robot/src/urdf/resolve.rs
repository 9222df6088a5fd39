//! Resolver of mesh and texture URIs to files.
//!
//! Search order by form of the URI:
//!
//! - `package://pkg/rest`, `model://pkg/rest`: the folder given for `pkg` in the configuration, and only there. Without
//!   one: `ROS_PACKAGE_PATH`, `AMENT_PREFIX_PATH` (`share/pkg`), then every folder above the URDF. In each folder of
//!   the first and the last, these match in this order: the folder itself if its name or the `<name>` of its
//!   `package.xml` is `pkg`, its subfolder `pkg`, and subfolders whose `package.xml` has that `<name>`.
//! - `file://...`: the absolute path; a relative path starts at the URDF.
//! - Absolute path: this path.
//! - Relative path: the folder of the URDF, then the asset root of the configuration.
//!
//! The asset root is also the last folder that is searched for packages. `package:///path` has no package: in lenient
//! reading it is an absolute path or, if that does not exist, `package://path`.
//!
//! A file that these rules do not find is searched in `meshdir` of `<mujoco><compiler>`: the whole path, then only its
//! last part, as MuJoCo does. `%20` and similar escapes are decoded in URIs, and in plain paths if the path as written
//! does not exist.
//!
//! `..` may leave a package or the folder of the URDF, since robots share meshes that way. The path only has to exist;
//! otherwise the error shows the path with `..` resolved. Nothing is written, so `..` reaches only files that the user
//! can read anyway.

use super::config::Strictness;
use std::collections::{BTreeMap, HashMap};
use std::path::{Component, Path, PathBuf};

/// Maximum number of entries of a folder that are examined in search of a package.
const FOLDER_LIMIT: usize = 4096;

/// Result of resolving a URI.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub(super) enum Resolved {
    /// The file exists.
    Found(PathBuf),
    /// The location is known, but the file does not exist.
    Missing {
        /// Most likely path.
        most_likely: PathBuf,
        /// Every path that was tried.
        tried: Vec<String>,
        /// Additional hint, such as a file whose name differs only in case; `None` without one.
        hint: Option<String>,
    },
    /// The package was not found.
    PackageUnknown {
        /// Name of the package.
        package: String,
        /// Most likely path.
        guess: PathBuf,
        /// Every folder that was searched.
        tried: Vec<String>,
    },
    /// The URI is empty.
    Empty,
    /// The URI cannot name a file, such as `http://`.
    Unsupported {
        /// Problem and accepted forms.
        problem: String,
    },
}

/// Resolver of the files that a URDF names. Results are cached by URI.
#[derive(Debug)]
pub(super) struct Resolver<'c> {
    packages: &'c BTreeMap<String, PathBuf>,
    folder: PathBuf,
    meshdir: Option<String>,
    asset_root: Option<PathBuf>,
    strictness: Strictness,
    /// Entries of `ROS_PACKAGE_PATH`.
    ros_package_path: Vec<PathBuf>,
    /// Entries of `AMENT_PREFIX_PATH`.
    ament_prefix_path: Vec<PathBuf>,
    resolved: HashMap<String, Resolved>,
    searched: HashMap<String, PackageSearch>,
}

/// Folders that match a package, and all folders that were searched.
#[derive(Clone, Debug, Default)]
struct PackageSearch {
    found: Vec<PathBuf>,
    tried: Vec<String>,
}

impl<'c> Resolver<'c> {
    /// Creates a resolver for the URDF at `urdf`, with package folders by name. Reads the environment variables
    /// `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
    pub(super) fn new(urdf: &Path, packages: &'c BTreeMap<String, PathBuf>, meshdir: Option<&str>) -> Self {
        let paths = |name: &str| {
            let value = std::env::var_os(name).unwrap_or_default();
            std::env::split_paths(&value).filter(|p| !p.as_os_str().is_empty()).collect::<Vec<_>>()
        };
        Self::with_paths(urdf, packages, meshdir, paths("ROS_PACKAGE_PATH"), paths("AMENT_PREFIX_PATH"))
    }

    /// Creates a resolver like [`Resolver::new`], with the two search paths as arguments instead of from the
    /// environment.
    pub(super) fn with_paths(
        urdf: &Path,
        packages: &'c BTreeMap<String, PathBuf>,
        meshdir: Option<&str>,
        ros_package_path: Vec<PathBuf>,
        ament_prefix_path: Vec<PathBuf>,
    ) -> Self {
        // Absolute, so that the walk upward does not end at the current folder, and results survive a change of it.
        let absolute = std::path::absolute(urdf).unwrap_or_else(|_| urdf.to_path_buf());
        Self {
            packages,
            folder: absolute.parent().map(Path::to_path_buf).unwrap_or_default(),
            meshdir: meshdir.map(str::to_owned),
            asset_root: None,
            strictness: Strictness::default(),
            ros_package_path,
            ament_prefix_path,
            resolved: HashMap::new(),
            searched: HashMap::new(),
        }
    }

    /// Sets the folder to search for files that are not found from the URDF.
    #[must_use]
    pub(super) fn with_asset_root(self, asset_root: Option<&Path>) -> Self {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        Self { asset_root: asset_root.map(absolute), ..self }
    }

    /// Sets the handling of invalid URIs.
    #[must_use]
    pub(super) fn with_strictness(self, strictness: Strictness) -> Self {
        Self { strictness, ..self }
    }

    /// Resolves a URI to a file.
    pub(super) fn resolve(&mut self, uri: &str) -> Resolved {
        if let Some(known) = self.resolved.get(uri) {
            return known.clone();
        }
        let resolved = self.look_up(uri.trim());
        self.resolved.insert(uri.to_owned(), resolved.clone());
        resolved
    }

    fn look_up(&mut self, uri: &str) -> Resolved {
        if uri.is_empty() {
            return Resolved::Empty;
        }
        let Some((scheme, rest)) = uri.split_once("://") else { return self.resolve_path(uri) };
        match scheme.to_ascii_lowercase().as_str() {
            "package" | "model" => {
                let rest = decode(rest);
                match rest.strip_prefix('/').filter(|_| self.strictness == Strictness::Lenient) {
                    Some(_) if Path::new(&rest).is_file() => Resolved::Found(PathBuf::from(rest)),
                    Some(package) => match self.package(package) {
                        Resolved::Missing { most_likely, tried, hint } => {
                            Resolved::Missing { most_likely, tried: [vec![rest], tried].concat(), hint }
                        }
                        Resolved::PackageUnknown { package, guess, tried } => {
                            Resolved::PackageUnknown { package, guess, tried: [vec![rest], tried].concat() }
                        }
                        other => other,
                    },
                    None => self.package(&rest),
                }
            }
            "file" => {
                self.resolve_path(&decode(rest.strip_prefix("localhost/").map_or(rest, |_| &rest["localhost".len()..])))
            }
            _ => Resolved::Unsupported {
                problem: format!("{scheme}:// is not supported; use package://, file:// or a path"),
            },
        }
    }

    /// Resolves a path that is absolute, or relative to the folder of the URDF or to the asset root.
    fn resolve_path(&self, path: &str) -> Resolved {
        let decoded = decode(path);
        let folders = [Some(&self.folder), self.asset_root.as_ref()];
        let candidates = folders.into_iter().flatten().flat_map(|f| [f.join(path), f.join(&decoded)]).collect();
        self.first_file(candidates, path)
    }

    fn package(&mut self, rest: &str) -> Resolved {
        let (package, file) = rest.split_once('/').unwrap_or((rest, ""));
        if package.is_empty() || file.is_empty() {
            // `package://part.stl` is a file beside the URDF or in the asset root.
            if self.strictness == Strictness::Lenient
                && !package.is_empty()
                && !rest.contains('/')
                && let found @ Resolved::Found(_) = self.resolve_path(package)
            {
                return found;
            }
            let problem =
                "the package or the file is missing; write package://name_of_package/meshes/part.stl".to_owned();
            return Resolved::Unsupported { problem };
        }
        let file = file.trim_start_matches('/');
        let search = match self.packages.get(package) {
            // A configured package is searched in its folder only: a file from another folder would be a surprise.
            Some(folder) => PackageSearch { found: vec![folder.clone()], tried: Vec::new() },
            None => self.search(package),
        };
        if !search.found.is_empty() {
            return self.first_file(search.found.iter().map(|folder| folder.join(file)).collect(), file);
        }
        let guess = self.folder.join(file);
        match self.in_meshdir(file) {
            Some(found) => Resolved::Found(found),
            None => Resolved::PackageUnknown { package: package.to_owned(), guess, tried: search.tried },
        }
    }

    /// Returns the first candidate that is a file, or else the file in `meshdir`, or else [`Resolved::Missing`].
    fn first_file(&self, candidates: Vec<PathBuf>, path: &str) -> Resolved {
        if let Some(found) = candidates.iter().find(|c| c.is_file()) {
            return Resolved::Found(found.clone());
        }
        if let Some(found) = self.in_meshdir(path) {
            return Resolved::Found(found);
        }
        let in_meshdir = self.meshdir_candidates(path);
        let mut tried: Vec<String> = Vec::new();
        for place in candidates.iter().chain(&in_meshdir).map(|c| normalize_path(c).display().to_string()) {
            if !tried.contains(&place) {
                tried.push(place);
            }
        }
        let most_likely = candidates.into_iter().next().unwrap_or_default();
        Resolved::Missing { hint: missing_file_hint(&most_likely), most_likely, tried }
    }

    fn in_meshdir(&self, path: &str) -> Option<PathBuf> {
        self.meshdir_candidates(path).into_iter().find(|c| c.is_file())
    }

    fn meshdir_candidates(&self, path: &str) -> Vec<PathBuf> {
        let Some(meshdir) = &self.meshdir else { return Vec::new() };
        let folder = self.folder.join(meshdir);
        let mut candidates = Vec::new();
        if Path::new(path).is_relative() {
            candidates.push(folder.join(path));
        }
        candidates.extend(Path::new(path).file_name().map(|name| folder.join(name)));
        candidates.dedup();
        candidates
    }

    /// Finds folders that match a package, best first.
    fn search(&mut self, package: &str) -> PackageSearch {
        if let Some(known) = self.searched.get(package) {
            return known.clone();
        }
        let mut search = PackageSearch::default();
        // A package is one folder: `..` or an absolute path is not a name, and joining it would leave the search path.
        let plain_name = matches!(Path::new(package).components().collect::<Vec<_>>()[..], [Component::Normal(_)]);
        if plain_name {
            for folder in self.ros_package_path.clone() {
                search.search_folder(&folder, package, "ROS_PACKAGE_PATH");
            }
            for prefix in &self.ament_prefix_path {
                search.check(prefix.join("share").join(package), "AMENT_PREFIX_PATH");
            }
            for folder in self.folder.ancestors() {
                search.search_folder(folder, package, "above the URDF");
            }
            if let Some(folder) = &self.asset_root {
                search.search_folder(folder, package, "asset root");
            }
        }
        self.searched.insert(package.to_owned(), search.clone());
        search
    }
}

impl PackageSearch {
    /// Checks the folder itself, if its name or its `package.xml` matches, then its child of that name, and its
    /// children whose `package.xml` has that name.
    fn search_folder(&mut self, folder: &Path, package: &str, why: &str) {
        if folder.file_name().is_some_and(|n| n == package) || declared_name(folder).as_deref() == Some(package) {
            self.check(folder.to_path_buf(), why);
        }
        self.check(folder.join(package), why);
        let children = std::fs::read_dir(folder).into_iter().flatten().take(FOLDER_LIMIT).flatten();
        let mut named: Vec<PathBuf> =
            children.map(|c| c.path()).filter(|c| declared_name(c).as_deref() == Some(package)).collect();
        named.sort();
        for child in named {
            self.check(child, why);
        }
    }

    fn check(&mut self, folder: PathBuf, why: &str) {
        if self.found.contains(&folder) {
            return;
        }
        self.tried.push(format!("{} ({why})", folder.display()));
        if folder.is_dir() {
            self.found.push(folder);
        }
    }
}

/// Reads the `<name>` of the `package.xml` in a folder; `None` without a readable one.
fn declared_name(folder: &Path) -> Option<String> {
    let path = folder.join("package.xml");
    let metadata = std::fs::metadata(&path).ok()?;
    if !metadata.is_file() || metadata.len() > 1 << 20 {
        return None;
    }
    let text = std::fs::read_to_string(path).ok()?;
    let document = roxmltree::Document::parse(&text).ok()?;
    let name = document.root_element().children().find(|n| n.has_tag_name("name"))?.text()?;
    Some(name.trim().to_owned())
}

/// Decodes `%20` and similar escapes. Invalid escapes stay as they are, and so does a text that would not be UTF-8.
fn decode(text: &str) -> String {
    percent_encoding::percent_decode_str(text).decode_utf8().map_or_else(|_| text.to_owned(), String::from)
}

/// Resolves `.` and `..` in the text of a path, for messages.
fn normalize_path(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// Explains why a path is not a file, if the folder shows a reason.
fn missing_file_hint(path: &Path) -> Option<String> {
    if path.is_dir() {
        return Some("it is a folder".to_owned());
    }
    let (folder, name) = (path.parent()?, path.file_name()?.to_str()?);
    let entries = std::fs::read_dir(folder).ok()?.take(FOLDER_LIMIT).flatten();
    let mut names: Vec<String> = entries.filter_map(|e| e.file_name().into_string().ok()).collect();
    names.sort();
    let alike = names.iter().find(|n| n.to_lowercase() == name.to_lowercase());
    let stem = |n: &str| Path::new(n).file_stem().map(std::ffi::OsStr::to_os_string);
    let found = alike.or_else(|| names.iter().find(|n| stem(n) == stem(name)))?;
    Some(format!("the folder has \"{found}\""))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_testkit::urdf::TempFiles;

    /// Creates the test files `ws/robot_description/{package.xml,urdf/robot.urdf,meshes/part one.stl}`, `ws/other
    /// folder` with the package `meshes_pkg`, `ws/install/share/installed`, and `ws/ros/rospkg`.
    fn workspace() -> TempFiles {
        let files = TempFiles::default();
        for (path, text) in [
            ("robot_description/urdf/robot.urdf", ""),
            ("robot_description/urdf/local.stl", ""),
            ("robot_description/urdf/100%25.stl", ""),
            ("robot_description/urdf/mj/only_here.stl", ""),
            ("robot_description/package.xml", "<package><name> robot_description </name></package>"),
            ("robot_description/meshes/part one.stl", ""),
            ("robot_description/meshes/Base.STL", ""),
            ("other folder/package.xml", "<package><name>meshes_pkg</name></package>"),
            ("other folder/a.stl", ""),
            ("install/share/installed/b.stl", ""),
            ("ros/rospkg/c.stl", ""),
            ("broken/package.xml", "<package><name>"),
        ] {
            files.write(&format!("ws/{path}"), text);
        }
        for path in ["cubes/meshes/cube.stl", "local.stl"] {
            files.write(&format!("assets/{path}"), "");
        }
        files
    }

    fn resolve(dir: &Path, uri: &str) -> Resolved {
        let packages = BTreeMap::from([("mapped".to_owned(), dir.join("ws/other folder"))]);
        let urdf = dir.join("ws/robot_description/urdf/robot.urdf");
        let (ros, ament) = (vec![dir.join("ws/ros")], vec![dir.join("ws/install")]);
        let resolver = Resolver::with_paths(&urdf, &packages, Some("mj"), ros, ament);
        resolver.with_asset_root(Some(&dir.join("assets"))).resolve(uri)
    }

    #[test]
    fn found() {
        let dir = workspace();
        let absolute = dir.folder().join("ws/ros/rospkg/c.stl").display().to_string();
        for (uri, file) in [
            ("package://robot_description/meshes/part%20one.stl", "part one.stl"),
            ("package://robot_description/meshes/part one.stl", "part one.stl"),
            ("package://robot_description//meshes/Base.STL", "Base.STL"),
            ("model://robot_description/meshes/Base.STL", "Base.STL"),
            ("package://meshes_pkg/a.stl", "a.stl"),
            ("package://mapped/a.stl", "a.stl"),
            ("package://installed/b.stl", "b.stl"),
            ("package://rospkg/c.stl", "c.stl"),
            ("package://rospkg/../../robot_description/meshes/Base.STL", "Base.STL"),
            ("package://nowhere/meshes/only_here.stl", "only_here.stl"),
            (&absolute, "c.stl"),
            (&format!("file://{absolute}"), "c.stl"),
            (&format!("file://localhost{absolute}"), "c.stl"),
            ("file://local.stl", "local.stl"),
            ("local.stl", "local.stl"),
            (" ./local.stl ", "local.stl"),
            ("../meshes/part%20one.stl", "part one.stl"),
            ("100%25.stl", "100%25.stl"),
            ("only_here.stl", "only_here.stl"),
            ("some/folder/only_here.stl", "only_here.stl"),
            // Isaac Gym: paths and packages from the asset root.
            ("cubes/meshes/cube.stl", "assets/cubes/meshes/cube.stl"),
            ("package://cubes/meshes/cube.stl", "assets/cubes/meshes/cube.stl"),
            // The folder of the URDF comes first.
            ("local.stl", "urdf/local.stl"),
            // One slash too many, with a package and with an absolute path.
            ("package:///rospkg/c.stl", "c.stl"),
            (&format!("package://{absolute}"), "c.stl"),
            // A file without a package, beside the URDF and in the asset root.
            ("package://local.stl", "urdf/local.stl"),
            ("package://only_here.stl", "only_here.stl"),
        ] {
            match resolve(dir.folder(), uri) {
                Resolved::Found(path) => assert!(path.is_file() && path.ends_with(file), "{uri}: {path:?}"),
                other => panic!("{uri}: {other:?}"),
            }
        }
    }

    #[test]
    fn missing() {
        let dir = workspace();
        for uri in ["package://robot_description/../../outside.stl", "../../outside.stl"] {
            let Resolved::Missing { tried, .. } = resolve(dir.folder(), uri) else { panic!("{uri}") };
            assert!(tried[0].ends_with("outside.stl") && !tried[0].contains(".."), "{tried:?}");
        }
        for (uri, says) in [("../meshes/base.stl", "the folder has \"Base.STL\""), ("../meshes/", "it is a folder")] {
            let Resolved::Missing { hint, .. } = resolve(dir.folder(), uri) else { panic!("{uri}") };
            assert_eq!(hint.unwrap(), says);
        }
        let Resolved::Missing { tried, .. } = resolve(dir.folder(), "package://mapped/c.stl") else { panic!() };
        assert!(tried[0].ends_with("ws/other folder/c.stl"));
        // Search roots that are one folder: each path is listed once.
        let same = dir.folder().join("ws/robot_description/urdf");
        let packages = BTreeMap::new();
        let resolver = Resolver::with_paths(&same.join("robot.urdf"), &packages, Some("."), vec![], vec![]);
        let Resolved::Missing { tried, .. } = resolver.with_asset_root(Some(&same)).resolve("none.stl") else {
            panic!()
        };
        assert_eq!(tried, [same.join("none.stl").display().to_string()]);
        let unknown = resolve(dir.folder(), "package://nope/x.stl");
        let Resolved::PackageUnknown { package, tried, .. } = unknown else { panic!() };
        assert_eq!(package, "nope");
        for place in ["ws/ros/nope (ROS_PACKAGE_PATH)", "ws/install/share/nope (AMENT_PREFIX_PATH)", "ws/nope (above"] {
            assert!(tried.iter().any(|t| t.contains(place)), "{place} not in {tried:?}");
        }
    }

    #[test]
    fn nonsense() {
        let dir = workspace();
        assert_eq!(resolve(dir.folder(), ""), Resolved::Empty);
        assert_eq!(resolve(dir.folder(), "  "), Resolved::Empty);
        let urdf = dir.folder().join("ws/robot_description/urdf/robot.urdf");
        let packages = BTreeMap::new();
        let unknown = resolve(dir.folder(), "package:///none/a.stl");
        assert!(matches!(&unknown, Resolved::PackageUnknown { tried, .. } if tried[0] == "/none/a.stl"), "{unknown:?}");
        let strict = Resolver::with_paths(&urdf, &packages, None, vec![dir.folder().join("ws/ros")], vec![]);
        let strict = strict.with_strictness(Strictness::Strict).resolve("package:///rospkg/c.stl");
        assert!(matches!(strict, Resolved::Unsupported { .. }), "{strict:?}");
        let strict = Resolver::with_paths(&urdf, &packages, None, vec![], vec![]);
        let strict = strict.with_strictness(Strictness::Strict).resolve("package://local.stl");
        assert!(matches!(strict, Resolved::Unsupported { .. }), "{strict:?}");
        for uri in ["http://example.com/a.stl", "package://", "package://pkg", "package://pkg/", "package:///a.stl"] {
            assert!(matches!(resolve(dir.folder(), uri), Resolved::Unsupported { .. }), "{uri}");
        }
        for uri in ["package://../robot_description/x.stl", "package://./x.stl", "package://a\0b/x.stl"] {
            assert!(matches!(resolve(dir.folder(), uri), Resolved::PackageUnknown { .. }), "{uri}");
        }
        let up = "../../../../../../../../../../x";
        for uri in ["%", "%0", "%zz.stl", "%ff.stl", "%00.stl", "file://", "://", up, "~"] {
            let resolved = resolve(dir.folder(), uri);
            assert!(!matches!(resolved, Resolved::Found(_)), "{uri}: {resolved:?}");
        }
    }
}
