//! Axis scaling and ticks.

/// A linear or logarithmic map from values to pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Logarithmic: `low` and `high` are decimal logarithms.
    log: bool,
    low: f64,
    high: f64,
    /// Pixel coordinates of `low` and `high`.
    pixel_range: [f64; 2],
}

/// Approximate distance between ticks \[pixels\].
const TICK_SPACING: f64 = 80.0;

impl Axis {
    /// Creates an axis that shows all `values` with a margin, from pixel `pixel_range[0]` to pixel `pixel_range[1]`.
    /// Values of a logarithmic axis must be above 0. Without values, the range is about 0 to 1, or 1 to 10 on a
    /// logarithmic axis.
    pub(super) fn new(values: impl Iterator<Item = f64>, log: bool, pixel_range: [f64; 2]) -> Self {
        let values = values.map(|x| if log { x.log10() } else { x });
        let (mut low, mut high) = values.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // The range of (nearly) equal values is widened, so that it contains different ticks.
        let least = 1e-9 * high.abs().max(low.abs());
        if high / 2.0 - low / 2.0 <= least {
            let half = if least > 0.0 { (0.5_f64).min(high.abs()).max(2.0 * least) } else { 0.5 };
            (low, high) = (low - half, high + half);
        }
        // Halved values, so that the difference of the largest floats does not overflow.
        let margin = 0.04 * (high / 2.0 - low / 2.0);
        Self { log, low: (low - margin).max(f64::MIN / 4.0), high: (high + margin).min(f64::MAX / 4.0), pixel_range }
    }

    /// Pixel coordinate of a value.
    pub(super) fn pixel_of(&self, value: f64) -> f64 {
        let value = if self.log { value.log10() } else { value };
        let share = (value - self.low) / (self.high - self.low);
        self.pixel_range[0] + share * (self.pixel_range[1] - self.pixel_range[0])
    }

