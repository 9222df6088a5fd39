//! [`OrthonormalBasis`]: an orthonormal basis around a normal.

use crate::vector::{V3, dot};

/// Three perpendicular unit vectors; the third is the normal of a surface.
#[derive(Clone, Copy, Debug)]
pub struct OrthonormalBasis([V3; 3]);

impl OrthonormalBasis {
    /// Creates a basis around a unit normal. Source: Duff et al., Building an orthonormal basis, revisited, JCGT 6(1),
    /// 2017.
    #[inline]
    pub fn from_normal(n: V3) -> Self {
        let sign = if n[2] < 0.0 { -1.0 } else { 1.0 };
        let a = -1.0 / (sign + n[2]);
        let b = n[0] * n[1] * a;
        Self([[1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]], [b, sign + n[1] * n[1] * a, -n[1]], n])
    }

    /// Maps a vector from the basis to the frame in which the normal is given.
    #[inline]
    pub fn to_world(self, v: V3) -> V3 {
        [0, 1, 2].map(|k| self.0[0][k] * v[0] + self.0[1][k] * v[1] + self.0[2][k] * v[2])
    }

    /// Maps a vector from the frame in which the normal is given to the basis.
    #[inline]
    pub fn to_local(self, v: V3) -> V3 {
        self.0.map(|axis| dot(axis, v))
    }
}
