"""Prints the last messages of a recording as JSON, read by the packages mcap, mcap-ros2-support and Pillow."""

import io
import struct
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from reader_output import print_json, weighed

last, counts = {}, {}
transforms = {}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
    summary = reader.get_summary()
    assert summary.chunk_indexes and all(c.compression == "lz4" for c in summary.chunk_indexes)
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        last[channel.topic] = (message, decoded)
        counts[channel.topic] = counts.get(channel.topic, 0) + 1
        if channel.topic.endswith("/tf") or channel.topic == "/tf_static":
            for transform in decoded.transforms:
                transforms[transform.child_frame_id] = transform
    indexed = {summary.channels[k].topic: n for k, n in summary.statistics.channel_message_counts.items()}
    assert all(indexed.get(topic, 0) == count for topic, count in counts.items()), "the index counts otherwise"


def pose(frame, parent):
    transform = transforms[frame]
    assert transform.header.frame_id == parent, transform.header.frame_id
    t, r = transform.transform.translation, transform.transform.rotation
    return [t.x, t.y, t.z, r.w, r.x, r.y, r.z]


joints = last["/env_1/arm/joint_states"][1]
stamp = joints.header.stamp
assert stamp.sec * 10**9 + stamp.nanosec == last["/env_1/arm/joint_states"][0].log_time
target = last["/env_1/arm/targets"][1]
imu = last["/env_1/imu"][1]
depth, mask = last["/env_1/camera/depth"][1], last["/env_1/camera/mask"][1]
assert (depth.encoding, mask.encoding, depth.step) == ("32FC1", "16UC1", 4 * depth.width)
numbers = struct.unpack(f"<{depth.width * depth.height}f", bytes(depth.data))
finite = [x for x in numbers if x != float("inf")]
color = last["/env_1/camera/color"][1]
assert color.format == "png" and color.header.frame_id == "env_1/sensors/camera"
picture = Image.open(io.BytesIO(bytes(color.data)))
assert picture.mode == "RGB" and picture.size == (depth.width, depth.height)
info = last["/env_1/camera/camera_info"][1]
assert (info.width, info.height, list(info.d)) == (depth.width, depth.height, [0.0] * 5)
assert pose("env_0", "world")[3:] == [1, 0, 0, 0]
links = [frame for frame in transforms if frame.startswith("env_1/arm/")]
print_json({
    "names": list(joints.name),
    "position": list(joints.position),
    "velocity": list(joints.velocity),
    "effort": list(joints.effort),
    "target": list(target.position),
    "tip": pose(links[-1], "env_1"),
    "tip_name": links[-1],
    "cube": pose("env_1/cube", "env_1"),
    "acceleration": [imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z],
    "orientation": [imu.orientation.w, imu.orientation.x, imu.orientation.y, imu.orientation.z],
    "intrinsics": list(info.k),
    "camera": pose("env_1/sensors/camera", "env_1"),
    "nanoseconds": last["/env_1/arm/joint_states"][0].log_time,
    "depth_shape": [depth.height, depth.width],
    "depth_finite": len(finite),
    "depth_range": [min(finite), max(finite)],
    "mask_sum": weighed(struct.unpack(f"<{mask.width * mask.height}H", bytes(mask.data))),
    "color_sum": weighed(picture.tobytes()),
    "rows": counts["/env_1/arm/joint_states"],
    "pictures": counts["/env_1/camera/color"],
})
