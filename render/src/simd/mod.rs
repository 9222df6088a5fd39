//! SIMD abstraction: sixteen lanes of single precision, eight of double precision, and narrower ones. The only module
//! that depends on the SIMD library.
//!
//! Only operations that IEEE 754 defines to the bit are used (add, subtract, multiply, divide, square root, compare),
//! and never fused: so every instruction set gives the same image. [`Scalar`] is the reference: plain loops. Tests compare
//! each operation of every instruction set with it. The renderer draws with it only on targets whose baseline has no known
//! vectors: for x86-64 it would be a third of the code. (The library has a scalar level of its own, but inlining
//! sixteen-wide loops everywhere took over ten minutes to compile.)

mod double;
mod narrow;
mod scalar;
#[cfg(test)]
mod tests;
mod vector;

pub(crate) use double::{D3, axes, dot_3, load_3};
pub(crate) use fearless_simd::Level as BackendLevel;
pub(crate) use scalar::Scalar;
pub(crate) use vector::{D, F, F4, F8, I, M, N, Simd, U};

/// An instruction set of this machine.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SimdLevel {
    /// Plain loops.
    #[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
    Scalar,
    /// A level of the SIMD library.
    Simd(BackendLevel),
}

impl SimdLevel {
    /// The best level of this machine.
    pub(crate) fn best() -> Self {
        let level = BackendLevel::new();
        #[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
        if level.is_fallback() {
            return Self::Scalar;
        }
        Self::Simd(level)
    }
}

/// Runs generic code with the instruction set of a level: AVX-512, AVX2, the machine's baseline, or plain loops.
///
/// One level fewer than the library's own `dispatch!` (SSE4.2 gains nothing here), because every level is compiled.
macro_rules! at_level {
    ($level:expr, $s:ident => $body:expr) => {
        match $level {
            #[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
            $crate::simd::SimdLevel::Scalar => {
                let $s = $crate::simd::Scalar;
                $body
            }
            $crate::simd::SimdLevel::Simd(level) => $crate::simd::at_simd_level!(level, $s => $body),
        }
    };
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
macro_rules! at_simd_level {
    ($level:ident, $s:ident => $body:expr) => {
        if let Some($s) = $level.as_avx512() {
            $body
        } else if let Some($s) = $level.as_avx2() {
            $body
        } else {
            let $s = $level.as_sse2().expect("a level of the library has SSE2");
            $body
        }
    };
}
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
macro_rules! at_simd_level {
    ($level:ident, $s:ident => $body:expr) => {{
        let $s = $level.as_neon().expect("a level of the library has NEON");
        $body
    }};
}
#[cfg(not(any(target_arch = "x86", target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! at_simd_level {
    ($level:ident, $s:ident => $body:expr) => {{
        let (_, $s) = ($level, $crate::simd::Scalar);
        $body
    }};
}
pub(crate) use {at_level, at_simd_level};

/// Lanes of single precision: 2 rows of 8 pixels.
pub(crate) const LANES: usize = 16;
/// Lanes of double precision.
pub(crate) const DOUBLES: usize = 8;

/// The first sixteen elements of a slice.
#[inline(always)]
pub(crate) fn as_lanes<T>(x: &[T]) -> &[T; LANES] {
    match x.first_chunk() {
        Some(x) => x,
        None => panic!("a slice of fewer than sixteen elements"),
    }
}

/// The first sixteen elements of a slice.
#[inline(always)]
fn as_lanes_mut<T>(x: &mut [T]) -> &mut [T; LANES] {
    match x.first_chunk_mut() {
        Some(x) => x,
        None => panic!("a slice of fewer than sixteen elements"),
    }
}

/// The same number in all lanes.
#[inline(always)]
pub(crate) fn splat<S: Simd>(s: S, x: f32) -> F<S> {
    F::new(s, s.splat(x))
}

/// The same integer in all lanes.
#[inline(always)]
pub(crate) fn splat_i<S: Simd>(s: S, x: i32) -> I<S> {
    I::new(s, s.splat_i(x))
}

/// The same id in all lanes.
#[inline(always)]
pub(crate) fn splat_u<S: Simd>(s: S, x: u32) -> U<S> {
    U::new(s, s.splat_u(x))
}

/// Loads sixteen numbers.
#[inline(always)]
pub(crate) fn load<S: Simd>(s: S, x: &[f32]) -> F<S> {
    F::new(s, s.load(as_lanes(x)))
}

/// Loads sixteen integers.
#[inline(always)]
pub(crate) fn load_i<S: Simd>(s: S, x: &[i32]) -> I<S> {
    I::new(s, s.load_i(as_lanes(x)))
}

/// Loads sixteen ids.
#[inline(always)]
pub(crate) fn load_u<S: Simd>(s: S, x: &[u32]) -> U<S> {
    U::new(s, s.load_u(as_lanes(x)))
}

/// The lower and the upper halves of sixteen pairs.
#[inline(always)]
pub(crate) fn halves<S: Simd>(s: S, pairs: &[u64; LANES]) -> [I<S>; 2] {
    let [lower, upper] = s.halves(pairs);
    [I::new(s, lower), I::new(s, upper)]
}

