//! The physics page: tables of the measured laws, and the check of an existing page.

use crate::run::{Failure, XtaskResult};
use kinetoscope_plot::{Plot, Series};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

/// Groups in the order of the page: folder of the tests, and heading.
const GROUPS: [(&str, &str); 5] = [
    ("rigid_body", "Rigid bodies"),
    ("articulated", "Mechanisms"),
    ("drives", "Drives"),
    ("contacts", "Contacts and sensors"),
    ("numerical", "Numerical guarantees"),
];
/// Share of its tolerance by which a number may differ, without a reason, between two machines or two supported MuJoCo
/// versions.
const MAX_TOLERANCE_SHARE: f64 = 0.1;
/// Digits after the first digit of the numbers on the page.
const DIGITS: usize = 8;

/// One number of a law on one MuJoCo version.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) group: String,
    pub(crate) law: String,
    pub(crate) statement: String,
    pub(crate) quantity: String,
    pub(crate) unit: String,
    pub(crate) expected: f64,
    pub(crate) measured: f64,
    pub(crate) tolerance: f64,
    pub(crate) mujoco: String,
    pub(crate) pass: bool,
    /// The law's reason for a difference between MuJoCo versions, if given.
    pub(crate) version_difference: Option<String>,
    /// True if the reason is for this row alone: the versions must then differ.
    pub(crate) must_differ: bool,
}

/// Results of one run.
#[derive(Clone, Debug, Default)]
pub(crate) struct PhysicsRun {
    pub(crate) rows: Vec<Row>,
    pub(crate) controls: usize,
    /// The controls that do not miss: law, quantity and removed effect.
    pub(crate) idle_controls: Vec<String>,
    /// Names of the laws, their plots and the version.
    pub(crate) plots: Vec<(String, Plot, String)>,
}

/// Reads the files that the tests wrote into `folder`, in the order of the page.
pub(crate) fn read(folder: &Path) -> XtaskResult<PhysicsRun> {
    let fail = |e: &dyn std::fmt::Display| Failure::new(format!("{}: {e}", folder.display()));
    let mut laws = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| fail(&e))? {
        let path = entry.map_err(|e| fail(&e))?.path();
        let text = std::fs::read_to_string(&path).map_err(|e| fail(&e))?;
        let law: Value = serde_json::from_str(&text).map_err(|e| fail(&e))?;
        laws.push(law);
    }
    let order = |law: &Value| GROUPS.iter().position(|(group, _)| law["group"] == *group);
    if let Some(law) = laws.iter().find(|law| order(law).is_none()) {
        return Err(fail(&format!("a law of the unknown group {}", law["group"])));
    }
    laws.sort_by_key(|law| (order(law), law["name"].as_str().map(str::to_string)));
    let mut measured = PhysicsRun::default();
    for law in &laws {
        add(&mut measured, law).ok_or_else(|| fail(&format!("not what a law writes: {law}")))?;
    }
    if measured.rows.is_empty() {
        return Err(fail(&"no law wrote what it measured"));
    }
    Ok(measured)
}

fn add(to: &mut PhysicsRun, law: &Value) -> Option<()> {
    let text = |value: &Value| value.as_str().map(str::to_string);
    // JSON has no NaN, which is written as null.
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let (name, mujoco, measured) = (text(&law["name"])?, text(&law["mujoco"])?, &law["measured"]);
    for row in measured["rows"].as_array()? {
        to.rows.push(Row {
            group: text(&law["group"])?,
            law: name.clone(),
            statement: text(&law["statement"])?,
            quantity: text(&row["quantity"])?,
            unit: text(&row["unit"])?,
            expected: number(&row["expected"]),
            measured: number(&row["measured"]),
            tolerance: number(&row["tolerance"]),
            mujoco: mujoco.clone(),
            pass: row["pass"].as_bool()?,
            version_difference: text(&row["lines_differ"]).or_else(|| text(&measured["lines_differ"])),
            must_differ: row["lines_differ"].is_string(),
        });
    }
    for control in measured["controls"].as_array()? {
        to.controls += 1;
        if !control["misses"].as_bool()? {
            let (quantity, without) = (text(&control["quantity"])?, text(&control["without"])?);
            to.idle_controls.push(format!("{name}, {quantity}, {without} (MuJoCo {mujoco})"));
        }
    }
    for plot in measured["plots"].as_array()? {
        let mut series = Vec::new();
        for curve in plot["series"].as_array()? {
            let points = curve["points"].as_array()?.iter().map(|p| [number(&p[0]), number(&p[1])]).collect();
            series.push(Series { name: text(&curve["name"])?, points });
        }
        let axis_labels = [text(&plot["x"])?, text(&plot["y"])?];
        let log_axes = plot["log"].as_bool()?;
        // A series with few points holds measurements, not samples of a curve.
        let markers = series.iter().all(|series: &Series| series.points.len() <= 12);
        let plot = Plot { title: text(&plot["title"])?, axis_labels, log_axes, markers, series, ..Plot::default() };
        to.plots.push((name.clone(), plot, mujoco.clone()));
    }
    Some(())
}

