//! Reduction of curves with far more points than pixels.

/// Keeps the first, lowest, highest and last of consecutive points \[pixels\] in each column of pixels. The line covers
/// the same pixels. Source: Jugel et al., "M4: A Visualization-Oriented Time Series Data Aggregation", VLDB 2014.
pub(super) fn decimate_m4(points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = Vec::new();
    for run in points.chunk_by(|a, b| a[0].floor() == b[0].floor()) {
        if run.len() <= 4 {
            out.extend_from_slice(run);
            continue;
        }
        let by_height = |a: &&usize, b: &&usize| run[**a][1].total_cmp(&run[**b][1]);
        let places: Vec<usize> = (0..run.len()).collect();
        let ends = [places.iter().min_by(by_height), places.iter().max_by(by_height)];
        let mut kept: Vec<usize> = ends.into_iter().flatten().copied().chain([0, run.len() - 1]).collect();
        kept.sort_unstable();
        kept.dedup();
        out.extend(kept.into_iter().map(|k| run[k]));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_points_of_each_column() {
        let points: Vec<[f64; 2]> = (0..100_000).map(|k| 1e-4 * f64::from(k)).map(|x| [x, (977.0 * x).sin()]).collect();
        let few = decimate_m4(points.clone());
        assert!(few.len() <= 40, "{}", few.len());
        for column in 0..10 {
            let of = |points: &[[f64; 2]]| {
                let mut ys = points.iter().filter(|p| p[0].floor() as i32 == column).map(|p| p[1]);
                let ends = ys.clone().fold([f64::MAX, f64::MIN], |[low, high], y| [low.min(y), high.max(y)]);
                (ends, ys.clone().next(), ys.next_back())
            };
            assert_eq!(of(&few), of(&points), "column {column}");
        }
        // The order of the points is unchanged.
        assert!(few.windows(2).all(|pair| pair[0][0] < pair[1][0]));
        // Control: a curve with few points is unchanged.
        assert_eq!(decimate_m4(points[..4].to_vec()), points[..4]);
    }
}
