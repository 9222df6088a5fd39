"""Calibration of cameras: camera_info, its files, rectification of pairs, and images on their way."""

import threading
import time

import cv2
import numpy as np
import pytest
import yaml

import kinetoscope as ks


def scene(**sensors):
    """Boxes in front of cameras at (0, 0, 1) that look along x."""
    sim = ks.SimulationManager(ks.SimulationManagerCfg(num_envs=2, threads=1))
    for number, (x, y) in enumerate(((2.0, 0.4), (3.0, -0.8), (2.5, -0.2))):
        sim.add_rigid_object(uid=f"box_{number}", body_type="static", init_pose=[x, y, 0.9, 1, 0, 0, 0], shape=ks.ObjectShape.box(size=[0.4] * 3))
    for name, cfg in sensors.items():
        sim.add_sensor(name, cfg)
    return sim


AHEAD = ks.Extrinsics(placement=ks.Placement.look_at(eye=[0, 0, 1], target=[2, 0, 0.8]))
LENS = ks.OpenCvLens(k1=-0.2, k2=0.05, p1=0.002, p2=-0.001)
# Focal lengths and principal point, from the corner of the first pixel.
PIXELS = ks.Intrinsics.pixels(fx=40.0, fy=41.0, cx=24.4, cy=17.8)


def test_calibrations(tmp_path):
    cfg = {"width": 48, "height": 36, "intrinsics": PIXELS, "lens": ks.Lens.opencv(LENS), "renderer": "fast_ray_traced"}
    view = {"channels": ["rgb", "depth", "position"], "extrinsics": AHEAD}
    sim = scene(eye=ks.CameraCfg(**cfg, **view))
    camera = sim["eye"]
    info = camera.camera_info(env=1)
    # In a calibration, the center of the first pixel is at 0.
    np.testing.assert_allclose(info["camera_matrix"], [[40, 0, 23.9], [0, 41, 17.3], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(info["distortion_coefficients"], [-0.2, 0.05, 0.002, -0.001, 0])
    assert (info["name"], info["width"], info["height"], info["distortion_model"]) == ("eye", 48, 36, "plumb_bob")
    np.testing.assert_array_equal(info["projection_matrix"][:, :3], info["camera_matrix"])
    np.testing.assert_array_equal(info["rectification_matrix"], np.eye(3))
    # OpenCV projects the points that the pixels see to these pixels.
    x, y, z, qw, *q = camera.pose_w("ros")[0]
    rotation = cv2.Rodrigues(2 * np.arctan2(np.linalg.norm(q), qw) * np.array(q) / np.linalg.norm(q))[0]
    seen = np.isfinite(camera["depth"][0])
    points = (camera["position"][0][seen].astype(float) - [x, y, z]) @ rotation
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), info["camera_matrix"], info["distortion_coefficients"])
    rows, columns = np.nonzero(seen)
    assert seen.sum() > 500
    # Single precision: 1e-7 of some meters, 40 pixels per meter at 1 m, some dozens of operations.
    np.testing.assert_allclose(pixels[:, 0], np.stack([columns, rows], axis=1), atol=1e-3)
    # Files: those of ROS, and the same camera again.
    camera.write_calibration(tmp_path / "eye.yaml")
    file = yaml.safe_load((tmp_path / "eye.yaml").read_text())
    assert file["image_width"] == 48 and file["distortion_model"] == "plumb_bob" and file["camera_name"] == "eye"
    np.testing.assert_array_equal(np.reshape(file["camera_matrix"]["data"], (3, 3)), info["camera_matrix"])
    fields = ks.read_calibration(tmp_path / "eye.yaml")
    assert fields["renderer"] == "fast_ray_traced" and fields["width"] == 48
    again = scene(eye=ks.CameraCfg(**fields, **view))
    for channel in ("rgb", "depth"):
        np.testing.assert_array_equal(again["eye"][channel], camera[channel])
    plain = scene(eye=ks.CameraCfg(width=48, height=36, **view))
    assert (plain["eye"]["depth"] != camera["depth"]).any()
    for call, error in (
        (lambda: ks.read_calibration(tmp_path / "missing.yaml"), ks.FileError),
        (lambda: camera.camera_info(env=2), ks.KinetoscopeError),
        (lambda: camera.camera_info(side="left"), ks.ArgumentError),
        (lambda: camera.rectification(), ks.ArgumentError),
        (lambda: camera.set_left_right_intrinsics(np.ones(4), np.ones(4)), ks.ArgumentError),
    ):
        with pytest.raises(error):
            call()
    (tmp_path / "bad.yaml").write_text("image_width: 48\n")
    with pytest.raises(ks.SensorError, match="image_height"):
        ks.read_calibration(tmp_path / "bad.yaml")


