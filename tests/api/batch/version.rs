//! A MuJoCo library of another version than the headers gives a clear error, tested with a stub library that only
//! reports a version.

use kinetoscope::prelude::*;
use kinetoscope_testkit::process::{is_child, run, text};
use std::path::Path;
use std::process::Command;

/// Output of a program that must be installed and succeed.
fn tool(program: &str, args: &[&str]) -> String {
    let output = Command::new(program).args(args).output().unwrap_or_else(|e| panic!("{program}: {e}"));
    assert!(output.status.success(), "{program} {args:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Builds a library with all symbols that this binary imports from MuJoCo: functions that abort, and this version.
fn build_stub(dir: &Path, version: i32) {
    let exe = std::env::current_exe().unwrap().to_string_lossy().into_owned();
    let dynamic = tool("readelf", &["-d", &exe]);
    let needed = dynamic.lines().find(|l| l.contains("NEEDED") && l.contains("libmujoco")).unwrap();
    let soname = needed.split(['[', ']']).nth(1).unwrap();
    let mut source = String::from("extern void abort(void);\n");
    // Columns: number, value, size, type, binding, visibility, section, name.
    for line in tool("readelf", &["--dyn-syms", "-W", &exe]).lines() {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let [_, _, size, kind, _, _, section, name, ..] = columns[..] else { continue };
        let name = name.split('@').next().unwrap_or(name);
        let size = size.parse().ok().filter(|&size: &usize| size > 0).unwrap_or(8);
        let definition = match (name, kind, section) {
            _ if !name.starts_with("mj") => continue,
            // Copied into the executable, where the size is known.
            (_, "OBJECT", _) => format!("char {name}[{size}];"),
            ("mj_version", _, "UND") => format!("int mj_version(void) {{ return {version}; }}"),
            ("mju_user_error" | "mju_user_warning", _, "UND") => format!("void (*{name})(const char*);"),
            (_, _, "UND") => format!("void {name}(void) {{ abort(); }}"),
            _ => continue,
        };
        source += &definition;
        source.push('\n');
    }
    assert!(source.contains("mj_version") && source.contains("mj_loadXML"), "{source}");
    let [file, library] = ["stub.c", soname].map(|name| dir.join(name).to_string_lossy().into_owned());
    std::fs::write(&file, source).unwrap();
    let name = format!("-Wl,-soname,{soname}");
    tool("cc", &["-shared", "-fPIC", "-w", "-fno-builtin", &name, "-o", &library, &file]);
}

#[test]
#[ignore = "needs readelf and cc: cargo xtask test"]
fn another_version() {
    let headers = kinetoscope::mujoco::version_string();
    // Version numbers in the format of 2.x and 3.x, and of 4.x.
    for (version, name) in [(210, "2.1.0"), (3_005_001, "3.5.1"), (4_001_000, "4.1.0")] {
        let dir = tempfile::tempdir().unwrap();
        build_stub(dir.path(), version);
        let variables = [("LD_LIBRARY_PATH", dir.path().to_str().unwrap())];
        let output = run(module_path!(), "scenario_start", dir.path(), &variables);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.success(), "{:?}: {out}\n{err}", output.status);
        let loaded = format!("the MuJoCo library that was loaded is version {name}");
        for what in ["manager", "compile", "file"] {
            assert!(out.contains(&format!("{what}: {loaded}")), "{what}: {out}");
        }
        assert!(out.contains(&format!("built with the headers of {headers}")), "{out}");
    }
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_start() {
    if !is_child() {
        return;
    }
    // Twice, because the error must not change.
    for _ in 0..2 {
        println!("manager: {}", SimulationManager::new(SimulationManagerCfg::default()).unwrap_err());
        println!("compile: {}", kinetoscope::mujoco::compile("<mujoco/>", &[]).unwrap_err());
        println!("file: {}", kinetoscope::mujoco::compile_file(Path::new("none.xml")).unwrap_err());
    }
}
