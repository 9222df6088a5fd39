"""Types of views of the extension module: windows, browser views, viewers, the record button. ``_sim.pyi`` has the module."""

from collections.abc import Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike, NDArray

from ._sim import RecordingSummary
from ._sim_entities import Robot, _Numbers

@final
class FileRecording:
    """Recording to files for the record button of windows and browser views, made by
    ``SimulationManager.file_recording``. Each recording that the button starts gets a new file. ``destroy`` aborts
    the current recording, so call ``finish`` before.
    """

    @property
    def failure(self) -> str | None:
        """Error that stopped the current recording, or None. ``finish`` raises it too."""
    @property
    def is_recording(self) -> bool:
        """True while a recording runs."""
    def __repr__(self) -> str: ...
    def finish(self, /) -> list[RecordingSummary]:
        """Ends the current recording, and returns the summaries of all recordings that ended since the last call.
        Raises the ``RecordingError`` of a recording that failed; a later call returns the complete ones.
        """
    def start(self, /) -> None:
        """Starts a recording without the button, to exactly the file of the configuration. Does nothing while a
        recording runs.
        """

@final
class ImageWindow:
    """A window for images that the program computes, such as the channels of a camera. It has a thread of its own,
    so it stays responsive while the program computes. It closes with ``close``, or when the object is dropped.
    """

    def __new__(cls, title: str | None = None, size: Sequence[int] | NDArray[Any] | None = None, *, display: str | None = None) -> Self: ...
    @property
    def failure(self) -> str | None:
        """Error that closed the window, such as a lost display; None if it is open or was closed as intended."""
    @property
    def frame_count(self) -> int:
        """Number of frames sent to the display."""
    @property
    def is_open(self) -> bool:
        """True while the window is open."""
    def __enter__(self, /) -> Self: ...
    def __exit__(self, /, *_exception: object) -> None: ...
    def __repr__(self) -> str: ...
    def close(self, /) -> None:
        """Requests the window to close, without waiting."""
    def show(self, /, image: ArrayLike) -> None:
        """Replaces the image and returns at once: uint8, shape (height, width, 4) or (height, width, 3). It is
        scaled to fit into the window. Without effect after the window was closed.
        """
    def wait(self, /, timeout: float | None = None) -> bool:
        """Waits until the window is closed, at most ``timeout`` seconds, and returns True if it is."""

@final
class Server:
    """A browser view of a simulation."""

    @property
    def url(self) -> str:
        """Address to open in a browser."""
    @property
    def viewers(self) -> int:
        """Number of connected browsers."""
    def __repr__(self) -> str: ...
    def close(self, /) -> None:
        """Disconnects all browsers and stops listening."""

@final
class Viewer:
    """A viewer that is a program, made by ``SimulationManager.viewer``: it pauses, steps and paces the simulation,
    while another thread steps it by ``update``, which handles commands after each step. Its pause and speed end with
    ``close``. While ``Playback.play`` shows a recording, the commands are for the recording.
    """

    @property
    def state(self) -> dict[str, Any]:
        """State of the simulation when it last published one, at most 30 times per second: a dict of ``steps`` since
        the simulation was created, ``paused``, ``speed`` (None for no limit), ``measured_speed`` (simulated seconds
        per second, or None), ``refusal``, the reason of the last refused command, or None, ``recording``, a dict of
        ``on`` and ``text`` (such as the name of the file) with a record button, otherwise None, and ``timeline``, a
        dict of ``time``, ``start`` and ``end`` [s] while ``Playback.play`` shows a recording, otherwise None.
        ``steps`` is then the index of the frame.
        """
    def __enter__(self, /) -> Self: ...
    def __exit__(self, /, *_exception: object) -> None: ...
    def __repr__(self) -> str: ...
    def drag(self, /, body: str, target: _Numbers, env: int = 0, anchor: _Numbers = (0.0, 0.0, 0.0)) -> None:
        """Pulls a body, a name of ``SimulationManager.body_names``, by a spring to ``target`` in the environment
        [m], until ``release``, the next ``drag``, ``close``, or the addition of an entity. ``anchor`` is the
        attachment point in the frame of the body [m]. A free body follows as a critically damped oscillator.
        """
    def record(self, /, on: bool = True) -> None:
        """Starts, or with False stops, the recording of the record button: ``SimulationManager.set_record_button``.
        Without a button, the command is refused (``state``). A recording that this viewer started ends with
        ``close``.
        """
    def release(self, /) -> None:
        """Ends the ``drag`` of this viewer, if any."""
    def set_target(self, /, robot: Robot, joint: str | int, value: float, env: int | None = None) -> None:
        """Sets the position target of a joint's drive, by name or index [rad or m], in one environment or all,
        between two steps. It is limited to the range of the joint; joints without a drive ignore it.
        """
    def toggle_pause(self, /) -> None:
        """Pauses a running simulation and resumes a paused one."""
    def close(self, /) -> None:
        """Ends the viewer, its pause and its speed. A second call does nothing."""
    def pause(self, /) -> None:
        """Pauses the simulation: ``update`` waits until any viewer resumes it, or this one is closed."""
    def reset(self, /, env: int | None = None) -> None:
        """Resets an environment, or all, after the next step."""
    def resume(self, /) -> None:
        """Resumes the simulation, whichever viewer paused it."""
    def seek(self, /, time: float) -> None:
        """Shows the frame of a recording at a time [s], while ``Playback.play`` shows it; a time outside shows its
        first or last frame.
        """
    def set_speed(self, /, speed: float | None) -> None:
        """Sets the speed: simulated seconds per second, from 0.001 to 1000, or None for no limit."""
    def step(self, /, steps: int = 1) -> None:
        """Runs this many steps inside the calls of ``update``, then pauses."""

@final
class Window:
    """A window of a simulation."""

    @property
    def failure(self) -> str | None:
        """Error that closed the window, such as a lost display; None if it is open or was closed as intended."""
    @property
    def frame_count(self) -> int:
        """Number of frames sent to the display."""
    @property
    def is_open(self) -> bool:
        """True while the window is open."""
    def __repr__(self) -> str: ...
    def close(self, /) -> None:
        """Requests the window to close, without waiting."""
    def wait(self, /, timeout: float | None = None) -> bool:
        """Waits until the window is closed, at most ``timeout`` seconds, and returns True if it is. The user, a call
        of ``close`` or the end of the simulation closes it.
        """
