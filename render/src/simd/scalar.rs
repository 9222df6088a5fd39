//! The reference implementation: plain loops over arrays.

use super::{DOUBLES, LANES, Simd};

/// The level without SIMD instructions, available on every machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scalar;

// Not inlined: in the kernels, the loops would make functions of a hundred thousand instructions.
#[inline(never)]
fn pairs<A: Copy, B: Copy, R, const N: usize>(a: &[A; N], b: &[B; N], f: impl Fn(A, B) -> R) -> [R; N] {
    std::array::from_fn(|k| f(a[k], b[k]))
}

#[inline(never)]
fn choose<T: Copy, const N: usize>(m: &[bool; N], a: &[T; N], b: &[T; N]) -> [T; N] {
    std::array::from_fn(|k| if m[k] { a[k] } else { b[k] })
}

impl Simd for Scalar {
    type F = [f32; LANES];
    type I = [i32; LANES];
    type U = [u32; LANES];
    type M = [bool; LANES];
    type D = [f64; DOUBLES];
    type N = [bool; DOUBLES];
    type F4 = [f32; 4];
    type F8 = [f32; 8];

    fn vectorize<R>(self, f: impl FnOnce() -> R) -> R {
        f()
    }
    fn splat(self, x: f32) -> Self::F {
        [x; LANES]
    }
    fn splat_i(self, x: i32) -> Self::I {
        [x; LANES]
    }
    fn splat_u(self, x: u32) -> Self::U {
        [x; LANES]
    }
    fn load(self, x: &[f32; LANES]) -> Self::F {
        *x
    }
    fn load_i(self, x: &[i32; LANES]) -> Self::I {
        *x
    }
    fn load_u(self, x: &[u32; LANES]) -> Self::U {
        *x
    }
    fn array(x: Self::F) -> [f32; LANES] {
        x
    }
    fn array_i(x: Self::I) -> [i32; LANES] {
        x
    }
    fn array_u(x: Self::U) -> [u32; LANES] {
        x
    }
    fn bits(m: Self::M) -> u64 {
        (0..LANES).fold(0, |bits, k| bits | u64::from(m[k]) << k)
    }
    fn splat_d(self, x: f64) -> Self::D {
        [x; DOUBLES]
    }
    fn load_d(self, x: &[f64; DOUBLES]) -> Self::D {
        *x
    }
    fn array_d(x: Self::D) -> [f64; DOUBLES] {
        x
    }
    fn bits_n(m: Self::N) -> u64 {
        (0..DOUBLES).fold(0, |bits, k| bits | u64::from(m[k]) << k)
    }
    fn splat_4(self, x: f32) -> Self::F4 {
        [x; 4]
    }
    fn splat_8(self, x: f32) -> Self::F8 {
        [x; 8]
    }
    fn load_4(self, x: &[f32; 4]) -> Self::F4 {
        *x
    }
    fn load_8(self, x: &[f32; 8]) -> Self::F8 {
        *x
    }
    fn array_4(x: Self::F4) -> [f32; 4] {
        x
    }
    fn array_8(x: Self::F8) -> [f32; 8] {
        x
    }
    fn halves(self, pairs: &[u64; LANES]) -> [Self::I; 2] {
        [pairs.map(|x| x as i32), pairs.map(|x| (x >> 32) as i32)]
    }
    fn add(a: Self::F, b: Self::F) -> Self::F {
        pairs(&a, &b, |a, b| a + b)
    }
    fn sub(a: Self::F, b: Self::F) -> Self::F {
        pairs(&a, &b, |a, b| a - b)
    }
    fn mul(a: Self::F, b: Self::F) -> Self::F {
        pairs(&a, &b, |a, b| a * b)
    }
    fn div(a: Self::F, b: Self::F) -> Self::F {
        pairs(&a, &b, |a, b| a / b)
    }
    fn lt(a: Self::F, b: Self::F) -> Self::M {
        pairs(&a, &b, |a, b| a < b)
    }
    fn le(a: Self::F, b: Self::F) -> Self::M {
        pairs(&a, &b, |a, b| a <= b)
    }
    fn eq(a: Self::F, b: Self::F) -> Self::M {
        pairs(&a, &b, |a, b| a == b)
    }
    fn add_i(a: Self::I, b: Self::I) -> Self::I {
        pairs(&a, &b, |a, b| a.wrapping_add(b))
    }
    fn mul_i(a: Self::I, b: Self::I) -> Self::I {
        pairs(&a, &b, |a, b| a.wrapping_mul(b))
    }
    fn or_i(a: Self::I, b: Self::I) -> Self::I {
        pairs(&a, &b, |a, b| a | b)
    }
    fn ge_i(a: Self::I, b: Self::I) -> Self::M {
        pairs(&a, &b, |a, b| a >= b)
    }
    fn add_u(a: Self::U, b: Self::U) -> Self::U {
        pairs(&a, &b, |a, b| a.wrapping_add(b))
    }
    fn ge_u(a: Self::U, b: Self::U) -> Self::M {
        pairs(&a, &b, |a, b| a >= b)
    }
    fn eq_u(a: Self::U, b: Self::U) -> Self::M {
        pairs(&a, &b, |a, b| a == b)
    }
    fn and(a: Self::M, b: Self::M) -> Self::M {
        pairs(&a, &b, |a, b| a & b)
    }
    fn or(a: Self::M, b: Self::M) -> Self::M {
        pairs(&a, &b, |a, b| a | b)
    }
    fn neg(a: Self::F) -> Self::F {
        pairs(&a, &a, |a, _| -a)
    }
    fn byte0(a: Self::I) -> Self::F {
        pairs(&a, &a, |a, _| (a & 255) as f32)
    }
    fn byte1(a: Self::I) -> Self::F {
        pairs(&a, &a, |a, _| (a >> 8 & 255) as f32)
    }
    fn byte2(a: Self::I) -> Self::F {
        pairs(&a, &a, |a, _| (a >> 16 & 255) as f32)
    }
    fn sqrt(a: Self::F) -> Self::F {
        pairs(&a, &a, |a, _| a.sqrt())
    }
    fn to_int(a: Self::F) -> Self::I {
        pairs(&a, &a, |a, _| a as i32)
    }
    fn not(a: Self::M) -> Self::M {
        pairs(&a, &a, |a, _| !a)
    }
    fn select(m: Self::M, a: Self::F, b: Self::F) -> Self::F {
        choose(&m, &a, &b)
    }
    fn select_i(m: Self::M, a: Self::I, b: Self::I) -> Self::I {
        choose(&m, &a, &b)
    }
    fn select_u(m: Self::M, a: Self::U, b: Self::U) -> Self::U {
        choose(&m, &a, &b)
    }
    fn add_d(a: Self::D, b: Self::D) -> Self::D {
        pairs(&a, &b, |a, b| a + b)
    }
    fn sub_d(a: Self::D, b: Self::D) -> Self::D {
        pairs(&a, &b, |a, b| a - b)
    }
    fn mul_d(a: Self::D, b: Self::D) -> Self::D {
        pairs(&a, &b, |a, b| a * b)
    }
    fn div_d(a: Self::D, b: Self::D) -> Self::D {
        pairs(&a, &b, |a, b| a / b)
    }
    fn neg_d(a: Self::D) -> Self::D {
        pairs(&a, &a, |a, _| -a)
    }
    fn sqrt_d(a: Self::D) -> Self::D {
        pairs(&a, &a, |a, _| a.sqrt())
    }
    fn lt_d(a: Self::D, b: Self::D) -> Self::N {
        pairs(&a, &b, |a, b| a < b)
    }
    fn le_d(a: Self::D, b: Self::D) -> Self::N {
        pairs(&a, &b, |a, b| a <= b)
    }
    fn eq_d(a: Self::D, b: Self::D) -> Self::N {
        pairs(&a, &b, |a, b| a == b)
    }
    fn and_n(a: Self::N, b: Self::N) -> Self::N {
        pairs(&a, &b, |a, b| a & b)
    }
    fn or_n(a: Self::N, b: Self::N) -> Self::N {
        pairs(&a, &b, |a, b| a | b)
    }
    fn not_n(a: Self::N) -> Self::N {
        pairs(&a, &a, |a, _| !a)
    }
    fn select_d(m: Self::N, a: Self::D, b: Self::D) -> Self::D {
        choose(&m, &a, &b)
    }
    fn add_4(a: Self::F4, b: Self::F4) -> Self::F4 {
        pairs(&a, &b, |a, b| a + b)
    }
    fn sub_4(a: Self::F4, b: Self::F4) -> Self::F4 {
        pairs(&a, &b, |a, b| a - b)
    }
    fn mul_4(a: Self::F4, b: Self::F4) -> Self::F4 {
        pairs(&a, &b, |a, b| a * b)
    }
    fn min_4(a: Self::F4, b: Self::F4) -> Self::F4 {
        pairs(&a, &b, |a, b| if a < b { a } else { b })
    }
    fn max_4(a: Self::F4, b: Self::F4) -> Self::F4 {
        pairs(&a, &b, |a, b| if a > b { a } else { b })
    }
    fn slide_4(a: Self::F4, b: Self::F4) -> Self::F4 {
        [a[3], b[0], b[1], b[2]]
    }
    fn add_8(a: Self::F8, b: Self::F8) -> Self::F8 {
        pairs(&a, &b, |a, b| a + b)
    }
    fn min_8(a: Self::F8, b: Self::F8) -> Self::F8 {
        pairs(&a, &b, |a, b| if a < b { a } else { b })
    }
    fn slide_8(a: Self::F8, b: Self::F8) -> Self::F8 {
        [a[7], b[0], b[1], b[2], b[3], b[4], b[5], b[6]]
    }
}