/// The plots of all runs, named after their files, which have the names of the laws. Curves that differ between MuJoCo
/// versions are drawn for each version.
pub(crate) fn plots(runs: &[PhysicsRun]) -> Vec<(String, Plot)> {
    let mut found: Vec<(String, Plot, &str)> = Vec::new();
    for (law, plot, mujoco) in runs.iter().flat_map(|run| &run.plots) {
        let labeled = |series: &Series, mujoco: &str| Series {
            name: format!("{}, {mujoco}", series.name),
            points: series.points.clone(),
        };
        match found.iter_mut().find(|(_, other, _)| other.title == plot.title) {
            None => {
                let others = found.iter().filter(|(name, ..)| name.split('-').next() == Some(law)).count();
                let name = if others == 0 { law.clone() } else { format!("{law}-{}", others + 1) };
                found.push((name, plot.clone(), mujoco));
            }
            Some((_, other, first)) => {
                for series in &plot.series {
                    let Some(at) = other.series.iter().position(|old| old.name == series.name) else { continue };
                    if !looks_like(&other.series[at], series) {
                        other.series[at] = labeled(&other.series[at], first);
                        other.series.push(labeled(series, mujoco));
                    }
                }
            }
        }
    }
    found.into_iter().map(|(name, plot, _)| (name, plot)).collect()
}

fn looks_like(a: &Series, b: &Series) -> bool {
    let near = |x: f64, y: f64| (x - y).abs() <= 0.02 * x.abs().max(y.abs());
    let pairs = || a.points.iter().zip(&b.points);
    // Rounding errors may differ by any amount.
    let rounding = |y: f64| y.abs() < 1e-12;
    a.name == b.name
        && a.points.len() == b.points.len()
        && pairs().all(|(p, q)| near(p[0], q[0]) && (near(p[1], q[1]) || rounding(p[1]) && rounding(q[1])))
}

