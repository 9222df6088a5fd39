//! Comparison of images with an analytic answer or with another renderer's image.

use std::path::PathBuf;

/// An image under test, with its tolerances.
#[derive(Clone, Copy, Debug)]
pub struct ImageCheck<'a> {
    /// Name of the image, which names the file of the difference.
    pub name: &'a str,
    /// Width and height \[pixels\].
    pub size: [usize; 2],
    /// Largest difference of a pixel, in the unit of the pixels.
    pub tolerance: f64,
    /// Largest share of the compared pixels that may differ more, for example silhouettes that two renderers round
    /// differently.
    pub outliers: f64,
}

impl ImageCheck<'_> {
    /// Asserts that an image has the expected value of each pixel `(column, row)`; pixels without one (`None`) are
    /// skipped.
    #[track_caller]
    pub fn assert_matches(&self, found: &[f32], expected: impl Fn(usize, usize) -> Option<f64>) {
        let [width, height] = self.size;
        assert_eq!(found.len(), width * height, "{}: number of pixels", self.name);
        let (mut wrong, mut compared) = (Vec::new(), 0);
        for (k, &found) in found.iter().enumerate() {
            let Some(expected) = expected(k % width, k / width) else { continue };
            compared += 1;
            let found = f64::from(found);
            let same = found == expected || (found - expected).abs() <= self.tolerance;
            if !same {
                wrong.push((k, found, expected));
            }
        }
        assert!(compared > 0, "{}: no pixel has an expected value", self.name);
        if wrong.len() as f64 <= self.outliers * compared as f64 {
            return;
        }
        let file = self.write_difference(&wrong);
        let line = |(k, found, expected): &(usize, f64, f64)| {
            format!("({}, {}): {found:.6e}, expected {expected:.6e}", k % width, k / width)
        };
        let first: Vec<String> = wrong.iter().take(5).map(line).collect();
        panic!(
            "{}: {} of {compared} pixels differ by more than {:e}, more than a share of {}; {}\nsee {}",
            self.name,
            wrong.len(),
            self.tolerance,
            self.outliers,
            first.join("; "),
            file.display()
        );
    }

    /// Returns the number of pixels that differ by more than the tolerance, and of those that have an expected value.
    /// For controls.
    pub fn count(&self, found: &[f32], expected: impl Fn(usize, usize) -> Option<f64>) -> [usize; 2] {
        let of_pixel = |(k, &found): (usize, &f32)| {
            let expected = expected(k % self.size[0], k / self.size[0])?;
            let found = f64::from(found);
            Some(!(found == expected || (found - expected).abs() <= self.tolerance))
        };
        let compared: Vec<bool> = found.iter().enumerate().filter_map(of_pixel).collect();
        [compared.iter().filter(|wrong| **wrong).count(), compared.len()]
    }

    /// Asserts that an image equals another image within the tolerances.
    #[track_caller]
    pub fn assert_same(&self, found: &[f32], expected: &[f32]) {
        assert_eq!(found.len(), expected.len(), "{}: number of pixels", self.name);
        self.assert_matches(found, |x, y| Some(f64::from(expected[y * self.size[0] + x])));
    }

    /// Writes an image that is white where pixels differ, beside the test binary.
    fn write_difference(&self, wrong: &[(usize, f64, f64)]) -> PathBuf {
        let [width, height] = self.size;
        let mut difference = image::GrayImage::new(width as u32, height as u32);
        for (k, ..) in wrong {
            difference.put_pixel((k % width) as u32, (k / width) as u32, image::Luma([255]));
        }
        let folder = std::env::current_exe().unwrap().with_file_name("image-differences");
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join(format!("{}.png", self.name.replace(|c: char| !c.is_alphanumeric(), "_")));
        difference.save(&file).unwrap();
        file
    }
}
