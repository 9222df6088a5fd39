//! Operations of an instruction set, and lane types with operators.

use super::{DOUBLES, LANES};
use fearless_simd::{Bytes, SimdBase, SimdFloat, SimdInt, SimdMask};
use std::ops::{Add, AddAssign, BitAnd, BitAndAssign, BitOr, BitOrAssign, Div, Mul, Neg, Not, Sub};

/// Declares the operations of an instruction set, and implements them by the SIMD library.
macro_rules! operations {
    ($($name:ident($($arg:ident: $A:ident),*) -> $R:ident = $body:expr;)*) => {
        /// An instruction set.
        pub(crate) trait Simd: Copy + 'static {
            /// Sixteen numbers.
            type F: Copy;
            /// Sixteen integers.
            type I: Copy;
            /// Sixteen ids.
            type U: Copy;
            /// Sixteen booleans.
            type M: Copy;
            /// Eight numbers of double precision.
            type D: Copy;
            /// Eight booleans.
            type N: Copy;
            /// Four numbers.
            type F4: Copy;
            /// Eight numbers.
            type F8: Copy;

            /// Calls `f`; code inlined into `f` is compiled for this instruction set.
            fn vectorize<R>(self, f: impl FnOnce() -> R) -> R;
            fn splat(self, x: f32) -> Self::F;
            fn splat_i(self, x: i32) -> Self::I;
            fn splat_u(self, x: u32) -> Self::U;
            fn load(self, x: &[f32; LANES]) -> Self::F;
            fn load_i(self, x: &[i32; LANES]) -> Self::I;
            fn load_u(self, x: &[u32; LANES]) -> Self::U;
            fn array(x: Self::F) -> [f32; LANES];
            fn array_i(x: Self::I) -> [i32; LANES];
            fn array_u(x: Self::U) -> [u32; LANES];
            fn bits(m: Self::M) -> u64;
            fn splat_d(self, x: f64) -> Self::D;
            fn load_d(self, x: &[f64; DOUBLES]) -> Self::D;
            fn array_d(x: Self::D) -> [f64; DOUBLES];
            fn bits_n(m: Self::N) -> u64;
            fn splat_4(self, x: f32) -> Self::F4;
            fn splat_8(self, x: f32) -> Self::F8;
            fn load_4(self, x: &[f32; 4]) -> Self::F4;
            fn load_8(self, x: &[f32; 8]) -> Self::F8;
            fn array_4(x: Self::F4) -> [f32; 4];
            fn array_8(x: Self::F8) -> [f32; 8];
            /// The lower and the upper halves of sixteen pairs.
            fn halves(self, pairs: &[u64; LANES]) -> [Self::I; 2];
            $(fn $name($($arg: Self::$A),*) -> Self::$R;)*
        }

        impl<T: fearless_simd::Simd> Simd for T {
            type F = fearless_simd::f32x16<T>;
            type I = fearless_simd::i32x16<T>;
            type U = fearless_simd::u32x16<T>;
            type M = fearless_simd::mask32x16<T>;
            type D = fearless_simd::f64x8<T>;
            type N = fearless_simd::mask64x8<T>;
            type F4 = fearless_simd::f32x4<T>;
            type F8 = fearless_simd::f32x8<T>;

            #[inline(always)]
            fn vectorize<R>(self, f: impl FnOnce() -> R) -> R {
                fearless_simd::Simd::vectorize(self, f)
            }
            #[inline(always)]
            fn splat(self, x: f32) -> Self::F {
                SimdBase::splat(self, x)
            }
            #[inline(always)]
            fn splat_i(self, x: i32) -> Self::I {
                SimdBase::splat(self, x)
            }
            #[inline(always)]
            fn splat_u(self, x: u32) -> Self::U {
                SimdBase::splat(self, x)
            }
            #[inline(always)]
            fn load(self, x: &[f32; LANES]) -> Self::F {
                SimdBase::from_slice(self, x)
            }
            #[inline(always)]
            fn load_i(self, x: &[i32; LANES]) -> Self::I {
                SimdBase::from_slice(self, x)
            }
            #[inline(always)]
            fn load_u(self, x: &[u32; LANES]) -> Self::U {
                SimdBase::from_slice(self, x)
            }
            #[inline(always)]
            fn array(x: Self::F) -> [f32; LANES] {
                *x
            }
            #[inline(always)]
            fn array_i(x: Self::I) -> [i32; LANES] {
                *x
            }
            #[inline(always)]
            fn array_u(x: Self::U) -> [u32; LANES] {
                *x
            }
            #[inline(always)]
            fn bits(m: Self::M) -> u64 {
                SimdMask::to_bitmask(m)
            }
            #[inline(always)]
            fn splat_d(self, x: f64) -> Self::D {
                SimdBase::splat(self, x)
            }
            #[inline(always)]
            fn load_d(self, x: &[f64; DOUBLES]) -> Self::D {
                SimdBase::from_slice(self, x)
            }
            #[inline(always)]
            fn array_d(x: Self::D) -> [f64; DOUBLES] {
                *x
            }
            #[inline(always)]
            fn bits_n(m: Self::N) -> u64 {
                SimdMask::to_bitmask(m)
            }
            #[inline(always)]
            fn splat_4(self, x: f32) -> Self::F4 {
                SimdBase::splat(self, x)
            }
            #[inline(always)]
            fn splat_8(self, x: f32) -> Self::F8 {
                SimdBase::splat(self, x)
            }
            #[inline(always)]
            fn load_4(self, x: &[f32; 4]) -> Self::F4 {
                SimdBase::from_slice(self, x)
            }
            #[inline(always)]
            fn load_8(self, x: &[f32; 8]) -> Self::F8 {
                SimdBase::from_slice(self, x)
            }
            #[inline(always)]
            fn array_4(x: Self::F4) -> [f32; 4] {
                *x
            }
            #[inline(always)]
            fn array_8(x: Self::F8) -> [f32; 8] {
                *x
            }
            #[inline(always)]
            fn halves(self, pairs: &[u64; LANES]) -> [Self::I; 2] {
                let (a, b) = pairs.split_at(LANES / 2);
                let a: fearless_simd::u64x8<T> = SimdBase::from_slice(self, a);
                let b: fearless_simd::u64x8<T> = SimdBase::from_slice(self, b);
                let (a, b) = (Bytes::bitcast(a), Bytes::bitcast(b));
                [self.unzip_low_i32x16(a, b), self.unzip_high_i32x16(a, b)]
            }
            $(#[inline(always)]
            fn $name($($arg: Self::$A),*) -> Self::$R {
                $body
            })*
        }

        /// Calls all operations with many vectors.
        #[cfg(test)]
        pub(super) fn all_results<S: Simd>(s: S) -> Vec<super::tests::Call> {
            use super::tests::{Call, choices, kind::{self, Kind}};
            let mut calls = Vec::new();
            // A function for each operation: compilers need minutes for one function with all.
            $({
                #[inline(never)]
                fn $name<S: Simd>(s: S, choice: [usize; 3]) -> Call {
                    let mut choice = choice.into_iter();
                    $(
                        let $arg = choice.next().unwrap_or_default();
                    )*
                    let arguments = vec![$(<kind::$A as Kind<S>>::bits(<kind::$A as Kind<S>>::vector(s, $arg))),*];
                    $(
                        let $arg = <kind::$A as Kind<S>>::vector(s, $arg);
                    )*
                    let result = s.vectorize(#[inline(always)] || S::$name($($arg),*));
                    Call { operation: stringify!($name), arguments, result: <kind::$R as Kind<S>>::bits(result) }
                }
                calls.extend(choices().map(|choice| $name(s, choice)));
            })*
            calls
        }
    };
}

