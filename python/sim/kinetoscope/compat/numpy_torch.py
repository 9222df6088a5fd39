"""The functions of torch that simulation scripts use most, on NumPy arrays, where torch is not installed.

``from kinetoscope.compat import numpy_torch as torch``. A ``Tensor`` is a NumPy array with the methods of a tensor that
differ from those of an array. There is no automatic differentiation and no GPU: other devices raise RuntimeError. Methods
of an array whose meaning differs have that of torch; those without a counterpart here raise TypeError. Functions of NumPy
work on tensors as on arrays.
"""

from __future__ import annotations

import warnings
from typing import Any, Literal, NamedTuple, cast

import numpy as np

float32 = np.float32
float64 = np.float64
int32 = np.int32
int64 = np.int64
uint8 = np.uint8
bool = np.bool_  # noqa: A001


_DTYPES = (float32, float64, int32, int64, uint8, bool)


class _Size(int):
    """Number of elements, for NumPy; as a function, the shape, as ``torch.Tensor.size``."""

    shape: tuple[int, ...] = ()

    def __call__(self, dim: int | None = None) -> Any:
        return self.shape if dim is None else self.shape[dim]


class ValuesAndIndices(NamedTuple):
    """Result of ``max``, ``min`` and ``sort`` along an axis."""

    values: Any
    indices: Any


def _check_device(name: Any) -> None:
    if name is not None and str(name) != "cpu":
        raise RuntimeError(f"device is {str(name)!r}: there is only the CPU; use 'cpu'")


def _along(method: str) -> Any:
    """A reduction that also accepts torch's names of the arguments."""

    def reduce(self: Any, *arguments: Any, **options: Any) -> Any:
        for own, other in (("dim", "axis"), ("keepdim", "keepdims")):
            if own in options:
                options[other] = options.pop(own)
        return getattr(np.ndarray, method)(self, *arguments, **options)

    return reduce


def _extreme(method: str) -> Any:
    """``max`` or ``min``: along an axis, torch returns values and indices."""

    def reduce(self: Any, dim: int | None = None, keepdim: Any = False, **numpy: Any) -> Any:
        if numpy or dim is None:
            return getattr(np.ndarray, method)(self, **numpy)
        plain = np.asarray(self)
        values = getattr(plain, method)(axis=dim, keepdims=keepdim)
        indices = getattr(plain, "arg" + method)(axis=dim, keepdims=keepdim)
        return ValuesAndIndices(np.asarray(values).view(Tensor), np.asarray(indices).view(Tensor))

    return reduce


def _spread(method: str) -> Any:
    """``std`` or ``var``: torch divides by n - 1, NumPy by n."""

    def reduce(self: Any, dim: Any = None, *, correction: int = 1, keepdim: Any = False, **numpy: Any) -> Any:
        if numpy:
            return getattr(np.ndarray, method)(self, **numpy)
        if dim is True or dim is False:
            raise TypeError(f"{method}: dim is {dim!r}; use an axis, and correction=0 for the biased value")
        return getattr(np.ndarray, method)(self, axis=dim, ddof=correction, keepdims=keepdim)

    return reduce


