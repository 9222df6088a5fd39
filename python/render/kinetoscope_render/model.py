"""Arrays of `mujoco.MjModel` under one name for all versions of MuJoCo."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

_FLOAT32 = (
    "mesh_vert", "mesh_normal", "mesh_texcoord", "hfield_data", "mat_rgba", "mat_texrepeat", "mat_emission", "mat_specular",
    "mat_shininess", "mat_reflectance", "skin_texcoord",
)
_INT32 = ("skin_face", "mesh_face", "mesh_facenormal", "mesh_facetexcoord", "tex_type", "mat_texuniform")
_INT64 = (
    "mesh_vertadr", "mesh_vertnum", "mesh_faceadr", "mesh_facenum", "mesh_normaladr", "mesh_normalnum", "mesh_texcoordadr", "hfield_nrow", "hfield_ncol",
    "hfield_adr", "tex_width", "tex_height", "tex_adr", "skin_vertadr", "skin_vertnum", "skin_faceadr", "skin_facenum",
    "skin_texcoordadr",
)


def _flat(array: Any, dtype: Any) -> np.ndarray:
    return np.ascontiguousarray(array, dtype=dtype).reshape(-1)


def _texture_of_materials(model: mujoco.MjModel) -> np.ndarray:
    """Color texture of each material, or -1."""
    texture = np.asarray(model.mat_texid)
    if texture.ndim == 1:
        return texture
    # Since 3.2, a material has one texture for each role.
    roles = mujoco.mjtTextureRole
    of_role = [texture[:, int(role)] for role in (roles.mjTEXROLE_RGB, roles.mjTEXROLE_RGBA)]
    return np.asarray(np.maximum(*of_role))


def _texcoord_counts(model: mujoco.MjModel) -> np.ndarray:
    """Number of texture coordinates of each mesh."""
    if hasattr(model, "mesh_texcoordnum"):
        return np.asarray(model.mesh_texcoordnum)
    first = np.asarray(model.mesh_texcoordadr)
    ends = np.append(np.unique(first[first >= 0]), np.asarray(model.mesh_texcoord).size // 2)
    return np.array([ends[np.searchsorted(ends, k, side="right")] - k if k >= 0 else 0 for k in first], np.int64)


def model_arrays(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Flat arrays of meshes, height fields, textures, materials and skins."""
    arrays = {}
    for names, dtype in ((_FLOAT32, np.float32), (_INT32, np.int32), (_INT64, np.int64)):
        arrays.update({name: _flat(getattr(model, name), dtype) for name in names})
    arrays["hfield_size"] = _flat(model.hfield_size, np.float64)
    arrays["mesh_texcoordnum"] = _flat(_texcoord_counts(model), np.int64)
    arrays["mat_texid"] = _flat(_texture_of_materials(model), np.int32)
    # Since 3.2, textures have 1 to 4 channels.
    has_channels = hasattr(model, "tex_data")
    arrays["tex_data"] = _flat(model.tex_data if has_channels else model.tex_rgb, np.uint8)
    arrays["tex_nchannel"] = _flat(model.tex_nchannel if has_channels else np.full(model.ntex, 3), np.int64)
    # Since 3.3.3, textures have a color space.
    arrays["tex_colorspace"] = _flat(getattr(model, "tex_colorspace", np.zeros(model.ntex)), np.int32)
    return arrays