operations! {
    add(a: F, b: F) -> F = a + b;
    sub(a: F, b: F) -> F = a - b;
    mul(a: F, b: F) -> F = a * b;
    div(a: F, b: F) -> F = a / b;
    neg(a: F) -> F = -a;
    sqrt(a: F) -> F = SimdFloat::sqrt(a);
    // Only for numbers in the range of i32.
    to_int(a: F) -> I = SimdFloat::to_int(a);
    lt(a: F, b: F) -> M = SimdBase::simd_lt(a, b);
    le(a: F, b: F) -> M = SimdBase::simd_le(a, b);
    eq(a: F, b: F) -> M = SimdBase::simd_eq(a, b);
    add_i(a: I, b: I) -> I = a + b;
    mul_i(a: I, b: I) -> I = a * b;
    or_i(a: I, b: I) -> I = a | b;
    // The lowest, second and third byte as a number.
    byte0(a: I) -> F = SimdInt::to_float(a & 255);
    byte1(a: I) -> F = SimdInt::to_float((a >> 8) & 255);
    byte2(a: I) -> F = SimdInt::to_float((a >> 16) & 255);
    ge_i(a: I, b: I) -> M = SimdBase::simd_ge(a, b);
    add_u(a: U, b: U) -> U = a + b;
    ge_u(a: U, b: U) -> M = SimdBase::simd_ge(a, b);
    eq_u(a: U, b: U) -> M = SimdBase::simd_eq(a, b);
    and(a: M, b: M) -> M = a & b;
    or(a: M, b: M) -> M = a | b;
    not(a: M) -> M = !a;
    select(m: M, a: F, b: F) -> F = fearless_simd::Select::select(m, a, b);
    select_i(m: M, a: I, b: I) -> I = fearless_simd::Select::select(m, a, b);
    select_u(m: M, a: U, b: U) -> U = fearless_simd::Select::select(m, a, b);
    add_d(a: D, b: D) -> D = a + b;
    sub_d(a: D, b: D) -> D = a - b;
    mul_d(a: D, b: D) -> D = a * b;
    div_d(a: D, b: D) -> D = a / b;
    neg_d(a: D) -> D = -a;
    sqrt_d(a: D) -> D = SimdFloat::sqrt(a);
    lt_d(a: D, b: D) -> N = SimdBase::simd_lt(a, b);
    le_d(a: D, b: D) -> N = SimdBase::simd_le(a, b);
    eq_d(a: D, b: D) -> N = SimdBase::simd_eq(a, b);
    and_n(a: N, b: N) -> N = a & b;
    or_n(a: N, b: N) -> N = a | b;
    not_n(a: N) -> N = !a;
    select_d(m: N, a: D, b: D) -> D = fearless_simd::Select::select(m, a, b);
    add_4(a: F4, b: F4) -> F4 = a + b;
    sub_4(a: F4, b: F4) -> F4 = a - b;
    mul_4(a: F4, b: F4) -> F4 = a * b;
    // Only for numbers other than NaN.
    min_4(a: F4, b: F4) -> F4 = SimdBase::min(a, b);
    max_4(a: F4, b: F4) -> F4 = SimdBase::max(a, b);
    // The last lane of `a`, then all lanes of `b` but the last.
    slide_4(a: F4, b: F4) -> F4 = SimdBase::slide::<3>(a, b);
    add_8(a: F8, b: F8) -> F8 = a + b;
    min_8(a: F8, b: F8) -> F8 = SimdBase::min(a, b);
    slide_8(a: F8, b: F8) -> F8 = SimdBase::slide::<7>(a, b);
}

