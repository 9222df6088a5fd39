//! Comparison of two example runs: depth and mask arrays of different renderers must agree.

use std::fs;
use std::path::Path;

/// Relative tolerance of depths \[m/m\]: single-precision rounding of rays, at the slants of the examples.
const DEPTH_TOLERANCE: f32 = 1e-4;
/// Largest relative depth difference of neighboring pixels on one surface.
const MAX_DEPTH_STEP: f32 = 0.1;

/// Checks that two folders have files of the same names, and the same `depth*.npy` and `mask*.npy` off silhouettes. If
/// `different_lighting` is true, the renderers have different lighting, and the color images must differ.
pub(crate) fn check(ours: &Path, other: &Path, different_lighting: bool) -> Result<(), String> {
    let names = |folder: &Path| -> Result<Vec<String>, String> {
        let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut names: Vec<String> = entries.flatten().filter_map(|e| e.file_name().into_string().ok()).collect();
        names.sort();
        Ok(names)
    };
    let (here, there) = (names(ours)?, names(other)?);
    if here != there {
        return Err(format!("{} has {here:?}, {} has {there:?}", ours.display(), other.display()));
    }
    let depths: Vec<&String> = here.iter().filter(|name| name.starts_with("depth") && name.ends_with(".npy")).collect();
    if depths.is_empty() {
        return Err(format!("{} has no depth*.npy", ours.display()));
    }
    for depth in depths {
        let mask = depth.replacen("depth", "mask", 1);
        let seen = |folder: &Path| Ok::<_, String>((array(&folder.join(depth))?, array(&folder.join(&mask))?));
        let (compared, different) = compare(&seen(ours)?, &seen(other)?)?;
        if compared == 0 || different > 0 {
            return Err(format!(
                "{depth} and {mask} of {} and {} differ at {different} of {compared} pixels off silhouettes",
                ours.display(),
                other.display()
            ));
        }
    }
    let read = |folder: &Path, name: &String| fs::read(folder.join(name)).map_err(|e| format!("{name}: {e}"));
    for image in
        here.iter().filter(|name| different_lighting && (name.starts_with("color") || name.starts_with("sensor_views")))
    {
        if read(ours, image)? == read(other, image)? {
            return Err(format!("{image} of {} and {} are the same image", ours.display(), other.display()));
        }
    }
    Ok(())
}

/// An array of four-byte numbers: its shape, and their bits.
type Array = (Vec<usize>, Vec<u32>);

/// Reads an array written by an example, in version 1.0 of NumPy's format.
fn array(path: &Path) -> Result<Array, String> {
    let wrong = |what: &str| format!("{}: {what}", path.display());
    let bytes = fs::read(path).map_err(|e| wrong(&e.to_string()))?;
    let length =
        bytes.get(8..10).and_then(|b| b.try_into().ok()).map(u16::from_le_bytes).ok_or_else(|| wrong("short"))?;
    let (header, data) = bytes.split_at_checked(10 + usize::from(length)).ok_or_else(|| wrong("short"))?;
    let header = String::from_utf8_lossy(header);
    if !header.contains("'<f4'") && !header.contains("'<i4'") {
        return Err(wrong("not of numbers of four bytes"));
    }
    let shape = header.split_once("'shape': (").and_then(|(_, rest)| rest.split_once(')')).map(|(shape, _)| shape);
    let shape = shape.ok_or_else(|| wrong("no shape"))?.split(',').map(str::trim).filter(|n| !n.is_empty());
    let shape: Vec<usize> = shape.map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong("no shape"))?;
    let numbers: Vec<u32> = data.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
    if numbers.len() != shape.iter().product::<usize>() || shape.len() < 2 {
        return Err(wrong("a shape of other numbers"));
    }
    Ok((shape, numbers))
}

/// Numbers of compared and of differing pixels. Compared pixels are off silhouettes: in both images, the pixel and its
/// eight neighbors show one object and one surface.
fn compare(ours: &(Array, Array), other: &(Array, Array)) -> Result<(usize, usize), String> {
    let ((shape, _), _) = ours;
    if [&ours.1.0, &other.0.0, &other.1.0].into_iter().any(|other| other != shape) {
        return Err(format!("shapes differ from {shape:?}"));
    }
    let [.., height, width] = shape[..] else { return Err("not images".into()) };
    let images = shape.iter().product::<usize>() / (height * width).max(1);
    let near = |a: f32, b: f32, part: f32| a == b || (a - b).abs() <= part * a.abs();
    let (mut compared, mut different) = (0, 0);
    for image in 0..images {
        for (y, x) in (1..height.max(2) - 1).flat_map(|y| (1..width.max(2) - 1).map(move |x| (y, x))) {
            let at = |y: usize, x: usize| (image * height + y) * width + x;
            let k = at(y, x);
            let whole = |((_, depth), (_, mask)): &(Array, Array)| {
                (0..9).all(|n| {
                    let n = at(y + n / 3 - 1, x + n % 3 - 1);
                    mask[n] == mask[k] && near(f32::from_bits(depth[k]), f32::from_bits(depth[n]), MAX_DEPTH_STEP)
                })
            };
            if whole(ours) && whole(other) {
                let [a, b] = [ours, other].map(|seen| f32::from_bits(seen.0.1[k]));
                compared += 1;
                different += usize::from(ours.1.1[k] != other.1.1[k] || !near(a, b, DEPTH_TOLERANCE));
            }
        }
    }
    Ok((compared, different))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with an image of 6 x 4 pixels: objects 7 and 8 side by side, at 2 and 3 m.
    fn folder(shift: f32, id: i32, color: &str) -> tempfile::TempDir {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let write = |name: &str, descr: &str, numbers: Vec<[u8; 4]>| {
            let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 4, 6), }}\n");
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.as_bytes());
            bytes.extend(numbers.concat());
            fs::write(dir.path().join(name), bytes).expect("writable");
        };
        let left = |k: &usize| k % 6 < 3;
        write(
            "depth_0.npy",
            "<f4",
            (0..24).map(|k| if left(&k) { 2.0f32 } else { 3.0 + shift }.to_le_bytes()).collect(),
        );
        write("mask_0.npy", "<i4", (0..24).map(|k| if left(&k) { 7i32 } else { id }.to_le_bytes()).collect());
        fs::write(dir.path().join("color.png"), color).expect("writable");
        dir
    }

    #[test]
    fn same_things_in_other_colors() {
        let ours = folder(0.0, 8, "ours");
        // In two rows, two columns of pixels are off silhouettes.
        let seen = |dir: &tempfile::TempDir| {
            let read = |name: &str| array(&dir.path().join(name)).expect("an array");
            (read("depth_0.npy"), read("mask_0.npy"))
        };
        assert_eq!(compare(&seen(&ours), &seen(&folder(0.0, 8, ""))), Ok((4, 0)));
        assert_eq!(compare(&seen(&ours), &seen(&folder(0.001, 8, ""))), Ok((4, 2)));
        assert_eq!(check(ours.path(), folder(0.0, 8, "ours").path(), false), Ok(()));
        let verdict = |other: tempfile::TempDir| check(ours.path(), other.path(), true);
        assert_eq!(verdict(folder(0.0002, 8, "other")), Ok(()));
        let said = |other| verdict(other).expect_err("they differ");
        assert!(said(folder(0.001, 8, "other")).contains("differ at 2 of 4 pixels"));
        assert!(said(folder(0.0, 9, "other")).contains("differ at 2 of 4 pixels"));
        assert!(said(folder(0.0, 8, "ours")).contains("are the same image"));
        assert!(said(tempfile::tempdir().expect("a scratch folder")).contains("has []"));
    }
}
