//! One comparison, for the JSON file and the table.

use kinetoscope::mujoco as mj;
use serde::Serialize;
use std::fmt::Write as _;

/// Our result compared with one baseline.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// Name of the benchmark.
    pub(crate) bench: String,
    /// Name of the measured case.
    pub(crate) case: String,
    /// Unit of `ours` and `baseline`.
    pub(crate) unit: String,
    /// Kinetoscope's number.
    pub(crate) ours: f64,
    /// The baseline's number; `None` if the row has no baseline, or if the baseline is not on the machine.
    #[serde(rename = "rival")]
    pub(crate) baseline: Option<f64>,
    /// Name of the baseline.
    #[serde(rename = "rival_name")]
    pub(crate) baseline_name: String,
    /// Ratio of the speeds, or of another quality; above 1 our side is better. `None` without a baseline's number.
    pub(crate) ratio: Option<f64>,
    /// Number of threads of both sides.
    pub(crate) threads: usize,
    /// Version of MuJoCo.
    pub(crate) mujoco: String,
    /// The target of the ratio; not part of the results.
    #[serde(skip)]
    pub(crate) wanted: Option<f64>,
}

impl Row {
    /// A row of this build without a baseline.
    pub(crate) fn new(bench: &str, case: impl Into<String>, unit: &str, threads: usize, ours: f64) -> Self {
        Self {
            bench: bench.into(),
            case: case.into(),
            unit: unit.into(),
            ours,
            baseline: None,
            baseline_name: "-".into(),
            ratio: None,
            threads,
            mujoco: mj::version_string(),
            wanted: None,
        }
    }

    /// Adds the baseline.
    pub(crate) fn against(mut self, baseline_name: &str, baseline: f64, ratio: f64) -> Self {
        self.baseline_name = baseline_name.into();
        self.baseline = Some(baseline);
        self.ratio = Some(ratio);
        self
    }

    /// Adds the name of a baseline that is not on the machine.
    pub(crate) fn without(mut self, baseline_name: &str) -> Self {
        self.baseline_name = baseline_name.into();
        self
    }

    /// Adds the target of the ratio.
    pub(crate) fn with_target_ratio(mut self, ratio: f64) -> Self {
        self.wanted = Some(ratio);
        self
    }

    fn misses(&self) -> bool {
        matches!((self.ratio, self.wanted), (Some(ratio), Some(wanted)) if ratio < wanted)
    }
}

/// All rows as text; ratios below their target are marked.
pub(crate) fn table(rows: &[Row]) -> String {
    let mut out = format!(
        "{:<13} {:<44} {:>7} {:>7} {:>12} {:>12} {:<11} {:<22} {:>6}\n",
        "bench", "case", "threads", "MuJoCo", "ours", "baseline", "unit", "baseline name", "ratio"
    );
    for row in rows {
        let number = |value: Option<f64>, digits| value.map_or("-".into(), |x| format!("{x:.digits$}"));
        let digits = if row.ours >= 1000.0 { 0 } else { 3 };
        let _ = write!(
            out,
            "{:<13} {:<44} {:>7} {:>7} {:>12} {:>12} {:<11} {:<22} {:>6}",
            row.bench,
            row.case,
            row.threads,
            row.mujoco,
            number(Some(row.ours), digits),
            number(row.baseline, digits),
            row.unit,
            row.baseline_name,
            number(row.ratio, 3),
        );
        match row.wanted {
            Some(wanted) if row.misses() => drop(writeln!(out, "  MISSES {wanted:.2}")),
            Some(wanted) => drop(writeln!(out, "  >= {wanted:.2}")),
            None => out.push('\n'),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_of_a_row() {
        let row = Row::new("step", "arm, 64 envs", "env-steps/s", 2, 90.0).against("bare loop", 100.0, 0.9);
        let json = serde_json::to_value(&row).unwrap_or_default();
        let keys: Vec<&String> = json.as_object().map(|o| o.keys().collect()).unwrap_or_default();
        assert_eq!(keys, ["bench", "case", "mujoco", "ours", "ratio", "rival", "rival_name", "threads", "unit"]);
        assert!(table(&[row.clone().with_target_ratio(0.97)]).contains("MISSES"));
        assert!(!table(&[row.with_target_ratio(0.8)]).contains("MISSES"));
    }
}
