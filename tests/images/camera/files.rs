//! Files that the examples write, checked byte by byte against their formats.

use kinetoscope::ndarray::{Array, Dimension, arr1, arr2, arr3};
use kinetoscope::scene::npy;
use kinetoscope_testkit::urdf::TempFiles;

#[path = "../../../examples/launcher/cloud.rs"]
#[allow(dead_code, reason = "examples use the rest")]
mod ply;

/// The type that `super` provides to `ply` in the examples.
type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Names, types and order of the elements follow Greg Turk, The PLY Polygon File Format, 1994; numbers are IEEE 754.
#[test]
fn ply_bytes() {
    let points = [([0.5, -1.0, 2.0], [1, 2, 3]), ([0.0, 0.25, -4.0], [255, 0, 128])];
    let data = b"\x00\x00\x00\x3f\x00\x00\x80\xbf\x00\x00\x00\x40\x01\x02\x03\
                 \x00\x00\x00\x00\x00\x00\x80\x3e\x00\x00\x80\xc0\xff\x00\x80";
    let folder = TempFiles::default();
    for count in [2, 1, 0] {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
             property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
        );
        let path = folder.folder().join("points.ply");
        ply::write_ply(&path, &points[..count]).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), [header.as_bytes(), &data[..15 * count]].concat());
    }
    let nowhere = ply::write_ply(&folder.folder().join("no/such/folder.ply"), &points).unwrap_err();
    assert!(nowhere.to_string().contains("folder.ply"), "{nowhere}");
}

/// Compares an array with the bytes of `numpy.save` (2.x): the dictionary is padded with spaces to byte 127 and ends
/// with a line feed.
#[track_caller]
fn check_npy<S: npy::NpyElement, D: Dimension>(array: &Array<S, D>, [kind, shape]: [&str; 2], data: &[u8]) {
    let dictionary = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let mut expected = b"\x93NUMPY\x01\x00v\x00".to_vec();
    expected.extend_from_slice(format!("{dictionary:<117}\n").as_bytes());
    expected.extend_from_slice(data);
    let mut written = Vec::new();
    npy::write(&mut written, array).unwrap();
    assert_eq!(written, expected);
}

#[test]
fn npy_as_numpy_writes() {
    let data = b"\x00\x00\x00\x00\x00\x00\x80?\x00\x00\x00@\x00\x00@@\x00\x00\x80@\x00\x00\xa0@";
    check_npy(&arr2(&[[0.0_f32, 1.0, 2.0], [3.0, 4.0, 5.0]]), ["<f4", "2, 3"], data);
    check_npy(&arr1(&[1_i32, -2]), ["<i4", "2,"], b"\x01\x00\x00\x00\xfe\xff\xff\xff");
    check_npy(&arr3(&[[[255_u8]]]), ["|u1", "1, 1, 1"], b"\xff");
    check_npy(&arr2::<u8, 4>(&[]), ["|u1", "0, 4"], b"");
    check_npy(&arr1(&[-2.5_f64]), ["<f8", "1,"], b"\x00\x00\x00\x00\x00\x00\x04\xc0");
    // An array with Fortran order in memory is written in C order.
    let turned = arr2(&[[0, 2], [1, 3]]).reversed_axes();
    assert!(!turned.is_standard_layout());
    check_npy(&turned, ["<i4", "2, 2"], b"\x00\x00\x00\x00\x01\x00\x00\x00\x02\x00\x00\x00\x03\x00\x00\x00");
}
