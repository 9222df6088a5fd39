//! Finds MuJoCo, checks that its version is supported (2.2.2 or 4.x), and generates the bindings.
//!
//! Search order: `MUJOCO_DIR` (a folder with `include/mujoco/mujoco.h` and `libmujoco.so*`, as in the PyPI wheel), then
//! with the feature `download` the PyPI wheel itself (kept in `~/.local/share/kinetoscope`), otherwise the system's include folders (Debian's `libmujoco-dev`).
//!
//! On docs.rs, where MuJoCo is missing, the committed declarations of 2.2.2 are used and nothing is linked.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// The three lines of the error without MuJoCo.
const NOT_FOUND: &str = "MuJoCo was not found: install it (Debian 12: apt-get install libmujoco-dev, version 2.2.2),\n\
                         or set MUJOCO_DIR to a folder with include/mujoco and libmujoco.so* of MuJoCo 2.2.2 or 4.x,\n\
                         or enable the feature `download` of kinetoscope, which gets MuJoCo 4.0.1 from PyPI by pip";

/// Name of a library of `MUJOCO_DIR` for the linker.
const LINKED: &str = "mujoco-of-mujoco-dir";

/// Version of MuJoCo that the feature `download` gets.
const DOWNLOADED: &str = "4.0.1";

/// Architecture, platform tag and SHA-256 of the wheels of [`DOWNLOADED`]. Headers and library are the same in the wheels
/// of all Python versions, of which these are for 3.11.
const WHEELS: [(&str, &str, &str); 2] = [
    ("x86_64", "manylinux_2_28_x86_64", "be28c0c7587347ef996b4de0487264e9da296282082b092bae211a9163e9aed6"),
    ("aarch64", "manylinux_2_28_aarch64", "52d934614a56f7d75dcfc2bd8bb72f058b465ecc19a0583a56df242f9505bdb6"),
];

const SUPPORTED: &str = "supported versions: MuJoCo 2.2.2 (Debian 12: apt-get install libmujoco-dev) and MuJoCo 4.x \
                         (set MUJOCO_DIR to a folder with include/mujoco and libmujoco.so*, for example the unpacked \
                         PyPI wheel mujoco-core)";

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=DOCS_RS");
    println!("cargo::rustc-check-cfg=cfg(mj4)");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    if env::var_os("DOCS_RS").is_some() {
        println!("cargo::rerun-if-changed=docs_rs");
        println!("cargo::metadata=version_header=222");
        for file in ["bindings.rs", "fields.rs"] {
            let declared = Path::new("docs_rs").join(format!("{file}.txt"));
            fs::copy(declared, out.join(file)).expect("the committed declarations are readable");
        }
        return;
    }
    let installation = Installation::find(&out).unwrap_or_else(|message| {
        message.lines().for_each(|line| println!("cargo::error={line}"));
        std::process::exit(1);
    });
    println!("cargo::rerun-if-changed={}", installation.header("mujoco.h").display());
    println!("cargo::metadata=version_header={}", installation.version_header);
    if installation.major() >= 4 {
        println!("cargo::rustc-cfg=mj4");
    }
    installation.link();

    write_bindings(&installation, &out.join("bindings.rs"));
    write_fields(&installation, &out.join("fields.rs"));
}

struct Installation {
    include: PathBuf,
    /// Library file in `MUJOCO_DIR`. `None` without `MUJOCO_DIR`: the linker's default search then finds the library.
    library: Option<PathBuf>,
    version_header: u32,
}