    /// Ticks within the range with their labels, at multiples of 1, 2 or 5 times a power of ten: about one per
    /// `TICK_SPACING`, at least two. A logarithmic axis has its ticks at integer powers of ten, and a short one also at
    /// 2 and 5 times those, or at the ticks of a linear axis.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        if self.log { self.logarithmic_ticks() } else { self.linear_ticks() }
    }

    fn linear_ticks(&self) -> Vec<(f64, String)> {
        let widest = self.tick_step();
        let power = 10.0_f64.powf(widest.log10().round());
        // The step is at most 5 times the wanted distance, and the range at least twice: a tenth is always enough.
        let steps = [5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05].map(|k| k * power).into_iter();
        let smaller = steps.filter(|step| *step < 0.9 * widest);
        let step = std::iter::once(widest).chain(smaller).find(|step| self.multiples(*step).len() >= 2);
        let step = step.unwrap_or(widest);
        self.multiples(step).into_iter().map(|tick| (tick, self.label(tick, step))).collect()
    }

    fn logarithmic_ticks(&self) -> Vec<(f64, String)> {
        let powers = self.multiples(self.tick_step().max(1.0).round());
        if powers.len() >= 2 {
            return powers.into_iter().map(|power| (10.0_f64.powf(power), format!("1e{power}"))).collect();
        }
        let decades = self.low.floor() as i32..=self.high.floor() as i32;
        let all = decades.flat_map(|power| [1, 2, 5].map(|digit| (digit, power)));
        let ticks: Vec<(f64, String)> = all
            .map(|(digit, power)| (f64::from(digit) * 10.0_f64.powi(power), format!("{digit}e{power}")))
            .filter(|(tick, _)| (self.low..=self.high).contains(&tick.log10()))
            .collect();
        if ticks.len() >= 2 {
            return ticks;
        }
        let [low, high] = [self.low, self.high].map(|power| 10.0_f64.powf(power));
        Self { log: false, low, high, pixel_range: self.pixel_range }.linear_ticks()
    }

    /// Distance between two ticks, in the unit of the range: 1, 2 or 5 times a power of ten, and at least the distance
    /// of `TICK_SPACING` pixels or half the range, if that is shorter.
    fn tick_step(&self) -> f64 {
        let wanted = ((self.pixel_range[1] - self.pixel_range[0]).abs() / TICK_SPACING).clamp(2.0, 20.0);
        let raw = (self.high - self.low) / wanted;
        let power = 10.0_f64.powf(raw.log10().floor());
        [1.0, 2.0, 5.0].map(|k| k * power).into_iter().find(|step| *step >= raw).unwrap_or(10.0 * power)
    }

    /// Multiples of a step in the range, at most 101.
    fn multiples(&self, step: f64) -> Vec<f64> {
        let (first, last) = ((self.low / step).ceil(), (self.high / step).floor());
        if first > last {
            return Vec::new();
        }
        // Bounds the number of ticks in case of rounding errors.
        let count = (last - first).min(100.0) as u32;
        (0..=count).map(|k| (first + f64::from(k)) * step).filter(|tick| tick.is_finite()).collect()
    }

    /// Formats a tick with as many digits as neighboring ticks need to differ.
    fn label(&self, tick: f64, step: f64) -> String {
        // Adding 0 turns -0 into 0.
        let (tick, largest) = (tick + 0.0, self.low.abs().max(self.high.abs()));
        // The small addend corrects rounding errors of the logarithm of a power of ten.
        let of_step = (step.log10() + 1e-9).floor();
        if largest < 1e6 && of_step >= -6.0 {
            return format!("{tick:.*}", (-of_step).clamp(0.0, 6.0) as usize);
        }
        let of_tick = if tick == 0.0 { of_step } else { tick.abs().log10().floor() };
        format!("{tick:.*e}", (of_tick - of_step).clamp(0.0, 12.0) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks are round and distinct numbers.
    #[test]
    fn ticks() {
        let labels = |values: [f64; 2]| -> Vec<String> {
            Axis::new(values.into_iter(), false, [0.0, 400.0]).ticks().into_iter().map(|(_, label)| label).collect()
        };
        for (values, expected) in [
            ([0.0, 1.0], "0.0 0.5 1.0"),
            ([-3.0, 40.0], "0 10 20 30 40"),
            ([100.0, 100.02], "100.000 100.005 100.010 100.015 100.020"),
        ] {
            assert_eq!(labels(values).join(" "), expected);
        }
        assert!(Axis::new(std::iter::empty(), false, [0.0, 1.0]).pixel_of(0.5).is_finite());
        for values in [[1e9, 1e9 + 50.0], [1e-9, 5e-9], [-1e300, 1e300], [f64::MIN, f64::MAX], [7.0, 7.0], [0.0, 0.0]] {
            assert!(Axis::new(values.into_iter(), false, [0.0, 1.0]).pixel_of(0.0).is_finite());
            let labels = labels(values);
            assert!((2..=12).contains(&labels.len()), "{values:?}: {labels:?}");
            assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{values:?}: {labels:?}");
            assert!(labels.iter().all(|label| label.parse::<f64>().is_ok_and(f64::is_finite)), "{labels:?}");
        }
    }

    /// Short axes: the only tick of an axis was drawn outside of it.
    #[test]
    fn ticks_of_short_axes() {
        for (values, log, expected) in [
            ([0.6, 4.5], false, "2 4"),
            ([2.0, 5.0], true, "2e0 5e0"),
            ([3.0, 40.0], true, "5e0 1e1 2e1"),
            ([2.1, 4.9], true, "3 4"),
        ] {
            let axis = Axis::new(values.into_iter(), log, [108.0, 0.0]);
            let ticks = axis.ticks();
            let labels: Vec<&str> = ticks.iter().map(|(_, label)| &label[..]).collect();
            assert_eq!(labels.join(" "), expected, "{values:?}");
            assert!(
                ticks.iter().all(|(tick, _)| (0.0..=108.0).contains(&axis.pixel_of(*tick))),
                "{values:?}: {ticks:?}"
            );
        }
    }

    #[test]
    fn logarithmic_ticks() {
        let axis = Axis::new([1e-9, 1e-3].into_iter(), true, [0.0, 400.0]);
        let ticks = axis.ticks();
        let labels: Vec<&str> = ticks.iter().map(|(_, label)| &label[..]).collect();
        assert_eq!(labels, ["1e-8", "1e-6", "1e-4"]);
        // Equal factors are equal distances.
        let places: Vec<f64> = ticks.iter().map(|(tick, _)| axis.pixel_of(*tick)).collect();
        assert!((places[2] - 2.0 * places[1] + places[0]).abs() < 1e-9, "{places:?}");
    }
}
