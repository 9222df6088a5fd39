//! Detects missing software on the machine, installs it with apt-get, and selects the MuJoCo to build against.

use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci, which};
use crate::wheel;
use clap::ValueEnum;
use std::env;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// The two supported MuJoCo versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MujocoVersion {
    /// Debian's package libmujoco-dev (2.2.2)
    #[value(name = "2")]
    Debian,
    /// The PyPI wheel mujoco-core (4.0.1), downloaded into the target folder
    #[value(name = "4")]
    Wheel,
}

/// Requirements of a command besides a compiler and libclang.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Requirements {
    /// The MuJoCo version. `None` selects the MuJoCo of `MUJOCO_DIR` if set, otherwise Debian's.
    pub(crate) version: Option<MujocoVersion>,
    /// Requirements of comparisons and second runs only: a failed installation is an error in CI and a note elsewhere.
    pub(crate) extras: &'static [Requirement],
}

/// A prepared machine, and the selected MuJoCo.
#[derive(Debug)]
pub(crate) struct Prepared {
    root: PathBuf,
    target: PathBuf,
    choice: Choice,
}

#[derive(Debug)]
enum Choice {
    Environment,
    Debian,
    Wheel { mujoco_dir: PathBuf },
}

impl Prepared {
    /// Cargo in the repository's root, with the chosen MuJoCo.
    pub(crate) fn cargo(&self) -> Cmd {
        let cmd = Cmd::new("cargo").current_dir(&self.root);
        match &self.choice {
            Choice::Environment => cmd,
            Choice::Debian => cmd.env_remove("MUJOCO_DIR"),
            Choice::Wheel { mujoco_dir } => cmd.env("MUJOCO_DIR", mujoco_dir).env("CARGO_TARGET_DIR", &self.target),
        }
    }

    /// Cargo for a build of a clean clone: it keeps nothing for the next build of an edited crate, which saves time and
    /// gigabytes. The user's own choice counts.
    pub(crate) fn cargo_once(&self) -> Cmd {
        const INCREMENTAL: &str = "CARGO_INCREMENTAL";
        let cargo = self.cargo();
        if env::var_os(INCREMENTAL).is_some() { cargo } else { cargo.env(INCREMENTAL, "0") }
    }

    /// A program that compiles with the chosen MuJoCo.
    pub(crate) fn program(&self, program: impl AsRef<std::ffi::OsStr>) -> Cmd {
        match &self.choice {
            Choice::Environment => Cmd::new(program),
            Choice::Debian => Cmd::new(program).env_remove("MUJOCO_DIR"),
            Choice::Wheel { mujoco_dir } => {
                Cmd::new(program).env("MUJOCO_DIR", mujoco_dir).env("CARGO_TARGET_DIR", &self.target)
            }
        }
    }

    /// Path of a program built by cargo with the profile of the tests.
    pub(crate) fn binary(&self, name: &str) -> PathBuf {
        self.target.join("debug").join(name)
    }

    /// An example built by cargo with the profile of the tests, run in the root of the repository.
    pub(crate) fn example(&self, name: &str) -> Cmd {
        let cmd = Cmd::new(self.target.join("debug/examples").join(name)).current_dir(&self.root);
        // Cargo sets the library path of programs that it starts; here cargo does not start the example.
        let mujoco_dir = match &self.choice {
            Choice::Environment => env::var_os("MUJOCO_DIR").map(PathBuf::from),
            Choice::Debian => None,
            Choice::Wheel { mujoco_dir } => Some(mujoco_dir.clone()),
        };
        match mujoco_dir.and_then(|dir| env::join_paths([dir.join("lib"), dir]).ok()) {
            Some(folders) => cmd.env("LD_LIBRARY_PATH", folders),
            None => cmd,
        }
    }
}

