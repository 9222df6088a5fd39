"""Public items of the Rust crates, from their sources: types with their methods, and free functions."""

import re
from pathlib import Path

PROJECT = Path(__file__).parents[2]
# Folders of the crates whose items programs in Python need, too. The root of the project is the facade.
CRATES = ("record", "robot", "scene", "sensors", "sim", "tasks", "viewer", ".")

# Modules and items that a build for users does not have, or that no documentation shows.
HIDDEN = r'^\s*#\[(?:cfg\(feature = "internals"\)|doc\(hidden\)|cfg\((?:doc)?test\))\]\n(?:\s*#\[.*\]\n)*.*\n'


def source(path):
    """Lines of a file without comments and hidden items."""
    text = re.sub(r"^\s*//.*\n", "", path.read_text(), flags=re.MULTILINE)
    return re.sub(HIDDEN, "", text, flags=re.MULTILINE)


def leaves(use):
    """Names at the ends of the paths of a `use`, by their new names: ``a::{b, c::{D, E as F}}`` has b, D and F."""
    names = re.sub(r"\w+\s+as\s+", "", use)
    return set(re.findall(r"(\w+|\*)\s*(?=[,}]|$)", names.strip()))


def module_file(folder, name):
    """File of a module that a file in ``folder`` declares; None for a module in the same file."""
    return next((path for path in (folder / f"{name}.rs", folder / name / "mod.rs") if path.exists()), None)


def exported(path, folder):
    """Names that a public module exports, with those of the public modules below it."""
    text, names = source(path), set()
    # At the beginning of a line: items of a macro are indented.
    names |= set(re.findall(r"^pub (?:const |unsafe |async )*(?:struct|enum|trait|type|fn|union) (\w+)", text, re.MULTILINE))
    open_modules = set(re.findall(r"^pub mod (\w+);", text, re.MULTILINE))
    for use in re.findall(r"^pub use ([^;]*);", text, re.MULTILINE):
        found = leaves(use)
        if "*" in found:
            open_modules.add(re.findall(r"(\w+)::\*", use)[-1])
        names |= found - {"*"}
    for module in open_modules:
        file = module_file(folder, module)
        if file is not None:
            names |= exported(file, folder / module)
    return names


def sources(crate):
    """Files of a crate that are not tests."""
    files = sorted((PROJECT / crate / "src").rglob("*.rs"))
    return [path for path in files if not any(part.startswith("tests") for part in (*path.parts, path.stem))]


def rust_api():
    """Public methods of the exported types and traits, by type: a set of names each. And exported functions, by crate."""
    methods, functions = {}, {}
    for crate in CRATES:
        files = sources(crate)
        names = exported(PROJECT / crate / "src" / "lib.rs", PROJECT / crate / "src")
        texts = [source(path) for path in files]
        # Types of the macro that declares numeric sensors.
        for text in texts:
            for declared in re.findall(r'^    "\w+" => \w+::\{([^}]*)\},', text, re.MULTILINE):
                names |= set(re.findall(r"\b[A-Z]\w+", declared))
        known = {name for text in texts for name in re.findall(r"^pub (?:const |unsafe )*fn (\w+)", text, re.MULTILINE)}
        functions[crate] = names & known
        for text in texts:
            owner, is_trait = None, False
            for line in text.split("\n"):
                begin = re.match(r"(?:impl(?:<.*?>)?\s+(\w+)(?:<.*?>)?\s*(?:where.*)?\{|pub trait (\w+)|\})", line)
                if begin:
                    owner, is_trait = begin[1] or begin[2], begin[2] is not None
                method = re.match(r"    (pub )?(?:const )?fn (\w+)", line)
                if method and owner in names and (is_trait or method[1]):
                    methods.setdefault(owner, set()).add(method[2])
    return methods, functions
