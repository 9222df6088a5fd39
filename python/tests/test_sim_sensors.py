"""Sensors of the package kinetoscope: every type, every channel by name, and what the values must be."""

import numpy as np
import pytest

import kinetoscope as ks

N = 2
MJCF = """<mujoco><worldbody>
  <body name="pole" pos="0 2 0.6"><joint name="hinge" axis="0 1 0" damping="0.1"/>
    <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.4" mass="1"/><site name="tip" pos="0 0 -0.4"/></body>
</worldbody>
<actuator><motor name="motor" joint="hinge" gear="2"/></actuator>
<sensor><jointpos name="angle" joint="hinge"/><framepos name="tip_pos" objtype="site" objname="tip"/></sensor></mujoco>"""


@pytest.fixture(scope="module")
def scene():
    """A standing quadruped, a cube, a pendulum from an MJCF file, and one sensor of each type."""
    sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=N, threads=2))
    sim.add_robot(ks.bundled_robot("quadruped", uid="dog"))
    sim.add_rigid_object(uid="cube", init_pose=[1.5, 0, 0.05, 1, 0, 0, 0], mass=2.0)
    sim.add_mjcf(uid="pendulum", text=MJCF)
    down = ks.Extrinsics(placement=ks.Placement.look_at(eye=[1.5, 0, 2], target=[1.5, 0, 0], up=[1, 0, 0]))
    sensors = {
        "camera": ks.CameraCfg(
            width=40, height=30, extrinsics=down, history_length=2, intrinsics=ks.Intrinsics.pixels(fx=40, fy=40, cx=20, cy=15),
            channels=["color", "depth", "distance", "mask", "normal", "shading_normal", "position", "albedo"],
        ),
        "moving": ks.CameraCfg(width=8, height=6, extrinsics=down, channels=["flow"]),
        "stereo": ks.StereoCameraCfg(
            camera=ks.CameraCfg(width=40, height=30, channels=["color", "depth"], extrinsics=down),
        ),
        "ray_camera": ks.RayCasterCameraCfg(width=8, height=6, extrinsics=down),
        "scanner": ks.RayCasterCfg(parent="dog/base", offset=[0, 0, 20, 1, 0, 0, 0], alignment="yaw", targets=ks.HitTargets.named(["ground"])),
        "feet": ks.ContactSensorCfg(
            bodies=["dog/.*_FOOT"], filters=["ground"], track_pose=True, track_air_time=True, track_contact_points=True,
            track_friction_forces=True, sampling=ks.SamplingCfg(history_length=3),
        ),
        "imu": ks.ImuCfg(body="cube", sampling=ks.SamplingCfg(history_length=4)),
        "frames": ks.FrameTransformerCfg(source="dog/base", targets=[ks.TargetFrameCfg(bodies="dog/.*_FOOT")]),
        "joints": ks.JointStateCfg(),
        "drives": ks.ActuatorStateCfg(),
        "wrenches": ks.JointWrenchCfg(links=["dog/.*_THIGH"]),
        "engine": ks.MujocoSensorCfg(),
    }  # fmt: skip
    for name, cfg in sensors.items():
        sim.add_sensor(name, cfg)
    sim.update(400)
    yield sim
    sim.destroy()


def test_every_channel_has_the_environments_first(scene):
    kinds = set()
    for name in scene:
        entity = scene[name]
        if isinstance(entity, ks.Sensor):
            kinds.add(entity.kind)
            assert entity.channels, name
            for channel in entity.channels:
                values = entity[channel]
                assert values.shape[0] == N and channel in entity, (name, channel)
                np.testing.assert_array_equal(values, entity.read(channel))
            assert list(entity) == entity.channels
            assert entity.channels[0] in repr(entity) and name in str(entity)
    assert len(kinds) == 11


def test_unknown_channels_list_the_known_ones(scene):
    for name in ("camera", "imu", "scanner", "feet", "stereo", "ray_camera"):
        with pytest.raises(ks.UnknownNameError, match="known channels: "):
            scene[name]["nothing"]
    with pytest.raises(ks.UnknownNameError, match='"depth"'):
        scene["camera"]["dept"]
    with pytest.raises(ks.UnknownNameError):
        scene["imu"].history("nothing")
    # The error named "depth" as unknown, and then as known.
    with pytest.raises(ks.UnknownNameError, match='channel "depth" of this sensor has no history'):
        scene["ray_camera"].history("depth")