class Tensor(np.ndarray[Any, np.dtype[Any]]):
    """A NumPy array with methods of a tensor."""

    @property
    def device(self) -> Literal["cpu"]:
        return "cpu"

    def cpu(self) -> Tensor:
        return self

    def detach(self) -> Tensor:
        return self

    def to(self, *targets: Any, dtype: Any = None, device: Any = None) -> Tensor:
        """Converts to a type of elements, to the CPU, or to the type of another tensor."""
        _check_device(device)
        for target in targets:
            if isinstance(target, np.ndarray):
                dtype = target.dtype
            elif isinstance(target, np.dtype) or target in _DTYPES:
                dtype = target
            else:
                _check_device(target)
        return self if dtype is None or self.dtype == dtype else cast(Tensor, self.astype(dtype))

    @property
    def size(self) -> _Size:  # type: ignore[override, unused-ignore]
        size = _Size(np.asarray(self).size)
        size.shape = self.shape
        return size

    max, min = _extreme("max"), _extreme("min")
    std, var = _spread("std"), _spread("var")
    sum, mean, prod = _along("sum"), _along("mean"), _along("prod")
    any, all, argmax, argmin = _along("any"), _along("all"), _along("argmax"), _along("argmin")
    cumsum, argsort = _along("cumsum"), _along("argsort")

    def sort(self, dim: int = -1, descending: Any = False, **numpy: Any) -> Any:  # type: ignore[override, unused-ignore]
        """Sorted values and their indices. With arguments of NumPy's method, that."""
        if numpy:
            return super().sort(**numpy)
        plain = np.asarray(self)
        indices = np.argsort(-plain if descending else plain, axis=dim, kind="stable")
        values = np.take_along_axis(plain, indices, axis=dim)
        return ValuesAndIndices(values.view(Tensor), indices.view(Tensor))

    def transpose(self, *axes: Any) -> Any:  # type: ignore[override, unused-ignore]
        """Exchanges two axes. With another number of axes, the method of NumPy."""
        if len(axes) == 2 and all(isinstance(axis, int) for axis in axes):
            return self.swapaxes(*axes)
        return super().transpose(*axes)

    def view(self, *shape: Any) -> Any:  # type: ignore[override, unused-ignore]
        """A tensor of another shape. With a type, the method of NumPy."""
        sizes = shape[0] if len(shape) == 1 and isinstance(shape[0], tuple | list) else shape
        if sizes and all(isinstance(size, int) for size in sizes):
            return self.reshape(sizes)
        return super().view(*shape)

    def nonzero(self) -> Any:
        raise TypeError("nonzero: torch returns one tensor, NumPy a tuple; use numpy.nonzero(numpy.asarray(t))")

    def float(self) -> Tensor:
        return cast(Tensor, self.astype(np.float32))

    def numpy(self) -> Any:
        return self.view(_Array)

    def clone(self) -> Tensor:
        return self.copy()

    def unsqueeze(self, axis: int) -> Tensor:
        return cast(Tensor, np.expand_dims(self, axis))

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

    def repeat(self, *sizes: Any, axis: Any = "tile") -> Any:  # type: ignore[override, unused-ignore]
        """Tiles the tensor, as ``torch.Tensor.repeat``. With ``axis``, the method of NumPy."""
        if axis != "tile":
            return super().repeat(sizes[0], axis=axis)
        counts = sizes[0] if len(sizes) == 1 and not isinstance(sizes[0], int) else sizes
        if len(counts) < self.ndim:
            raise RuntimeError(f"repeat: {len(counts)} sizes for {self.ndim} axes; give one for each axis")
        return np.tile(np.asarray(self), counts).view(Tensor)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: Any = False) -> Any:
        return np.asarray(array).view(Tensor)


class _Array(np.ndarray[Any, np.dtype[Any]]):
    """A NumPy array with the method ``ptp`` that NumPy 2 removed."""

    def ptp(self, *arguments: Any, **options: Any) -> Any:
        return np.ptp(np.asarray(self), *arguments, **options)


def device(name: Any = "cpu") -> str:
    """The device, which is always the CPU."""
    _check_device(name)
    return str(name)


def _typed(data: Any, dtype: Any) -> Any:
    """Type of the elements: that of an array, single precision for Python's numbers."""
    if dtype is not None or isinstance(data, np.ndarray | np.generic):
        return dtype
    return np.float32 if np.asarray(data).dtype == np.float64 else None


def tensor(data: Any, dtype: Any = None, device: Any = None) -> Tensor:
    """A copy of the data. Numbers of Python have single precision, arrays keep their type."""
    _check_device(device)
    return np.array(data, dtype=_typed(data, dtype)).view(Tensor)


def as_tensor(data: Any, dtype: Any = None, device: Any = None) -> Tensor:
    """A tensor of the data, without a copy where possible. Types are those of ``tensor``."""
    _check_device(device)
    return np.asarray(data, dtype=_typed(data, dtype)).view(Tensor)


from_numpy = as_tensor


def zeros(*shape: Any, dtype: Any = float32, device: Any = None) -> Tensor:
    _check_device(device)
    sizes = shape[0] if len(shape) == 1 and not isinstance(shape[0], int) else shape
    return np.zeros(sizes, dtype=dtype).view(Tensor)


def ones(*shape: Any, dtype: Any = float32, device: Any = None) -> Tensor:
    _check_device(device)
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
    return as_tensor(_GENERATOR.standard_normal(np.shape(other), dtype=np.float32))


def max(data: Any) -> Any:  # noqa: A001
    return np.asarray(data).max()


def min(data: Any) -> Any:  # noqa: A001
    return np.asarray(data).min()


def cat(tensors: Any, dim: int = 0) -> Tensor:
    return as_tensor(np.concatenate(tensors, axis=dim))


def stack(tensors: Any, dim: int = 0) -> Tensor:
    return as_tensor(np.stack(tensors, axis=dim))


def set_printoptions(precision: int | None = None, sci_mode: Any = None, **_: Any) -> None:
    """Sets the number of digits that arrays are printed with."""
    options: dict[str, Any] = {}
    if precision is not None:
        options["precision"] = precision
    if sci_mode is not None:
        options["suppress"] = not sci_mode
    np.set_printoptions(**options)