/// Writes the page.
///
/// # Errors
/// The MuJoCo versions differ and the law gives no reason, or a law gives a reason for a number that does not differ.
pub(crate) fn page(runs: &[PhysicsRun]) -> XtaskResult<String> {
    let rows: Vec<&Row> = runs.iter().flat_map(|run| &run.rows).collect();
    let mut laws: Vec<(&str, &str)> = rows.iter().map(|row| (row.group.as_str(), row.law.as_str())).collect();
    laws.sort_unstable();
    laws.dedup();
    let mut versions: Vec<&str> = Vec::new();
    for row in &rows {
        if !versions.contains(&row.mujoco.as_str()) {
            versions.push(&row.mujoco);
        }
    }
    let failed = rows.iter().filter(|row| !row.pass).count();
    let controls: usize = runs.iter().map(|run| run.controls).sum();
    let idle: Vec<&str> = runs.iter().flat_map(|run| &run.idle_controls).map(String::as_str).collect();
    let controls = if idle.is_empty() {
        format!(
            "{controls} controls, in which an effect is taken away or altered, all miss by more than the tolerance."
        )
    } else {
        format!("**{} of {controls} controls hold as well and show nothing**: {}.", idle.len(), idle.join("; "))
    };
    let mut out = format!(
        "# Laws of physics\n\nWritten by `cargo xtask physics-report`; do not edit. {} laws, each with a closed form, a \
         conservation law, a symmetry or a reproducibility guarantee, run through URDF files, manager, robots and objects on MuJoCo {}: {} numbers, {}. {controls}\n\nThe derivation of a law, and where its \
         tolerance comes from, stand at the head of its file. A number is as true on another machine if it differs by less than a \
         tenth of its tolerance; that is what CI asks of this page.\n",
        laws.len(),
        versions.join(" and "),
        rows.len(),
        if failed == 0 { "all of which hold".to_string() } else { format!("**{failed} of which FAIL**") },
    );
    for (group, heading) in GROUPS {
        if rows.iter().all(|row| row.group != group) {
            continue;
        }
        let _ = write!(
            out,
            "\n## {heading}\n\n| test | law | quantity | expected | measured | error | tolerance | MuJoCo | |\n\
             |---|---|---|--:|--:|--:|--:|---|---|\n"
        );
        // Versions next to each other: rows in the order of the first run, then rows of other runs only.
        let mut done: Vec<(&str, &str)> = Vec::new();
        for row in rows.iter().filter(|row| row.group == group) {
            if done.contains(&(row.law.as_str(), row.quantity.as_str())) {
                continue;
            }
            done.push((row.law.as_str(), row.quantity.as_str()));
            for row in rows.iter().filter(|other| is_same(other, row)) {
                let _ = writeln!(out, "{}", table_row(row));
            }
        }
    }
    out.push_str(&differences(&rows, &versions)?);
    let plots = plots(runs);
    if !plots.is_empty() {
        out.push_str("\n## Plots\n");
        for (law, plot) in plots {
            let _ = write!(out, "\n![{}](physics/{law}.svg)\n", plot.title);
        }
    }
    Ok(out)
}

fn is_same(a: &Row, b: &Row) -> bool {
    (&a.group, &a.law, &a.quantity) == (&b.group, &b.law, &b.quantity)
}