def test_images(scene):
    """The camera looks straight down at a cube of 0.1 m: everything is known."""
    camera = scene["camera"]
    depth, mask = camera["depth"], camera["mask"]
    assert depth.shape == (N, 30, 40) and camera.image_shape == (30, 40)
    ids = {object_: id_ for id_, object_, *_ in scene.mask_ids}
    assert (mask[:, 15, 20] == ids["cube"]).all() and (mask[:, 0, 0] == ids["ground"]).all()
    assert mask[0, 15, 20] == scene["cube"].mask_id
    # The cube sinks in by less than 1 mm.
    np.testing.assert_allclose(depth[:, 15, 20], 1.9, atol=1e-3)
    np.testing.assert_allclose(depth[:, 0, 0], 2.0, atol=1e-6)
    # The distance is longer by the length of the ray through the pixel center.
    u, v = np.meshgrid(np.arange(40) + 0.5 - 20, np.arange(30) + 0.5 - 15)
    np.testing.assert_allclose(camera["distance"], depth * np.sqrt(1 + (u / 40) ** 2 + (v / 40) ** 2), rtol=1e-6)
    np.testing.assert_allclose(camera["normal"][0, 0, 0], [0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(camera["position"][0, 0, 0, 2], 0, atol=1e-6)
    for alias, name in (("rgb", "color"), ("distance_to_image_plane", "depth"), ("normals", "normal")):
        np.testing.assert_array_equal(camera[alias], camera[name])
    assert camera["color"].dtype == np.uint8 and (camera["color"][..., 3] == 255).all()
    assert camera.history("depth").shape == (N, 2, 30, 40)
    np.testing.assert_array_equal(camera.history("depth")[:, 0], depth)
    np.testing.assert_allclose(camera.intrinsic_matrices[1], [[40, 0, 20], [0, 40, 15], [0, 0, 1]])
    np.testing.assert_allclose(camera.pose_w()[:, :3], [[1.5, 0, 2]] * N)
    points = camera.point_cloud(0)
    assert points.shape[1] == 3
    np.testing.assert_allclose(np.sort(np.unique(np.round(points[:, 2], 2))), [0.0, 0.1])


def test_images_into_an_array_of_the_caller(scene):
    camera = scene["camera"]
    out = np.zeros((N, 30, 40), np.float32)
    assert camera.read("depth", out=out) is out
    np.testing.assert_array_equal(out, camera["depth"])
    frozen = np.zeros((N, 30, 40), np.float32)
    frozen.setflags(write=False)
    for wrong in (np.zeros((N, 30, 41), np.float32), np.zeros((N, 30, 40)), frozen, [1]):
        with pytest.raises(ks.ArgumentError, match="out: expected a writable, aligned array of f32"):
            camera.read("depth", out=wrong)


def test_stereo(scene):
    stereo = scene["stereo"]
    assert stereo["left/depth"].shape == stereo["right/depth"].shape == stereo["disparity"].shape == (N, 30, 40)
    assert stereo["left/color"].shape == (N, 30, 40, 4)
    np.testing.assert_allclose(stereo["left/depth"][0, 0, 0], 2.0, atol=1e-5)


def test_ray_casters(scene):
    scanner, ray = scene["scanner"], scene["ray_camera"]
    assert scanner["hits"].shape == scanner["normals"].shape == scanner["ray_starts"].shape == (N, 187, 3)
    assert scanner["hit_mask"].all() and scanner["hit_mask"].dtype == bool and scanner["ids"].dtype == np.int32
    np.testing.assert_allclose(scanner["hits"][..., 2], 0, atol=1e-9)
    hits = scanner["ray_starts"] + scanner["distances"][..., None] * scanner["ray_directions"]
    np.testing.assert_allclose(hits, scanner["hits"], atol=1e-6)
    assert ray["depth"].shape == (N, 6, 8) and ray.image_shape == (6, 8)


def test_contacts(scene):
    feet = scene["feet"]
    assert feet["net_forces_w"].shape == (N, 4, 3) and feet.history("net_forces_w").shape == (N, 3, 4, 3)
    assert feet["force_matrix_w"].shape == (N, 4, 1, 3) and feet["contact_count_matrix"].shape == (N, 4, 1)
    assert feet.columns == [f"dog/{leg}_FOOT" for leg in ("LF", "RF", "LH", "RH")] and feet.filters == ["ground"]
    assert feet.units["net_forces_w"] == "N"
    # A standing robot: the feet carry its weight, and everything that touches them is the ground.
    weight = scene["dog"].total_mass * 9.81
    np.testing.assert_allclose(feet["net_forces_w"][..., 2].sum(axis=1), weight, rtol=0.02)
    np.testing.assert_array_equal(feet["force_matrix_w"][:, :, 0], feet["net_forces_w"])
    assert (feet["current_contact_time"] > 0).all() and not feet["first_contact"].any()
    assert feet["contact_points_w"].shape == feet["pos_w"].shape == (N, 4, 3) and feet["quat_w"].shape == (N, 4, 4)
    contacts = scene.contacts()
    assert len(contacts) == N
    on_feet = [c for c in contacts[0] if any(body and body.endswith("_FOOT") for body in c["bodies"])]
    assert sum(abs(c["force"][2]) for c in on_feet) == pytest.approx(weight, rel=0.02)


def test_inertial_measurements(scene):
    imu = scene["imu"]
    # At rest, an accelerometer measures the reaction to gravity.
    np.testing.assert_allclose(imu["lin_acc_b"], [[0, 0, 9.81]] * N, atol=0.05)
    np.testing.assert_allclose(imu["pos_w"], scene["cube"].pose[:, :3], atol=1e-9)
    assert imu.history("ang_vel_b").shape == (N, 4, 3)
    np.testing.assert_array_equal(imu.history("ang_vel_b")[:, 0], imu["ang_vel_b"])
    assert (imu.sample_counts == 400).all()
    np.testing.assert_allclose(imu.stamps, scene.time)


def test_joints_frames_and_engine(scene):
    dog, part = scene["dog"], scene["pendulum"]
    joints, frames, drives, engine = scene["joints"], scene["frames"], scene["drives"], scene["engine"]
    np.testing.assert_array_equal(joints["positions"], np.concatenate([dog.qpos, part.qpos], axis=1))
    assert len(joints.columns) == 13 and joints.columns[0] == f"dog/{dog.joint_names[0]}"
    assert frames["target_pos_source"].shape == (N, 4, 3) and frames["source_pos_w"].shape == (N, 3)
    np.testing.assert_allclose(frames["source_pos_w"], dog.root_pose[:, :3], atol=1e-12)
    np.testing.assert_allclose(frames["target_pos_w"][:, 0], dog.link_pose("LF_FOOT")[:, :3], atol=1e-9)
    assert all(drives[channel].shape == (N, 13) for channel in drives.channels)
    assert engine["values"].shape == (N, 4)
    np.testing.assert_allclose(engine["values"][:, 1:], part.site_pose("tip")[:, :3], atol=1e-9)
    wrenches = scene["wrenches"]
    assert wrenches["forces"].shape == wrenches["torques"].shape == (N, len(wrenches.columns), 3)


def test_cameras_can_be_moved(scene):
    camera = scene["camera"]
    pose = camera.pose_w()
    camera.look_at([1.5, 0, 3], [1.5, 0, 0], up=[1, 0, 0])
    np.testing.assert_allclose(camera["depth"][:, 0, 0], 3.0, atol=1e-6)
    higher = pose.copy()
    higher[1, 2] = 4
    camera.set_world_poses(higher)
    np.testing.assert_allclose(camera["depth"][:, 0, 0], [2.0, 4.0], atol=1e-6)
    camera.set_intrinsics([80, 80, 20, 15], env_ids=[1])
    assert camera.intrinsic_matrices[:, 0, 0].tolist() == [40, 80]
    gl = camera.local_pose("opengl")
    np.testing.assert_allclose(gl[:, :3], camera.local_pose()[:, :3])
    assert not np.allclose(gl[:, 3:], camera.local_pose()[:, 3:])
    camera.restore()
    np.testing.assert_allclose(camera.pose_w(), pose)
    for call in (
        lambda: scene["imu"].look_at([0, 0, 1], [0, 0, 0]),
        lambda: scene["imu"].image_shape,
        lambda: camera.pose_w("rso"),
        lambda: camera.look_at([0, 0], [0, 0, 0]),
        lambda: camera.set_intrinsics([1, 2, 3]),
    ):
        with pytest.raises(ks.ArgumentError):
            call()


def test_display_in_notebooks(scene):
    html = scene["camera"]._repr_html_()
    assert html.count("<img") == N * 9 - N and "data:image/png;base64," in html
    assert scene["imu"]._repr_html_().startswith("<pre>")
    scene["feet"].set_debug_vis(True)


def test_segments_and_boxes():
    """Two boxes below a camera, one partly hidden: the judges are the mask and the sizes of the boxes."""
    sim = ks.SimulationManager(num_envs=2)
    for uid, y, z, size in (("low", 0.0, 0.1, 0.2), ("high", 0.1, 0.5, 0.1)):
        shape = ks.ObjectShape.box(size=[size] * 3)
        sim.add_rigid_object(uid=uid, shape=shape, body_type="static", init_pose=[0, y, z, 1, 0, 0, 0])
    above = ks.Placement.look_at(eye=[0, 0, 1.5], target=[0, 0, 0], up=[1, 0, 0])
    camera = sim.add_sensor("camera", ks.CameraCfg(width=64, height=48, channels=["mask"], extrinsics=ks.Extrinsics(placement=above)))
    sim.update()
    mask, (low, high) = camera["mask"], (sim[uid].mask_id for uid in ("low", "high"))
    segmentation = sim.segmentation({"low|high": "box"})
    names = {row["name"]: row for row in segmentation.segments()}
    assert names["low"]["mask_ids"] == [low] and names["high"]["class"] == "box" and "ground" in names
    assert [row["mask_ids"] for row in segmentation.segments("semantic") if row["name"] == "box"] == [sorted([low, high])]
    # Instances have the ids of the mask; boxes are one class.
    np.testing.assert_array_equal(segmentation.segment(mask), mask)
    classes = segmentation.segment(mask[0], level="semantic")
    assert classes.shape == (48, 64) and classes.dtype == np.int32
    assert len({*classes[(mask[0] == low) | (mask[0] == high)]}) == 1
    colors = segmentation.colorize(mask)
    assert colors.shape == (2, 48, 64, 4) and colors.dtype == np.uint8
    np.testing.assert_array_equal(segmentation.colorize(mask[1].astype(np.int64)), colors[1])
    assert len(np.unique(colors[0].reshape(-1, 4), axis=0)) == len(np.unique(mask[0]))
    boxes = {row["name"]: row for row in segmentation.boxes_2d(camera, env=1)}
    for uid, mask_id in (("low", low), ("high", high)):
        v, u = np.nonzero(mask[1] == mask_id)
        assert boxes[uid]["tight"] == (u.min(), v.min(), u.max() + 1, v.max() + 1)
        assert boxes[uid]["visible_pixels"] == len(u)
    solid = {row["name"]: row for row in segmentation.boxes_3d(camera)}
    np.testing.assert_allclose(solid["high"]["pose"], sim["high"].pose[0], atol=1e-6)
    np.testing.assert_allclose([solid["low"]["min"], solid["low"]["max"]], [[-0.1] * 3, [0.1] * 3], atol=1e-6)
    hidden = {row["name"]: row for row in segmentation.occlusions(camera)}
    assert hidden["high"]["ratio"] == 0 and 0 < hidden["low"]["ratio"] < 1
    assert hidden["low"]["visible_pixels"] == (mask[0] == low).sum() < hidden["low"]["unoccluded_pixels"]
    with pytest.raises(ks.ArgumentError, match="instance"):
        segmentation.segments("object")
    with pytest.raises(ks.ArgumentError, match="whole numbers"):
        segmentation.segment(np.zeros((2, 2)))
    with pytest.raises(ks.KinetoscopeError, match="nothing"):
        sim.segmentation({"nothing": "box"})
    # Points of pixels, and environments of rows.
    partial = sim.add_sensor("partial", ks.CameraCfg(width=6, height=4, channels=["depth"], env_ids=[1], extrinsics=ks.Extrinsics(placement=above)))
    assert partial.env_ids == [1] and camera.env_ids == [0, 1] and partial["depth"].shape == (1, 4, 6)
    points = partial.point_map(1, "camera")
    np.testing.assert_array_equal(points[..., 2], partial["depth"][0])
    np.testing.assert_allclose(partial.point_map(1).reshape(-1, 3), partial.point_cloud(1), atol=1e-6)
    other = ks.SimulationManager()
    with pytest.raises(ks.ForeignHandleError):
        segmentation.boxes_2d(other.add_sensor("camera", ks.CameraCfg(width=4, height=4, channels=["mask"])))
    sim.add_sensor("imu", ks.ImuCfg(body="low"))
    with pytest.raises(ks.ArgumentError, match="camera"):
        segmentation.boxes_2d(sim["imu"])
