//! Arrays that examples write for NumPy, against the bytes that `numpy.save` (2.x) writes for the same arrays.

#[path = "../../../examples/launcher/npy.rs"]
mod writer;

use kinetoscope::ndarray::{Array, Array1, Array2, Array3, arr1, arr2, arr3};

/// What NumPy writes: the dictionary is filled up with spaces to byte 127, and ended with a line feed.
fn file(dictionary: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00v\x00".to_vec();
    bytes.extend_from_slice(format!("{dictionary:<117}\n").as_bytes());
    bytes.extend_from_slice(data);
    bytes
}

fn written<S: writer::Element, D: kinetoscope::ndarray::Dimension>(array: &Array<S, D>) -> Vec<u8> {
    let mut bytes = Vec::new();
    writer::write(&mut bytes, array).unwrap();
    bytes
}

#[test]
fn every_type_and_number_of_axes_is_as_numpy_writes_it() {
    let floats: Array2<f32> = arr2(&[[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
    let data = b"\x00\x00\x00\x00\x00\x00\x80?\x00\x00\x00@\x00\x00@@\x00\x00\x80@\x00\x00\xa0@";
    assert_eq!(written(&floats), file("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }", data));

    let integers: Array1<i32> = arr1(&[1, -2]);
    let data = b"\x01\x00\x00\x00\xfe\xff\xff\xff";
    assert_eq!(written(&integers), file("{'descr': '<i4', 'fortran_order': False, 'shape': (2,), }", data));

    let bytes: Array3<u8> = arr3(&[[[255]]]);
    assert_eq!(written(&bytes), file("{'descr': '|u1', 'fortran_order': False, 'shape': (1, 1, 1), }", b"\xff"));

    let none: Array2<u8> = Array2::zeros((0, 4));
    assert_eq!(written(&none), file("{'descr': '|u1', 'fortran_order': False, 'shape': (0, 4), }", b""));

    let doubles: Array1<f64> = arr1(&[-2.5]);
    let data = b"\x00\x00\x00\x00\x00\x00\x04\xc0";
    assert_eq!(written(&doubles), file("{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }", data));
}

#[test]
fn an_array_that_lies_otherwise_in_memory_is_written_in_c_order() {
    let turned = arr2(&[[0, 2], [1, 3]]).reversed_axes();
    assert!(!turned.is_standard_layout());
    let data = b"\x00\x00\x00\x00\x01\x00\x00\x00\x02\x00\x00\x00\x03\x00\x00\x00";
    assert_eq!(written(&turned), file("{'descr': '<i4', 'fortran_order': False, 'shape': (2, 2), }", data));
}
