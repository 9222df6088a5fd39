//! Tests of the table of examples and of the report checks.

use super::*;
use serde_json::json;

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_string()).collect()
}

#[test]
fn gaps_of_the_table() {
    let mut all: Vec<&str> = TABLE.iter().map(|row| row.example).collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(table_gaps(&names(&all)), [""; 0]);
    let more: Vec<&str> = all.iter().copied().chain(["new"]).collect();
    assert_eq!(table_gaps(&names(&more)), ["the example `new` has no row"]);
    let gap = format!("there are rows for `{}`, but no such example", all[0]);
    assert_eq!(table_gaps(&names(&all[1..])), [gap]);
}

#[test]
fn files_and_folders() {
    let dir = tempfile::tempdir().expect("a scratch folder");
    for path in ["examples/a.rs", "examples/b/main.rs", "examples/common/mod.rs", "examples/README.md"] {
        crate::wheel::tests::write(&dir.path().join(path), "");
    }
    assert_eq!(examples(dir.path()), ["a", "b"]);
}

#[test]
fn rows_of_the_second_version() {
    let rows = RowSelection::VersionDependent.chosen();
    assert!(TABLE.iter().all(|row| rows.iter().any(|chosen| chosen.example == row.example)));
    assert!(QUICK.iter().all(|quick| rows.iter().any(|row| row.example == *quick)));
    assert!(rows.iter().any(|row| row.args.contains("--friction 0.02")), "controls that must fail are among them");
    assert!(rows.iter().all(|row| row.exits != [2]) && rows.len() < TABLE.len() / 3);
}

#[test]
fn placeholders_are_filled() {
    let args = words("--report {out}/a.json --urdf {robots}/x.urdf", "scratch");
    assert_eq!(args, ["--report", "scratch/a.json", "--urdf", "../shared/robots/x.urdf"]);
    assert_eq!(flag_value(&args, "--report"), Some("scratch/a.json"));
    assert_eq!(flag_value(&args, "--out"), None);
}

#[test]
fn broken_reports() {
    let dir = tempfile::tempdir().expect("a scratch folder");
    let path = dir.path().join("report.json");
    assert!(check_report(&path, anything).is_err());
    for text in ["", "{}", "[1]", "{\"steps\": NaN}"] {
        fs::write(&path, text).expect("writable");
        assert!(check_report(&path, anything).is_err(), "{text}");
    }
    fs::write(&path, "{\"steps\": 400}").expect("writable");
    assert!(check_report(&path, anything).is_ok());
}

#[test]
fn disparities() {
    let report = |points: f64, low: f64, error: f64| {
        json!({ "width": 20, "height": 10, "points": points, "disparity_min": low, "disparity_max": 9.0,
                "points_compared": 0.8 * points, "disagreement_pixels": error })
    };
    for (what, report, good) in [
        ("as it should be", report(100.0, 1.0, 1e-4), true),
        ("few points", report(10.0, 1.0, 1e-4), false),
        ("infinitely far points", report(100.0, 0.0, 1e-4), false),
        ("points elsewhere", report(100.0, 1.0, 0.2), false),
        ("empty", json!({}), false),
    ] {
        assert_eq!(check_disparity(&report).is_ok(), good, "{what}");
    }
}

/// A report of 16 environments: the first is `odd`, the others are `rest`.
fn trial(successes: u64, odd: &Value, rest: &Value) -> Value {
    let environments: Vec<&Value> = std::iter::once(odd).chain(std::iter::repeat_n(rest, 15)).collect();
    json!({ "num_envs": 16, "successes": successes, "needed": 15, "environments": environments })
}

