#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use kinetoscope_testkit::refusal::assert_error;
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
    // Pixels have two decimals, and so have the labels: 2 s on some 800 pixels, 0.6 rad on some 430.
    let (time, angle) = (0.02 * 2.0 / 700.0, 0.02 * 0.6 / 400.0);
    for (k, [t, y]) in (0..).zip(&lines[0]) {
        let exact = f64::from(k) * 2.0 / 300.0;
        assert!((t - exact).abs() < time, "{t} instead of {exact}");
        assert!((y - 0.3 * (5.0 * exact).sin()).abs() < angle, "{y} at {t}");
    }
    // The control: a wave that is a thousandth faster does not.
    let off = lines[0].iter().map(|[t, y]| (y - 0.3 * (5.005 * t).sin()).abs()).fold(0.0, f64::max);
    assert!(off > 10.0 * angle, "{off}");
}

/// Cause: 17 curves had 7 colors.
#[test]
fn colors_of_many_curves() {
    let wave = |k: u32| Series::new(format!("joint {k}"), [[0.0, f64::from(k)], [1.0, f64::from(k) + 1.0]]);
    let plot = (0..24).fold(Plot::over_time("joints", "angle [rad]"), |plot, k| plot.with(wave(k)));
    let colors: Vec<[u8; 3]> = plot.drawing().unwrap().curves.iter().map(|curve| curve.color).collect();
    let apart =
        |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum::<f64>().sqrt();
    for (k, color) in colors.iter().enumerate() {
        assert!(apart(*color, [255; 3]) > 80.0, "{color:?} is seen on white");
        assert!(colors[..k].iter().all(|other| apart(*color, *other) > 40.0), "{color:?} is like another");
    }
    assert_eq!(colors.len(), 24);
}

#[test]
fn ink() {
    let plot = sine(300);
    let (canvas, drawing) = (plot.to_canvas().unwrap(), plot.drawing().unwrap());
    let blue = |x: f64, y: f64| {
        let [r, g, b] = canvas.pixel(x.floor() as usize, y.floor() as usize).unwrap();
        r < 128 && g < 190 && b > 150
    };
    for point in &drawing.curves[0].pieces[0] {
        assert!(blue(point[0], point[1]), "{point:?}");
        // The control: ten pixels beside it there is none, but where the line is steep.
        let flat = (point[1] - drawing.curves[0].pieces[0][15][1]).abs() < 20.0;
        assert!(flat || !blue(point[0], point[1] + 12.0) || !blue(point[0], point[1] - 12.0), "{point:?}");
    }
    // All ink of the curve is near it: a line of 1.5 pixels and half a pixel of edge to both sides.
    let [left, top, right, bottom] = drawing.frame.map(|x| x as usize);
    let piece = &drawing.curves[0].pieces[0];
    for y in top + 2..bottom - 2 {
        for x in (left + 2..right - 2).filter(|x| blue(*x as f64, y as f64)) {
            let [px, py] = [x as f64 + 0.5, y as f64 + 0.5];
            let near = piece.windows(2).any(|pair| {
                let way = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
                let to = [px - pair[0][0], py - pair[0][1]];
                let t = ((to[0] * way[0] + to[1] * way[1]) / (way[0] * way[0] + way[1] * way[1])).clamp(0.0, 1.0);
                (to[0] - t * way[0]).hypot(to[1] - t * way[1]) < 1.3
            });
            assert!(near, "ink at {x}, {y}");
        }
    }
}

#[test]
fn gaps_and_frame() {
    let points = [[0.0, 1.0], [1.0, f64::NAN], [2.0, -5.0], [3.0, 2.0], [f64::INFINITY, 0.0], [4.0, 1e3]];
    let plot = Plot::over_time("a < b & c", "x").with(Series::new("one", points)).with(Series::new("two", []));
    let svg = plot.to_svg().unwrap();
    assert!(svg.contains("a &lt; b &amp; c") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    // Two points alone, one line.
    assert_eq!((svg.matches("<circle").count(), svg.matches("<polyline").count()), (2, 1));
    let drawing = plot.drawing().unwrap();
    let [left, top, right, bottom] = drawing.frame;
    for [x, y] in drawing.curves.iter().flat_map(|curve| &curve.pieces).flatten() {
        assert!((left..right).contains(x) && (top..bottom).contains(y), "{x}, {y}");
    }
    plot.to_canvas().unwrap();
}

#[test]
fn long_legend() {
    let series =
        (0..90).map(|k| Series::new(format!("{}end{k}", "long/".repeat(40)), [[0.0, 1.0], [1.0, f64::from(k)]]));
    let plot = Plot { series: series.collect(), ..Plot::default() };
    let svg = plot.to_svg().unwrap();
    assert!(svg.contains("...") && svg.contains("end3</text>") && svg.contains("more</text>"), "{svg}");
    let [left, _, right, _] = plot.drawing().unwrap().frame;
    assert!(right - left > 0.4 * 960.0);
    let small = Plot { size: [200, 200], ..plot.clone() };
    small.to_canvas().unwrap();
    // Nothing at all is a frame.
    assert!(Plot::default().to_svg().unwrap().ends_with("</svg>\n"));
}

#[test]
fn files() {
    let folder = tempfile::tempdir().unwrap();
    let plot = sine(50);
    let [svg, png] = ["a.svg", "a.PNG"].map(|name| folder.path().join(name));
    std::fs::write(&svg, "what was there before").unwrap();
    plot.write(&svg).unwrap();
    plot.write(&png).unwrap();
    assert_eq!(std::fs::read_to_string(&svg).unwrap(), plot.to_svg().unwrap());
    let image = image::load_from_memory(&std::fs::read(&png).unwrap()).unwrap().to_rgba8();
    assert_eq!(image.dimensions(), (960, 540));
    assert_eq!(image.into_raw(), plot.to_canvas().unwrap().bytes());
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 2, "nothing else is left");
    for (name, words) in [("a.gif", ".svg or .png"), ("a", ".svg or .png"), ("no/such/folder/a.svg", "No such file")] {
        assert_error(plot.write(folder.path().join(name)), "", &[words]);
    }
    assert_error(Plot { size: [20, 540], ..plot }.write(&svg), "Size { width: 20", &[]);
}