/// Installs missing software.
///
/// # Errors
/// A requirement is still missing afterwards; the message suggests a fix.
pub(crate) fn prepare(repo: &Repo, wanted: Requirements) -> XtaskResult<Prepared> {
    let mujoco_dir_set = env::var_os("MUJOCO_DIR").is_some();
    let choice = match wanted.version {
        None if mujoco_dir_set => Choice::Environment,
        None | Some(MujocoVersion::Debian) => Choice::Debian,
        Some(MujocoVersion::Wheel) => Choice::Wheel { mujoco_dir: PathBuf::new() },
    };
    let machine = Machine::this();
    let mut needs = vec![Requirement::Compiler, Requirement::Libclang];
    if matches!(choice, Choice::Debian) {
        needs.push(Requirement::MuJoCo);
    }
    if matches!(choice, Choice::Wheel { .. }) && !wheel::is_available(repo) {
        needs.push(Requirement::Pip);
    }
    install(&machine, &needs)?;
    if let Err(failure) = install(&machine, wanted.extras) {
        if in_ci() {
            return Err(failure);
        }
        eprintln!("note: {}", failure.message);
    }
    let (choice, target) = match choice {
        Choice::Wheel { .. } => (Choice::Wheel { mujoco_dir: wheel::obtain(repo)? }, target_of_wheel(repo, in_ci())),
        other => (other, repo.target.clone()),
    };
    Ok(Prepared { root: repo.root.clone(), target, choice })
}

/// Installs a requirement if it is missing; prints a note if it cannot be installed, such as a package that newer
/// distributions no longer have.
pub(crate) fn try_to_have(need: Requirement) {
    if let Err(failure) = install(&Machine::this(), &[need]) {
        eprintln!("note: {}", failure.message);
    }
}

/// The target folder of the wheel's build. Developers switch between the versions, so each has its own folder and keeps
/// its build. CI switches once, and shares the folder to build crates without MuJoCo only once.
fn target_of_wheel(repo: &Repo, in_ci: bool) -> PathBuf {
    if in_ci { repo.target.clone() } else { repo.target.join("mujoco4") }
}

/// A software requirement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Requirement {
    Compiler,
    Libclang,
    MuJoCo,
    Models,
    Pip,
    Venv,
    OsMesa,
    Chromium,
    Xvfb,
    Readelf,
    Groff,
}

impl Requirement {
    fn packages(self) -> &'static [&'static str] {
        match self {
            Self::Compiler => &["gcc", "libc6-dev"],
            Self::Libclang => &["libclang-dev"],
            Self::MuJoCo => &["libmujoco-dev"],
            Self::Models => &["libmujoco-samples"],
            Self::Pip => &["python3-pip"],
            Self::Venv => &["python3-venv"],
            Self::OsMesa => &["libosmesa6"],
            Self::Chromium => &["chromium"],
            Self::Xvfb => &["xvfb"],
            Self::Readelf => &["binutils"],
            Self::Groff => &["groff-base"],
        }
    }

    fn description(self) -> &'static str {
        match self {
            Self::Compiler => "a C compiler `cc` with the C library's headers (Rust links with it)",
            Self::Libclang => "libclang with its headers (the bindings are generated with it)",
            Self::MuJoCo => {
                "MuJoCo 2.2.2 with its headers; or set MUJOCO_DIR to a folder with include/mujoco and libmujoco.so* of \
                 MuJoCo 4.x; or `cargo xtask test --mujoco 4`, which downloads that"
            }
            Self::Models => "the models that come with MuJoCo (humanoid.xml)",
            Self::Pip => "python3 with pip (MuJoCo 4 is downloaded with it)",
            Self::Venv => "python3 with venv (used to install the Python baselines)",
            Self::OsMesa => {
                "OSMesa, Mesa's software renderer (MuJoCo's own cameras draw with it; gone from Mesa 25.1 on)"
            }
            Self::Chromium => "Chromium (the page of the browser view is tested in it)",
            Self::Readelf => "readelf (a MuJoCo of another version than the headers is tested with it)",
            Self::Groff => "groff (the manual pages are checked with it)",
            Self::Xvfb => "Xvfb, an X server without a screen (the window is tested on it)",
        }
    }
}

/// The file system and variables that are inspected; tests pass their own folder.
#[derive(Debug)]
struct Machine {
    root: PathBuf,
    search_path: Vec<PathBuf>,
    libclang_path: Option<PathBuf>,
    python_has: fn(Requirement) -> bool,
}

