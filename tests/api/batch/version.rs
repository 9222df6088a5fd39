//! A library of another version than the headers is a clear error: tried with a library that is nothing but a version.

use kinetoscope::prelude::*;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use testkit::process::{is_child, run, text};

fn tool(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok()?;
    output.status.success().then(|| text(&output.stdout))
}

/// What this binary wants of MuJoCo.
struct Wanted {
    /// The name of the library that it asks the loader for.
    soname: String,
    functions: Vec<String>,
    /// Names and sizes.
    variables: Vec<(String, usize)>,
}

fn wanted() -> Option<Wanted> {
    let exe = std::env::current_exe().unwrap().to_string_lossy().into_owned();
    let dynamic = tool("readelf", &["-d", &exe])?;
    let soname = dynamic.lines().find(|l| l.contains("NEEDED") && l.contains("libmujoco"))?;
    let soname = soname.split(['[', ']']).nth(1)?.to_owned();
    // Columns: number, value, size, type, binding, visibility, section, name.
    let symbols = tool("readelf", &["--dyn-syms", "-W", &exe])?;
    let (mut functions, mut variables) = (Vec::new(), Vec::new());
    for line in symbols.lines() {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let [_, _, size, kind, _, _, section, name, ..] = columns[..] else { continue };
        let name = name.split('@').next().unwrap_or(name);
        if !name.starts_with("mj") {
            continue;
        }
        match (kind, section) {
            // Copied into the executable: it has the size there.
            ("OBJECT", _) => variables.push((name.to_owned(), size.parse().ok().filter(|&s| s > 0).unwrap_or(8))),
            (_, "UND") => functions.push(name.to_owned()),
            _ => {}
        }
    }
    Some(Wanted { soname, functions, variables })
}

fn build_stub(dir: &Path, version: i32) -> Option<()> {
    let Wanted { soname, functions, variables } = wanted()?;
    let handlers = ["mju_user_error", "mju_user_warning"];
    let mut source = String::from("extern void abort(void);\n");
    for name in functions {
        if name == "mj_version" {
            let _ = writeln!(source, "int mj_version(void) {{ return {version}; }}");
        } else if handlers.contains(&name.as_str()) {
            let _ = writeln!(source, "void (*{name})(const char*);");
        } else {
            let _ = writeln!(source, "void {name}(void) {{ abort(); }}");
        }
    }
    for (name, size) in variables {
        let _ = writeln!(source, "char {name}[{size}];");
    }
    assert!(source.contains("mj_version") && source.contains("mj_loadXML"), "{source}");
    let file = dir.join("stub.c");
    std::fs::write(&file, source).unwrap();
    let library = dir.join(&soname);
    let status = Command::new("cc")
        .args(["-shared", "-fPIC", "-w", "-fno-builtin"])
        .arg(format!("-Wl,-soname,{soname}"))
        .arg("-o")
        .arg(&library)
        .arg(&file)
        .status()
        .ok()?;
    assert!(status.success());
    Some(())
}

#[test]
fn a_library_of_another_version_is_a_clear_error() {
    let headers = kinetoscope::sim::mj::version_string();
    // Written as 2.x and 3.x write it, and as 4.x does.
    for (version, name) in [(210, "2.1.0"), (3_005_001, "3.5.1"), (4_000_001, "4.0.1")] {
        let dir = tempfile::tempdir().unwrap();
        if build_stub(dir.path(), version).is_none() {
            eprintln!("skipped: this needs readelf and cc");
            return;
        }
        let output =
            run(module_path!(), "scenario_start", dir.path(), &[("LD_LIBRARY_PATH", dir.path().to_str().unwrap())]);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.success(), "{:?}: {out}\n{err}", output.status);
        for expected in [
            format!("manager: the MuJoCo library that was loaded is version {name}"),
            format!("built with the headers of {headers}"),
            format!("compile: the MuJoCo library that was loaded is version {name}"),
            format!("file: the MuJoCo library that was loaded is version {name}"),
        ] {
            assert!(out.contains(&expected), "{expected:?} is not in {out}");
        }
    }
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_start() {
    if !is_child() {
        return;
    }
    // Twice: the answer does not change.
    for _ in 0..2 {
        println!("manager: {}", SimulationManager::new(SimulationManagerCfg::default()).unwrap_err());
        println!("compile: {}", kinetoscope::sim::mj::compile("<mujoco/>", &[]).unwrap_err());
        println!("file: {}", kinetoscope::sim::mj::compile_file(Path::new("none.xml")).unwrap_err());
    }
}
