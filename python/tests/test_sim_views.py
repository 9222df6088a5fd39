"""Windows of images, and recordings in viewers."""

import threading
import time

import numpy as np
import pytest
from conftest import virtual_display

import kinetoscope as ks


def until(condition):
    """Waits for a condition, at most 20 s."""
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end, "the condition stays false"
        time.sleep(0.01)


def screen(folder):
    """Colors of the display, RGB, shape (height, width, 3): Xvfb writes them to a file in the format of xwd."""
    dumped = (folder / "Xvfb_screen0").read_bytes()
    words = np.frombuffer(dumped, ">u4", 25)
    header, width, height, line, colors = (int(words[at]) for at in (0, 4, 5, 12, 19))
    pixels = np.frombuffer(dumped, np.uint8, line * height, header + 12 * colors).reshape(height, line // 4, 4)
    return pixels[:, :width, 2::-1]


def test_images_in_a_window(tmp_path):
    with virtual_display("-fbdir", str(tmp_path)) as display:
        window = ks.ImageWindow("camera", (64, 48), display=display)
        assert window.is_open and repr(window) == "<ImageWindow, open>" and window.failure is None
        until(lambda: window.frame_count >= 1)
        # Columns and rows have colors of their own. An image of RGBA with gaps between its elements, then one of RGB.
        image = np.zeros((48, 128, 4), np.uint8)
        image[..., 0] = np.arange(128)
        image[..., 1] = 200 - np.arange(48)[:, None]
        for shown in (image[:, ::2], np.ascontiguousarray(255 - image[:, ::2, :3])):
            before = window.frame_count
            window.show(shown)
            until(lambda before=before: window.frame_count > before)
            colors = shown[..., :3]
            # The window is somewhere on the display.
            until(lambda colors=colors: any((screen(tmp_path)[y : y + 48, x : x + 64] == colors).all() for y, x in np.argwhere((screen(tmp_path) == colors[0, 0]).all(axis=2))))  # fmt: skip
        assert not window.wait(0.05) and not window.wait(0)
        window.close()
        assert window.wait() and window.wait(0) and not window.is_open and window.failure is None
        window.show(image)
        with ks.ImageWindow(display=display) as other:
            pass
        assert other.wait(20) and repr(other) == "<ImageWindow, closed>"
    with pytest.raises(ks.ViewerError):
        ks.ImageWindow(display=":4242")


def falling(path):
    """A recording of a falling cube: 101 frames in one second."""
    sim = ks.SimulationManager(threads=1, ground=None)
    sim.add_rigid_object(uid="cube", init_pose=[0, 0, 5, 1, 0, 0, 0])
    with sim.record(path):
        sim.update(100)
    return sim


def test_the_timeline_of_a_recording(tmp_path):
    """A viewer pauses a recording, seeks, and shows single frames; ``play`` ends after its time."""
    playback = ks.Playback(tmp_path / "a.npz", falling(tmp_path / "a.npz"))
    viewer, times = playback.sim.viewer(), playback.times
    assert viewer.state["timeline"] is None and len(times) == 101
    thread = threading.Thread(target=playback.play, kwargs={"timeout": 6.0})
    started = time.monotonic()
    thread.start()
    until(lambda: viewer.state["timeline"] is not None)
    viewer.pause()
    until(lambda: viewer.state["paused"])
    for seek, frame in ((times[50], 50), (times[55] + 0.005, 55), (-1e9, 0), (1e9, 100)):
        viewer.seek(seek)
        until(lambda frame=frame: viewer.state["steps"] == frame)
        timeline = viewer.state["timeline"]
        assert (timeline["start"], timeline["end"]) == (times[0], times[-1]) and timeline["time"] == times[frame]
    viewer.seek(times[10])
    viewer.step(3)
    until(lambda: viewer.state["steps"] == 13)
    thread.join(30)
    assert not thread.is_alive() and time.monotonic() - started >= 6.0
    # The simulation has the state of the last frame that was shown.
    part = playback.sim[playback.sim.keys()[0]]
    shown = part.body_poses
    playback.seek(13)
    np.testing.assert_array_equal(part.body_poses, shown)
    assert (part.body_poses[0, :, 2] < 5).any()
    viewer.close()


def test_a_recording_plays_in_real_time(tmp_path, display):
    playback = ks.Playback(tmp_path / "a.npz", falling(tmp_path / "a.npz"))
    end = playback.times[-1]
    viewer, window = playback.sim.viewer(), playback.sim.open_window(display=display)
    thread = threading.Thread(target=playback.play, args=(window,))
    started = time.monotonic()
    thread.start()
    until(lambda: viewer.state["timeline"] is not None and viewer.state["timeline"]["time"] == end)
    assert time.monotonic() - started > 0.9 and thread.is_alive()
    # The window ends it.
    window.close()
    thread.join(20)
    assert not thread.is_alive()
