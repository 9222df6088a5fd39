//! What a law is: rows of expected and measured numbers, and controls that show that the rows can fail.

use crate::rows;
use serde::Serialize;

/// The larger of two numbers, NaN if either is: `f64::max` would drop what went wrong.
pub(crate) fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// One number that a law predicts.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// What it is, unique within the law.
    pub(crate) quantity: String,
    /// Its unit; empty for a plain number.
    pub(crate) unit: String,
    pub(crate) expected: f64,
    pub(crate) measured: f64,
    /// Largest error, in the unit of the quantity.
    pub(crate) tolerance: f64,
    /// Where the tolerance comes from.
    pub(crate) why: String,
    pub(crate) pass: bool,
    /// Why the two lines of MuJoCo differ in this row, where they do.
    pub(crate) lines_differ: Option<String>,
}

/// The same number where the effect was taken away: it must miss.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Control {
    /// The row that it is a control of.
    pub(crate) quantity: String,
    /// What was taken away.
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

/// A picture of the law.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Plot {
    pub(crate) title: String,
    /// Labels of the axes, with units.
    pub(crate) x: String,
    pub(crate) y: String,
    /// Whether both axes are logarithmic.
    pub(crate) log: bool,
    pub(crate) series: Vec<Series>,
}

/// What a law measures.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Measured {
    rows: Vec<Row>,
    controls: Vec<Control>,
    plots: Vec<Plot>,
    /// Why the two lines of MuJoCo give different numbers, where any of them may.
    lines_differ: Option<String>,
}

impl Measured {
    /// `measured` is `expected` within `tolerance`, all in `unit`; `why` says where the tolerance comes from.
    pub(crate) fn row(
        &mut self,
        quantity: &str,
        unit: &str,
        expected: f64,
        measured: f64,
        (tolerance, why): (f64, &str),
    ) {
        assert!(self.rows.iter().all(|row| row.quantity != quantity), "two rows are called {quantity:?}");
        assert!(tolerance.is_finite() && tolerance >= 0.0 && expected.is_finite(), "{quantity}: no such tolerance");
        // Not `error > tolerance`: a measured NaN fails.
        let pass = (measured - expected).abs() <= tolerance;
        let [quantity, unit, why] = [quantity, unit, why].map(str::to_string);
        self.rows.push(Row { quantity, unit, expected, measured, tolerance, why, pass, lines_differ: None });
    }

    /// Every row needs at least one: the row called `quantity`, measured again in a world `without` the effect, must miss by more than its tolerance.
    #[track_caller]
    pub(crate) fn control(&mut self, quantity: &str, without: &str, measured: f64) {
        let row = self.rows.iter().find(|row| row.quantity == quantity).expect("a control of a row that exists");
        // A world that came out as NaN would not show that the row can tell two worlds apart.
        let misses = measured.is_finite() && (measured - row.expected).abs() > row.tolerance;
        self.controls.push(Control { quantity: quantity.into(), without: without.into(), measured, misses });
    }

    /// Why 2.2.2 and 4.x give numbers that differ by more than a tenth of a tolerance. A law that does not say so promises
    /// that they do not.
    pub(crate) fn lines_differ(&mut self, why: &str) {
        self.lines_differ = Some(why.into());
    }

    /// As [`lines_differ`](Self::lines_differ), of one row only.
    pub(crate) fn lines_differ_in(&mut self, quantity: &str, why: &str) {
        let row = self.rows.iter_mut().find(|row| row.quantity == quantity).expect("a row that exists");
        row.lines_differ = Some(why.into());
    }

    /// A picture for the page of numbers: series of (x, y).
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

/// Measures a law, writes its rows where they are wanted, and fails unless every row holds and every control misses.
///
/// `path` is `module_path!()`, from which the law has its name; `statement` is the law as a formula.
#[track_caller]
pub(crate) fn law(path: &str, statement: &str, measure: impl FnOnce(&mut Measured)) {
    let mut words = path.rsplit("::");
    let (name, group) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let mut measured = Measured::default();
    measure(&mut measured);
    rows::write(group, name, statement, &measured);
    let failures = measured.failures();
    assert!(failures.is_empty(), "{name}: {statement}\n  {}", failures.join("\n  "));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(expected: f64, measured: f64, tolerance: f64, control: f64) -> Vec<String> {
        let mut m = Measured::default();
        m.row("x", "m", expected, measured, (tolerance, "by hand"));
        m.control("x", "without it", control);
        m.failures()
    }

    #[test]
    fn worse_of_nan() {
        assert_eq!([1.0, 3.0, 2.0].into_iter().fold(0.0, worse), 3.0);
        assert!([1.0, f64::NAN, 2.0].into_iter().fold(0.0, worse).is_nan());
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
        assert_eq!(Measured::default().failures(), ["a law needs rows"]);
        let mut m = Measured::default();
        m.row("x", "", 1.0, 1.0, (0.0, "the same number"));
        assert_eq!(m.failures(), ["x has no control, which would show that it can fail"]);
        m.control("x", "without it", 2.0);
        m.row("y", "", 1.0, 1.0, (0.0, "the same number"));
        assert!(m.failures()[0].starts_with("y has no control"));
    }
}
