"""Videos of LeRobot datasets, configurations of recordings and views, and recordings that were killed."""

import io
import json
import os
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest
from PIL import Image

import kinetoscope as ks


def moving_cube(num_envs=1):
    """A red cube that crosses the view of a camera of 64 x 64 pixels."""
    sim = ks.SimulationManager(num_envs=num_envs, threads=1, ground=None, gravity=[0, 0, 0])
    cube = sim.add_rigid_object(
        uid="cube", shape=ks.ObjectShape.box(size=[0.4] * 3), rgba=[1, 0, 0, 1], init_pose=[0, -0.6, 0, 1, 0, 0, 0]
    )
    look = ks.Placement.look_at(eye=[2, 0, 0], target=[0, 0, 0])
    sim.add_sensor("eye", ks.CameraCfg(width=64, height=64, channels=["rgb"], extrinsics=ks.Extrinsics(placement=look)))
    cube.write_velocity([0, 2, 0, 0, 0, 0])
    return sim


def png_images(path):
    """All PNG images in the bytes of a Parquet file, whose pages are not compressed."""
    content, images, start = path.read_bytes(), [], 0
    while (start := content.find(b"\x89PNG\r\n\x1a\n", start)) >= 0:
        end = content.index(b"IEND", start) + 8
        images.append(np.asarray(Image.open(io.BytesIO(content[start:end])).convert("RGB")))
        start = end
    return images


def video_frames(path):
    """All frames of a video, decoded by OpenCV."""
    video, frames = cv2.VideoCapture(str(path)), []
    while (read := video.read())[0]:
        frames.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
    return frames


@pytest.mark.parametrize("use_videos", [True, False])
def test_cameras_of_learning_datasets(use_videos, tmp_path):
    """Videos by default, PNG images otherwise, against the images of a NumPy archive of the same run."""
    sim = moving_cube(num_envs=2)
    path, archive = tmp_path / "run.lerobot", tmp_path / "run.npz"
    topics = [ks.Topic.object_pose("cube"), ks.Topic.sensor("eye")]
    options = {} if use_videos else {"use_videos": False}
    with sim.record(path, topics, **options), sim.record(archive, topics):
        sim.update(60)
    info = json.loads((path / "meta" / "info.json").read_text())
    feature = info["features"]["observation.images.eye"]
    assert feature["dtype"] == ("video" if use_videos else "image") and feature["shape"] == [64, 64, 3]
    assert info["total_episodes"] == 2 and (info["video_path"] is not None) == use_videos
    videos = sorted(path.rglob("*.mp4"))
    expected = np.load(archive)["eye/color"]
    count = info["total_frames"] // 2
    assert expected.shape[1:] == (2, 64, 64, 4) and expected.shape[0] >= count > 50
    expected = expected[:count, ..., :3]
    if use_videos:
        assert [str(video.relative_to(path)) for video in videos] == ["videos/observation.images.eye/chunk-000/file-000.mp4"]
        frames = video_frames(videos[0])
    else:
        assert not videos
        frames = [image for table in sorted(path.glob("data/**/*.parquet")) for image in png_images(table)]
    # The episodes of both environments in sequence.
    assert len(frames) == 2 * count
    for env in range(2):
        for at in range(0, count, 10):
            frame, own = frames[env * count + at].astype(int), expected[:, env].astype(int)
            if use_videos:
                # Videos lose details: of the images of other times, 10 steps apart, none is as near.
                distances = [np.abs(frame - own[other]).mean() for other in range(0, count, 10)]
                assert np.argmin(distances) == at // 10, distances
            else:
                np.testing.assert_array_equal(frame, own[at])
    if use_videos:
        sim.add_sensor("odd", ks.CameraCfg(width=63, height=64))
        with pytest.raises(ks.RecordingError, match="even"):
            sim.record(tmp_path / "odd.lerobot")


