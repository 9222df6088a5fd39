//! Affine transforms of points and normals, including scale and shear.

use super::builder::unit;
use crate::vector::dot;

/// The upper three rows of a transform.
pub(super) type Affine = [[f64; 4]; 3];

pub(super) const IDENTITY: Affine = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]];

pub(super) fn product(a: &Affine, b: &Affine) -> Affine {
    let mut out = [[0.0; 4]; 3];
    for (row, a) in out.iter_mut().zip(a) {
        for (j, x) in row.iter_mut().enumerate() {
            *x = a[0] * b[0][j] + a[1] * b[1][j] + a[2] * b[2][j] + if j == 3 { a[3] } else { 0.0 };
        }
    }
    out
}

/// Rotation about a unit axis by an angle \[rad\].
pub(super) fn rotation(axis: [f64; 3], angle: f64) -> Affine {
    let ([x, y, z], (s, c)) = (axis, angle.sin_cos());
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0.0],
        [t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0.0],
        [t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0.0],
    ]
}

/// A transform prepared for points and normals.
pub(super) struct PreparedAffine {
    matrix: Affine,
    /// Cofactors: the inverse transpose times the determinant, so that no division can fail.
    cofactors: [[f64; 3]; 3],
    /// True if the transform mirrors, in which case the winding must be reversed.
    pub(super) mirrored: bool,
}

impl PreparedAffine {
    pub(super) fn new(matrix: &Affine) -> Self {
        let m = matrix;
        let minor = |i: usize, j: usize| {
            let (r, s, u, v) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
            m[r][u] * m[s][v] - m[r][v] * m[s][u]
        };
        let cofactors = [0, 1, 2].map(|i| [0, 1, 2].map(|j| minor(i, j)));
        let determinant: f64 = (0..3).map(|j| m[0][j] * cofactors[0][j]).sum();
        Self { matrix: *matrix, cofactors, mirrored: determinant < 0.0 }
    }

    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        self.matrix.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
    }

    /// Transformed unit normal; `None` for a zero normal or one that the transform flattens.
    pub(super) fn normal(&self, n: [f64; 3]) -> Option<[f32; 3]> {
        let sign = if self.mirrored { -1.0 } else { 1.0 };
        let n = self.cofactors.map(|row| sign * dot(row, n));
        // Scaled first: the cofactors of a file in millimeters are of the order 1e-6.
        let largest = n.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        unit(n.map(|x| (x / largest) as f32))
    }
}
