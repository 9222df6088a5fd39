#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use kinetoscope_testkit::error_tables::assert_error;

fn sine(points: u32) -> Plot {
    let wave = (0..points).map(|k| f64::from(k) * 2.0 / f64::from(points)).map(|t| [t, 0.3 * (5.0 * t).sin()]);
    Plot::over_time("a wave", "angle [rad]").with(Series::new("hinge", wave))
}

#[test]
fn ink() {
    let plot = sine(300);
    let (image, drawing) = (canvas(&plot).unwrap(), plot.layout().unwrap());
    let blue = |x: f64, y: f64| {
        let [r, g, b] = image.pixel(x.floor() as usize, y.floor() as usize).unwrap();
        r < 128 && g < 190 && b > 150
    };
    for point in &drawing.curves[0].polylines[0] {
        assert!(blue(point[0], point[1]), "{point:?}");
        // Control: twelve pixels above or below, the image has no line, except where the line is steep.
        let flat = (point[1] - drawing.curves[0].polylines[0][15][1]).abs() < 20.0;
        assert!(flat || !blue(point[0], point[1] + 12.0) || !blue(point[0], point[1] - 12.0), "{point:?}");
    }
    // All colored pixels of the curve are near it: the line is 1.5 pixels wide, plus half a pixel of edge on both
    // sides.
    let [left, top, right, bottom] = drawing.frame.map(|x| x as usize);
    let piece = &drawing.curves[0].polylines[0];
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
fn odd_plots() {
    let points = [[0.0, 1.0], [1.0, f64::NAN], [2.0, -5.0], [3.0, 2.0], [f64::INFINITY, 0.0], [4.0, 1e3]];
    canvas(&Plot::over_time("gaps", "x").with(Series::new("one", points)).with(Series::new("two", []))).unwrap();
    let series =
        (0..90).map(|k| Series::new(format!("{}end{k}", "long/".repeat(40)), [[0.0, 1.0], [1.0, f64::from(k)]]));
    canvas(&Plot { series: series.collect(), size: [200, 200], ..Plot::default() }).unwrap();
}

#[test]
fn files() {
    let folder = tempfile::tempdir().unwrap();
    let plot = sine(50);
    let [svg, png] = ["a.svg", "a.PNG"].map(|name| folder.path().join(name));
    std::fs::write(&svg, "what was there before").unwrap();
    write(&plot, &svg).unwrap();
    write(&plot, &png).unwrap();
    assert_eq!(std::fs::read_to_string(&svg).unwrap(), plot.to_svg().unwrap());
    let image = image::load_from_memory(&std::fs::read(&png).unwrap()).unwrap().to_rgba8();
    assert_eq!(image.dimensions(), (960, 540));
    assert_eq!(image.into_raw(), canvas(&plot).unwrap().bytes());
    let files = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(files, 2, "nothing else is left");
    for (name, words) in [("a.gif", ".svg or .png"), ("a", ".svg or .png"), ("no/such/folder/a.svg", "No such file")] {
        assert_error(write(&plot, folder.path().join(name)), "", &[words]);
    }
    assert_error(write(&Plot { size: [20, 540], ..plot }, &svg), "Size(SizeError { width: 20", &[]);
}
