//! `cargo xtask physics-report`: measures the laws of physics on both supported MuJoCo versions and writes the page of
//! results.

use crate::physics_page::{self, PhysicsRun};
use crate::progress::Progress;
use crate::run::{Failure, Repo, XtaskResult, no_findings};
use crate::setup::{self, MujocoVersion, Requirements};
use crate::svg;
use kinetoscope_plot::Plot;
use std::fs;
use std::path::{Path, PathBuf};

const PAGE: &str = "docs/physics.md";
/// Folder of the plots, one file per law.
const PLOTS: &str = "docs/physics";
/// Environment variable with the folder for the results of the laws.
pub(crate) const VARIABLE: &str = "KINETOSCOPE_PHYSICS_ROWS";
const VERSIONS: [MujocoVersion; 2] = [MujocoVersion::Debian, MujocoVersion::Wheel];
/// Largest accepted shift of a curve in an existing plot \[pixels\].
const MAX_SHIFT_PIXELS: f64 = 1.0;

#[derive(Debug, clap::Args)]
pub(crate) struct PhysicsReportArgs {
    /// Measure and compare with the page; write nothing
    #[arg(long)]
    pub(crate) check: bool,
}

/// The folder of a version's rows, below the target folder.
fn folder(repo: &Repo, line: MujocoVersion) -> PathBuf {
    let name = match line {
        MujocoVersion::Debian => "2",
        MujocoVersion::Wheel => "4",
    };
    repo.target.join("physics-rows").join(name)
}

/// An empty folder for the rows of a version, without rows of earlier runs.
pub(crate) fn fresh_folder(repo: &Repo, line: MujocoVersion) -> XtaskResult<PathBuf> {
    let folder = folder(repo, line);
    let fail = |e: std::io::Error| Failure::new(format!("{}: {e}", folder.display()));
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(fail)?;
    }
    fs::create_dir_all(&folder).map_err(fail)?;
    Ok(folder)
}

/// Removes the rows of earlier runs.
pub(crate) fn clear_rows(repo: &Repo) -> XtaskResult {
    VERSIONS.iter().try_for_each(|&line| fresh_folder(repo, line).map(|_| ()))
}

pub(crate) fn run(repo: &Repo, args: &PhysicsReportArgs) -> XtaskResult {
    let mut failed = Ok(());
    let mut progress = Progress::new(VERSIONS.len());
    for line in VERSIONS {
        progress.begin(&format!("the laws of physics, MuJoCo version {line:?}"));
        let ready = setup::prepare(repo, Requirements { version: Some(line), extras: &[] })?;
        let rows = fresh_folder(repo, line)?;
        let tests = ready.cargo().env(VARIABLE, rows).args(["test", "--package", "kinetoscope", "--test", "physics"]);
        // The page also shows the results of failing laws.
        failed = failed.and(tests.run());
    }
    progress.end();
    let runs = measured(repo)?;
    if args.check {
        compare(repo, &runs)?;
    } else {
        write(repo, &runs)?;
        println!("written to {PAGE} and {PLOTS}");
    }
    failed
}

/// Compares the page with the rows that the tests of both versions have written ([`fresh_folder`]).
pub(crate) fn check_rows(repo: &Repo) -> XtaskResult {
    compare(repo, &measured(repo)?)
}

/// True if both versions have written rows.
pub(crate) fn has_rows(repo: &Repo) -> bool {
    VERSIONS.iter().all(|&line| fs::read_dir(folder(repo, line)).is_ok_and(|mut files| files.next().is_some()))
}

fn measured(repo: &Repo) -> XtaskResult<Vec<PhysicsRun>> {
    VERSIONS.iter().map(|&line| physics_page::read(&folder(repo, line))).collect()
}