#[test]
fn successes() {
    let (good, bad) = (json!({ "success": true, "diverged": null }), json!({ "success": false, "diverged": null }));
    let diverged = json!({ "success": true, "diverged": "step 7: bad acceleration" });
    let changed = |changes: &[(&str, u64)]| {
        let mut report = trial(16, &good, &good);
        changes.iter().for_each(|(name, count)| report[*name] = json!(count));
        report
    };
    for (what, report, passes) in [
        ("all", trial(16, &good, &good), true),
        ("all but one", trial(15, &bad, &good), true),
        ("too few", trial(1, &good, &bad), false),
        ("another number than is claimed", trial(16, &bad, &good), false),
        ("one diverged", trial(16, &diverged, &good), false),
        ("few are needed", changed(&[("needed", 1)]), false),
        ("of few environments", changed(&[("needed", 1), ("num_envs", 4)]), false),
        ("no trial", json!({ "steps": 4 }), false),
    ] {
        assert_eq!(check_successes(&report).is_ok(), passes, "{what}");
    }
}

#[test]
fn balance_and_learning() {
    let row = |tilt: f64, airborne: f64| json!({ "success": true, "diverged": null, "largest_tilt": tilt, "airborne": airborne });
    let good = row(0.3, 0.2);
    // The first control is hardly tilted; the second is never in the air.
    for (odd, passes) in [(good.clone(), true), (row(0.05, 0.2), false), (row(0.3, 0.0), false)] {
        assert_eq!(balanced(&trial(16, &odd, &good)).is_ok(), passes, "{odd}");
    }
    for (before, after, needed, envs, passes) in [
        (0.01, 0.95, 0.9, 256, true),
        (0.2, 0.95, 0.9, 256, false),
        (0.0, 0.89, 0.9, 256, false),
        (0.0, 0.95, 0.5, 256, false),
        (0.0, 0.95, 0.9, 16, false),
    ] {
        let report = json!({ "reached_before": before, "reached_after": after, "needed": needed, "num_envs": envs });
        assert_eq!(check_learned(&report).is_ok(), passes, "{report}");
    }
    for (after, signal, iterations, passes) in
        [(0.02, false, 32, true), (0.06, false, 32, false), (0.01, true, 32, false), (0.01, false, 0, false)]
    {
        let control = json!({ "reached_before": 0.01, "reached_after": after, "signal": signal,
                              "iterations": iterations, "num_envs": 256 });
        assert_eq!(check_not_learned(&control).is_ok(), passes, "{control}");
    }
    assert!(check_not_learned(&json!({})).is_err());
}

#[test]
fn controls() {
    let row = |lifted: bool, planned: bool, open: f64| {
        let diverged = Value::Null;
        json!({ "success": false, "diverged": diverged, "lifted": lifted, "planned": planned,
                "planned_to_lift": planned, "open": open })
    };
    let good = row(false, true, 0.0);
    for control in [check_none_lifted, check_none_opened] {
        assert_eq!(control(&trial(0, &good, &good)), Ok(()));
        assert!(control(&trial(1, &good, &good)).is_err());
        assert!(control(&trial(0, &json!({ "planned": true }), &good)).is_err(), "says nothing");
        assert!(control(&json!({ "successes": 0, "num_envs": 16, "environments": [] })).is_err());
    }
    assert!(check_none_lifted(&trial(0, &row(true, true, 0.0), &good)).is_err());
    assert!(check_none_lifted(&trial(0, &row(false, false, 0.0), &good)).is_err(), "the hand was not there");
    assert!(check_none_opened(&trial(0, &row(false, true, 0.16), &good)).is_err());
    assert!(check_none_opened(&trial(0, &row(false, false, 0.0), &good)).is_err(), "the hand was not there");
    let row = |found: bool, beside: f64, fell: bool| {
        json!({ "success": false, "diverged": null, "found": found, "planned": true, "beside": beside,
                "body_touched_floor": fell })
    };
    for (control, good, bad) in [
        (check_all_fell as ReportCheck, row(true, 0.0, true), row(true, 0.0, false)),
        (check_all_beside as ReportCheck, row(true, 0.027, true), row(true, 0.003, true)),
        (check_none_found as ReportCheck, row(false, 0.2, true), row(true, 0.2, true)),
    ] {
        assert_eq!(control(&trial(0, &good, &good)), Ok(()));
        assert!(control(&trial(0, &bad, &good)).is_err());
        assert!(control(&trial(1, &good, &good)).is_err());
    }
}
