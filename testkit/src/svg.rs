//! Reading of SVG plots, using only the labels of their axes.

/// Value and position \[pixels\] of two labels of an axis, `[[value, position]; 2]`.
pub type Ticks = [[f64; 2]; 2];

fn attribute(line: &str, name: &str) -> Option<f64> {
    line.split_once(&format!(" {name}=\""))?.1.split('"').next()?.parse().ok()
}

/// First and last label of the horizontal axis and of the vertical axis.
pub fn axes(svg: &str) -> [Ticks; 2] {
    // Labels of the vertical axis are 4 pixels below their lines.
    [("\"middle\"", "x", 0.0), ("\"end\"", "y", 4.0)].map(|(anchor, name, below)| {
        let labels = svg.lines().filter(|line| line.starts_with("<text") && line.contains(anchor));
        let value = |line: &str| line.split_once('>')?.1.trim_end_matches("</text>").parse::<f64>().ok();
        let all: Vec<_> = labels.filter_map(|line| Some([value(line)?, attribute(line, name)? - below])).collect();
        [all[0], all[all.len() - 1]]
    })
}

/// Points of each polyline, in the units of the axes: a curve with gaps has several, and single points are left out.
pub fn curves(svg: &str) -> Vec<Vec<[f64; 2]>> {
    let [across, up] = axes(svg);
    let back = |[[a, x], [b, y]]: Ticks, pixel: &str| a + (pixel.parse::<f64>().unwrap() - x) / (y - x) * (b - a);
    let lines = svg.lines().filter(|line| line.starts_with("<polyline"));
    let points = lines.map(|line| line.split_once("points=\"").unwrap().1.trim_end_matches("\"/>"));
    let point = |point: &str| {
        let (x, y) = point.split_once(',').unwrap();
        [back(across, x), back(up, y)]
    };
    points.map(|points| points.split(' ').map(point).collect()).collect()
}
