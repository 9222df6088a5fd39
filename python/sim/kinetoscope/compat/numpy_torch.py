"""The functions of torch that simulation scripts use most, on NumPy arrays, where torch is not installed.

``from kinetoscope.compat import numpy_torch as torch``. A ``Tensor`` is a NumPy array with the methods of a tensor that
differ from those of an array. There is no automatic differentiation and no GPU.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

float32 = np.float32
float64 = np.float64
int32 = np.int32
int64 = np.int64
uint8 = np.uint8
bool = np.bool_  # noqa: A001


class Tensor(np.ndarray):  # type: ignore[type-arg]
    """A NumPy array with methods of a tensor."""

    @property
    def device(self) -> str:
        return "cpu"

    def cpu(self) -> Tensor:
        return self

    def detach(self) -> Tensor:
        return self

    def to(self, *_: Any, **__: Any) -> Tensor:
        return self

    def float(self) -> Tensor:
        return self.astype(np.float32)

    def numpy(self) -> Any:
        return self.view(_Array)

    def clone(self) -> Tensor:
        return self.copy()

    def unsqueeze(self, axis: int) -> Tensor:
        return np.expand_dims(self, axis)

    def unsqueeze_(self, axis: int) -> Tensor:
        return self._in_place(np.expand_dims(self, axis).shape)

    def squeeze_(self, axis: int | None = None) -> Tensor:
        return self._in_place(self.squeeze(axis).shape)

    def _in_place(self, shape: tuple[int, ...]) -> Tensor:
        with warnings.catch_warnings():
            # NumPy 2.5 has no other way to change the shape of an existing array.
            warnings.simplefilter("ignore", DeprecationWarning)
            self.shape = shape
        return self

    def repeat(self, *sizes: Any, axis: Any = "tile") -> Any:  # type: ignore[override]
        """Tiles the tensor, as ``torch.Tensor.repeat``. With ``axis``, the method of NumPy."""
        if axis != "tile":
            return super().repeat(sizes[0], axis=axis)
        counts = sizes[0] if len(sizes) == 1 and not isinstance(sizes[0], int) else sizes
        return np.tile(np.asarray(self), counts).view(Tensor)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: Any = False) -> Any:
        return np.asarray(array).view(Tensor)


class _Array(np.ndarray):  # type: ignore[type-arg]
    """A NumPy array with the method ``ptp`` that NumPy 2 removed."""

    def ptp(self, *arguments: Any, **options: Any) -> Any:
        return np.ptp(np.asarray(self), *arguments, **options)


def device(name: Any = "cpu") -> str:
    """The device, which is always the CPU."""
    return str(name)


def tensor(data: Any, dtype: Any = None, device: Any = None) -> Tensor:  # noqa: ARG001
    """A copy of the data; floating-point numbers have single precision."""
    array = np.array(data, dtype=dtype)
    if dtype is None and array.dtype == np.float64:
        array = array.astype(np.float32)
    return array.view(Tensor)


def as_tensor(data: Any, dtype: Any = None, device: Any = None) -> Tensor:  # noqa: ARG001
    """A tensor of the data, without a copy where possible."""
    return np.asarray(data, dtype=dtype).view(Tensor)


from_numpy = as_tensor


def zeros(*shape: Any, dtype: Any = float32, device: Any = None) -> Tensor:  # noqa: ARG001
    sizes = shape[0] if len(shape) == 1 and not isinstance(shape[0], int) else shape
    return np.zeros(sizes, dtype=dtype).view(Tensor)


def ones(*shape: Any, dtype: Any = float32, device: Any = None) -> Tensor:  # noqa: ARG001
    sizes = shape[0] if len(shape) == 1 and not isinstance(shape[0], int) else shape
    return np.ones(sizes, dtype=dtype).view(Tensor)


def zeros_like(other: Any) -> Tensor:
    return np.zeros_like(np.asarray(other)).view(Tensor)


def ones_like(other: Any) -> Tensor:
    return np.ones_like(np.asarray(other)).view(Tensor)


_GENERATOR = np.random.default_rng()


def manual_seed(seed: int) -> None:
    """Seeds ``rand`` and the like."""
    global _GENERATOR
    _GENERATOR = np.random.default_rng(seed)


def rand(*shape: Any) -> Tensor:
    return _GENERATOR.random(shape, dtype=np.float32).view(Tensor)


def rand_like(other: Any) -> Tensor:
    return rand(*np.shape(other))


def randn_like(other: Any) -> Tensor:
    return _GENERATOR.standard_normal(np.shape(other), dtype=np.float32).view(Tensor)


def max(data: Any) -> Any:  # noqa: A001
    return np.asarray(data).max()


def min(data: Any) -> Any:  # noqa: A001
    return np.asarray(data).min()


def cat(tensors: Any, dim: int = 0) -> Tensor:
    return np.concatenate(tensors, axis=dim).view(Tensor)


def stack(tensors: Any, dim: int = 0) -> Tensor:
    return np.stack(tensors, axis=dim).view(Tensor)


def set_printoptions(precision: int | None = None, sci_mode: Any = None, **_: Any) -> None:
    """Sets the number of digits that arrays are printed with."""
    options: dict[str, Any] = {}
    if precision is not None:
        options["precision"] = precision
    if sci_mode is not None:
        options["suppress"] = not sci_mode
    np.set_printoptions(**options)
