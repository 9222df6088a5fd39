//! NumPy's `.npy` array format, version 1.0, as described in `numpy.lib.format`.

use ndarray::{ArrayBase, Data, Dimension};
use std::fmt::Write as _;
use std::io::{self, Write};

/// Alignment of the data \[bytes\].
const ALIGN: usize = 64;
/// Length of magic, version and header length \[bytes\].
const PREAMBLE_LEN: usize = 10;
const MAGIC: &[u8; 8] = b"\x93NUMPY\x01\x00";

/// Type of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElementType {
    /// Unsigned 8-bit integers: color and albedo.
    U8,
    /// Signed 32-bit integers: mask ids.
    I32,
    /// Single precision: images such as depth.
    F32,
    /// Double precision: states and sensors.
    F64,
}

impl ElementType {
    /// Size of a number \[bytes\].
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// NumPy's type descriptor: byte order, kind and size.
    pub fn descr(self) -> &'static str {
        match self {
            Self::U8 => "|u1",
            Self::I32 => "<i4",
            Self::F32 => "<f4",
            Self::F64 => "<f8",
        }
    }
}

/// Types of numbers in array files: `u8`, `i32`, `f32` and `f64`.
pub trait NpyElement: Copy {
    /// Element type in the file.
    const ELEMENT: ElementType;

    /// Appends the number as little-endian bytes.
    fn append_le_bytes(self, bytes: &mut Vec<u8>);
}

macro_rules! numbers {
    ($($number:ty: $element:ident),*) => {$(
        impl NpyElement for $number {
            const ELEMENT: ElementType = ElementType::$element;

            fn append_le_bytes(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

numbers!(u8: U8, i32: I32, f32: F32, f64: F64);

/// Writes a `.npy` file with the values of `array` in C order, independent of their order in memory.
///
/// # Errors
/// `to` cannot be written, or the array has more axes than the format supports.
pub fn write<S, D>(to: &mut impl Write, array: &ArrayBase<S, D>) -> io::Result<()>
where
    S: Data,
    S::Elem: NpyElement,
    D: Dimension,
{
    let head = header(S::Elem::ELEMENT, array.shape());
    to.write_all(&head.ok_or_else(|| io::Error::other("more axes than the .npy format supports"))?)?;
    let mut bytes = Vec::with_capacity(array.len() * size_of::<S::Elem>());
    for &number in array {
        number.append_le_bytes(&mut bytes);
    }
    to.write_all(&bytes)
}

/// Returns the file header of an array in C order; `None` for more axes than the format supports.
pub fn header(element: ElementType, shape: &[usize]) -> Option<Vec<u8>> {
    let mut axes = String::new();
    for (k, length) in shape.iter().enumerate() {
        // Writing to a `String` does not fail. Python writes (2,) and (2, 3).
        let _ = write!(axes, "{}{length}", if k == 0 { "" } else { ", " });
    }
    if shape.len() == 1 {
        axes.push(',');
    }
    let mut text = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({axes}), }}", element.descr());
    // One byte is for the newline.
    let whole = (PREAMBLE_LEN + text.len() + 1).next_multiple_of(ALIGN);
    text.extend(std::iter::repeat_n(' ', whole - PREAMBLE_LEN - text.len() - 1));
    text.push('\n');
    let length = u16::try_from(text.len()).ok()?;
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(&length.to_le_bytes());
    bytes.extend_from_slice(text.as_bytes());
    Some(bytes)
}

/// Parses a `.npy` file of version 1.0 in C order: type descriptor, shape, and all bytes after the header. The number
/// of these bytes is not checked. `None` for other files, such as those in Fortran order.
pub fn parse(bytes: &[u8]) -> Option<(&str, Vec<usize>, &[u8])> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let (length, rest) = rest.split_first_chunk::<2>()?;
    let (text, data) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
    let text = std::str::from_utf8(text).ok()?;
    let after = |key: &str| text.split_once(key).map(|(_, rest)| rest);
    after("'fortran_order': False")?;
    let descr = after("'descr': '")?.split('\'').next()?;
    let axes = after("'shape': (")?.split(')').next()?;
    let shape = axes.split(',').map(str::trim).filter(|axis| !axis.is_empty()).map(|axis| axis.parse().ok());
    Some((descr, shape.collect::<Option<Vec<usize>>>()?, data))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn headers() {
        // numpy.save writes these bytes for zeros((2,), float64) and zeros((2, 3, 4), float32), without the data.
        let one = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }";
        let header_of_one = header(ElementType::F64, &[2]).unwrap();
        assert_eq!(&header_of_one[..one.len()], one);
        assert_eq!((header_of_one.len(), header_of_one.last()), (128, Some(&b'\n')));
        let three = header(ElementType::F32, &[2, 3, 4]).unwrap();
        assert!(String::from_utf8_lossy(&three).contains("'<f4', 'fortran_order': False, 'shape': (2, 3, 4), }"));
        assert_eq!(parse(&three), Some(("<f4", vec![2, 3, 4], &[][..])));
        assert_eq!(parse(&header_of_one).unwrap().1, [2]);
        assert_eq!(parse(&one[..20]), None);
        let fortran = String::from_utf8_lossy(&three[10..]).replace("False", "True ");
        assert_eq!(parse(&[&three[..10], fortran.as_bytes()].concat()), None);
    }
}
