"""Types of the extension module. A test compares them with the module, and the documentation with that of the module
(``python/tests/stub_docs.py`` writes it). The classes of entities are in ``_sim_entities.pyi``,
those of views in ``_sim_views.pyi``, and that of kinematic chains in ``_sim_kinematics.pyi``."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._sim_entities import (
    IkResult,
    MjcfPart,
    RenderProgress,
    RigidObject,
    RigidObjectGroup,
    Robot,
    Segmentation,
    Sensor,
    Terrain,
    Weld,
    _Array,
    _Envs,
    _Fields,
    _Numbers,
)
from ._sim_kinematics import KinematicChain, _UrdfFiles
from ._sim_views import FileRecording, ImageWindow, Server, Viewer, Window
from .cfg import (
    ActuatorStateCfg,
    ArticulationCfg,
    CameraCfg,
    ContactSensorCfg,
    Format,
    FoxgloveCfg,
    FrameTransformerCfg,
    ImuCfg,
    InspectCfg,
    JointStateCfg,
    JointWrenchCfg,
    MjcfPartCfg,
    MujocoSensorCfg,
    OverviewCfg,
    Property,
    Randomization,
    RandomizationTerm,
    RayCasterCameraCfg,
    RayCasterCfg,
    RecorderCfg,
    RigidObjectCfg,
    RigidObjectGroupCfg,
    RobotCfg,
    SceneCfg,
    ScreenshotCfg,
    SegmentationCfg,
    ServeCfg,
    SimulationManagerCfg,
    StereoCameraCfg,
    TaskCfg,
    TerrainCfg,
    TerrainGrid,
    WeldCfg,
    WindowCfg,
)
from .diagnostics import Diagnostic
from .notebook import Frame

_PlainTopic: TypeAlias = Literal["everything", "engine_states", "task_results", "overview", "events"]
_Topics: TypeAlias = Topic | _PlainTopic | Sequence[Topic | _PlainTopic]
_SensorCfg: TypeAlias = (
    ActuatorStateCfg
    | CameraCfg
    | ContactSensorCfg
    | FrameTransformerCfg
    | ImuCfg
    | JointStateCfg
    | JointWrenchCfg
    | MujocoSensorCfg
    | RayCasterCameraCfg
    | RayCasterCfg
    | StereoCameraCfg
)
_EntityCfg: TypeAlias = (
    ArticulationCfg
    | MjcfPartCfg
    | RigidObjectCfg
    | RigidObjectGroupCfg
    | RobotCfg
    | TerrainCfg
    | WeldCfg
    | _SensorCfg
)
_Handle: TypeAlias = MjcfPart | RigidObject | RigidObjectGroup | Robot | Sensor | Terrain | Weld

__all__ = [
    "FileRecording",
    "FoxgloveServer",
    "IkResult",
    "ImageWindow",
    "KinematicChain",
    "MjcfPart",
    "Playback",
    "Recorder",
    "RecordingSummary",
    "RenderProgress",
    "RigidObject",
    "RigidObjectGroup",
    "Robot",
    "Segmentation",
    "Sensor",
    "Server",
    "SimulationManager",
    "Snapshot",
    "Task",
    "Terrain",
    "Topic",
    "Viewer",
    "Weld",
    "Window",
    "_NONE_IS_FALSE",
    "__version__",
    "_default_fields",
    "_default_uid",
    "_intrinsics_from_matrix",
    "_intrinsics_matrix",
    "_panic_next",
    "_set_assets",
    "_simulation_manager_cfg_env_origins",
    "_terrain_grid_heights",
    "_terrain_grid_platform_heights",
    "_terrain_grid_row_difficulty",
    "_terrain_grid_size",
    "_terrain_grid_tile_at",
    "_terrain_grid_tile_center",
    "assemble_urdf",
    "asset_path",
    "bundled_robot",
    "inspect",
    "json_schema",
    "mujoco_version",
    "read_calibration",
    "read_series",
    "recording_topics",
    "recover",
    "to_toml",
]

__version__: str
_NONE_IS_FALSE: list[str]

def assemble_urdf(robot: _UrdfFiles) -> str:
    """Merges the URDF files of a robot into one, and returns its text. ``robot`` is a ``UrdfCfg``, a ``RobotCfg``
    with URDF files, a dict of the fields of one of them, or the path of a file. Paths of meshes and textures are
    absolute. Masses and inertias are those of the files. ``inspect`` lists warnings about the files.
    """
def asset_path(asset: str | os.PathLike[str]) -> Path:
    """Path of a bundled asset such as ``sr5/SR5.urdf``, searched in the folder ``KINETOSCOPE_ASSETS``, then in the
    package.
    """
def bundled_robot(name: str) -> str:
    """Configuration of a bundled robot as the text of a scene file with this one entity."""
def inspect(cfg: InspectCfg | _Fields | None = None, **fields: Any) -> dict[str, Any]:
    """Masses, links, joints, mass matrix and gravity torques of a robot at joint positions, without a simulation: a
    dict of plain values. ``cfg`` is an ``InspectCfg`` or a dict of its fields; keyword arguments replace fields. A
    number that is not finite, such as an unlimited effort, is None.
    """
def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 7) of scene files, a dict, for completion and checks in editors."""
def recover(path: str | os.PathLike[str], to: str | os.PathLike[str] | None = None) -> tuple[int, str | None]:
    """Makes a complete MCAP file from the partial file of a recording that was killed. ``path`` is the intended path
    of the recording, without ``.part``; the new file is ``to``, by default ``path``. Returns the number of messages,
    and damage of the partial file other than an incomplete end, or None.
    """
