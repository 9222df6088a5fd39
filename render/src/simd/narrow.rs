//! Four or eight lanes. `min` and `max` are defined for numbers other than NaN; of two zeros either may be returned.

use super::{F4, F8, Simd};
use std::ops::{Add, Mul, Sub};

macro_rules! narrow {
    ($Name:ident $count:literal $splat:ident $load:ident $array:ident $slide:ident; $($name:ident $method:ident),*; $($Trait:ident $operator:ident $op:ident),*) => {
        impl<S: Simd> $Name<S> {
            /// The same number in all lanes.
            #[inline(always)]
            pub(crate) fn splat(s: S, x: f32) -> Self {
                Self::new(s, s.$splat(x))
            }
            #[inline(always)]
            pub(crate) fn load(s: S, x: &[f32; $count]) -> Self {
                Self::new(s, s.$load(x))
            }
            #[inline(always)]
            pub(crate) fn array(self) -> [f32; $count] {
                S::$array(self.v)
            }
            /// A number followed by all lanes but the last.
            #[inline(always)]
            pub(crate) fn shift_in(self, x: f32) -> Self {
                Self::new(self.s, S::$slide(self.s.$splat(x), self.v))
            }
            $(#[inline(always)]
            pub(crate) fn $name(self, o: Self) -> Self {
                Self::new(self.s, S::$method(self.v, o.v))
            })*
        }

        $(impl<S: Simd> $Trait for $Name<S> {
            type Output = Self;
            #[inline(always)]
            fn $operator(self, o: Self) -> Self {
                Self::new(self.s, S::$op(self.v, o.v))
            }
        })*
    };
}
narrow!(F4 4 splat_4 load_4 array_4 slide_4; min min_4, max max_4; Add add add_4, Sub sub sub_4, Mul mul mul_4);
narrow!(F8 8 splat_8 load_8 array_8 slide_8; min min_8; Add add add_8);
