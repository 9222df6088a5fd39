//! Reference values of OpenCV, stored in `data/opencv.txt`.

/// Reference values of OpenCV: the rows called `name` in `data/opencv.txt`.
pub fn opencv<const N: usize>(name: &str) -> impl Iterator<Item = [f64; N]> {
    let row = move |line: &str| {
        let numbers = line.strip_prefix(name)?.strip_prefix(": ")?;
        Some(numbers.split(' ').map(|x| x.parse().unwrap()).collect::<Vec<f64>>().try_into().unwrap())
    };
    include_str!("../data/opencv.txt").lines().filter_map(row)
}
