//! Finds MuJoCo, checks that its version is supported (2.2.2 or 4.x), and generates the bindings.
//!
//! Search order: `MUJOCO_DIR` (a folder with `include/mujoco/mujoco.h` and `libmujoco.so*`, as in the PyPI wheel), then
//! with the feature `download` the PyPI wheel itself (kept in `~/.local/share/kinetoscope`), otherwise the system's include folders (Debian's `libmujoco-dev`).
//!
//! On docs.rs, where MuJoCo is missing, the committed declarations of 2.2.2 are used and nothing is linked.

mod installation;

use installation::{Download, Installation, WHEELS, cargo_errors};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Name of a library of `MUJOCO_DIR` for the linker.
const LINKED: &str = "mujoco-of-mujoco-dir";

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=installation.rs");
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
    let given = env::var_os("MUJOCO_DIR").map(PathBuf::from);
    let wanted = env::var_os("CARGO_FEATURE_DOWNLOAD").map(|_| download(&out));
    let found = Installation::find(given, wanted, &["/usr/include", "/usr/local/include"].map(Path::new));
    let installation = found.unwrap_or_else(|message| {
        print!("{}", cargo_errors(&message));
        std::process::exit(1);
    });
    println!("cargo::rerun-if-changed={}", installation.header("mujoco.h").display());
    println!("cargo::metadata=version_header={}", installation.version_header);
    if installation.major() >= 4 {
        println!("cargo::rustc-cfg=mj4");
    }
    link(&installation);

    write_bindings(&installation, &out.join("bindings.rs"));
    write_fields(&installation, &out.join("fields.rs"));
}

/// The download for the target, into a folder for data of the user: `~/.local/share/kinetoscope`, or below `out` without a
/// home folder.
///
/// Not below `out` otherwise: `cargo install` deletes that folder, and the installed program loads the library from where
/// it is.
fn download(out: &Path) -> Download<'static> {
    for variable in ["XDG_DATA_HOME", "HOME"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    let absolute = |variable: &str| env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    let home = absolute("XDG_DATA_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local/share")));
    let target = |variable: &str| env::var(variable).unwrap_or_default();
    Download {
        arch: target("CARGO_CFG_TARGET_ARCH"),
        os: target("CARGO_CFG_TARGET_OS"),
        wheels: &WHEELS,
        data: home.map_or_else(|| out.to_path_buf(), |folder| folder.join("kinetoscope")),
        scratch: out.to_path_buf(),
        pip_options: Vec::new(),
    }
}

/// Links the library.
fn link(installation: &Installation) {
    let Some(library) = &installation.library else {
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
