//! Polygons by which OpenGL draws shapes, for light that is computed at their corners.

/// Numbers of polygons of shapes, as in MuJoCo's visualizer (`mjVisual.quality`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tessellation {
    /// Polygons around a round shape.
    pub slices: u16,
    /// Polygons from pole to pole.
    pub stacks: u16,
    /// Polygons along the sides of a box.
    pub quads: u16,
}

impl Default for Tessellation {
    /// The defaults of MuJoCo.
    fn default() -> Self {
        Self { slices: 28, stacks: 16, quads: 4 }
    }
}

/// Lines of the grid of a plane along one axis: regular ones around the middle, and the borders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneLines {
    /// Coordinate of the last regular line \[m\]; the first one is at its negative.
    pub reach: f32,
    /// Distance between regular lines \[m\].
    pub step: f32,
    /// Coordinate of a border \[m\]; the other one is at its negative.
    pub border: f32,
}

impl Default for PlaneLines {
    /// Lines at a distance of 1 m.
    fn default() -> Self {
        Self { reach: 100.0, step: 1.0, border: 1e4 }
    }
}

impl PlaneLines {
    /// The two lines around a coordinate, and the fraction of the way between them, 0..=1.
    pub fn cell(&self, x: f32) -> ([f32; 2], f32) {
        let Self { reach, step, border } = *self;
        let ends = if x < -reach {
            [-border, -reach]
        } else if x >= reach {
            [reach, border]
        } else {
            let line = ((x + reach) / step).floor();
            [line * step - reach, (line + 1.0) * step - reach]
        };
        let width = ends[1] - ends[0];
        (ends, if width > 0.0 { ((x - ends[0]) / width).clamp(0.0, 1.0) } else { 0.0 })
    }

    /// All lines, from border to border \[m\].
    pub fn all(&self) -> Vec<f32> {
        let count = (2.0 * self.reach / self.step).round().max(0.0) as usize;
        let regular = (0..=count).map(|k| k as f32 * self.step - self.reach);
        let mut all: Vec<f32> =
            std::iter::once(-self.border).chain(regular).chain(std::iter::once(self.border)).collect();
        all.dedup();
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_a_grid() {
        let lines = PlaneLines { reach: 1.0, step: 0.5, border: 1.25 };
        assert_eq!(lines.all(), [-1.25, -1.0, -0.5, 0.0, 0.5, 1.0, 1.25]);
        for pair in lines.all().windows(2) {
            for fraction in [0.0, 0.25, 0.75] {
                let (ends, found) = lines.cell(pair[0] + fraction * (pair[1] - pair[0]));
                assert_eq!((&ends[..], found), (pair, fraction));
            }
        }
        // A grid that ends at the border.
        let whole = PlaneLines { border: 1.0, ..lines };
        assert_eq!(whole.all(), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(whole.cell(1.0), ([1.0, 1.0], 0.0));
    }
}