fn plot_files(runs: &[PhysicsRun]) -> XtaskResult<Vec<(String, String)>> {
    let image = |(law, plot): (String, Plot)| {
        let text = plot.to_svg().map_err(|e| Failure::new(format!("{law}: {e}")))?;
        Ok((format!("{law}.svg"), text))
    };
    physics_page::plots(runs).into_iter().map(image).collect()
}

fn write(repo: &Repo, runs: &[PhysicsRun]) -> XtaskResult {
    let page = physics_page::page(runs)?;
    let plots = repo.root.join(PLOTS);
    let fail = |e: std::io::Error| Failure::new(format!("{PLOTS}: {e}"));
    if plots.exists() {
        fs::remove_dir_all(&plots).map_err(fail)?;
    }
    fs::create_dir_all(&plots).map_err(fail)?;
    for (name, text) in plot_files(runs)? {
        fs::write(plots.join(name), text).map_err(fail)?;
    }
    fs::write(repo.root.join(PAGE), page).map_err(|e| Failure::new(format!("{PAGE}: {e}")))
}

fn compare(repo: &Repo, runs: &[PhysicsRun]) -> XtaskResult {
    // Fails if the versions differ without a reason.
    physics_page::page(runs)?;
    let mut findings = physics_page::outdated_statements(&repo.read(PAGE)?, runs);
    findings.extend(outdated_plots(&repo.root.join(PLOTS), &plot_files(runs)?)?);
    no_findings(&format!("{PAGE} is outdated; `cargo xtask physics-report` rewrites it"), &findings)
}

/// Differences between the folder of the plots and the plots of the report: missing, outdated and superfluous files.
fn outdated_plots(folder: &Path, images: &[(String, String)]) -> XtaskResult<Vec<String>> {
    let mut findings = Vec::new();
    for (name, text) in images {
        match fs::read_to_string(folder.join(name)) {
            Ok(old) if svg::agree(&old, text, MAX_SHIFT_PIXELS) => {}
            Ok(_) => findings.push(format!("{PLOTS}/{name} shows other curves, or other numbers at its axes")),
            Err(_) => findings.push(format!("{PLOTS}/{name} is not there")),
        }
    }
    let fail = |e: std::io::Error| Failure::new(format!("{PLOTS}: {e}"));
    let Ok(files) = fs::read_dir(folder) else { return Ok(findings) };
    for file in files {
        let name = file.map_err(fail)?.file_name().to_string_lossy().into_owned();
        if images.iter().all(|(known, _)| *known != name) {
            findings.push(format!("{PLOTS}/{name} belongs to no law"));
        }
    }
    Ok(findings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_plot::Series;

    #[test]
    fn plot_files() {
        let of = |name: &str, size: f64| {
            let series = vec![Series { name: "RK4".into(), points: vec![[0.0, 0.0], [1.0, size], [2.0, 0.0]] }];
            let plot = Plot { title: "t".into(), series, ..Plot::default() };
            (format!("{name}.svg"), plot.to_svg().expect("a size that can be drawn"))
        };
        let folder = tempfile::tempdir().expect("a scratch folder");
        let look = |images: &[(String, String)]| outdated_plots(folder.path(), images).expect("readable");
        let images = [of("top", 1.0), of("bounce", 2.0)];
        for (name, text) in &images {
            fs::write(folder.path().join(name), text).expect("writable");
        }
        assert_eq!(look(&images), Vec::<String>::new());
        // The measured values are twice as large, so the curve has the same shape but other axis labels.
        let found = look(&[of("top", 2.0), of("bounce", 2.0)]);
        assert!(found.len() == 1 && found[0].contains("top.svg shows other curves"), "{found:?}");
        let found = look(&images[..1]);
        assert!(found.len() == 1 && found[0].contains("bounce.svg belongs to no law"), "{found:?}");
        let found = look(&[of("top", 1.0), of("bounce", 2.0), of("fall", 1.0)]);
        assert!(found.len() == 1 && found[0].contains("fall.svg is not there"), "{found:?}");
    }
}
