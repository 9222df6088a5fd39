//! Eight lanes of double precision: operators, and vectors of three coordinates.

use super::{D, DOUBLES, N, Simd};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

macro_rules! operators {
    ($($Trait:ident $method:ident $op:ident),*) => {
        $(impl<S: Simd> $Trait for D<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                Self::new(self.s, S::$op(self.v, o.v))
            }
        }
        impl<S: Simd> $Trait<f64> for D<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: f64) -> Self {
                Self::new(self.s, S::$op(self.v, self.s.splat_d(o)))
            }
        })*
    };
}
operators!(Add add add_d, Sub sub sub_d, Mul mul mul_d, Div div div_d);

impl<S: Simd> Neg for D<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.s, S::neg_d(self.v))
    }
}

impl<S: Simd> D<S> {
    /// The same number in all lanes.
    #[inline(always)]
    pub(crate) fn splat(s: S, x: f64) -> Self {
        Self::new(s, s.splat_d(x))
    }
    #[inline(always)]
    pub(crate) fn load(s: S, x: &[f64; DOUBLES]) -> Self {
        Self::new(s, s.load_d(x))
    }
    #[inline(always)]
    pub(crate) fn array(self) -> [f64; DOUBLES] {
        S::array_d(self.v)
    }
    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self::new(self.s, S::sqrt_d(self.v))
    }
    #[inline(always)]
    pub(crate) fn lt(self, o: Self) -> N<S> {
        N::new(self.s, S::lt_d(self.v, o.v))
    }
    #[inline(always)]
    pub(crate) fn le(self, o: Self) -> N<S> {
        N::new(self.s, S::le_d(self.v, o.v))
    }
    #[inline(always)]
    pub(crate) fn eq(self, o: Self) -> N<S> {
        N::new(self.s, S::eq_d(self.v, o.v))
    }
    /// The smaller number; the second one if either is NaN.
    #[inline(always)]
    pub(crate) fn min(self, o: Self) -> Self {
        self.lt(o).select(self, o)
    }
    /// The larger number; the second one if either is NaN.
    #[inline(always)]
    pub(crate) fn max(self, o: Self) -> Self {
        o.lt(self).select(self, o)
    }
    /// Absolute value.
    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        self.max(-self)
    }
    /// The smallest lane; no lane may be NaN.
    #[inline(always)]
    pub(crate) fn reduce_min(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.array();
        let min = |a: f64, b: f64| if a < b { a } else { b };
        min(min(min(a, b), min(c, d)), min(min(e, f), min(g, h)))
    }
    /// The largest lane; no lane may be NaN.
    #[inline(always)]
    pub(crate) fn reduce_max(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.array();
        let max = |a: f64, b: f64| if a > b { a } else { b };
        max(max(max(a, b), max(c, d)), max(max(e, f), max(g, h)))
    }
}

impl<S: Simd> N<S> {
    /// A bit for each lane, the first lane in the lowest bit.
    #[inline(always)]
    pub(crate) fn to_bitmask(self) -> u64 {
        S::bits_n(self.v)
    }
    /// `a` where the mask is set, else `b`.
    #[inline(always)]
    pub(crate) fn select(self, a: D<S>, b: D<S>) -> D<S> {
        D::new(a.s, S::select_d(self.v, a.v, b.v))
    }
}

impl<S: Simd> BitAnd for N<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        Self::new(self.s, S::and_n(self.v, o.v))
    }
}

impl<S: Simd> BitOr for N<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        Self::new(self.s, S::or_n(self.v, o.v))
    }
}

impl<S: Simd> Not for N<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self::new(self.s, S::not_n(self.v))
    }
}

/// Three coordinates of eight points.
pub(crate) type D3<S> = [D<S>; 3];

/// Evaluates `of` for each axis. [`std::array`](std::array) is not always inlined, and then compiled without the
/// instruction set. For the same reason, closures over vectors are `#[inline(always)]`.
#[inline(always)]
pub(crate) fn axes<T>(of: impl Fn(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

/// Loads three coordinates of eight points.
#[inline(always)]
pub(crate) fn load_3<S: Simd>(s: S, x: &[[f64; DOUBLES]; 3]) -> D3<S> {
    [D::load(s, &x[0]), D::load(s, &x[1]), D::load(s, &x[2])]
}

/// SIMD version of [`dot`](kinetoscope_scene::vector::dot), to the bit.
#[inline(always)]
pub(crate) fn dot_3<S: Simd>(a: D3<S>, b: D3<S>) -> D<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
