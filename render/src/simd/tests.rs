//! Each operation of every instruction set gives the bits of plain loops, and their combinations the expected numbers.

use super::vector::all_results;
use super::{DOUBLES, F, LANES, M, Scalar, Simd, U, all_levels, at_level};
use std::fmt::Debug;

/// Numbers with special rules, and powers of two near the ends of integers and of exact numbers.
const SPECIAL: [f32; 26] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    1.5,
    -2.5,
    255.0,
    256.0,
    16_777_216.0,
    -16_777_217.0,
    2_147_483_500.0,
    -2_147_483_600.0,
    4_294_967_296.0,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    f32::EPSILON,
    1e-45,
    -1e-45,
    1e-40,
    3.4e19,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

/// Number of vectors of each type.
const VECTORS: usize = 40;

/// Bits of vector `v`: special numbers, then all kinds of bit patterns, from a counter.
fn pattern(v: usize, lane: usize) -> u64 {
    let mut x = ((v * 64 + lane) as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^ x >> 29
}

fn float(v: usize, lane: usize) -> f32 {
    let x = pattern(v, lane);
    match v % 4 {
        // Half of the pairs of vectors have lanes in common, for equality.
        0 => SPECIAL[(lane + v) % SPECIAL.len()],
        1 => SPECIAL[(x % SPECIAL.len() as u64) as usize],
        2 => f32::from_bits(x as u32),
        _ => (x as i32 as f32) / (1 << 20) as f32,
    }
}

fn double(v: usize, lane: usize) -> f64 {
    match v % 3 {
        0 => f64::from(float(v, lane)),
        1 => f64::from_bits(pattern(v, lane)),
        _ => (pattern(v, lane) as i64 as f64) / (1u64 << 50) as f64,
    }
}

fn integer(v: usize, lane: usize) -> u32 {
    match v % 3 {
        0 => [0, 1, 2, 255, 256, 0xff_ffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff][(lane + v) % 9],
        1 => (pattern(v, lane) % 9) as u32,
        _ => pattern(v, lane) as u32,
    }
}

/// Types of vectors: their values for tests, and the bits of their lanes. Any NaN counts as the same.
pub(super) mod kind {
    use super::*;

    pub(crate) trait Kind<S: Simd> {
        type Vector: Copy;
        fn vector(s: S, v: usize) -> Self::Vector;
        fn bits(x: Self::Vector) -> Vec<u64>;
    }

    macro_rules! kinds {
        ($($Name:ident: $vector:expr, $bits:expr;)*) => {
            $(pub(crate) struct $Name;
            impl<S: Simd> Kind<S> for $Name {
                type Vector = S::$Name;
                #[inline(never)]
                fn vector(s: S, v: usize) -> S::$Name {
                    let vector: fn(S, usize) -> S::$Name = $vector;
                    vector(s, v)
                }
                #[inline(never)]
                fn bits(x: S::$Name) -> Vec<u64> {
                    let bits: fn(S::$Name) -> Vec<u64> = $bits;
                    bits(x)
                }
            })*
        };
    }

    fn singles(x: &[f32]) -> Vec<u64> {
        x.iter().map(|x| if x.is_nan() { f32::NAN } else { *x }.to_bits().into()).collect()
    }

    fn lanes<T, const N: usize>(v: usize, of: fn(usize, usize) -> T) -> [T; N] {
        std::array::from_fn(|lane| of(v, lane))
    }

    kinds! {
        F: |s, v| s.load(&lanes(v, float)), |x| singles(&S::array(x));
        F4: |s, v| s.load_4(&lanes(v, float)), |x| singles(&S::array_4(x));
        F8: |s, v| s.load_8(&lanes(v, float)), |x| singles(&S::array_8(x));
        D: |s, v| s.load_d(&lanes(v, double)),
            |x| S::array_d(x).map(|x| if x.is_nan() { f64::NAN } else { x }.to_bits()).to_vec();
        I: |s, v| s.load_i(&lanes::<u32, LANES>(v, integer).map(|x| x as i32)),
            |x| S::array_i(x).map(|x| u64::from(x as u32)).to_vec();
        U: |s, v| s.load_u(&lanes(v, integer)), |x| S::array_u(x).map(u64::from).to_vec();
        M: |s, v| S::ge_u(s.load_u(&lanes::<u32, LANES>(v, integer)), s.splat_u(1 << (v % 32))), |x| vec![S::bits(x)];
        N: |s, v| S::lt_d(s.load_d(&lanes::<f64, DOUBLES>(v, double)), s.splat_d(0.25)), |x| vec![S::bits_n(x)];
    }
}

/// Operations with a smaller domain, which their documentation states: true for bits of arguments that belong to it.
fn is_defined(operation: &str, arguments: &[Vec<u64>]) -> impl Fn(usize) -> bool {
    let lane = |k: usize, lane: usize| f32::from_bits(arguments[k][lane] as u32);
    let in_domain: Vec<bool> = (0..arguments[0].len())
        .map(|k| match operation {
            "to_int" => lane(0, k).abs() < 2_147_483_648.0,
            // Of two zeros, either may be returned.
            "min_4" | "max_4" | "min_8" => {
                let (a, b) = (lane(0, k), lane(1, k));
                !(a.is_nan() || b.is_nan() || a == 0.0 && b == 0.0)
            }
            _ => true,
        })
        .collect();
    move |k| in_domain.get(k).copied().unwrap_or(true)
}

/// A call of an operation: its name, and the bits of its arguments and of its result.
pub(super) struct Call {
    pub(super) operation: &'static str,
    pub(super) arguments: Vec<Vec<u64>>,
    pub(super) result: Vec<u64>,
}

/// Pairs and triples of vectors: each with its neighbors, and with itself.
pub(super) fn choices() -> impl Iterator<Item = [usize; 3]> {
    (0..VECTORS).flat_map(|v| [[v, v, v], [v, (v + 4) % VECTORS, (v + 1) % VECTORS], [v, (v + 7) % VECTORS, v]])
}

#[test]
fn operations() {
    let expected = all_results(Scalar);
    let mut names: Vec<&str> = expected.iter().map(|call| call.operation).collect();
    names.dedup();
    assert!(names.len() >= 45 && expected.len() == names.len() * choices().count(), "{names:?}");
    for level in all_levels() {
        let found = at_level!(level, s => all_results(s));
        let mut compared = 0;
        for (found, expected) in found.iter().zip(&expected) {
            let Call { operation, arguments, result } = expected;
            assert_eq!((*operation, arguments), (found.operation, &found.arguments), "{level:?}");
            let is_defined = is_defined(operation, arguments);
            for k in (0..result.len()).filter(|&k| is_defined(k)) {
                assert_eq!(found.result[k], result[k], "{level:?}: {operation}, lane {k} of {arguments:x?}");
                compared += 1;
            }
        }
        assert!(found.len() == expected.len() && compared > 40_000, "{compared}");
    }
}

/// Operations that are not between vectors.
#[test]
fn loads() {
    fn check<T: PartialEq + Debug>(what: &str, found: T, expected: T) {
        assert_eq!(found, expected, "{what}");
    }
    for level in all_levels() {
        at_level!(level, s => s.vectorize(
            #[inline(always)]
            || {
                fn arrays<S: Simd>(s: S) {
                    check("splat", S::array(s.splat(1.25)), [1.25; LANES]);
                    check("splat_i", S::array_i(s.splat_i(-7)), [-7; LANES]);
                    check("splat_u", S::array_u(s.splat_u(u32::MAX)), [u32::MAX; LANES]);
                    check("splat_d", S::array_d(s.splat_d(-1e300)), [-1e300; DOUBLES]);
                    check("splat_4", S::array_4(s.splat_4(3.5)), [3.5; 4]);
                    check("splat_8", S::array_8(s.splat_8(-3.5)), [-3.5; 8]);
                    let [ints, doubles] = [std::array::from_fn(|k| k as i32 - 5), [9; LANES]];
                    check("load_i", S::array_i(s.load_i(&ints)), ints);
                    check("load_u", S::array_u(s.load_u(&ints.map(|x| x as u32))), ints.map(|x| x as u32));
                    check("load", S::array(s.load(&ints.map(|x| x as f32))), ints.map(|x| x as f32));
                    check("load_d", S::array_d(s.load_d(&[1., 2., 3., 4., 5., 6., 7., 8.])), [1., 2., 3., 4., 5., 6., 7., 8.]);
                    check("load_4", S::array_4(s.load_4(&[1., 2., 3., 4.])), [1., 2., 3., 4.]);
                    check("load_8", S::array_8(s.load_8(&[1., 2., 3., 4., 5., 6., 7., 8.])), [1., 2., 3., 4., 5., 6., 7., 8.]);
                    let pairs = ints.map(|x| (x as u32 as u64) | 9 << 32);
                    check("halves", s.halves(&pairs).map(S::array_i), [ints, doubles]);
                    // Bit k is lane k.
                    check("bits", S::bits(S::ge_i(s.load_i(&ints), s.splat_i(5))), 0xfc00);
                    let three = S::lt_d(s.load_d(&[1., 9., 1., 9., 9., 9., 9., 1.]), s.splat_d(2.0));
                    check("bits_n", S::bits_n(three), 0b1000_0101);
                }
                arrays(s);
            }
        ));
    }
}

/// Comparisons that are made of others, and questions about masks.
#[test]
fn comparisons() {
    fn check<S: Simd>(s: S) {
        let numbers: [f32; LANES] = std::array::from_fn(|k| k as f32);
        let (x, y) = (F::new(s, s.load(&numbers)), F::new(s, s.splat(5.0)));
        let ids = U::new(s, s.load_u(&numbers.map(|x| x as u32)));
        let five = U::new(s, s.splat_u(5));
        let found = [x.simd_lt(y), x.simd_le(y), x.simd_gt(y), x.simd_ge(y), x.simd_eq(y)].map(M::to_bitmask);
        assert_eq!(found, [0x001f, 0x003f, 0xffc0, 0xffe0, 0x0020]);
        let found = [ids.simd_lt(five), ids.simd_ge(five), ids.simd_eq(five)].map(M::to_bitmask);
        assert_eq!(found, [0x001f, 0xffe0, 0x0020]);
        let [none, one, most, all] = [x.simd_lt(x), x.simd_eq(y), !x.simd_eq(y), x.simd_ge(x)];
        assert_eq!([none, one, most, all].map(M::any_true), [false, true, true, true]);
        assert_eq!([none, one, most, all].map(M::all_true), [false, false, false, true]);
        assert_eq!((one | none).to_bitmask() | (most & one).to_bitmask(), 0x0020);
    }
    for level in all_levels() {
        at_level!(level, s => check(s));
    }
}
