"""Tensors of torch where it is installed, NumPy arrays with their methods where not."""

from __future__ import annotations

import importlib
import os
from typing import Any

import numpy as np

from . import numpy_torch

# The module, or None: torch is no requirement of this package, whose types do not depend on it.
torch: Any = None
# The variable selects NumPy although torch is installed.
if os.environ.get("KINETOSCOPE_COMPAT_TORCH") != "0":
    try:
        torch = importlib.import_module("torch")
    except ImportError:
        pass


def tensor(array: Any) -> Any:
    """A tensor of an array that no other object uses. Numbers in double precision become single precision, as the
    other simulators have, and ``uint64`` becomes ``int64``; all other arrays keep their memory."""
    array = np.asarray(array)
    if array.dtype == np.float64:
        array = array.astype(np.float32)
    if array.dtype == np.uint64:
        array = array.astype(np.int64)
    return numpy_torch.as_tensor(array) if torch is None else torch.from_numpy(array)


def array(values: Any) -> Any:
    """A NumPy array of a tensor or of anything that NumPy accepts."""
    if torch is not None and isinstance(values, torch.Tensor):
        return values.detach().cpu().numpy()
    return np.asarray(values)


def random_integers(low: int, high: int, count: int) -> Any:
    """Numbers from ``low`` to ``high``, both included, of the generator that scripts seed: torch's, or NumPy's without torch."""
    if torch is None:
        return np.random.randint(low, high + 1, count)
    return torch.randint(low, high + 1, (count,)).numpy()


def device() -> Any:
    """The device of all tensors: the CPU."""
    return numpy_torch.device() if torch is None else torch.device("cpu")
