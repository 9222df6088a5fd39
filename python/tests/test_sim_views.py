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


def step_until(sim, condition):
    """Steps until a condition, at most 20 s."""

    def is_true():
        if condition():
            return True
        sim.update(1)
        return False

    until(is_true)


def published(viewer, sim, condition):
    """Steps until the published state fulfills a condition, and returns it."""
    step_until(sim, lambda: condition(viewer.state))
    return viewer.state


def test_the_record_button_writes_files(arm_sim, tmp_path, display):
    """Each press starts a new file, here by a viewer. The judge is the motion that the program saw."""
    sim, arm = arm_sim
    files = sim.file_recording(ks.RecorderCfg(path=tmp_path / "run.npz", topics=[ks.Topic.joint_states("arm")]))
    assert repr(files) == "<FileRecording: no recording yet>" and files.finish() == [] and not files.is_recording
    viewer = sim.viewer()
    # Without a button, the command is refused.
    assert viewer.state["recording"] is None
    viewer.record()
    assert "button" in published(viewer, sim, lambda state: state["refusal"])["refusal"]
    window = sim.open_window(display=display, speed=None, record_button=files)
    assert published(viewer, sim, lambda state: state["recording"])["recording"] == {"on": False, "text": ""}
    seen = []
    for number, target in enumerate((0.2, -0.1)):
        arm.set_qpos_target([target] * 6)
        viewer.record()
        step_until(sim, lambda: files.is_recording)
        assert files.failure is None and repr(files).startswith("<FileRecording, recording: run")
        positions = [arm.qpos]
        for _ in range(9 + number):
            sim.update(1)
            positions.append(arm.qpos)
        seen.append(np.array(positions))
        viewer.record(False)
        step_until(sim, lambda: not files.is_recording)
    assert published(viewer, sim, lambda state: "MB" in state["recording"]["text"])["recording"]["on"] is False
    summaries = files.finish()
    assert [summary.path.name for summary in summaries] == ["run.npz", "run-2.npz"] and files.finish() == []
    for positions, summary in zip(seen, summaries, strict=True):
        recorded = np.load(summary.path)["arm/joint_states/positions"]
        # Commands are handled some steps later.
        starts = range(len(recorded) - len(positions) + 1)
        assert sum((recorded[start : start + len(positions)] == positions).all() for start in starts) == 1, recorded.shape
    # A program records by the same object, to exactly the file of the configuration, which exists now.
    with pytest.raises(ks.RecordingError, match="exists"):
        files.start()
    other = sim.file_recording(tmp_path / "own.npz")
    other.start()
    sim.update(3)
    assert [summary.path.name for summary in other.finish()] == ["own.npz"]
    # Another button replaces it; the view of a browser has it too.
    server = sim.serve(record_button=other)
    viewer.record()
    step_until(sim, lambda: other.is_recording)
    assert not files.is_recording
    sim.set_record_button(files)
    sim.update(1)
    assert not other.is_recording
    assert [summary.path.name for summary in other.finish()] == ["own-2.npz"]
    server.close()
    window.close()
    with ks.SimulationManager() as foreign:
        for call in (
            lambda: foreign.set_record_button(files),
            lambda: foreign.serve(record_button=files),
            lambda: foreign.open_window(display=display, record_button=files),
        ):
            with pytest.raises(ks.ForeignHandleError, match="record button belongs to another simulation"):
                call()
    with pytest.raises(ks.ConfigError, match="file_path"):
        sim.file_recording({"file_path": "run.npz"})


def test_viewers_set_targets_and_pull(arm_sim):
    sim, arm = arm_sim
    viewer = sim.viewer()
    viewer.set_target(arm, "JOINT3", -0.25, env=1)
    viewer.set_target(arm, 1, 0.5)
    expected = np.array([[0, 0.5, 0, 0, 0, 0], [0, 0.5, -0.25, 0, 0, 0]])
    step_until(sim, lambda: (arm.qpos_target == expected).all())
    # A paused simulation waits in update.
    viewer.toggle_pause()
    thread = threading.Thread(target=sim.update, args=(1000,))
    thread.start()
    until(lambda: viewer.state["paused"])
    time.sleep(0.2)
    assert thread.is_alive()
    viewer.toggle_pause()
    thread.join(20)
    assert not thread.is_alive() and not published(viewer, sim, lambda state: not state["paused"])["paused"]
    with ks.SimulationManager() as foreign:
        twin = foreign.add_robot(ks.bundled_robot("sr5", uid="arm"))
        for call, error, text in (
            (lambda: viewer.set_target(twin, 0, 0.0), ks.ForeignHandleError, "another simulation"),
            (lambda: viewer.set_target(arm, 6, 0.0), ks.OutOfRangeError, "joint 6 does not exist; there are 6"),
            (lambda: viewer.set_target(arm, "JOIN1", 0.0), ks.UnknownNameError, "JOINT1"),
            (lambda: viewer.set_target(arm, 0, np.nan), ks.ArgumentError, "not a finite position"),
            (lambda: viewer.set_target(arm, 0, 0.0, env=2), ks.OutOfRangeError, "environment 2"),
            (lambda: viewer.drag("arm/lnk3", [0, 0, 1]), ks.UnknownNameError, "arm/link3"),
            (lambda: viewer.drag("arm/link3", [0, np.inf, 1]), ks.ArgumentError, "target"),
            (lambda: viewer.drag("arm/link3", [0, 0, 1], anchor=[np.nan, 0, 0]), ks.ArgumentError, "anchor"),
            (lambda: viewer.drag("arm/link3", [0, 0, 1], env=2), ks.OutOfRangeError, "environment 2"),
        ):
            with pytest.raises(error, match=text):
                call()


def is_steady(sim, body):
    """True if the velocity of a body in environment 1 stays for a step."""
    before = body.velocity[1]
    sim.update(1)
    return (body.velocity[1] == before).all()


def test_a_viewer_pulls_a_body_with_a_spring():
    """A free body reaches the target of the spring in one environment; after the release, and in the other, it goes straight on."""
    sim = ks.SimulationManager(num_envs=2, threads=1, ground=None, gravity=[0, 0, 0])
    cube = sim.add_rigid_object(uid="cube")
    start = cube.pose[:, :3]
    viewer = sim.viewer()
    viewer.drag("cube", start[1] + [0.2, 0, 0], env=1)
    step_until(sim, lambda: cube.velocity[1, 0] > 0)
    sim.update(300)
    np.testing.assert_allclose(cube.pose[1, :3], start[1] + [0.2, 0, 0], atol=0.01)
    np.testing.assert_array_equal(cube.pose[0, :3], start[0])
    viewer.drag("cube", start[1] - [20, 0, 0], env=1)
    step_until(sim, lambda: cube.velocity[1, 0] < -0.01)
    viewer.release()
    step_until(sim, lambda: is_steady(sim, cube))
    velocity, before = cube.velocity[1, :3], cube.pose[1, :3]
    assert velocity[0] < -0.01
    sim.update(10)
    np.testing.assert_allclose(cube.velocity[1, :3], velocity, atol=1e-9)
    np.testing.assert_allclose(cube.pose[1, :3], before + 10 * sim.physics_dt * velocity, atol=1e-9)