impl Installation {
    fn find(out: &Path) -> Result<Self, String> {
        let given = env::var_os("MUJOCO_DIR").map(PathBuf::from);
        let wants_download = given.is_none() && env::var_os("CARGO_FEATURE_DOWNLOAD").is_some();
        let folder = if wants_download { Some(download(out)?) } else { given };
        let (include, library) = match folder {
            Some(dir) => {
                let dir =
                    fs::canonicalize(&dir).map_err(|e| format!("MUJOCO_DIR={}: {e}; {SUPPORTED}", dir.display()))?;
                let library = find_library(&dir).ok_or_else(|| {
                    format!("MUJOCO_DIR={}: no libmujoco.so* in it, nor in its lib/; {SUPPORTED}", dir.display())
                })?;
                (dir.join("include"), Some(library))
            }
            None => {
                let include = ["/usr/include", "/usr/local/include"]
                    .iter()
                    .map(PathBuf::from)
                    .find(|dir| dir.join("mujoco/mujoco.h").exists())
                    .ok_or(NOT_FOUND)?;
                (include, None)
            }
        };
        let header = include.join("mujoco/mujoco.h");
        let text = fs::read_to_string(&header).map_err(|e| format!("{}: {e}; {SUPPORTED}", header.display()))?;
        let version_header = text
            .lines()
            .find_map(|line| line.trim().strip_prefix("#define mjVERSION_HEADER")?.trim().parse().ok())
            .ok_or_else(|| format!("{}: no mjVERSION_HEADER in it; {SUPPORTED}", header.display()))?;
        let found = Self { include, library, version_header };
        if version_header != 222 && found.major() != 4 {
            return Err(format!(
                "{} belongs to MuJoCo {version_header}, which is not supported; {SUPPORTED}",
                header.display()
            ));
        }
        Ok(found)
    }

    fn header(&self, name: &str) -> PathBuf {
        self.include.join("mujoco").join(name)
    }

    /// Major version. `mjVERSION_HEADER` is 222 for 2.2.2; since 3.5 it is major * 10^6 + minor * 10^3 + patch.
    fn major(&self) -> u32 {
        if self.version_header < 1000 { self.version_header / 100 } else { self.version_header / 1_000_000 }
    }

    fn link(&self) {
        let Some(library) = &self.library else {
            println!("cargo::rustc-link-lib=dylib=mujoco");
            return;
        };
        let name = library.file_name().and_then(|n| n.to_str()).expect("find_library returns a UTF-8 file name");
        // Cargo adds only link-search folders below OUT_DIR to the library path of `cargo run` and `cargo test`. A
        // symlink there lets tests and examples find a library outside the system's search path.
        let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
        // A second link for the linker: not every linker finds the versioned name. Its name is unlike that of the library,
        // so that no library of a system folder is linked instead. Programs load the library by its SONAME.
        for link in [name, &format!("lib{LINKED}.so")] {
            let link = out.join(link);
            let _ = fs::remove_file(&link);
            #[cfg(unix)]
            std::os::unix::fs::symlink(library, &link).expect("OUT_DIR is writable");
        }
        println!("cargo::rustc-link-search=native={}", out.display());
        let folder = library.parent().expect("find_library returns a file in a folder");
        println!("cargo::metadata=library_dir={}", folder.display());
        println!("cargo::rustc-link-lib=dylib={LINKED}");
    }
}