def mujoco_version() -> str:
    """Version of the MuJoCo library that is loaded."""
def to_toml(scene: SceneCfg | _Fields) -> str:
    """Text of a scene file: the scene as Rust reads it, with all fields. ``scene`` is a ``SceneCfg``, or a dict of
    its fields.
    """
def read_calibration(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Fields of a ``CameraCfg`` from a calibration file of ROS: width, height, intrinsics, lens, and a renderer that
    supports the lens, for ``CameraCfg(**read_calibration("wrist.yaml"))``.
    """
@overload
def read_series(path: str | os.PathLike[str], topic: str, field: str, env: int | None = None) -> list[_Array]:
    """Times [s] and values of a number in a recording, shape (rows,) each. Of a list of fields, a list of such
    pairs, read in one pass.
    """
@overload
def read_series(path: str | os.PathLike[str], topic: str, field: list[str], env: int | None = None) -> list[list[_Array]]:
    """Times [s] and values of a number in a recording, shape (rows,) each. Of a list of fields, a list of such
    pairs, read in one pass.
    """
def recording_topics(path: str | os.PathLike[str]) -> list[tuple[str, list[str]]]:
    """Names of the topics of a recording, each with the names of its numbers."""
def _default_fields(name: str) -> str: ...
def _default_uid(kind: str) -> str: ...
def _intrinsics_from_matrix(matrix: ArrayLike) -> dict[str, Any]: ...
def _intrinsics_matrix(intrinsics: Mapping[str, Any], width: int, height: int) -> _Array: ...
def _simulation_manager_cfg_env_origins(cfg: SimulationManagerCfg) -> _Array: ...
def _terrain_grid_heights(cfg: TerrainGrid) -> _Array: ...
def _terrain_grid_platform_heights(cfg: TerrainGrid) -> _Array: ...
def _terrain_grid_row_difficulty(cfg: TerrainGrid, row: int) -> float: ...
def _terrain_grid_size(cfg: TerrainGrid) -> tuple[float, float]: ...
def _terrain_grid_tile_at(cfg: TerrainGrid, x: float, y: float) -> tuple[int, int] | None: ...
def _terrain_grid_tile_center(cfg: TerrainGrid, row: int, column: int) -> tuple[float, float]: ...
def _set_assets(folder: str | os.PathLike[str]) -> bool: ...
def _panic_next(requested: bool) -> bool: ...

@final
class FoxgloveServer:
    """A live stream to Foxglove. It ends when it is closed, or with the simulation."""

    @property
    def clients(self) -> int:
        """Number of connected clients."""
    @property
    def dropped_rows(self) -> int:
        """Number of rows that were dropped because the writer thread was too slow."""
    @property
    def failure(self) -> str | None:
        """Error that stopped the stream, or None."""
    @property
    def url(self) -> str:
        """Address for Foxglove's dialog "Open connection", such as ``"ws://127.0.0.1:8765"``."""
    def __repr__(self) -> str: ...
    def close(self, /) -> None:
        """Disconnects all clients and stops listening."""

@final
class Playback:
    """Playback of a recording: ``seek`` puts the simulation ``sim`` into the state of a recorded frame."""

    def __new__(cls, path: str | os.PathLike[str], sim: SimulationManager | None = None) -> Self: ...
    @property
    def joints_without_data(self) -> list[str]:
        """Names of the joints that the recording has no positions of; they stay where they were."""
    @property
    def sim(self) -> SimulationManager:
        """Simulation that shows the recording: the recorded scene as MJCF parts."""
    @property
    def times(self) -> _Array:
        """Times of the frames [s], shape (frames,)."""
    def __len__(self) -> int: ...
    def __repr__(self) -> str: ...
    def frame_at(self, /, time: float) -> int:
        """Index of the last frame at or before a time [s]; 0 before the first."""
    def play(self, /, window: Window | None = None, timeout: float | None = None) -> None:
        """Shows the recording in the windows and browser views of ``sim``, from the first frame in real time.
        Viewers pause it, seek, show single frames and change the speed. Returns when ``window``, a window of
        ``sim``, is closed, after ``timeout`` seconds, or with ``KeyboardInterrupt`` on Ctrl+C. Other calls of
        ``sim`` wait meanwhile.
        """
    def seek(self, /, frame: int) -> None:
        """Shows a frame, by its index in ``times``."""

@final
class Recorder:
    """A running recording. ``finish`` completes the file; as a context manager, it is finished at the end of the
    block.
    """

    @property
    def failure(self) -> str | None:
        """Error that stopped the recording, or None. ``finish`` raises it too."""
    @property
    def path(self) -> Path:
        """Path of the file or folder."""
    def __enter__(self, /) -> Self: ...
    def __exit__(self, /, *_exception: object) -> None: ...
    def __repr__(self) -> str: ...
    def finish(self, /) -> RecordingSummary:
        """Completes the file. A second call raises ``RecordingError``."""
    def note(self, /, text: str, env: int | None = None) -> None:
        """Writes a text into the recording, about one environment or all."""

@final
class RecordingSummary:
    """Summary of a finished recording."""

    @property
    def bytes(self) -> int:
        """Size [bytes]."""
    @property
    def left_out(self) -> list[str]:
        """Topics and entities that were left out, each with the reason."""
    @property
    def packets(self) -> int:
        """Number of rows and events."""
    @property
    def path(self) -> Path:
        """File or folder."""
    @property
    def text(self) -> str:
        """All of this in words."""
    @property
    def waits(self) -> int:
        """Number of times that the simulation waited for the writer."""
    def __repr__(self) -> str: ...

@final
class SimulationManager:
    """Robots, objects and sensors in parallel environments.

    ``cfg`` is a ``SimulationManagerCfg`` or a dict of its fields; keyword arguments replace fields. All methods
    release the interpreter while they work, and ``update`` ends early with ``KeyboardInterrupt`` on Ctrl+C.
    """

    def __new__(cls, cfg: SimulationManagerCfg | _Fields | None = None, **fields: Any) -> Self: ...
    @property
    def body_names(self) -> list[str]:
        """Names of all bodies, in the order in which sensors and viewers number them."""
    @property
    def cfg(self) -> SimulationManagerCfg:
        """Configuration of the simulation with all its values: a ``SimulationManagerCfg``. It is a copy: changes
        have no effect.
        """
    @property
    def control_names(self) -> list[str]:
        """Names of the columns of controls in ``rollout``."""
    @property
    def diagnostics(self) -> list[Diagnostic]:
        """Everything repaired, ignored or unusual in the files and configurations of all entities: texts with the
        attributes ``kind``, ``message``, ``file`` and ``line``.
        """
    @property
    def diverged(self) -> list[tuple[int, int, str]]:
        """Environments that are frozen after an invalid state, with the step and the reason."""
    @property
    def engine_states(self) -> tuple[_Array, _Array]:
        """Positions and velocities of all joints in MuJoCo's layout, shapes (num_envs, nq) and (num_envs, nv).
        ``state_names`` names the columns.
        """
    @property
    def env_origins(self) -> _Array:
        """Origins of the environments in the overview [m], shape (num_envs, 3). Poses do not contain them."""
    @property
    def mask_ids(self) -> list[tuple[int, str, str | None, str]]:
        """Table of the mask ids of cameras: id, entity, link (or None), semantic class."""
    @property
    def mjcf(self) -> str:
        """The MJCF document of the simulation."""
    def device_array(self, /, name: str) -> Any:
        """An array of the physics on a device, without a copy: a ``warp.array`` with a row per environment, for
        ``warp.to_torch`` and DLPack. Names: ``qpos``, ``qvel``, ``qacc_warmstart``, ``act`` and ``qacc``. Raises
        ``DeviceError`` on the device ``cpu``.
        """

    @property
    def num_envs(self) -> int:
        """Number of environments."""
    @property
    def physics_dt(self) -> float:
        """Physics time step [s]."""
    @property
    def state_names(self) -> list[str]:
        """Names of the columns of states in ``rollout``."""
    @property
    def threads(self) -> int:
        """Number of threads that step."""
    @property
    def time(self) -> _Array:
        """Simulation time of each environment since its last reset [s], shape (num_envs,)."""
    @property
    def warnings(self) -> dict[str, int]:
        """Counts of all warnings by name: diagnostics, and MuJoCo's warnings over all environments."""
    def __contains__(self, name: object, /) -> bool: ...
    def __enter__(self, /) -> Self: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __exit__(self, /, *_exception: object) -> None: ...
    def __getitem__(self, name: str, /) -> Any: ...
    def __hash__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...
    def __len__(self) -> int: ...
    def __repr__(self) -> str: ...
    def _repr_html_(self, /) -> str: ...
    def add(self, /, name: str, cfg: _EntityCfg | _Fields) -> Any:
        """Adds an entity of any type under a name: a robot, object, terrain, sensor and so on. Returns its handle."""
    def add_articulation(self, /, cfg: ArticulationCfg | _Fields | None = None, **fields: Any) -> Robot:
        """Adds a passive articulation, such as a cabinet, and returns its handle."""
    def add_mjcf(self, /, cfg: MjcfPartCfg | _Fields | None = None, **fields: Any) -> MjcfPart:
        """Attaches an MJCF file and returns its handle."""
    def add_rigid_object(self, /, cfg: RigidObjectCfg | _Fields | None = None, **fields: Any) -> RigidObject:
        """Adds a rigid object and returns its handle."""
    def add_rigid_object_group(self, /, cfg: RigidObjectGroupCfg | _Fields | None = None, **fields: Any) -> RigidObjectGroup:
        """Adds a group of rigid objects and returns its handle."""
    def add_robot(self, /, cfg: RobotCfg | _Fields | None = None, **fields: Any) -> Robot:
        """Adds a robot and returns its handle. Fields of ``RobotCfg`` may be given as keyword arguments."""
    def add_sensor(self, /, name: str, cfg: _SensorCfg | _Fields) -> Sensor:
        """Adds a sensor under a name and returns its handle. ``cfg`` is a configuration such as ``CameraCfg``, or a
        dict with ``type``.
        """
    def add_terrain(self, /, cfg: TerrainCfg | _Fields | None = None, **fields: Any) -> Terrain:
        """Adds a terrain and returns its handle."""
    def add_weld(self, /, cfg: WeldCfg | _Fields | None = None, **fields: Any) -> Weld:
        """Adds a weld, initially released, and returns its handle."""
    def contacts(self, /, env_ids: _Envs = None) -> list[list[dict[str, Any]]]:
        """Contacts of each selected environment: dicts with ``bodies`` (names; None for the world), ``point``,
        ``normal``, ``distance``, ``force`` on the second body, ``normal_force``.
        """
    def destroy(self, /) -> None:
        """Frees the simulation. Later calls of it and of its handles raise ``DestroyedError``."""
    def dump(self, /, folder: str | os.PathLike[str]) -> list[Diagnostic]:
        """Writes the merged robots, the MJCF documents for both MuJoCo versions and the meshes to a folder. Returns
        diagnostics for everything left out.
        """
    def env_warnings(self, /, env: int) -> dict[str, int]:
        """Counts of MuJoCo's warnings in one environment, by name."""
    def exclude_collision(self, /, one: str | _Handle, other: str | _Handle) -> None:
        """Excludes collisions between two entities or bodies from now on: names such as ``"arm/link"``, or handles."""
    @classmethod
    def from_file(cls, path: str | os.PathLike[str], **fields: Any) -> Self:
        """Builds the scene of a scene file (TOML or YAML). Keyword arguments replace fields of ``[simulation]``."""
    @classmethod
    def from_scene(cls, scene: SceneCfg | _Fields) -> Self:
        """Builds a scene from a ``SceneCfg``, or a dict of its fields. An entity may be a dict with a ``type``."""
    def keys(self, /) -> list[str]:
        """Names of the entities, in the order in which they were added."""
    def nominal_property(self, /, property: Property, name: str) -> list[float]:
        """Value of a property of a link, object or joint in the model as it was compiled, which ``reset_properties``
        returns to.
        """
    def file_recording(self, /, path: str | os.PathLike[str] | RecorderCfg | _Fields) -> FileRecording:
        """Recording to files for a record button: for ``open_window``, ``serve`` and ``set_record_button``. ``path``
        is a path such as ``"run.mcap"``, after which the button writes ``run-2.mcap`` and so on, or a
        ``RecorderCfg``. Existing files are not overwritten unless the configuration allows it.
        """
    def open_window(self, /, title: str | None = None, size: Sequence[int] | NDArray[Any] | None = None, *, speed: float | None = 1.0, display: str | None = None, record_button: FileRecording | None = None, cfg: WindowCfg | _Fields | None = None) -> Window:
        """Opens a window that shows the simulation while it steps, in real time unless ``speed`` is another factor,
        or None for no limit. ``record_button`` is the ``file_recording`` that the record button starts and stops.
        ``cfg`` is a ``WindowCfg``, in place of the arguments before ``record_button``. Raises ``ViewerError``
        without a display.
        """
    def property(self, /, property: Property, name: str) -> _Array:
        """Values of a property of a link, object or joint in every environment, shape (num_envs, values)."""
    def property_names(self, /, property: Property) -> list[str]:
        """Names that have a property, such as the links and objects with a ``"mass"``."""
    def randomize(self, /, randomization: Randomization | _Fields | Sequence[RandomizationTerm | _Fields], env_ids: _Envs = None) -> None:
        """Randomizes properties of environments: a ``Randomization``, or a list of its terms."""
    def record(self, /, path: str | os.PathLike[str] | RecorderCfg | _Fields, topics: _Topics | None = None, *, format: Format | None = None, env_ids: _Envs = None, period_steps: int | None = None, stream_periods: Mapping[str, int] | None = None, scene: bool | None = None, task: str | None = None, use_videos: bool | None = None, overwrite: bool | None = None, overview: OverviewCfg | _Fields | None = None, overview_size: Sequence[int] | None = None, overview_fps: float | None = None) -> Recorder:
        """Begins a recording; its format follows from the extension of the path. ``path`` is a path, or a
        ``RecorderCfg``. Keyword arguments replace its fields, ``env_ids`` the field ``envs``, and the last two those
        of ``overview``.
        """
    def reset(self, /, env_ids: _Envs = None) -> None:
        """Resets environments to their initial state and time 0."""
    def reset_buffers(self, /, env_ids: _Envs = None) -> None:
        """Clears what environments keep beside their state: histories of sensors, external wrenches, memory of
        actuator models. Positions, velocities, targets and time stay.
        """
    def reset_properties(self, /, env_ids: _Envs = None) -> None:
        """Resets all properties of environments to their nominal values."""
    def restore(self, /, snapshot: Snapshot, env_ids: _Envs = None, properties: bool = False) -> None:
        """Restores states of a snapshot. With ``properties``, masses, gains and other properties are restored as
        well.
        """
    def rollout(self, /, controls: ArrayLike, start: Snapshot | None = None, env_ids: _Envs = None) -> tuple[_Array, Snapshot, list[tuple[int, str]]]:
        """Simulates copies of environments: controls, shape (num_envs, steps, columns of ``control_names``). Returns
        the states after each step, shape (num_envs, steps, columns of ``state_names``), the final states as a
        snapshot, and the diverged rows with their reasons. The simulation does not change. Ctrl+C ends the call
        after the current step.
        """
    @overload
    def screenshot(self, /, path: None = None, *, size: Sequence[int] | None = None, env: int | None = None, eye: _Numbers | None = None, target: _Numbers | None = None, cfg: ScreenshotCfg | _Fields | None = None) -> _Array:
        """Image of all environments, or of one, RGBA, uint8, shape (height, width, 4). With a path, a PNG file is
        written instead. ``eye`` and ``target`` place the camera [m]. ``cfg`` is a ``ScreenshotCfg``; the other
        arguments replace its fields.
        """
    @overload
    def screenshot(self, /, path: str | os.PathLike[str], *, size: Sequence[int] | None = None, env: int | None = None, eye: _Numbers | None = None, target: _Numbers | None = None, cfg: ScreenshotCfg | _Fields | None = None) -> None:
        """Image of all environments, or of one, RGBA, uint8, shape (height, width, 4). With a path, a PNG file is
        written instead. ``eye`` and ``target`` place the camera [m]. ``cfg`` is a ``ScreenshotCfg``; the other
        arguments replace its fields.
        """
    def segmentation(self, /, labels: Mapping[str, str] | SegmentationCfg | None = None) -> Segmentation:
        """Segmentation of mask images by instance, link and semantic class. ``labels`` is a dict of classes by
        pattern of names, ``{"arm": "manipulator", "cube_.*": "target"}``, or a ``SegmentationCfg``; other entities
        keep their own class. Call it again after entities were added.
        """
    def serve(self, /, address: str = "127.0.0.1:0", *, speed: float | None = None, max_fps: float | None = None, max_viewers: int | None = None, jpeg_quality: int | None = None, allow_local_frames: bool | None = None, record_button: FileRecording | None = None, cfg: ServeCfg | _Fields | None = None) -> Server:
        """Serves the simulation to browsers; port 0 selects a free port. ``cfg`` is a ``ServeCfg``; keyword
        arguments replace its fields. ``speed`` is simulated seconds per second. ``allow_local_frames`` lets web
        pages of this machine show the view in a frame, as notebooks do. ``record_button`` is the ``file_recording``
        that the record button starts and stops.
        """
    def set_camera_view(self, /, eye: _Numbers, target: _Numbers) -> None:
        """Sets the view of windows, browser views and screenshots [m]."""
    def set_record_button(self, /, record_button: FileRecording) -> None:
        """Sets the record button of all windows and browser views, which ``Viewer.record`` presses too. The
        recording of the button before is stopped.
        """
    def set_property(self, /, property: Property, name: str, values: ArrayLike, env_ids: _Envs = None) -> None:
        """Sets a property of a link, object or joint: one row for each of ``env_ids``, or one for all."""
    def show(self, /, width: int = 960, height: int = 540) -> Frame:
        """Browser view in a frame, for notebooks whose browser runs on this machine. The view stays open while the
        simulation exists.
        """
    def snapshot(self, /, env_ids: _Envs = None) -> Snapshot:
        """Copies the states of environments."""
    def stream_to_foxglove(self, /, address: str | FoxgloveCfg | _Fields | None = None, topics: _Topics | None = None, *, env_ids: _Envs = None, period_steps: int | None = None, stream_periods: Mapping[str, int] | None = None, overview: OverviewCfg | _Fields | None = None, overview_size: Sequence[int] | None = None, overview_fps: float | None = None) -> FoxgloveServer:
        """Streams topics to Foxglove while the simulation steps. ``address`` is an address, ``"127.0.0.1:8765"`` by
        default, or a ``FoxgloveCfg``; port 0 selects a free port. An address such as ``"0.0.0.0:8765"`` lets other
        machines read, with the token that is part of ``url``. Keyword arguments are those of ``record``.
        """
    def update(self, /, steps: int = 1) -> None:
        """Steps all environments ``steps`` times. Ctrl+C ends the call after at most one block of steps, also while
        a viewer pauses the simulation or sets its speed.
        """
    def update_for(self, /, seconds: float) -> None:
        """Steps all environments by a time [s], a whole number of ``physics_dt``. Ctrl+C ends it as it ends
        ``update``.
        """
    def viewer(self, /) -> Viewer:
        """Adds a viewer that pauses, steps and paces the simulation from the program."""
    def verify_recording(self, /, path: str | os.PathLike[str]) -> dict[str, Any]:
        """Replays a recording (``.npz`` or ``.mcap``) in this simulation, built as the recorded one was, and
        compares the states bit by bit. Returns a dict: ``identical``, ``steps``, ``values``, and ``difference`` (a
        text, or None). Ctrl+C ends the call after the current step.
        """

@final
class Snapshot:
    """States of environments, made by ``SimulationManager.snapshot``. Snapshots can be pickled."""

    @property
    def env_ids(self) -> list[int]:
        """Environments of the snapshot."""
    @property
    def time(self) -> _Array:
        """Simulation times of the environments [s], shape (num_envs,)."""
    def __len__(self) -> int: ...
    def __reduce__(self, /) -> tuple[Any, tuple[bytes]]: ...
    def __repr__(self) -> str: ...
    @classmethod
    def from_bytes(cls, content: bytes) -> Snapshot:
        """Reads the content of a file of a snapshot."""
    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Snapshot:
        """Reads a file that ``save`` wrote."""
    def save(self, /, path: str | os.PathLike[str]) -> None:
        """Writes the snapshot to a file."""
    def to_bytes(self, /) -> bytes:
        """Content of the file of the snapshot."""

@final
class Task:
    """A task for learning agents in the environments of a simulation.

    ``cfg`` is a ``TaskCfg`` or a dict of its fields: ``decimation`` (physics steps in a step), ``episode_steps``
    (limit of an episode), ``autoreset`` ("next_step", "same_step" or "disabled", as in Gymnasium), and the terms
    ``actions``, ``commands``, ``curricula``, ``events``, ``rewards`` and ``terminations``, dicts by name whose
    ``type`` is the name of a ready-made term of Rust. ``observations`` is a dict of groups of terms; the group
    ``policy`` is that of ``reset`` and ``step``. ``dtype`` is the type of observations, "float64" or "float32". The
    simulation is usable between steps; ``close`` ends the task.
    """

    def __new__(cls, sim: SimulationManager, cfg: TaskCfg | _Fields, *, dtype: Literal["float64", "float32"] = "float64") -> Self: ...
    @property
    def action_space(self) -> tuple[list[str], list[float], list[float]]:
        """Columns of the actions: names ``term/column``, lower and upper bounds."""
    @property
    def autoreset(self) -> str:
        """Mode of automatic resets: "next_step", "same_step" or "disabled"."""
    @property
    def curriculum_names(self) -> list[str]:
        """Names of the curriculum terms."""
    @property
    def dtype(self) -> str:
        """Type of observations: "float64" or "float32"."""
    @property
    def episode_steps(self) -> int | None:
        """Limit of an episode in steps, or None."""
    @property
    def group_names(self) -> list[str]:
        """Names of the observation groups, ``policy`` first."""
    @property
    def num_envs(self) -> int:
        """Number of environments."""
    @property
    def observation_space(self) -> tuple[list[str], list[float], list[float]]:
        """Columns of the observations of the group ``policy``: names ``term/column``, lower and upper bounds."""
    @property
    def reward_names(self) -> list[str]:
        """Names of the reward terms."""
    @property
    def sim(self) -> SimulationManager:
        """The simulation, to serve, record or change it between steps."""
    @property
    def step_dt(self) -> float:
        """Duration of a step [s]."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __repr__(self) -> str: ...
    def close(self, /) -> None:
        """Ends the task; its simulation goes on."""
    def curriculum(self, /, name: str) -> _Array:
        """Numbers of a curriculum, such as the levels of terrain, shape (num_envs,)."""
    def group_space(self, /, group: str) -> tuple[list[str], list[float], list[float]]:
        """Columns of a group: names ``term/column``, lower and upper bounds."""
    def image_spaces(self, /, group: str) -> dict[str, tuple[tuple[int, int, int], str, float, float]]:
        """Images of a group, by name: shape of one environment (height, width, components), type, lowest and highest
        value.
        """
    def images(self, /, group: str, name: str, *, final: bool = False) -> _Array:
        """Images of a group after the last reset or step, shape (num_envs, height, width, components). With
        ``final``, those that the step led to: in an environment whose episode ended, its last ones.
        """
    def observations(self, /, group: str, *, final: bool = False) -> _Array:
        """Observations of a group after the last reset or step, shape (num_envs, columns). With ``final``, those
        that the step led to: in an environment whose episode ended, its last ones.
        """
    def reset(self, /, seed: int | None = None, mask: Sequence[bool] | NDArray[np.bool_] | None = None) -> tuple[_Array, dict[str, Any]]:
        """Begins new episodes, in the environments of ``mask`` or in all. Returns the observations, shape (num_envs,
        columns), and an empty dict. The same seed gives the same episodes.
        """
    def set_curriculum(self, /, name: str, values: ArrayLike) -> None:
        """Sets the numbers of a curriculum, shape (num_envs,), to continue an earlier run. They take effect at the
        next resets.
        """
    def step(self, /, actions: ArrayLike) -> tuple[_Array, _Array, _Array, _Array, dict[str, Any]]:
        """One step with actions, shape (num_envs, columns). Returns observations, rewards, terminated, truncated and
        a dict of ``final_observations``, ``reward_terms`` (num_envs, terms) and ``ended`` (episodes that ended:
        dicts). By default, an environment whose episode ends begins the next one in the same step (``autoreset``).
        Ctrl+C ends a long step, after which all environments have to be reset.
        """

@final
class Topic:
    """Selection of what is recorded."""

    @property
    def value(self) -> str | dict[str, Any]:
        """Form of the topic in configurations: a text, or a dict with the names."""
    def __repr__(self) -> str: ...
    @staticmethod
    def body_poses(uid: str) -> Topic:
        """Body poses of an MJCF part."""
    @staticmethod
    def channel(sensor: str, channel: str) -> Topic:
        """One channel of a camera."""
    @staticmethod
    def engine_states() -> Topic:
        """Times, positions and velocities of all joints in MuJoCo's order."""
    @staticmethod
    def events() -> Topic:
        """Resets, writes, divergence and notes."""
    @staticmethod
    def everything() -> Topic:
        """Everything that the format supports, except engine states. The overview is included only in formats of
        images, and only without a camera.
        """
    @staticmethod
    def joint_states(uid: str) -> Topic:
        """Joint positions, velocities and efforts of a robot or articulation."""
    @staticmethod
    def link_poses(uid: str) -> Topic:
        """Link poses of a robot or articulation."""
    @staticmethod
    def mjcf_state(uid: str) -> Topic:
        """Positions, velocities and controls of an MJCF part."""
    @staticmethod
    def object_pose(uid: str) -> Topic:
        """Pose of a rigid object."""
    @staticmethod
    def overview() -> Topic:
        """Overview image of all environments."""
    @staticmethod
    def sensor(uid: str) -> Topic:
        """All channels of a sensor."""
    @staticmethod
    def targets(uid: str) -> Topic:
        """Position, velocity and effort targets of a robot or articulation."""
    @staticmethod
    def task_results() -> Topic:
        """Rewards and ends of episodes."""