impl Machine {
    fn this() -> Self {
        Self {
            root: PathBuf::from("/"),
            search_path: env::var_os("PATH").map(|path| env::split_paths(&path).collect()).unwrap_or_default(),
            libclang_path: env::var_os("LIBCLANG_PATH").map(PathBuf::from),
            python_has: |need| match need {
                Requirement::Venv => Cmd::new("python3").args(["-c", "import venv, ensurepip"]).quiet().succeeds(),
                _ => wheel::pip().is_some(),
            },
        }
    }

    fn has(&self, need: Requirement) -> bool {
        match need {
            Requirement::Compiler => {
                self.search_path.iter().any(|dir| dir.join("cc").is_file()) && self.header("stdlib.h").is_some()
            }
            Requirement::Libclang => self.has_libclang(),
            Requirement::MuJoCo => {
                self.header("mujoco/mujoco.h").is_some()
                    && self.library_folders().iter().any(|dir| dir.join("libmujoco.so").exists())
            }
            Requirement::Xvfb => self.search_path.iter().any(|dir| dir.join("Xvfb").is_file()),
            Requirement::Groff => self.search_path.iter().any(|dir| dir.join("groff").is_file()),
            Requirement::Readelf => self.search_path.iter().any(|dir| dir.join("readelf").is_file()),
            Requirement::Models => self.root.join("usr/share/mujoco/model/humanoid/humanoid.xml").exists(),
            Requirement::Pip | Requirement::Venv => (self.python_has)(need),
            Requirement::OsMesa => {
                self.library_folders().iter().flat_map(|dir| entries(dir)).any(|file| is_osmesa(&file_name(&file)))
            }
            // The names that the tests look for.
            Requirement::Chromium => {
                let names = ["chromium", "chromium-browser", "google-chrome"];
                self.search_path.iter().any(|dir| names.iter().any(|name| dir.join(name).is_file()))
            }
        }
    }

    fn header(&self, name: &str) -> Option<PathBuf> {
        ["usr/include", "usr/local/include"].iter().map(|dir| self.root.join(dir).join(name)).find(|file| file.exists())
    }

    fn library_folders(&self) -> Vec<PathBuf> {
        ["usr/lib", "usr/lib64", "usr/local/lib"]
            .iter()
            .map(|dir| self.root.join(dir))
            .chain([self.root.join(format!("usr/lib/{}-linux-gnu", env::consts::ARCH))])
            .collect()
    }

    /// True if libclang is installed with clang's own `stddef.h`, without which no C header parses, or if
    /// `LIBCLANG_PATH` is set.
    fn has_libclang(&self) -> bool {
        if self.libclang_path.is_some() {
            return true;
        }
        let llvm: Vec<PathBuf> = entries(&self.root.join("usr/lib"))
            .into_iter()
            .filter(|dir| file_name(dir).starts_with("llvm-"))
            .map(|dir| dir.join("lib"))
            .collect();
        let mut folders = self.library_folders();
        folders.extend(llvm);
        let library = folders.iter().flat_map(|dir| entries(dir)).any(|file| is_libclang(&file_name(&file)));
        let headers = folders
            .iter()
            .flat_map(|dir| entries(&dir.join("clang")))
            .any(|version| version.join("include/stddef.h").exists());
        library && headers
    }
}

/// `libclang.so`, `libclang.so.13`, `libclang-14.so.1`, but neither `libclang-cpp.so.14` nor `libclangAST.a`.
fn is_libclang(name: &str) -> bool {
    let Some(rest) = name.strip_prefix("libclang") else { return false };
    let version = rest.strip_prefix('-').unwrap_or(rest).trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    rest.starts_with(".so") || rest.starts_with('-') && version.starts_with("so")
}

/// `libOSMesa.so.8`, `libOSMesa.so`.
fn is_osmesa(name: &str) -> bool {
    name.starts_with("libOSMesa.so")
}

fn entries(dir: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(dir).map(|found| found.flatten().map(|entry| entry.path()).collect()).unwrap_or_default()
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

fn missing(machine: &Machine, needs: &[Requirement]) -> Vec<Requirement> {
    needs.iter().copied().filter(|need| !machine.has(*need)).collect()
}

fn packages(needs: &[Requirement]) -> Vec<&'static str> {
    needs.iter().flat_map(|need| need.packages()).copied().collect()
}

