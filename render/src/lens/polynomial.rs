//! Polynomials of one variable, lowest coefficient first.

/// Bisection steps: enough to reach adjacent numbers.
const MAX_STEPS: usize = 200;

/// Value at x.
pub(super) fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Coefficients of the derivative.
pub(super) fn derivative(coefficients: &[f64]) -> Vec<f64> {
    coefficients.iter().enumerate().skip(1).map(|(k, c)| k as f64 * c).collect()
}

/// Sign changes between `from` and `to`, in order. Roots without a change of sign are left out. Between two neighboring
/// sign changes of the derivative, or the ends, there is at most one.
pub(super) fn sign_changes(coefficients: &[f64], from: f64, to: f64) -> Vec<f64> {
    let used = coefficients.iter().rposition(|&c| c != 0.0).map_or(0, |last| last + 1);
    let coefficients = &coefficients[..used];
    if used < 2 {
        return Vec::new();
    }
    let mut ends = vec![from];
    ends.extend(sign_changes(&derivative(coefficients), from, to));
    ends.push(to);
    let change = |pair: &[f64]| {
        let negative = value(coefficients, pair[0]) < 0.0;
        (negative != (value(coefficients, pair[1]) < 0.0))
            .then(|| bisect(pair[0], pair[1], |x| (value(coefficients, x) < 0.0) == negative))
    };
    ends.windows(2).filter_map(change).collect()
}

/// The first sign change from 0 to `limit` of a polynomial that is positive at 0; `None` without a sign change.
pub(super) fn first_sign_change(coefficients: &[f64], limit: f64) -> Option<f64> {
    sign_changes(coefficients, 0.0, limit).first().copied()
}

/// Bisects a predicate that holds at `from` and not at `to`; returns the last number found where it holds.
pub(super) fn bisect(from: f64, to: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut yes, mut no) = (from, to);
    for _ in 0..MAX_STEPS {
        let middle = 0.5 * (yes + no);
        if middle == yes || middle == no {
            break;
        }
        if holds(middle) { yes = middle } else { no = middle }
    }
    yes
}

/// Solves for a value of a function that increases from `from` to `to`, by Newton's method with bisection if a step
/// leaves the interval. `at` returns value and slope.
pub(super) fn solve(target: f64, from: f64, to: f64, start: f64, at: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (from, to);
    let mut x = start.clamp(low, high);
    for _ in 0..MAX_STEPS {
        let (value, slope) = at(x);
        let error = value - target;
        if error > 0.0 {
            high = x
        } else {
            low = x
        }
        let step = x - error / slope;
        let next = if step > low && step < high { step } else { 0.5 * (low + high) };
        if error == 0.0 || (next - x).abs() <= 4.0 * f64::EPSILON * x.abs() {
            return if error == 0.0 { x } else { next };
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots() {
        // (x - 1)(x - 2)(x - 3), and (x - 5)^2, whose sign does not change.
        let cubic = [-6.0, 11.0, -6.0, 1.0];
        let found = sign_changes(&cubic, 0.0, 10.0);
        assert!(found.len() == 3 && found.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert!(sign_changes(&cubic, 3.5, 10.0).is_empty());
        assert!(sign_changes(&[25.0, -10.0, 1.0], 0.0, 10.0).is_empty());
        assert!(sign_changes(&[2.0, 0.0, 0.0], 0.0, 10.0).is_empty());
        assert!((first_sign_change(&[1.0, 0.0, -0.25, 0.0], 10.0).unwrap_or(0.0) - 2.0).abs() < 1e-12);
        assert_eq!(derivative(&cubic), [11.0, -12.0, 3.0]);
        assert_eq!(value(&cubic, 4.0), 6.0);
        let root = solve(8.0, 0.0, 100.0, 50.0, |x| (x * x * x, 3.0 * x * x));
        assert!((root - 2.0).abs() < 1e-14, "{root}");
    }
}