def test_rectified_pairs(rng):
    """After the rotations and projections, points have one row in both images, and the disparity f b / z."""
    turn = ks.StereoCameraCfg(
        camera=ks.CameraCfg(width=48, height=36, channels=["depth"], extrinsics=AHEAD, intrinsics=PIXELS),
        left_to_right_pos=[0.2, 0.01, -0.02],
        left_to_right_rot={"rpy_deg": [2.0, -3.0, 1.0]},
    )
    sim = scene(pair=turn)
    pair = sim["pair"]
    pair.set_left_right_intrinsics([40, 41, 24, 18], [42, 43, 23, 17])
    infos = [pair.camera_info(side=side) for side in ("left", "right")]
    assert infos[0]["name"] == "pair/left" and infos[1]["camera_matrix"][0, 0] == 42
    np.testing.assert_array_equal(pair.camera_info()["camera_matrix"], infos[0]["camera_matrix"])
    found = pair.rectification()
    roll, pitch, yaw = np.radians([2.0, -3.0, 1.0])
    turns = [cv2.Rodrigues(angle * axis)[0] for angle, axis in zip((roll, pitch, yaw), np.eye(3), strict=True)]
    rotation, offset = turns[2] @ turns[1] @ turns[0], np.array([0.2, 0.01, -0.02])
    points = rng.uniform([-1, -1, 2], [1, 1, 6], (50, 3))
    rotated = [points @ found["rotations"][0].T, (points - offset) @ rotation @ found["rotations"][1].T]
    pixels = []
    for side, seen in enumerate(rotated):
        projected = seen @ found["projections"][side][:, :3].T
        pixels.append(projected[:, :2] / projected[:, 2:])
    np.testing.assert_allclose(pixels[0][:, 1], pixels[1][:, 1], atol=1e-9)
    focal, baseline = found["projections"][0][0, 0], np.linalg.norm(offset)
    np.testing.assert_allclose(pixels[0][:, 0] - pixels[1][:, 0], focal * baseline / rotated[0][:, 2], atol=1e-9)
    # The calibration has the same matrices, from the center of the first pixel.
    np.testing.assert_array_equal(infos[1]["rectification_matrix"], found["rotations"][1])
    shift = np.zeros((3, 4))
    shift[:2, 2] = 0.5
    np.testing.assert_allclose(infos[1]["projection_matrix"] + shift, found["projections"][1], atol=1e-12)
    # A control: without the rotations, the rows differ.
    plain = [points @ infos[0]["camera_matrix"].T, (points - offset) @ rotation @ infos[1]["camera_matrix"].T]
    assert np.abs(plain[0][:, 1] / plain[0][:, 2] - plain[1][:, 1] / plain[1][:, 2]).max() > 1
    with pytest.raises(ks.ArgumentError, match="side"):
        pair.camera_info(side="middle")


def test_images_on_their_way():
    """With a latency, current images follow a write to the state at once, delivered ones after the latency."""
    sim = scene(eye=ks.CameraCfg(width=16, height=12, channels=["depth"], extrinsics=AHEAD, latency_steps=5, history_length=3))
    ball = sim.add_rigid_object(uid="ball", body_type="kinematic", init_pose=[1.5, 0, 1, 1, 0, 0, 0], shape=ks.ObjectShape.sphere(radius=0.2))
    camera = sim["eye"]
    sim.update(20)
    dt = sim.physics_dt
    np.testing.assert_allclose(camera.stamps, [15 * dt] * 2, atol=1e-12)
    np.testing.assert_array_equal(camera.latest_delivered_stamps, camera.stamps)
    np.testing.assert_allclose(camera.stamp_history[0], np.array([15, 14, 13]) * dt, atol=1e-12)
    before = camera["depth"]
    np.testing.assert_array_equal(camera.latest_delivered("depth"), before)
    ball.write_pose([1.5, 5, 1, 1, 0, 0, 0], env_ids=[1])
    assert (camera["depth"][1] != before[1]).any()
    np.testing.assert_array_equal(camera.latest_delivered("depth"), before)
    np.testing.assert_allclose(camera.stamps, [15 * dt, 20 * dt], atol=1e-12)
    np.testing.assert_allclose(camera.latest_delivered_stamps, [15 * dt] * 2, atol=1e-12)
    sim.update(6)
    np.testing.assert_array_equal(camera.latest_delivered("depth"), camera["depth"])
    with pytest.raises(ks.UnknownNameError, match="deph"):
        camera.latest_delivered("deph")
    imu = sim.add_sensor("imu", ks.ImuCfg(body="ball"))
    with pytest.raises(ks.UnknownNameError, match="no delivered images"):
        imu.latest_delivered("ang_vel_b")
    assert imu.stamp_history.shape == (2, 0)
    with pytest.raises(ks.ArgumentError, match="not a camera"):
        imu.image_shape  # noqa: B018