fn descriptions(needs: &[Requirement]) -> String {
    needs.iter().map(|need| format!("\n  - {}", need.description())).collect()
}

fn install(machine: &Machine, needs: &[Requirement]) -> XtaskResult {
    let absent = missing(machine, needs);
    if absent.is_empty() {
        return Ok(());
    }
    if which("apt-get").is_none() {
        return Err(Failure::new(format!(
            "this machine has no apt-get, so please install by hand:{}",
            descriptions(&absent)
        )));
    }
    let names = packages(&absent);
    let Some(root) = as_root() else {
        return Err(Failure::new(format!(
            "packages are missing, and installing them needs root. Please run:\n\n    {}\n",
            manual_command(&names)
        )));
    };
    eprintln!("installing with apt-get: {}", names.join(" "));
    if is_interactive() && !confirmed()? {
        return Err(Failure::new(format!("nothing was installed. By hand:\n\n    {}\n", manual_command(&names))));
    }
    let known = |name: &&&str| Cmd::new("apt-cache").args(["show", name]).quiet().succeeds();
    let lists_are_complete = names.iter().filter(known).count() == names.len();
    if !lists_are_complete {
        apt(&root).arg("update").run()?;
    }
    let result = apt_install(&root, &names).or_else(|failure| {
        if !lists_are_complete {
            return Err(failure);
        }
        // The package lists may name older builds than the mirror has.
        apt(&root).arg("update").run()?;
        apt_install(&root, &names)
    });
    let absent = missing(machine, needs);
    match result {
        Ok(()) if absent.is_empty() => Ok(()),
        Ok(()) => {
            Err(Failure::new(format!("after installing {}, still missing:{}", names.join(" "), descriptions(&absent))))
        }
        Err(failure) => {
            Err(Failure { message: format!("{}\nneeded:{}", failure.message, descriptions(&absent)), ..failure })
        }
    }
}

/// True if a prompt precedes the installation of packages.
static ASK: AtomicBool = AtomicBool::new(false);

/// Enables a prompt before packages are installed. Only a terminal outside CI gets the prompt.
pub(crate) fn ask_before_installing() {
    ASK.store(true, Ordering::Relaxed);
}

fn is_interactive() -> bool {
    ASK.load(Ordering::Relaxed) && !in_ci() && std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

/// Reads the user's answer; an empty line means yes.
fn confirmed() -> XtaskResult<bool> {
    eprint!("continue? [Y/n] ");
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).map_err(|e| Failure::new(format!("the answer: {e}")))?;
    Ok(is_yes(&answer))
}

/// True for an empty line, `y` and `yes`. The end of the input counts as no.
fn is_yes(answer: &str) -> bool {
    answer.ends_with('\n') && ["", "y", "yes"].contains(&answer.trim().to_ascii_lowercase().as_str())
}

/// The command prefix for root's rights without a password prompt: empty for root, otherwise `sudo -n`; `None` without
/// such rights.
fn as_root() -> Option<Vec<&'static str>> {
    let uid = Cmd::new("id").arg("-u").output().ok()?;
    if uid.trim_ascii() == b"0" {
        return Some(Vec::new());
    }
    Cmd::new("sudo").args(["-n", "true"]).quiet().succeeds().then(|| vec!["sudo", "-n"])
}

fn manual_command(names: &[&str]) -> String {
    format!("sudo sh -c 'apt-get update && apt-get install -y --no-install-recommends {}'", names.join(" "))
}

