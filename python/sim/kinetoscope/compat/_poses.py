"""Poses as 4 x 4 matrices and as rows x y z qw qx qy qz."""

from __future__ import annotations

from typing import Any

import numpy as np


def to_matrix(rows: Any) -> Any:
    """Matrices of pose rows, shape (..., 4, 4)."""
    rows = np.asarray(rows, dtype=float)
    w, x, y, z = np.moveaxis(rows[..., 3:7] / np.linalg.norm(rows[..., 3:7], axis=-1, keepdims=True), -1, 0)
    matrices = np.zeros((*rows.shape[:-1], 4, 4))
    matrices[..., 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1)
    matrices[..., 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1)
    matrices[..., 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    matrices[..., :3, 3] = rows[..., :3]
    matrices[..., 3, 3] = 1
    return matrices


def to_row(matrix: Any) -> list[float]:
    """Pose row of a matrix."""
    matrix = np.asarray(matrix, dtype=float)
    if matrix.shape != (4, 4):
        raise ValueError(f"expected a 4 x 4 matrix, not an array of shape {matrix.shape}")
    m = matrix[:3, :3]
    # The eigenvector of the largest eigenvalue of Bar-Itzhack's matrix is the quaternion of the nearest rotation.
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    x, y, z, w = np.linalg.eigh(k / 3)[1][:, -1]
    quaternion = np.array([w, x, y, z]) * (-1 if w < 0 else 1)
    return [*matrix[:3, 3].tolist(), *quaternion.tolist()]


def rows(poses: Any) -> Any:
    """Pose rows of rows or matrices, shape (n, 7)."""
    poses = np.asarray(poses, dtype=float)
    if poses.shape[-2:] == (4, 4):
        return np.array([to_row(matrix) for matrix in poses.reshape(-1, 4, 4)])
    return np.atleast_2d(poses)


def to_world(poses: Any, origins: Any) -> Any:
    """Adds the origins of the environments to positions or poses, shape (n, ..., 3 or more)."""
    moved = np.array(poses, dtype=float)
    moved[..., :3] += np.asarray(origins).reshape(len(origins), *[1] * (moved.ndim - 2), 3)
    return moved
