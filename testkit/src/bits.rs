//! Bit-for-bit comparison of numbers: `NaN` equals itself, and `0.0` differs from `-0.0`.

use std::fmt::Debug;

/// Numbers with a bit pattern.
pub trait Bits: Copy + Debug {
    /// The bit pattern, in the low bits.
    fn bits(self) -> u64;
}

macro_rules! numbers {
    ($($number:ty => $bits:expr;)*) => {
        $(impl Bits for $number {
            fn bits(self) -> u64 {
                ($bits)(self)
            }
        })*
    };
}

numbers! {
    f64 => f64::to_bits;
    f32 => |x: f32| u64::from(x.to_bits());
    u8 => u64::from;
    u32 => u64::from;
    u64 => |x| x;
    i32 => |x: i32| u64::from(x.cast_unsigned());
}

/// Returns the bit patterns of all elements of a slice, vector or array.
pub fn bits<'a, T: Bits + 'a>(values: impl IntoIterator<Item = &'a T>) -> Vec<u64> {
    values.into_iter().map(|value| value.bits()).collect()
}

/// Asserts that both sequences have the same bits.
#[track_caller]
pub fn assert_same_bits<'a, T: Bits + 'a>(
    what: &str,
    found: impl IntoIterator<Item = &'a T>,
    expected: impl IntoIterator<Item = &'a T>,
) {
    let (found, expected): (Vec<T>, Vec<T>) =
        (found.into_iter().copied().collect(), expected.into_iter().copied().collect());
    assert_eq!(found.len(), expected.len(), "{what}: lengths");
    let differs = (0..found.len()).find(|&k| found[k].bits() != expected[k].bits());
    if let Some(k) = differs {
        panic!("{what}: element {k} of {} is {:?}, expected {:?}", found.len(), found[k], expected[k]);
    }
}
