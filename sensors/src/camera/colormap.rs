//! Color maps of camera channels.

/// Returns the color of a depth \[m\] between `near` (dark, then blue) and `far` (dark red): Google's Turbo color map.
/// Depths outside get the colors of the ends; a depth that is not finite (nothing was hit) is black.
///
/// Source: Mikhailov's polynomial approximation of Turbo (2019).
pub fn depth_color(depth: f32, [near, far]: [f32; 2]) -> [u8; 3] {
    if !depth.is_finite() {
        return [0, 0, 0];
    }
    let width = if far > near { far - near } else { 1.0 };
    let x = ((depth - near) / width).clamp(0.0, 1.0);
    const COEFFICIENTS: [[f32; 6]; 3] = [
        [0.135_721_38, 4.615_392_6, -42.660_32, 132.131_08, -152.942_4, 59.286_38],
        [0.091_402_61, 2.194_188_4, 4.842_966_6, -14.185_033, 4.277_298_6, 2.829_566],
        [0.106_673_3, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25],
    ];
    COEFFICIENTS.map(|c| {
        let value = c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    })
}

/// Returns the color of a mask id: constant for an id, far from the colors of neighboring ids, black for 0.
pub fn mask_color(id: i32) -> [u8; 3] {
    if id == 0 {
        return [0, 0, 0];
    }
    // Hues one golden section apart never come close to a recent hue; brightness alternates in addition.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let hue = (f64::from(id) * GOLDEN).rem_euclid(1.0) * 6.0;
    let value = [1.0, 0.75, 0.88][id.rem_euclid(3) as usize];
    let saturation = if id.rem_euclid(2) == 0 { 0.55 } else { 0.8 };
    let channel = |shift: f64| {
        let k = (shift + hue).rem_euclid(6.0);
        let x = value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        (x * 255.0 + 0.5) as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

/// Returns the color of a unit normal, (n + 1) / 2 for each axis: a surface facing +z is light blue. Black for 0
/// (nothing was hit).
pub fn normal_color(normal: [f32; 3]) -> [u8; 3] {
    if normal == [0.0; 3] {
        return [0, 0, 0];
    }
    normal.map(|n| ((n.clamp(-1.0, 1.0) + 1.0) * 127.5 + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth() {
        let range = [1.0, 3.0];
        let [near, quarter, middle, far] = [1.0, 1.4, 2.0, 3.0].map(|d| depth_color(d, range));
        assert!(quarter[2] > 200 && far[0] > far[2] && middle[1] > 200, "{quarter:?} {middle:?} {far:?}");
        assert_eq!([depth_color(0.1, range), depth_color(9.0, range)], [near, far]);
        assert_eq!(depth_color(f32::INFINITY, range), [0, 0, 0]);
        assert_eq!(depth_color(2.0, [2.0, 2.0]), near, "an empty range is no reason to fail");
    }

    #[test]
    fn ids() {
        assert_eq!(mask_color(0), [0, 0, 0]);
        for id in 1..200 {
            for other in id + 1..id + 6 {
                let (a, b) = (mask_color(id), mask_color(other));
                let apart: i32 = (0..3).map(|k| (i32::from(a[k]) - i32::from(b[k])).abs()).sum();
                assert!(apart > 60, "{id} {a:?}, {other} {b:?}");
            }
        }
        assert_ne!(mask_color(-1), [0, 0, 0]);
    }

    #[test]
    fn normals() {
        let colors = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0; 3]].map(normal_color);
        assert_eq!(colors, [[128, 128, 255], [0, 128, 128], [0, 0, 0]]);
    }
}
