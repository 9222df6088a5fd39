"""Prints the last sensor messages as JSON: points, contact forces, images, names. Read by mcap, mcap-ros2-support, Pillow."""

import io
import struct
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from reader_output import print_json, weighed

last, frames, about = {}, {}, {}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        last[channel.topic] = (schema.name, message, decoded)
        about[channel.topic] = channel.metadata
        if channel.topic == "/env_1/tf":
            frames.update((transform.child_frame_id, transform.transform) for transform in decoded.transforms)
    attached = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}


def of(topic, kind):
    name, message, decoded = last[topic]
    assert name == kind, name
    return message, decoded


message, cloud = of("/env_1/scanner/points", "sensor_msgs/msg/PointCloud2")
names = ["x", "y", "z", "distance", "normal_x", "normal_y", "normal_z", "id"]
assert [(f.name, f.offset, f.count) for f in cloud.fields] == [(name, 4 * k, 1) for k, name in enumerate(names)]
assert [f.datatype for f in cloud.fields] == [7] * 7 + [5]
assert (cloud.height, cloud.is_bigendian, cloud.is_dense, cloud.point_step) == (1, False, True, 32)
assert cloud.row_step == len(cloud.data) == 32 * cloud.width and cloud.header.frame_id == "env_1"
hits = list(struct.iter_unpack("<7fi", bytes(cloud.data)))
points = [x for hit in hits for x in hit[:3]]
_, distances = of("/env_1/scanner/distances", "std_msgs/msg/Float64MultiArray")
whole = [struct.pack("<f", x) for x in distances.data if x != float("inf")]
assert whole == [struct.pack("<f", hit[3]) for hit in hits], "a distance of every hit, in the order of the rays"


def vector(v):
    return [v.x, v.y, v.z]


def words(topic, encoding, size):
    """Returns the data of an image as 32-bit words."""
    _, image = of(topic, "sensor_msgs/msg/Image")
    assert (image.encoding, image.step) == (encoding, size * image.width), (image.encoding, image.step)
    return struct.unpack(f"<{len(image.data) // 4}I", bytes(image.data))


def color(topic):
    _, image = of(topic, "sensor_msgs/msg/CompressedImage")
    return Image.open(io.BytesIO(bytes(image.data))).convert("RGB").tobytes()


_, speed = of("/env_1/imu/velocity", "geometry_msgs/msg/TwistStamped")
_, change = of("/env_1/imu/acceleration", "geometry_msgs/msg/AccelStamped")
moves = vector(speed.twist.linear) + vector(speed.twist.angular) + vector(change.accel.linear) + vector(change.accel.angular)
mount = frames["env_1/sensors/scanner"]
turn = mount.rotation

_, forces = of("/env_1/touch/net_forces_w", "std_msgs/msg/Float64MultiArray")
assert [dim.size for dim in forces.layout.dim] == [3] and forces.layout.data_offset == 0

_, normal = of("/env_1/eye/normal", "sensor_msgs/msg/Image")
assert (normal.encoding, normal.is_bigendian, normal.step) == ("32FC3", 0, 12 * normal.width)
assert len(normal.data) == normal.step * normal.height and normal.header.frame_id == "env_1/sensors/eye"
numbers = bytes(normal.data)

infos = [of(f"/env_1/pair/{eye}/camera_info", "sensor_msgs/msg/CameraInfo")[1] for eye in ("left", "right")]
projections = [[round(x, 9) for x in info.p] for info in infos]
_, fish = of("/env_1/fish/camera_info", "sensor_msgs/msg/CameraInfo")

print_json({
    "fish": [fish.distortion_model, list(fish.d), list(fish.k)],
    "infos": sorted(topic for topic in last if topic.startswith("/env_1") and topic.endswith("camera_info")),
    "projections": projections,
    "round": "env_1/sensors/round" in frames,
    "points": points,
    "point_time": message.log_time,
    "forces": list(forces.data),
    "normal_shape": [normal.height, normal.width, 3],
    # Each number by its bits and its place: none may stand for another.
    "normal_sum": weighed(struct.unpack(f"<{len(numbers) // 4}I", numbers)),
    "upward": sum(numbers[k : k + 12] == struct.pack("<3f", 0, 0, 1) for k in range(0, len(numbers), 12)),
    "attached": sorted(attached),
    "flow_sum": weighed(words("/env_1/eye/flow", "32FC2", 8)),
    "albedo_sum": weighed(color("/env_1/eye/albedo")),
    "disparity_sum": weighed(words("/env_1/pair/disparity", "32FC1", 4)),
    "right_sum": weighed(color("/env_1/pair/right/color")),
    "moves": moves,
    "distances": list(distances.data),
    "hit_ids": [hit[7] for hit in hits],
    "hit_normals": [x for hit in hits for x in hit[4:7]],
    "scanner": vector(mount.translation) + [turn.w, turn.x, turn.y, turn.z],
    "mask_ids": metadata["mask_ids"],
    "bodies": about["/env_1/touch/net_forces_w"]["rows"],
})