/// Declares a lane type with operators.
macro_rules! lanes {
    ($(#[$doc:meta])* $Name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $Name<S: Simd> {
            pub(super) s: S,
            pub(super) v: S::$Name,
        }

        impl<S: Simd> $Name<S> {
            #[inline(always)]
            pub(super) fn new(s: S, v: S::$Name) -> Self {
                Self { s, v }
            }
        }
    };
}

lanes! {
    /// Sixteen numbers.
    F
}
lanes! {
    /// Sixteen integers.
    I
}
lanes! {
    /// Sixteen ids.
    U
}
lanes! {
    /// Sixteen booleans.
    M
}
lanes! {
    /// Eight numbers of double precision.
    D
}
lanes! {
    /// Eight booleans.
    N
}
lanes! {
    /// Four numbers.
    F4
}
lanes! {
    /// Eight numbers.
    F8
}

macro_rules! operators {
    ($($Trait:ident $method:ident),*) => {
        $(impl<S: Simd> $Trait for F<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                Self::new(self.s, S::$method(self.v, o.v))
            }
        }
        impl<S: Simd> $Trait<f32> for F<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: f32) -> Self {
                Self::new(self.s, S::$method(self.v, self.s.splat(o)))
            }
        }
        impl<S: Simd> $Trait<F<S>> for f32 {
            type Output = F<S>;
            #[inline(always)]
            fn $method(self, o: F<S>) -> F<S> {
                F::new(o.s, S::$method(o.s.splat(self), o.v))
            }
        })*
    };
}
operators!(Add add, Sub sub, Mul mul, Div div);

impl<S: Simd> Neg for F<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.s, S::neg(self.v))
    }
}