/// Gets the wheel with MuJoCo by pip, which compares its hash, and unpacks it in a folder of the user.
///
/// Not below `out`: `cargo install` deletes that folder, and the installed program loads the library from where it is.
fn download(out: &Path) -> Result<PathBuf, String> {
    for variable in ["XDG_DATA_HOME", "HOME"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    let target = |variable: &str| env::var(variable).unwrap_or_default();
    let (arch, os) = (target("CARGO_CFG_TARGET_ARCH"), target("CARGO_CFG_TARGET_OS"));
    let wheel = WHEELS.iter().find(|(name, ..)| *name == arch).filter(|_| os == "linux");
    let Some((_, platform, hash)) = wheel else {
        return Err(format!("the feature `download` has no MuJoCo for {arch} {os}; set MUJOCO_DIR instead"));
    };
    let data = data_folder(out);
    let complete = data.join(format!("mujoco-{DOWNLOADED}-{arch}"));
    let unpacked = complete.join("mujoco");
    let is_complete = || unpacked.join(format!("libmujoco.so.{DOWNLOADED}")).is_file();
    if is_complete() {
        return Ok(unpacked);
    }
    let (requirements, wheels) = (out.join("wheel.txt"), out.join("wheels"));
    // In the folder of the result, so that it can be renamed; other builds may unpack at the same time.
    let scratch = data.join(format!("mujoco-{DOWNLOADED}-{arch}.{}.tmp", std::process::id()));
    for folder in [&wheels, &scratch] {
        remove(folder)?;
    }
    let failed = |path: &Path| {
        let path = path.display().to_string();
        move |error: std::io::Error| format!("{path}: {error}")
    };
    fs::create_dir_all(&scratch).map_err(failed(&scratch))?;
    let requirement = format!("mujoco-core=={DOWNLOADED} --hash=sha256:{hash}\n");
    fs::write(&requirements, requirement).map_err(failed(&requirements))?;
    let mut pip = Command::new("python3");
    pip.args(["-m", "pip", "download", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps"])
        .args(["--only-binary=:all:", "--python-version", "3.11", "--platform", platform, "--require-hashes"])
        .arg("--requirement")
        .arg(&requirements)
        .arg("--dest")
        .arg(&wheels);
    run(&mut pip)?;
    let wheel = fs::read_dir(&wheels).map_err(failed(&wheels))?.flatten().next();
    let wheel = wheel.ok_or("pip downloaded no wheel of mujoco-core")?.path();
    run(Command::new("python3").args(["-m", "zipfile", "-e"]).arg(&wheel).arg(&scratch))?;
    // Renamed at the end: a folder of that name with the library is complete.
    if fs::rename(&scratch, &complete).is_err() && !is_complete() {
        remove(&complete)?;
        fs::rename(&scratch, &complete).map_err(failed(&complete))?;
    }
    remove(&scratch)?;
    remove(&wheels)?;
    Ok(unpacked)
}

/// Folder for data of the user, `~/.local/share/kinetoscope`; below `out` without a home folder.
fn data_folder(out: &Path) -> PathBuf {
    let absolute = |variable: &str| env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    let home = absolute("XDG_DATA_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local/share")));
    home.map_or_else(|| out.to_path_buf(), |folder| folder.join("kinetoscope"))
}

fn remove(folder: &Path) -> Result<(), String> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(format!("{}: {error}", folder.display())),
        _ => Ok(()),
    }
}

/// Runs a command; its messages are part of the error.
fn run(command: &mut Command) -> Result<(), String> {
    let name =
        format!("{} -m {}", command.get_program().display(), command.get_args().nth(1).unwrap_or_default().display());
    let output = command.output().map_err(|e| format!("{name}: {e} (the feature `download` needs Python with pip)"))?;
    if output.status.success() {
        return Ok(());
    }
    Err(format!("{name} failed: {}", String::from_utf8_lossy(&output.stderr).trim()))
}

fn find_library(dir: &Path) -> Option<PathBuf> {
    let mut found: Vec<PathBuf> = [dir.to_path_buf(), dir.join("lib")]
        .iter()
        .filter_map(|d| fs::read_dir(d).ok())
        .flatten()
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|p| p.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with("libmujoco.so")))
        .collect();
    found.sort();
    found.into_iter().next()
}

#[derive(Debug)]
struct StripTrailingUnderscore;

impl bindgen::callbacks::ParseCallbacks for StripTrailingUnderscore {
    /// Removes the underscore of struct tags: 2.2.2 writes `typedef struct mjModel_ {..} mjModel;`, 4.x
    /// `typedef struct mjModel {..} mjModel;`.
    fn item_name(&self, item: bindgen::callbacks::ItemInfo<'_>) -> Option<String> {
        (item.name.starts_with("mj") && item.name.ends_with('_')).then(|| item.name.trim_end_matches('_').to_string())
    }
}

