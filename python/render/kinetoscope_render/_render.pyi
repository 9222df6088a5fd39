from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = ["FrameList", "__version__"]

__version__: str

@final
class FrameList:
    def __new__(
        cls,
        arrays: dict[str, npt.NDArray[Any]],
        geom_fields: dict[str, int],
        light_fields: dict[str, int],
        threads: int,
        samples: int,
        wraps_textures: bool,
        shadows: list[float],
        decor_casts: bool,
        quality: list[int],
    ) -> FrameList: ...
    def reload(self, arrays: dict[str, npt.NDArray[Any]]) -> None: ...
    def omitted(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def clear(self) -> None: ...
    def capture(
        self,
        geoms: npt.NDArray[np.uint8],
        lights: npt.NDArray[np.uint8],
        camera: list[float],
        options: list[float],
        effects: list[bool],
        size: list[int],
        scale: float = 1.0,
        soft: tuple[list[npt.NDArray[np.float32]], list[npt.NDArray[np.int32]]] | None = None,
    ) -> None: ...
    def render(
        self,
        rgb: npt.NDArray[np.uint8] | None = None,
        depth: npt.NDArray[np.float32] | None = None,
        segmentation: npt.NDArray[np.int32] | None = None,
        segments: npt.NDArray[np.int32] | None = None,
        normal: npt.NDArray[np.float32] | None = None,
        surfaces_of_color: bool = False,
    ) -> None: ...