/// Stores sixteen numbers.
#[inline(always)]
pub(crate) fn store<S: Simd>(x: F<S>, to: &mut [f32]) {
    *as_lanes_mut(to) = x.array();
}

/// Stores sixteen ids.
#[inline(always)]
pub(crate) fn store_u<S: Simd>(x: U<S>, to: &mut [u32]) {
    *as_lanes_mut(to) = x.array();
}

/// Stores sixteen integers.
#[inline(always)]
pub(crate) fn store_i<S: Simd>(x: I<S>, to: &mut [i32]) {
    *as_lanes_mut(to) = x.array();
}

/// `a` where the mask is set, else `b`.
#[inline(always)]
pub(crate) fn select<S: Simd>(m: M<S>, a: F<S>, b: F<S>) -> F<S> {
    F::new(a.s, S::select(m.v, a.v, b.v))
}

/// `a` where the mask is set, else `b`.
#[inline(always)]
pub(crate) fn select_i<S: Simd>(m: M<S>, a: I<S>, b: I<S>) -> I<S> {
    I::new(a.s, S::select_i(m.v, a.v, b.v))
}

/// `a` where the mask is set, else `b`.
#[inline(always)]
pub(crate) fn select_u<S: Simd>(m: M<S>, a: U<S>, b: U<S>) -> U<S> {
    U::new(a.s, S::select_u(m.v, a.v, b.v))
}

/// The smaller number; the second one if either is NaN.
#[inline(always)]
pub(crate) fn min<S: Simd>(a: F<S>, b: F<S>) -> F<S> {
    select(a.simd_lt(b), a, b)
}

/// The larger number; the second one if either is NaN.
#[inline(always)]
pub(crate) fn max<S: Simd>(a: F<S>, b: F<S>) -> F<S> {
    select(a.simd_gt(b), a, b)
}

/// Absolute value.
#[inline(always)]
pub(crate) fn abs<S: Simd>(a: F<S>) -> F<S> {
    max(a, -a)
}

/// Square root; 0 for negative numbers.
#[inline(always)]
pub(crate) fn sqrt_or_zero<S: Simd>(s: S, a: F<S>) -> F<S> {
    max(a, splat(s, 0.0)).sqrt()
}

/// Column 0..8 of each lane.
pub(crate) const COLUMN: [f32; LANES] = [0., 1., 2., 3., 4., 5., 6., 7., 0., 1., 2., 3., 4., 5., 6., 7.];
/// Row 0..2 of each lane.
pub(crate) const ROW: [f32; LANES] = [0., 0., 0., 0., 0., 0., 0., 0., 1., 1., 1., 1., 1., 1., 1., 1.];

/// Vectors of sixteen points.
#[derive(Clone, Copy)]
pub(crate) struct V3<S: Simd> {
    pub(crate) x: F<S>,
    pub(crate) y: F<S>,
    pub(crate) z: F<S>,
}

impl<S: Simd> V3<S> {
    #[inline(always)]
    pub(crate) fn splat(s: S, v: [f32; 3]) -> Self {
        Self { x: splat(s, v[0]), y: splat(s, v[1]), z: splat(s, v[2]) }
    }

    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> F<S> {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        Self { x: self.y * o.z - self.z * o.y, y: self.z * o.x - self.x * o.z, z: self.x * o.y - self.y * o.x }
    }

    #[inline(always)]
    pub(crate) fn scale(self, k: F<S>) -> Self {
        Self { x: self.x * k, y: self.y * k, z: self.z * k }
    }

    #[inline(always)]
    pub(crate) fn add(self, o: Self) -> Self {
        Self { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }

    #[inline(always)]
    pub(crate) fn sub(self, o: Self) -> Self {
        Self { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }

    #[inline(always)]
    pub(crate) fn select(m: M<S>, a: Self, b: Self) -> Self {
        Self { x: select(m, a.x, b.x), y: select(m, a.y, b.y), z: select(m, a.z, b.z) }
    }

    /// Rotates by the rows of a matrix.
    #[inline(always)]
    pub(crate) fn rotate(self, r: &[[f32; 3]; 3]) -> Self {
        let row = {
            #[inline(always)]
            |r: &[f32; 3]| self.x * r[0] + self.y * r[1] + self.z * r[2]
        };
        Self { x: row(&r[0]), y: row(&r[1]), z: row(&r[2]) }
    }

    /// Normalizes to length 1; zero vectors stay zero.
    #[inline(always)]
    pub(crate) fn unit(self, s: S) -> Self {
        let length = self.dot(self).sqrt();
        let k = 1.0 / select(length.simd_gt(splat(s, 0.0)), length, splat(s, 1.0));
        self.scale(k)
    }
}

/// All levels of this machine, the baseline first: for tests that all levels give the same bits.
#[cfg(test)]
pub(crate) fn all_levels() -> Vec<SimdLevel> {
    let mut levels = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        let best = BackendLevel::new();
        levels.extend(best.as_sse2().map(|s| SimdLevel::Simd(BackendLevel::Sse2(s))));
        levels.extend(best.as_avx2().map(|s| SimdLevel::Simd(BackendLevel::Avx2(s))));
        if best.as_avx512().is_none() {
            return levels;
        }
    }
    levels.push(SimdLevel::best());
    levels
}