fn write_bindings(installation: &Installation, path: &Path) {
    bindgen::Builder::default()
        .header_contents("wrapper.h", "#include <mujoco/mujoco.h>\n")
        .clang_arg(format!("-I{}", installation.include.display()))
        .parse_callbacks(Box::new(StripTrailingUnderscore))
        .allowlist_function("mj_.*|mju_.*")
        .allowlist_var("mj.*")
        .allowlist_type("mjt.*|mjModel|mjData|mjVFS|mjContact|mjOption")
        // Enum values come from the library: a value unknown to a Rust enum would be undefined behavior.
        .default_enum_style(bindgen::EnumVariation::Consts)
        .prepend_enum_name(false)
        .default_macro_constant_type(bindgen::MacroTypeVariation::Signed)
        // Structs of up to 2 MB that own memory must not be copied by an assignment.
        .no_copy("mj(Model|Data|VFS|vScene|UI|vFigure|rContext)_?")
        .derive_debug(false)
        .generate_comments(false)
        .size_t_is_usize(true)
        .layout_tests(true)
        // The error handler unwinds out of engine functions.
        .override_abi(bindgen::Abi::CUnwind, ".*")
        .generate()
        .expect("bindgen on MuJoCo's headers")
        .write_to_file(path)
        .expect("OUT_DIR is writable");
}

/// Writes accessors of all arrays of `mjModel` and `mjData`, generated from MuJoCo's own X-macros: no stride is typed
/// by hand.
///
/// `X(type, name, rows, cols)` becomes `pub unsafe fn name<'a>(..) -> &'a [type]` of `rows * cols` elements;
/// `model::each` visits all arrays of a model.
fn write_fields(installation: &Installation, path: &Path) {
    let text = fs::read_to_string(installation.header("mjxmacro.h")).expect("mjxmacro.h stands beside mujoco.h");
    let lists = x_macros(&text);
    let mut out = String::new();
    for (module, prefixes) in
        [("model", &["MJMODEL_POINTERS"][..]), ("data", &["MJDATA_POINTERS", "MJDATA_ARENA_POINTERS"][..])]
    {
        let mut arrays: BTreeMap<&str, (&str, &str, &str)> = BTreeMap::new();
        for (_, entries) in lists.iter().filter(|(list, _)| prefixes.iter().any(|p| list.starts_with(p))) {
            for entry in entries {
                if let [kind, name, rows, cols] = entry.as_slice() {
                    arrays.insert(name, (kind, rows, cols));
                }
            }
        }
        assert!(arrays.len() > 50, "mjxmacro.h: only {} arrays found for {module}", arrays.len());
        writeln!(out, "pub mod {module} {{\n    use crate::*;").unwrap();
        let mut each = String::new();
        for (name, (kind, rows, cols)) in arrays {
            let kind = rust_type(kind);
            let (rows, cols) = (size_expression(rows), size_expression(cols));
            writeln!(
                each,
                "        array(ModelArray {{ name: \"{name}\", element_type: \"{kind}\", pointer_offset: ::std::mem::offset_of!(mjModel, {name}), bytes: unsafe {{ ({rows}) * ({cols}) }} * ::std::mem::size_of::<{kind}>() }});"
            )
            .unwrap();
            let (arguments, owner) = if module == "model" {
                ("m: *const mjModel", "m")
            } else {
                ("m: *const mjModel, d: *const mjData", "d")
            };
            writeln!(
                out,
                "    pub unsafe fn {name}<'a>({arguments}) -> &'a [{kind}] {{ unsafe {{ super::slice((*{owner}).{name}, ({rows}) * ({cols})) }} }}"
            )
            .unwrap();
            let arguments = arguments
                .replace("d: *const", "d: *mut")
                .replace("m: *const mjModel", if module == "model" { "m: *mut mjModel" } else { "m: *const mjModel" });
            writeln!(
                out,
                "    pub unsafe fn {name}_mut<'a>({arguments}) -> &'a mut [{kind}] {{ unsafe {{ super::slice_mut((*{owner}).{name}, ({rows}) * ({cols})) }} }}"
            )
            .unwrap();
        }
        if module == "model" {
            writeln!(
                out,
                "    pub unsafe fn each(m: *const mjModel, mut array: impl FnMut(ModelArray)) {{\n{each}    }}\n    \
                 pub use super::ModelArray;"
            )
            .unwrap();
        }
        writeln!(out, "}}").unwrap();
    }
    fs::write(path, out).expect("OUT_DIR is writable");
}

