//! NumPy's `.npy` format, version 1.0, after the documentation of `numpy.lib.format`. `record::npy` writes the same
//! format, but is missing in builds without recordings.

use kinetoscope::ndarray::{ArrayBase, Data, Dimension};
use std::io::{self, Write};

/// A number that an array file can hold.
pub(crate) trait Element: Copy {
    /// NumPy's name of the type: byte order, kind and number of bytes.
    const DESCR: &'static str;

    /// Appends the bytes in little-endian order.
    fn put(self, bytes: &mut Vec<u8>);
}

macro_rules! element {
    ($($number:ty: $descr:literal),*) => {$(
        impl Element for $number {
            const DESCR: &'static str = $descr;

            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

element!(u8: "|u1", i32: "<i4", f32: "<f4", f64: "<f8");

/// Writes the elements of `array` in C order, independent of its memory layout.
pub(crate) fn write<S, D>(to: &mut impl Write, array: &ArrayBase<S, D>) -> io::Result<()>
where
    S: Data,
    S::Elem: Element,
    D: Dimension,
{
    // The data begin at a multiple of 64 bytes: magic and version (8), length of the header (2), header.
    const ALIGN: usize = 64;
    const FIXED: usize = 10;
    let mut shape: String = array.shape().iter().map(|n| format!("{n}, ")).collect();
    // Python writes (2,) and (2, 3).
    shape.truncate(shape.len() - if array.ndim() == 1 { 1 } else { 2.min(shape.len()) });
    let mut header =
        format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({shape}), }}", <S::Elem as Element>::DESCR);
    // One byte is the final line break.
    let padding = (FIXED + header.len() + 1).next_multiple_of(ALIGN) - (FIXED + header.len() + 1);
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let length = u16::try_from(header.len()).map_err(|_| io::Error::other("too many axes for the .npy format"))?;
    to.write_all(b"\x93NUMPY\x01\x00")?;
    to.write_all(&length.to_le_bytes())?;
    to.write_all(header.as_bytes())?;
    let mut bytes = Vec::with_capacity(array.len() * size_of::<S::Elem>());
    for &number in array {
        number.put(&mut bytes);
    }
    to.write_all(&bytes)
}