/// sudo drops variables, so `env` sets the variable that makes debconf non-interactive.
fn apt(root: &[&str]) -> Cmd {
    let words: Vec<&str> = root.iter().copied().chain(["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]).collect();
    Cmd::new(words[0]).args(&words[1..]).args(["-o", "DPkg::Lock::Timeout=300"])
}

fn apt_install(root: &[&str], names: &[&str]) -> XtaskResult {
    apt(root).args(["install", "-y", "--no-install-recommends"]).args(names).run()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// True if a machine with these files meets the requirement.
    fn has(need: Requirement, files: &[&str]) -> bool {
        let dir = tempfile::tempdir().expect("a scratch folder");
        files.iter().for_each(|file| crate::wheel::tests::write(&dir.path().join(file), ""));
        let search_path = vec![dir.path().join("usr/bin")];
        let machine =
            Machine { root: dir.path().to_path_buf(), search_path, libclang_path: None, python_has: |_| false };
        assert_eq!(missing(&machine, &[need]).is_empty(), machine.has(need));
        machine.has(need)
    }

    #[test]
    fn needs() {
        let library = |name| format!("usr/lib/{}-linux-gnu/{name}", env::consts::ARCH);
        let (mujoco, mesa) = (library("libmujoco.so"), library("libOSMesa.so.8"));
        let (header, clang) = ("usr/include/mujoco/mujoco.h", "usr/lib/llvm-14/lib/libclang-14.so.1");
        let clang_headers = "usr/lib/llvm-14/lib/clang/14/include/stddef.h";
        for (need, files, expected) in [
            (Requirement::Compiler, &[][..], false),
            (Requirement::Compiler, &["usr/bin/cc"], false),
            (Requirement::Compiler, &["usr/bin/cc", "usr/include/stdlib.h"], true),
            (Requirement::Libclang, &[clang], false),
            (Requirement::Libclang, &[clang_headers], false),
            (Requirement::Libclang, &["usr/lib/llvm-14/lib/libclang-cpp.so.14", clang_headers], false),
            (Requirement::Libclang, &[clang, clang_headers], true),
            (Requirement::MuJoCo, &[header], false),
            (Requirement::MuJoCo, &[header, &mujoco], true),
            (Requirement::Models, &[], false),
            (Requirement::Pip, &[], false),
            (Requirement::OsMesa, &["usr/lib/libGL.so.1"], false),
            (Requirement::OsMesa, &[&mesa], true),
            (Requirement::Chromium, &["usr/bin/firefox"], false),
            (Requirement::Chromium, &["usr/bin/chromium"], true),
            (Requirement::Chromium, &["usr/bin/google-chrome"], true),
            (Requirement::Xvfb, &["usr/share/doc/xvfb/copyright"], false),
            (Requirement::Xvfb, &["usr/bin/Xvfb"], true),
        ] {
            assert_eq!(has(need, files), expected, "{need:?}: {files:?}");
        }
        let needs = [
            Requirement::Compiler,
            Requirement::Libclang,
            Requirement::MuJoCo,
            Requirement::OsMesa,
            Requirement::Chromium,
            Requirement::Xvfb,
        ];
        let names = ["gcc", "libc6-dev", "libclang-dev", "libmujoco-dev", "libosmesa6", "chromium", "xvfb"];
        assert_eq!(packages(&needs), names);
    }

    #[test]
    fn names_of_libclang() {
        for name in ["libclang.so", "libclang.so.13", "libclang-14.so", "libclang-14.so.1", "libclang-14.0.6.so"] {
            assert!(is_libclang(name), "{name}");
        }
        for name in ["libclang-cpp.so.14", "libclangAST.a", "libclang.a", "libmujoco.so"] {
            assert!(!is_libclang(name), "{name}");
        }
    }

    #[test]
    fn one_command() {
        let line = "sudo sh -c 'apt-get update && apt-get install -y --no-install-recommends gcc libmujoco-dev'";
        assert_eq!(manual_command(&["gcc", "libmujoco-dev"]), line);
    }

    #[test]
    fn answers() {
        let yes = |answer| is_yes(answer);
        assert_eq!(["\n", "y\n", "Yes\n"].map(yes), [true; 3]);
        assert_eq!(["", "n\n", "no\n", "what\n"].map(yes), [false; 4]);
    }

    #[test]
    fn apt_never_asks() {
        let shown = apt(&["sudo", "-n"]).arg("update").to_string();
        assert_eq!(shown, "sudo -n env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 update");
        assert!(apt(&[]).to_string().starts_with("env DEBIAN_FRONTEND=noninteractive apt-get"));
    }
}
