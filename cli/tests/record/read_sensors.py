"""Says as JSON what the last messages of sensors hold: points, forces of contact, normals. Read by mcap and mcap-ros2-support."""

import struct
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from told import tell, weighed

last, frames = {}, set()
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        last[channel.topic] = (schema.name, message, decoded)
        if channel.topic == "/env_1/tf":
            frames.update(transform.child_frame_id for transform in decoded.transforms)
    attached = {attachment.name: attachment.data for attachment in reader.iter_attachments()}


def of(topic, kind):
    name, message, decoded = last[topic]
    assert name == kind, name
    return message, decoded


message, cloud = of("/env_1/scanner/points", "sensor_msgs/msg/PointCloud2")
assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1)]
assert (cloud.height, cloud.is_bigendian, cloud.is_dense, cloud.point_step) == (1, False, True, 12)
assert cloud.row_step == len(cloud.data) == 12 * cloud.width and cloud.header.frame_id == "env_1"
points = struct.unpack(f"<{3 * cloud.width}f", bytes(cloud.data))

_, forces = of("/env_1/touch/net_forces_w", "std_msgs/msg/Float64MultiArray")
assert [dim.size for dim in forces.layout.dim] == [3] and forces.layout.data_offset == 0

_, normal = of("/env_1/eye/normal", "sensor_msgs/msg/Image")
assert (normal.encoding, normal.is_bigendian, normal.step) == ("32FC3", 0, 12 * normal.width)
assert len(normal.data) == normal.step * normal.height and normal.header.frame_id == "env_1/sensors/eye"
numbers = bytes(normal.data)

_, fish = of("/env_1/fish/camera_info", "sensor_msgs/msg/CameraInfo")

tell({
    "fish": [fish.distortion_model, list(fish.d), list(fish.k)],
    "infos": sorted(topic for topic in last if topic.endswith("camera_info")),
    "round": "env_1/sensors/round" in frames,
    "points": list(points),
    "point_time": message.log_time,
    "forces": list(forces.data),
    "normal_shape": [normal.height, normal.width, 3],
    # Each number by its bits and its place: none may stand for another.
    "normal_sum": weighed(struct.unpack(f"<{len(numbers) // 4}I", numbers)),
    "upward": sum(numbers[k : k + 12] == struct.pack("<3f", 0, 0, 1) for k in range(0, len(numbers), 12)),
    "attached": sorted(attached),
})
