//! Laws: rows of expected and measured numbers, and controls that show that the rows can fail.

use crate::rows;
use serde::Serialize;

/// The larger of two numbers, or NaN if either is NaN; `f64::max` would drop the NaN.
pub(crate) fn max_or_nan(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// One number that a law predicts.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// Name of the quantity, unique within the law.
    pub(crate) quantity: String,
    /// Unit; empty for a plain number.
    pub(crate) unit: String,
    pub(crate) expected: f64,
    pub(crate) measured: f64,
    /// Largest error, in the unit of the quantity.
    pub(crate) tolerance: f64,
    /// Source of the tolerance.
    pub(crate) why: String,
    pub(crate) pass: bool,
    /// Reason for a difference between the supported MuJoCo versions in this row, if any.
    pub(crate) lines_differ: Option<String>,
}

/// The same quantity measured without the effect: it must miss the expected number.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Control {
    /// The row of the control.
    pub(crate) quantity: String,
    /// The removed effect.
    pub(crate) without: String,
    pub(crate) measured: f64,
    pub(crate) misses: bool,
}

/// A curve of a plot.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<[f64; 2]>,
}

/// A plot of the law.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Plot {
    pub(crate) title: String,
    /// Labels of the axes, with units.
    pub(crate) x: String,
    pub(crate) y: String,
    /// True if both axes are logarithmic.
    pub(crate) log: bool,
    pub(crate) series: Vec<Series>,
}

/// Measurements of a law.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Measurements {
    rows: Vec<Row>,
    controls: Vec<Control>,
    plots: Vec<Plot>,
    /// Reason for differences between the supported MuJoCo versions in any row, if any.
    lines_differ: Option<String>,
}

impl Measurements {
    /// Adds a row: `measured` must equal `expected` within `tolerance`, all in `unit`; `why` is the source of the
    /// tolerance.
    pub(crate) fn row(
        &mut self,
        quantity: &str,
        unit: &str,
        expected: f64,
        measured: f64,
        (tolerance, why): (f64, &str),
    ) {
        assert!(self.rows.iter().all(|row| row.quantity != quantity), "two rows are called {quantity:?}");
        assert!(
            tolerance.is_finite() && tolerance >= 0.0 && expected.is_finite(),
            "{quantity}: the tolerance and the expected number must be finite"
        );
        // Not `error > tolerance`, so that a measured NaN fails.
        let pass = (measured - expected).abs() <= tolerance;
        let [quantity, unit, why] = [quantity, unit, why].map(str::to_string);
        self.rows.push(Row { quantity, unit, expected, measured, tolerance, why, pass, lines_differ: None });
    }

    /// Adds a control: the row called `quantity`, measured `without` the effect, must miss by more than its tolerance.
    /// Every row needs at least one.
    #[track_caller]
    pub(crate) fn control(&mut self, quantity: &str, without: &str, measured: f64) {
        let row = self.rows.iter().find(|row| row.quantity == quantity).expect("a control of a row that exists");
        // A NaN would not show that the row can distinguish the two cases.
        let misses = measured.is_finite() && (measured - row.expected).abs() > row.tolerance;
        self.controls.push(Control { quantity: quantity.into(), without: without.into(), measured, misses });
    }

    /// Gives the reason why 2.2.2 and 4.x differ by more than a tenth of a tolerance. Without a reason, the law
    /// guarantees that they do not.
    pub(crate) fn versions_differ(&mut self, why: &str) {
        self.lines_differ = Some(why.into());
    }

    /// As [`versions_differ`](Self::versions_differ), for one row only.
    pub(crate) fn versions_differ_in(&mut self, quantity: &str, why: &str) {
        let row = self.rows.iter_mut().find(|row| row.quantity == quantity).expect("a row that exists");
        row.lines_differ = Some(why.into());
    }

    /// Adds a plot to the physics page: series of (x, y).
    pub(crate) fn plot(&mut self, title: &str, [x, y]: [&str; 2], log: bool, series: &[(&str, Vec<[f64; 2]>)]) {
        let series = series.iter().map(|(name, points)| Series { name: (*name).into(), points: points.clone() });
        let [title, x, y] = [title, x, y].map(str::to_string);
        self.plots.push(Plot { title, x, y, log, series: series.collect() });
    }

    fn failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        for row in self.rows.iter().filter(|row| !row.pass) {
            let Row { quantity, unit, expected, measured, tolerance, why, .. } = row;
            let error = measured - expected;
            failures.push(format!(
                "{quantity}: expected {expected:.12e} {unit}, measured {measured:.12e}: off by {error:.3e}, tolerance \
                 {tolerance:.3e} ({why})"
            ));
        }
        for Control { quantity, without, measured, .. } in self.controls.iter().filter(|control| !control.misses) {
            failures.push(format!("the control passes: {quantity} is {measured:.12e} also {without}"));
        }
        for Row { quantity, .. } in &self.rows {
            if !self.controls.iter().any(|control| control.quantity == *quantity) {
                failures.push(format!("{quantity} has no control, which would show that it can fail"));
            }
        }
        if self.rows.is_empty() {
            failures.push("a law needs rows".into());
        }
        failures
    }
}

/// Measures a law, writes its rows if requested, and fails unless every row holds and every control misses.
///
/// `path` is `module_path!()`, the source of the law's name; `statement` is the law as a formula.
#[track_caller]
pub(crate) fn law(path: &str, statement: &str, measure: impl FnOnce(&mut Measurements)) {
    let mut words = path.rsplit("::");
    let (name, group) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let mut measured = Measurements::default();
    measure(&mut measured);
    rows::write(group, name, statement, &measured);
    let failures = measured.failures();
    assert!(failures.is_empty(), "{name}: {statement}\n  {}", failures.join("\n  "));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(expected: f64, measured: f64, tolerance: f64, control: f64) -> Vec<String> {
        let mut m = Measurements::default();
        m.row("x", "m", expected, measured, (tolerance, "by hand"));
        m.control("x", "without it", control);
        m.failures()
    }

    #[test]
    fn worse_of_nan() {
        assert_eq!([1.0, 3.0, 2.0].into_iter().fold(0.0, max_or_nan), 3.0);
        assert!([1.0, f64::NAN, 2.0].into_iter().fold(0.0, max_or_nan).is_nan());
    }

    #[test]
    fn rows_and_controls() {
        assert!(of(1.0, 1.05, 0.1, 2.0).is_empty());
        assert!(of(1.0, 1.05, 0.01, 2.0)[0].contains("off by 5.0"));
        assert!(of(1.0, f64::NAN, 0.1, 2.0)[0].contains("NaN"));
        assert!(of(1.0, 1.0, 0.1, 1.05)[0].contains("the control passes"));
        assert!(of(1.0, 1.0, 0.1, f64::NAN)[0].contains("the control passes"));
    }

    #[test]
    fn missing_rows_and_controls() {
        assert_eq!(Measurements::default().failures(), ["a law needs rows"]);
        let mut m = Measurements::default();
        m.row("x", "", 1.0, 1.0, (0.0, "the same number"));
        assert_eq!(m.failures(), ["x has no control, which would show that it can fail"]);
        m.control("x", "without it", 2.0);
        m.row("y", "", 1.0, 1.0, (0.0, "the same number"));
        assert!(m.failures()[0].starts_with("y has no control"));
    }
}
