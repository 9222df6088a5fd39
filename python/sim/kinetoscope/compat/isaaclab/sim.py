"""Simulation context and spawners of Isaac."""

from __future__ import annotations

import warnings
from typing import Any, ClassVar

from ...errors import ViewerError
from .._layer import Layer
from ..configclass import configclass
from .spawners import (
    CapsuleCfg,
    CollisionPropertiesCfg,
    ConeCfg,
    CuboidCfg,
    CylinderCfg,
    MassPropertiesCfg,
    PreviewSurfaceCfg,
    RigidBodyMaterialCfg,
    RigidBodyPropertiesCfg,
    SphereCfg,
)

__all__ = [
    "CapsuleCfg",
    "CollisionPropertiesCfg",
    "ConeCfg",
    "CuboidCfg",
    "CylinderCfg",
    "DistantLightCfg",
    "DomeLightCfg",
    "GroundPlaneCfg",
    "MassPropertiesCfg",
    "PinholeCameraCfg",
    "PreviewSurfaceCfg",
    "RigidBodyMaterialCfg",
    "RigidBodyPropertiesCfg",
    "SimulationCfg",
    "SimulationContext",
    "SphereCfg",
    "UrdfFileCfg",
]


@configclass
class SimulationCfg:
    """Time step [s] and gravity. ``substeps`` has no effect, as in Orbit."""

    dt: float = 1.0 / 60.0
    substeps: int = 1
    gravity: Any = (0.0, 0.0, -9.81)
    device: str = "cpu"
    physics_prim_path: str = "/physicsScene"
    render_interval: int = 1


@configclass
class GroundPlaneCfg:
    """A ground plane."""

    color: Any = (0.1, 0.1, 0.1)
    size: Any = (100.0, 100.0)


@configclass
class DomeLightCfg:
    """Light from all directions. An intensity of 3000 gives a white surface the largest brightness of an image."""

    intensity: float = 1.0
    color: Any = (1.0, 1.0, 1.0)


@configclass
class DistantLightCfg:
    """Light from far above. An intensity of 3000 counts as 1."""

    intensity: float = 1.0
    color: Any = (1.0, 1.0, 1.0)
    angle: float = 0.53


@configclass
class PinholeCameraCfg:
    """A pinhole camera: lengths in one unit, the clipping range in meters."""

    focal_length: float = 24.0
    focus_distance: float = 400.0
    f_stop: float = 0.0
    horizontal_aperture: float = 20.955
    vertical_aperture: float | None = None
    horizontal_aperture_offset: float = 0.0
    vertical_aperture_offset: float = 0.0
    clipping_range: Any = (0.01, 1e6)


@configclass
class UrdfFileCfg:
    """A robot from a URDF file."""

    asset_path: str = ""
    fix_base: bool = False
    self_collisions: bool = False
    activate_contact_sensors: bool = True


class SimulationContext(Layer):
    """The simulation of the script. It exists before its scene, and steps it once it is built."""

    _instance: ClassVar[SimulationContext | None] = None
    wants_window: ClassVar[bool] = False
    wants_server: ClassVar[bool] = False

    def __init__(self, cfg: SimulationCfg | None = None) -> None:
        self.cfg = cfg or SimulationCfg()
        self.native: Any = None
        self.window: Any = None
        self.server: Any = None
        self.step_count = 0
        self._view: Any = None
        SimulationContext._instance = self

    @classmethod
    def instance(cls) -> SimulationContext | None:
        """The current context, or None."""
        return cls._instance

    @classmethod
    def clear_instance(cls) -> None:
        """Frees the current context."""
        if cls._instance is not None:
            cls._instance.close()

    def get_physics_dt(self) -> float:
        return float(self.cfg.dt)

    def get_rendering_dt(self) -> float:
        return self.get_physics_dt() * self.cfg.render_interval

    def has_gui(self) -> bool:
        """True if a window is open."""
        return self.window is not None and bool(self.window.is_open)

    def set_camera_view(self, eye: Any, target: Any) -> None:
        """Sets the view of windows."""
        self._view = ([float(x) for x in eye], [float(x) for x in target])
        if self.native is not None:
            self.native.set_camera_view(*self._view)

    def attach(self, native: Any) -> None:
        """Takes the simulation of a scene."""
        self.native = native
        if self._view is not None:
            native.set_camera_view(*self._view)

    def reset(self) -> None:
        """Starts the simulation; opens the window of a script that is not headless, or the browser view of --livestream, and
        prints its address. Both run in real time."""
        if self.native is None:
            raise RuntimeError("sim.reset: there is no scene; create an InteractiveScene first")
        if SimulationContext.wants_window and self.window is None:
            try:
                self.window = self.native.open_window()
            except ViewerError as error:
                warnings.warn(f"no window: {error}", stacklevel=2)
        if SimulationContext.wants_server and self.server is None:
            self.server = self.native.serve(speed=1.0)
            print(f"open {self.server.url}", flush=True)

    def step(self, render: bool = True) -> None:  # noqa: ARG002
        """One physics step."""
        self.native.update(1)
        self.step_count += 1

    def render(self) -> None:
        """Does nothing: windows draw on their own threads."""

    def forward(self) -> None:
        """Does nothing: states are current after every write."""

    def play(self) -> None:
        """Does nothing: a simulation with a scene always plays."""

    def is_playing(self) -> bool:
        return self.native is not None

    is_stopped = staticmethod(lambda: False)

    def close(self) -> None:
        """Frees the simulation."""
        if self.native is not None:
            self.native.destroy()
        if SimulationContext._instance is self:
            SimulationContext._instance = None
