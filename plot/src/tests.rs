#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use kinetoscope_testkit::svg::curves;

fn sine(points: u32) -> Plot {
    let wave = (0..points).map(|k| f64::from(k) * 2.0 / f64::from(points)).map(|t| [t, 0.3 * (5.0 * t).sin()]);
    Plot::over_time("a wave", "angle [rad]").with(Series::new("hinge", wave))
}

#[test]
fn closed_form() {
    let svg = sine(300).to_svg().unwrap();
    let lines = curves(&svg);
    assert_eq!((lines.len(), lines[0].len()), (1, 300));
    // Pixel coordinates and labels have two decimals: 2 s on some 800 pixels, 0.6 rad on some 430.
    let (time, angle) = (0.02 * 2.0 / 700.0, 0.02 * 0.6 / 400.0);
    for (k, [t, y]) in (0..).zip(&lines[0]) {
        let exact = f64::from(k) * 2.0 / 300.0;
        assert!((t - exact).abs() < time, "{t} instead of {exact}");
        assert!((y - 0.3 * (5.0 * exact).sin()).abs() < angle, "{y} at {t}");
    }
    // Control: the comparison detects a frequency that is 0.1 % higher.
    let off = lines[0].iter().map(|[t, y]| (y - 0.3 * (5.005 * t).sin()).abs()).fold(0.0, f64::max);
    assert!(off > 10.0 * angle, "{off}");
}

/// Regression test: 17 curves shared 7 colors.
#[test]
fn colors_of_many_curves() {
    let wave = |k: u32| Series::new(format!("joint {k}"), [[0.0, f64::from(k)], [1.0, f64::from(k) + 1.0]]);
    let plot = (0..24).fold(Plot::over_time("joints", "angle [rad]"), |plot, k| plot.with(wave(k)));
    let colors: Vec<[u8; 3]> = plot.layout().unwrap().curves.iter().map(|curve| curve.color).collect();
    let apart =
        |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum::<f64>().sqrt();
    for (k, color) in colors.iter().enumerate() {
        assert!(apart(*color, [255; 3]) > 80.0, "{color:?} differs from white");
        assert!(colors[..k].iter().all(|other| apart(*color, *other) > 40.0), "{color:?} differs from all others");
    }
    assert_eq!(colors.len(), 24);
}

#[test]
fn gaps_and_frame() {
    let points = [[0.0, 1.0], [1.0, f64::NAN], [2.0, -5.0], [3.0, 2.0], [f64::INFINITY, 0.0], [4.0, 1e3]];
    let plot = Plot::over_time("a < b & c", "x").with(Series::new("one", points)).with(Series::new("two", []));
    let svg = plot.to_svg().unwrap();
    assert!(svg.contains("a &lt; b &amp; c") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    // Two isolated points, one line.
    assert_eq!((svg.matches("<circle").count(), svg.matches("<polyline").count()), (2, 1));
    let drawing = plot.layout().unwrap();
    let [left, top, right, bottom] = drawing.frame;
    for [x, y] in drawing.curves.iter().flat_map(|curve| &curve.polylines).flatten() {
        assert!((left..right).contains(x) && (top..bottom).contains(y), "{x}, {y}");
    }
}

#[test]
fn long_legend() {
    let series =
        (0..90).map(|k| Series::new(format!("{}end{k}", "long/".repeat(40)), [[0.0, 1.0], [1.0, f64::from(k)]]));
    let plot = Plot { series: series.collect(), ..Plot::default() };
    let svg = plot.to_svg().unwrap();
    assert!(svg.contains("...") && svg.contains("end3</text>") && svg.contains("more</text>"), "{svg}");
    let [left, _, right, _] = plot.layout().unwrap().frame;
    assert!(right - left > 0.4 * 960.0);
    let small = Plot { size: [200, 200], ..plot.clone() };
    small.to_svg().unwrap();
    // A plot without curves is valid.
    assert!(Plot::default().to_svg().unwrap().ends_with("</svg>\n"));
}

#[test]
fn logarithms() {
    let points = [[1e-3, 1e-9], [1e-2, 1e-5], [1e-1, 0.0]];
    let plot = Plot { log_axes: true, markers: true, ..Plot::default() }.with(Series::new("order", points));
    let svg = plot.to_svg().unwrap();
    assert!(svg.contains(">1e-3<") && svg.contains(">1e-6<"), "{svg}");
    assert_eq!((svg.matches("<circle").count(), svg.matches("<polyline").count()), (2, 1));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
}

#[test]
fn sizes() {
    let plot = Plot { size: [20, 540], ..sine(50) };
    assert_eq!(plot.to_svg().unwrap_err().to_string(), "a plot of 20 x 540 pixels: both must be from 200 to 16384");
}
