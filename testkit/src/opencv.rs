//! Numbers of OpenCV, kept in `data/opencv.txt`.

/// Numbers of OpenCV: the rows of this name in `data/opencv.txt`.
pub fn opencv<const N: usize>(name: &str) -> impl Iterator<Item = [f64; N]> {
    let row = move |line: &str| {
        let numbers = line.strip_prefix(name)?.strip_prefix(": ")?;
        Some(numbers.split(' ').map(|x| x.parse().unwrap()).collect::<Vec<f64>>().try_into().unwrap())
    };
    include_str!("../data/opencv.txt").lines().filter_map(row)
}