def test_configurations_of_recordings(tmp_path):
    sim = moving_cube(num_envs=2)
    cfg = ks.RecorderCfg(
        path=tmp_path / "a.npz", topics=[ks.Topic.object_pose("cube"), "events"], envs=[1], period_steps=5, packets=3
    )
    with sim.record(cfg) as recorder:
        assert recorder.path == tmp_path / "a.npz" and recorder.failure is None
        sim.update(20)
    rows = np.load(tmp_path / "a.npz")
    assert rows["cube/pose"].shape == (5, 1, 1, 7)
    # Arguments replace fields, and a dict does as well as the class.
    with sim.record({"path": str(tmp_path / "b.npz"), "topics": [{"object_pose": "cube"}], "period_steps": 5}, period_steps=10):
        sim.update(20)
    rows = np.load(tmp_path / "b.npz")
    assert rows["cube/pose"].shape == (3, 2, 1, 7)
    assert ks.Topic.channel("eye", "rgb").value == {"channel": {"sensor": "eye", "channel": "rgb"}}
    assert ks.Topic.events().value == "events"
    for wrong, text in (
        (ks.RecorderCfg(packets=1, path=tmp_path / "c.npz"), "packets"),
        (ks.ServeCfg(), "a ServeCfg is not a RecorderCfg"),
        ({"paths": "x"}, "paths"),
        (3, "not int"),
    ):
        with pytest.raises(ks.KinetoscopeError, match=text):
            sim.record(wrong)
    # The overview from another side is another image.
    images = []
    for number, eye in enumerate(([3.0, 0, 1], [0, -3.0, 1])):
        overview = ks.OverviewCfg(size=(64, 48), fps=50.0, eye=eye, target=[0, 0, 0])
        path = tmp_path / f"overview_{number}"
        with sim.record(path, ks.Topic.overview(), format="images", overview=overview):
            sim.update()
        images.append(sorted(path.rglob("*.png"))[0].read_bytes())
    assert images[0] != images[1]


def test_configurations_of_views(tmp_path):
    sim = moving_cube(num_envs=2)
    camera = ks.OrbitCamera(target=[0, 0, 0], distance=4.0, azimuth=0.5)
    cfg = ks.ScreenshotCfg(size=(64, 48), camera=camera, envs=ks.EnvSelection.one(0))
    plain = sim.screenshot(cfg=cfg)
    assert plain.shape == (48, 64, 4)
    assert sim.screenshot(cfg=cfg, size=[32, 24]).shape == (24, 32, 4)
    frames = ks.ScreenshotCfg(size=(64, 48), camera=camera, envs=ks.EnvSelection.one(0), overlays=ks.Overlays(frames=True))
    assert (sim.screenshot(cfg=frames) != plain).any()
    assert (sim.screenshot(cfg=ks.ScreenshotCfg(size=(64, 48), camera=camera, envs="all")) != plain).any()
    with pytest.raises(ks.ConfigError, match="framse"):
        sim.screenshot(cfg={"overlays": {"framse": True}})
    for cfg in (ks.ServeCfg(max_viewers=3, speed=None), {"max_viewers": 3, "speed": None}, ks.ServeCfg(speed=ks.Speed.factor(2.0))):
        server = sim.serve(cfg=cfg)
        assert server.url.startswith("http://127.0.0.1:")
        server.close()
    with pytest.raises(ks.ArgumentError, match="not both"):
        sim.open_window("title", cfg=ks.WindowCfg())
    stream = sim.stream_to_foxglove(ks.FoxgloveCfg(address="127.0.0.1:0", topics=[ks.Topic.object_pose("cube")]))
    assert stream.url.startswith("ws://127.0.0.1:")
    stream.close()
    segmentation = sim.segmentation(ks.SegmentationCfg(labels={"cube": "target"}))
    assert "target" in {segment["name"] for segment in segmentation.segments("semantic")}


WINDOW = """
import sys, kinetoscope as ks
sim = ks.SimulationManager()
window = sim.open_window(cfg=ks.WindowCfg(title="window", size=(160, 120), speed=ks.Speed.unlimited))
assert window.is_open and window.failure is None and not window.wait(0.05)
sim.update(10)
window.close()
assert window.wait(20) and not window.is_open and window.failure is None and window.wait(0)
print("closed")
"""


def test_windows_are_waited_for(display):
    environment = {**os.environ, "DISPLAY": display}
    program = [sys.executable, "-c", WINDOW]
    result = subprocess.run(program, capture_output=True, text=True, timeout=120, env=environment, check=False)
    assert result.stdout == "closed\n", result.stderr


KILLED = """
import sys, kinetoscope as ks
sim = ks.SimulationManager(num_envs=1)
sim.add_rigid_object(uid="cube")
recorder = sim.record(sys.argv[1], [ks.Topic.object_pose("cube")])
print("started", flush=True)
while True:
    sim.update(100)
"""


def test_killed_recordings_are_recovered(tmp_path):
    path = tmp_path / "run.mcap"
    process = subprocess.Popen([sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "started\n"
    # What the writer thread received is in the file half a second later.
    deadline, part = time.monotonic() + 60, tmp_path / "run.mcap.part"
    while time.monotonic() < deadline and not (part.exists() and part.stat().st_size > 100_000):
        time.sleep(0.1)
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=60)
    assert not path.exists()
    messages, damage = ks.recover(path)
    assert messages > 100 and damage is None and path.is_file()
    times, heights = ks.read_series(path, "/env_0/tf", "transforms[env_0/cube].transform.translation.z")
    assert len(times) > 50 and np.isfinite(heights).all()
    with pytest.raises(ks.RecordingError):
        ks.recover(tmp_path / "missing.mcap")