/// Returns the Rust name of a C element type. Types of MuJoCo keep their names, because bindgen declares them.
fn rust_type(c: &str) -> &str {
    match c {
        "int" => "::std::os::raw::c_int",
        "float" => "f32",
        "double" => "f64",
        "char" => "::std::os::raw::c_char",
        "uint64_t" => "u64",
        "uintptr_t" => "usize",
        mujoco => mujoco,
    }
}

/// Rust expression of a size in `mjxmacro.h`: a number, a constant, a size field of the model, or `MJ_D(..)`, a size
/// field of the data.
///
/// `njmax` and `nconmax` (2.2.2) are allocated rows. Only the first `nefc` and `ncon` rows are filled, so the accessors
/// return those, as 4.x declares.
fn size_expression(c: &str) -> String {
    let inner = |c: &str| c[c.find('(').map_or(0, |i| i + 1)..c.rfind(')').unwrap_or(c.len())].trim().to_string();
    if let Some((a, b)) = c.split_once('*') {
        return format!("{} * {}", size_expression(a.trim()), size_expression(b.trim()));
    }
    match c {
        "njmax" | "MJ_M(njmax)" => "(*d).nefc as usize".into(),
        "nconmax" => "(*d).ncon as usize".into(),
        _ if c.starts_with("MJ_D") => format!("(*d).{} as usize", inner(c)),
        _ if c.starts_with("MJ_M") => format!("(*m).{} as usize", inner(c)),
        _ if c.starts_with("mj") => format!("{c} as usize"),
        _ if c.bytes().all(|b| b.is_ascii_digit()) => c.into(),
        _ => format!("(*m).{c} as usize"),
    }
}

/// Parses `#define NAME \ X(a, b, ...) \ XMJV(a, ...)` into (NAME, [[a, b, ...], ...]).
fn x_macros(text: &str) -> BTreeMap<String, Vec<Vec<String>>> {
    let joined = text.replace("\\\r\n", " ").replace("\\\n", " ");
    let mut lists: BTreeMap<String, Vec<Vec<String>>> = BTreeMap::new();
    for line in joined.lines() {
        let Some(rest) = line.trim().strip_prefix("#define ") else { continue };
        let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let entries = calls(&rest[name.len()..]);
        if !entries.is_empty() {
            lists.entry(name).or_default().extend(entries);
        }
    }
    lists
}

/// Argument lists of all calls `X...(..)` in `text`; nested parentheses (`MJ_M(n)`) belong to the argument.
fn calls(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        if bytes[at] == b'X' && (at == 0 || !bytes[at - 1].is_ascii_alphanumeric() && bytes[at - 1] != b'_') {
            let word_end = at + text[at..].find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len() - at);
            let open = word_end + text[word_end..].len() - text[word_end..].trim_start().len();
            if bytes.get(open) == Some(&b'(') {
                let (mut depth, mut end) = (0, open);
                for (i, &b) in bytes.iter().enumerate().skip(open) {
                    match b {
                        b'(' => depth += 1,
                        b')' => depth -= 1,
                        _ => {}
                    }
                    if depth == 0 {
                        end = i;
                        break;
                    }
                }
                found.push(split_arguments(&text[open + 1..end]));
                at = end + 1;
                continue;
            }
        }
        at += 1;
    }
    found
}

fn split_arguments(text: &str) -> Vec<String> {
    let (mut depth, mut current, mut out) = (0, String::new(), Vec::new());
    for c in text.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            ',' if depth == 0 => {
                out.push(current.trim().to_string());
                current.clear();
                continue;
            }
            _ => {}
        }
        current.push(c);
    }
    out.push(current.trim().to_string());
    out
}