fn table_row(row: &Row) -> String {
    let Row { group, law, statement, quantity, unit, expected, measured, tolerance, mujoco, pass, .. } = row;
    let quantity = if unit.is_empty() { quantity.clone() } else { format!("{quantity} [{unit}]") };
    let cells = [
        format!("[{law}](../tests/physics/{group}/{law}.rs)"),
        statement.clone(),
        quantity,
        number(*expected),
        number(*measured),
        format!("{:.1e}", measured - expected),
        format!("{tolerance:.1e}"),
        mujoco.clone(),
        (if *pass { "pass" } else { "**FAIL**" }).to_string(),
    ];
    format!("| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

/// A number in a readable notation with nine digits.
fn number(x: f64) -> String {
    let plain = x == 0.0 || (1e-4..1e7).contains(&x.abs());
    if !plain {
        return format!("{x:.DIGITS$e}");
    }
    let before = if x == 0.0 { 0 } else { x.abs().log10().floor() as i32 };
    let digits = usize::try_from(DIGITS as i32 - before).unwrap_or(0);
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// The table of the differences between the MuJoCo versions.
fn differences(rows: &[&Row], versions: &[&str]) -> XtaskResult<String> {
    let [first, second] = versions else { return Ok(String::new()) };
    let mut out = format!(
        "\n## Where {first} and {second} differ\n\nAll other numbers of both agree within a tenth of their tolerances.\n\n\
         | test | quantity | {first} | {second} | why |\n|---|---|--:|--:|---|\n"
    );
    let (mut unexplained, mut needless, mut some) = (Vec::new(), Vec::new(), false);
    for row in rows.iter().filter(|row| row.mujoco == **first) {
        let Some(other) = rows.iter().find(|other| other.mujoco == **second && is_same(other, row)) else {
            some = true;
            let why = row.version_difference.as_deref().unwrap_or("not measured there");
            let _ = writeln!(out, "| {} | {} | {} | - | {why} |", row.law, row.quantity, number(row.measured));
            continue;
        };
        let most = row.tolerance.min(other.tolerance) * MAX_TOLERANCE_SHARE;
        if (row.measured - other.measured).abs() <= most {
            if row.must_differ {
                needless.push(format!("{} ({})", row.law, row.quantity));
            }
            continue;
        }
        some = true;
        match &row.version_difference {
            None => unexplained.push(format!(
                "{} ({}): {} and {}, with a tolerance of {:.1e}",
                row.law,
                row.quantity,
                number(row.measured),
                number(other.measured),
                row.tolerance
            )),
            Some(why) => {
                let (law, quantity) = (&row.law, &row.quantity);
                let (a, b) = (number(row.measured), number(other.measured));
                let _ = writeln!(out, "| {law} | {quantity} | {a} | {b} | {} |", why.replace('|', "\\|"));
            }
        }
    }
    for row in rows.iter().filter(|row| row.mujoco == **second) {
        if !rows.iter().any(|other| other.mujoco == **first && is_same(other, row)) {
            some = true;
            let why = row.version_difference.as_deref().unwrap_or("not measured there");
            let _ = writeln!(out, "| {} | {} | - | {} | {why} |", row.law, row.quantity, number(row.measured));
        }
    }
    crate::run::no_findings(
        "numbers differ between the MuJoCo versions by more than a tenth of the tolerance, and the law gives no reason \
         (`versions_differ`)",
        &unexplained,
    )?;
    crate::run::no_findings(
        "laws give a reason for a difference between the MuJoCo versions (`versions_differ_in`), but the versions agree",
        &needless,
    )?;
    Ok(if some { out } else { String::new() })
}

/// Statements of a page that were not measured: numbers that changed by more than a tenth of their tolerance, missing
/// or superfluous rows, and differences in the text around the tables.
pub(crate) fn outdated_statements(page: &str, runs: &[PhysicsRun]) -> Vec<String> {
    let mut findings = Vec::new();
    let now = match self::page(runs) {
        Ok(now) => now,
        Err(failure) => return vec![failure.message],
    };
    // Lines outside of the number tables: counts, versions, overall result, headings, images.
    let is_text = |line: &&str| !line.starts_with("| ");
    let (was, is): (Vec<&str>, Vec<&str>) =
        (page.lines().filter(is_text).collect(), now.lines().filter(is_text).collect());
    findings.extend(is.iter().filter(|line| !was.contains(line)).map(|line| format!("not on the page: {line}")));
    findings.extend(was.iter().filter(|line| !is.contains(line)).map(|line| format!("only on the page: {line}")));
    findings.extend(outdated_differences(page, &now, runs));
    let mut old_rows: Vec<Vec<String>> = page.lines().filter_map(cells).filter(|cells| cells.len() == 9).collect();
    old_rows.retain(|cells| cells[0].starts_with('['));
    for row in runs.iter().flat_map(|run| &run.rows) {
        // The row as it would be written now; rows with equal text in the key columns correspond.
        let new = cells(&table_row(row)).unwrap_or_default();
        let name = format!("{} ({}, MuJoCo {})", row.law, row.quantity, row.mujoco);
        let key = |cells: &[String]| [0, 2, 7].map(|k| cells[k].clone());
        let Some(at) = old_rows.iter().position(|old| key(old) == key(&new)) else {
            findings.push(format!("{name} is not on the page"));
            continue;
        };
        let old = old_rows.swap_remove(at);
        let parsed = |cell: &str| cell.parse::<f64>().unwrap_or(f64::NAN);
        for (k, what) in [(3, "expected"), (4, "measured"), (5, "error")] {
            let (was, is) = (parsed(&old[k]), parsed(&new[k]));
            // An error is written with two digits.
            let digits = if k == 5 { 1 } else { DIGITS as i32 };
            let most = MAX_TOLERANCE_SHARE * row.tolerance + 10.0_f64.powi(1 - digits) * is.abs();
            // Not `>`, so that NaN counts as a difference.
            let agrees = (was - is).abs() <= most;
            if !agrees {
                findings.push(format!("{name}: {what} {} on the page, {} now", old[k], new[k]));
            }
        }
        for k in [1, 6, 8] {
            if old[k] != new[k] {
                findings.push(format!("{name}: `{}` on the page, `{}` now", old[k], new[k]));
            }
        }
    }
    findings.extend(old_rows.iter().map(|row| format!("{} ({}, MuJoCo {}) was not measured", row[0], row[2], row[7])));
    findings
}

/// Statements in the table of version differences that were not measured.
fn outdated_differences(page: &str, now: &str, runs: &[PhysicsRun]) -> Vec<String> {
    let table = |text: &str| -> Vec<Vec<String>> {
        text.lines().filter_map(cells).filter(|cells| cells.len() == 5 && cells[0] != "test").collect()
    };
    let (was, is) = (table(page), table(now));
    let same = |a: &[String], b: &[String]| [0, 1, 4].iter().all(|&k| a[k] == b[k]);
    let near = |old: &[String], new: &[String]| {
        let of_row = |row: &&Row| row.law == new[0] && row.quantity == new[1];
        let tolerance =
            runs.iter().flat_map(|run| &run.rows).filter(of_row).map(|row| row.tolerance).fold(0.0, f64::max);
        [2, 3].iter().all(|&k| match (old[k].parse::<f64>(), new[k].parse::<f64>()) {
            (Ok(was), Ok(is)) => {
                (was - is).abs() <= MAX_TOLERANCE_SHARE * tolerance + 10.0_f64.powi(1 - DIGITS as i32) * is.abs()
            }
            _ => old[k] == new[k],
        })
    };
    let mut findings = Vec::new();
    for new in &is {
        match was.iter().find(|old| same(old, new)) {
            None => findings
                .push(format!("{} ({}): the page does not list this difference between the versions", new[0], new[1])),
            Some(old) if !near(old, new) => {
                let [old, new] = [old, new].map(|cells| cells[2..4].join(" and "));
                findings.push(format!("difference between the versions: {old} on the page, {new} now"));
            }
            Some(_) => {}
        }
    }
    let gone = |old: &&Vec<String>| !is.iter().any(|new| same(old, new));
    findings
        .extend(was.iter().filter(gone).map(|old| format!("{} ({}): the versions no longer differ", old[0], old[1])));
    findings
}

/// The cells of a line of a table.
fn cells(line: &str) -> Option<Vec<String>> {
    let inner = line.strip_prefix("| ")?.strip_suffix(" |")?.replace("\\|", "\u{1}");
    Some(inner.split(" | ").map(|cell| cell.replace('\u{1}', "|")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(mujoco: &str, measured: f64) -> Row {
        Row {
            group: "rigid_body".into(),
            law: "free_fall".into(),
            statement: "|z| = g t²/2".into(),
            quantity: "height".into(),
            unit: "m".into(),
            expected: 1.095,
            measured,
            tolerance: 1e-6,
            mujoco: mujoco.into(),
            pass: true,
            version_difference: None,
            must_differ: false,
        }
    }

    fn run(mujoco: &str, measured: f64) -> PhysicsRun {
        PhysicsRun { rows: vec![row(mujoco, measured)], controls: 1, ..PhysicsRun::default() }
    }

    #[test]
    fn rows_of_both_versions() {
        let runs = [run("2.2.2", 1.095), run("4.0.0", 1.095_000_01)];
        let page = page(&runs).expect("they agree");
        assert!(page.contains("| [free_fall](../tests/physics/rigid_body/free_fall.rs) | \\|z\\| = g t²/2 | height [m] | 1.095 | 1.095 | 0.0e0 | 1.0e-6 | 2.2.2 | pass |"), "{page}");
        assert_eq!(page.matches("| pass |").count(), 2);
        assert_eq!(outdated_statements(&page, &runs), Vec::<String>::new());
        assert!(page.contains("1 laws") && !page.contains("FAIL") && !page.contains("differ\n"), "{page}");
    }

    #[test]
    fn what_changed_is_untrue() {
        let page = page(&[run("2.2.2", 1.095)]).expect("one line");
        assert_eq!(outdated_statements(&page, &[run("2.2.2", 1.095 + 5e-8)]), Vec::<String>::new());
        let found = outdated_statements(&page, &[run("2.2.2", 1.095 + 3e-7)]);
        assert!(found.len() == 1 && found[0].contains("1.0950003 now"), "{found:?}");
        // The changed row, the removed row, and the version in the text, old and new.
        assert_eq!(outdated_statements(&page, &[run("4.0.0", 1.095)]).len(), 4);
        let mut failed = run("2.2.2", 1.095);
        failed.rows[0].pass = false;
        assert!(
            outdated_statements(&page, &[failed])
                .iter()
                .any(|finding| finding.contains("`pass` on the page, `**FAIL**` now"))
        );
        let mut more = run("2.2.2", 1.095);
        more.controls = 2;
        assert!(outdated_statements(&page, &[more])[0].contains("2 controls"));
        let forged = page.replace("| 0.0e0 |", "| 3.0e-7 |");
        assert!(outdated_statements(&forged, &[run("2.2.2", 1.095)])[0].contains("error"), "{forged}");
        let mut other = run("2.2.2", 1.095);
        other.rows[0].statement = "z = 0".into();
        assert_eq!(outdated_statements(&page, &[other]).len(), 1);
    }

    #[test]
    fn reason_without_difference() {
        let mut runs = [run("2.2.2", 1.095), run("4.0.0", 1.095)];
        for run in &mut runs {
            run.rows[0].version_difference = Some("it was mended".into());
        }
        assert!(page(&runs).is_ok(), "a reason for some of the numbers of a law");
        for run in &mut runs {
            run.rows[0].must_differ = true;
        }
        let failure = page(&runs).expect_err("a reason for one number, which is the same");
        assert!(failure.message.contains("free_fall"), "{failure}");
    }

    #[test]
    fn difference_without_reason() {
        let mut runs = [run("2.2.2", 1.095), run("4.0.0", 1.095 + 5e-7)];
        let failure = page(&runs).expect_err("no reason");
        assert!(failure.message.contains("free_fall"), "{failure}");
        for run in &mut runs {
            run.rows[0].version_difference = Some("it was mended".into());
        }
        let page = page(&runs).expect("a reason");
        assert!(page.contains("| it was mended |"));
        assert_eq!(outdated_statements(&page, &runs), Vec::<String>::new());
        let forged = page.replace("| it was mended |", "| it was always so |");
        assert_eq!(outdated_statements(&forged, &runs).len(), 2);
        let forged = page.replace("| height | 1.095 | 1.0950005 |", "| height | 1.095 | 1.0960005 |");
        assert!(outdated_statements(&forged, &runs)[0].contains("1.0960005 on the page"), "{forged}");
    }

    #[test]
    fn controls() {
        let control =
            |misses: bool| serde_json::json!({ "quantity": "height", "without": "without gravity", "misses": misses });
        let law = |misses| {
            let measured = serde_json::json!({ "rows": [], "controls": [control(true), control(misses)], "plots": [] });
            serde_json::json!({ "name": "free_fall", "mujoco": "2.2.2", "measured": measured })
        };
        for (misses, text) in [(true, "2 controls, in which"), (false, "**1 of 2 controls hold as well")] {
            let mut measured = PhysicsRun { rows: vec![row("2.2.2", 1.095)], ..PhysicsRun::default() };
            add(&mut measured, &law(misses)).expect("a law");
            let page = page(&[measured]).expect("one line");
            assert!(page.contains(text), "{page}");
        }
    }

    #[test]
    fn numbers_read_well() {
        for (x, text) in [(0.0, "0"), (1.095, "1.095"), (-0.25, "-0.25"), (1e-9, "1.00000000e-9"), (123456.0, "123456")]
        {
            assert_eq!(number(x), text);
        }
        assert_eq!(number(2.367_842_123_456), "2.36784212");
    }

    #[test]
    fn curves() {
        let plot = |y: f64| {
            let series = vec![Series { name: "RK4".into(), points: vec![[1.0, y], [2.0, 1.0]] }];
            Plot { title: "t".into(), series, ..Plot::default() }
        };
        let of = |mujoco: &str, y| PhysicsRun {
            plots: vec![("law".into(), plot(y), mujoco.into())],
            ..PhysicsRun::default()
        };
        assert_eq!(plots(&[of("2.2.2", 1.0), of("4.0.0", 1.001)])[0].1.series.len(), 1);
        let both = plots(&[of("2.2.2", 1.0), of("4.0.0", 1.5)]);
        let names: Vec<&str> = both[0].1.series.iter().map(|series| series.name.as_str()).collect();
        assert_eq!(names, ["RK4, 2.2.2", "RK4, 4.0.0"]);
    }

    #[test]
    fn broken_folders() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        assert!(read(dir.path()).is_err());
        std::fs::write(dir.path().join("x.json"), "{\"group\": \"cooking\"}").expect("writable");
        assert!(read(dir.path()).expect_err("unknown").message.contains("cooking"));
        assert!(read(&dir.path().join("none")).is_err());
    }
}