impl<S: Simd> F<S> {
    #[inline(always)]
    pub(crate) fn array(self) -> [f32; LANES] {
        S::array(self.v)
    }
    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self::new(self.s, S::sqrt(self.v))
    }
    /// Rounds towards zero; only for numbers in the range of `i32`.
    #[inline(always)]
    pub(crate) fn to_int(self) -> I<S> {
        I::new(self.s, S::to_int(self.v))
    }
    #[inline(always)]
    pub(crate) fn simd_lt(self, o: Self) -> M<S> {
        M::new(self.s, S::lt(self.v, o.v))
    }
    #[inline(always)]
    pub(crate) fn simd_le(self, o: Self) -> M<S> {
        M::new(self.s, S::le(self.v, o.v))
    }
    #[inline(always)]
    pub(crate) fn simd_gt(self, o: Self) -> M<S> {
        M::new(self.s, S::lt(o.v, self.v))
    }
    #[inline(always)]
    pub(crate) fn simd_ge(self, o: Self) -> M<S> {
        M::new(self.s, S::le(o.v, self.v))
    }
    #[inline(always)]
    pub(crate) fn simd_eq(self, o: Self) -> M<S> {
        M::new(self.s, S::eq(self.v, o.v))
    }
}

impl<S: Simd> I<S> {
    #[inline(always)]
    pub(crate) fn array(self) -> [i32; LANES] {
        S::array_i(self.v)
    }
    #[inline(always)]
    pub(crate) fn simd_ge(self, o: Self) -> M<S> {
        M::new(self.s, S::ge_i(self.v, o.v))
    }
    /// The lowest three bytes as numbers.
    #[inline(always)]
    pub(crate) fn bytes(self) -> [F<S>; 3] {
        [F::new(self.s, S::byte0(self.v)), F::new(self.s, S::byte1(self.v)), F::new(self.s, S::byte2(self.v))]
    }
}

impl<S: Simd> Add for I<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.s, S::add_i(self.v, o.v))
    }
}

impl<S: Simd> Add<i32> for I<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: i32) -> Self {
        Self::new(self.s, S::add_i(self.v, self.s.splat_i(o)))
    }
}

impl<S: Simd> Mul<i32> for I<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: i32) -> Self {
        Self::new(self.s, S::mul_i(self.v, self.s.splat_i(o)))
    }
}

impl<S: Simd> BitOr for I<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        Self::new(self.s, S::or_i(self.v, o.v))
    }
}

impl<S: Simd> U<S> {
    #[inline(always)]
    pub(crate) fn array(self) -> [u32; LANES] {
        S::array_u(self.v)
    }
    #[inline(always)]
    pub(crate) fn simd_eq(self, o: Self) -> M<S> {
        M::new(self.s, S::eq_u(self.v, o.v))
    }
    #[inline(always)]
    pub(crate) fn simd_ge(self, o: Self) -> M<S> {
        M::new(self.s, S::ge_u(self.v, o.v))
    }
    #[inline(always)]
    pub(crate) fn simd_lt(self, o: Self) -> M<S> {
        !self.simd_ge(o)
    }
}

impl<S: Simd> Add for U<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.s, S::add_u(self.v, o.v))
    }
}

impl<S: Simd> AddAssign for F<S> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<S: Simd> M<S> {
    #[inline(always)]
    pub(crate) fn to_bitmask(self) -> u64 {
        S::bits(self.v)
    }
    #[inline(always)]
    pub(crate) fn any_true(self) -> bool {
        S::bits(self.v) != 0
    }
    #[inline(always)]
    pub(crate) fn all_true(self) -> bool {
        S::bits(self.v) == 0xffff
    }
}

impl<S: Simd> BitAnd for M<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        Self::new(self.s, S::and(self.v, o.v))
    }
}

impl<S: Simd> BitOr for M<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        Self::new(self.s, S::or(self.v, o.v))
    }
}

impl<S: Simd> Not for M<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self::new(self.s, S::not(self.v))
    }
}

impl<S: Simd> BitAndAssign for M<S> {
    #[inline(always)]
    fn bitand_assign(&mut self, o: Self) {
        *self = *self & o;
    }
}

impl<S: Simd> BitOrAssign for M<S> {
    #[inline(always)]
    fn bitor_assign(&mut self, o: Self) {
        *self = *self | o;
    }
}