def test_poses_and_intrinsics_of_images_on_their_way():
    """With a latency, those of the delivered images: where the parent was at the capture, and the program's intrinsics at the
    delivery."""
    sim = ks.SimulationManager(num_envs=2, threads=1, ground=None, gravity=[0, 0, 0])
    cart = sim.add_rigid_object(uid="cart", body_type="kinematic", init_pose=[0, 0, 1, 1, 0, 0, 0])
    cfg = ks.CameraCfg(width=16, height=12, channels=["depth"], extrinsics=ks.Extrinsics(parent="cart"), latency_steps=5)
    camera = sim.add_sensor("eye", cfg)
    sim.update(20)
    poses, matrices = camera.pose_w("opengl"), camera.intrinsic_matrices
    np.testing.assert_array_equal(camera.latest_delivered_pose_w("opengl"), poses)
    np.testing.assert_array_equal(camera.latest_delivered_intrinsic_matrices, matrices)
    cart.write_pose([0, 5, 1, 1, 0, 0, 0], env_ids=[1])
    camera.set_intrinsics([20.0, 21.0, 8.0, 6.0], env_ids=[1])
    # Current images show the write at once. Delivered ones are older, in the environment of the write.
    np.testing.assert_allclose(camera.pose_w("opengl")[:, 1] - poses[:, 1], [0, 5], atol=1e-12)
    np.testing.assert_array_equal(camera.latest_delivered_pose_w("opengl"), poses)
    assert (camera.latest_delivered_pose_w() != poses).any()
    np.testing.assert_array_equal(camera.intrinsic_matrices[1], [[20, 0, 8], [0, 21, 6], [0, 0, 1]])
    np.testing.assert_array_equal(camera.latest_delivered_intrinsic_matrices, matrices)
    sim.update(6)
    np.testing.assert_array_equal(camera.latest_delivered_pose_w("opengl"), camera.pose_w("opengl"))
    np.testing.assert_array_equal(camera.latest_delivered_intrinsic_matrices, camera.intrinsic_matrices)
    with pytest.raises(ks.ArgumentError, match='"ros", "opengl" or "world"'):
        camera.latest_delivered_pose_w("open-gl")


def test_path_tracing_is_canceled_from_another_thread():
    sim = scene(eye=ks.CameraCfg(width=64, height=48, extrinsics=AHEAD, renderer=ks.CameraRenderer.ray_traced(samples=4)))
    camera = sim["eye"]
    progress = camera.progress
    assert (progress.samples, progress.total, progress.rays, progress.fraction, progress.elapsed) == (0, 0, 0, None, None)
    image = camera["color"]
    # Two environments.
    assert progress.samples == progress.total == 2 * 64 * 48 * 4 and progress.fraction == 1 and progress.remaining == 0
    assert progress.rays > progress.samples and progress.elapsed > 0
    assert repr(progress) == f"<RenderProgress: {progress.total} of {progress.total} paths>"
    progress.cancel()
    sim.update(1)
    assert progress.is_canceled and camera.progress.is_canceled
    with pytest.raises(ks.SensorError, match="cancel"):
        camera["color"]  # noqa: B018
    progress.resume()
    assert not progress.is_canceled and camera["color"].shape == image.shape
    # While a thread renders for minutes, another one sees the progress, and cancels it.
    large = ks.CameraCfg(width=640, height=480, extrinsics=AHEAD, renderer=ks.CameraRenderer.ray_traced(samples=50_000))
    camera = sim.add_sensor("large", large)
    progress, raised = camera.progress, []

    def render():
        try:
            camera["color"]  # noqa: B018
        except ks.SensorError as error:
            raised.append(str(error))

    thread = threading.Thread(target=render)
    thread.start()
    while not progress.rays:
        assert thread.is_alive()
        time.sleep(0.01)
    assert progress.total == 2 * 640 * 480 * 50_000 and 0 <= progress.fraction < 0.5 and not raised
    progress.cancel()
    thread.join(60)
    assert not thread.is_alive() and len(raised) == 1 and "cancel" in raised[0]
    with pytest.raises(ks.ArgumentError, match="not a camera"):
        sim.add_sensor("imu", ks.ImuCfg(body="box_0")).progress  # noqa: B018
