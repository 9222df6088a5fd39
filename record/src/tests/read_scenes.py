"""Prints the scene of an environment as JSON: points of each entity, placed by the last recorded transforms. Read by the packages
mcap and mcap-ros2-support."""

import sys

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from reader_output import print_json


def matrix(position, orientation):
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = rotation, [position.x, position.y, position.z]
    return whole


def outline(size):
    """Returns the centers of the sides of a box, which are the ends of the axes of round shapes."""
    half = np.array([size.x, size.y, size.z]) / 2
    return np.concatenate([np.diag(half), -np.diag(half)])


path, env = sys.argv[1], "env_1"
updates, frames, counts, types = {}, {env: np.eye(4)}, {}, {}
with open(path, "rb") as file:
    for schema, channel, message, decoded in make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True).iter_decoded_messages():
        counts[channel.topic] = counts.get(channel.topic, 0) + 1
        if channel.topic.endswith("/scene"):
            assert (schema.name, schema.encoding) == ("foxglove_msgs/msg/SceneUpdate", "ros2msg")
            updates.setdefault(channel.topic, []).append((message.log_time, decoded))
        if channel.topic == f"/{env}/tf":
            for transform in decoded.transforms:
                assert transform.header.frame_id == env
                t = transform.transform
                frames[transform.child_frame_id] = matrix(t.translation, t.rotation)

output = []
for time, update in updates[f"/{env}/scene"]:
    (deletion,) = update.deletions
    assert deletion.type == 1
    entities = {}
    for entity in update.entities:
        assert entity.timestamp.sec * 10**9 + entity.timestamp.nanosec == time
        assert entity.frame_locked and (entity.lifetime.sec, entity.lifetime.nanosec) == (0, 0)
        assert not (entity.arrows or entity.lines or entity.texts or entity.models)
        about = {pair.key: pair.value for pair in entity.metadata}
        kinds = {"cube": entity.cubes, "ball": entity.spheres, "cylinder": entity.cylinders, "triangles": entity.triangles}
        ((kind, (shape,)),) = [(kind, shapes) for kind, shapes in kinds.items() if shapes]
        corners = 0
        if kind == "triangles":
            points = np.array([[p.x, p.y, p.z] for p in shape.points])
            indices = np.array(shape.indices)
            assert len(indices) % 3 == 0 and indices.max() < len(points) and len(shape.colors) in (0, len(points))
            corners = len(indices)
        else:
            points = outline(shape.size)
            if kind == "cylinder":
                assert (shape.bottom_scale, shape.top_scale) == (1, 1)
        place = frames[entity.frame_id] @ matrix(shape.pose.position, shape.pose.orientation)
        there = points @ place[:3, :3].T + place[:3, 3]
        assert entity.id not in entities
        entities[entity.id] = {
            "kind": kind,
            "frame": entity.frame_id,
            "name": about["name"],
            "mask_id": int(about["mask_id"]),
            "points": [[float(x) for x in point] for point in there],
            "corners": corners,
            "color": [float(x) for x in (shape.color.r, shape.color.g, shape.color.b, shape.color.a)],
        }
    output.append({"time": time, "entities": entities})
print_json({"updates": output, "counts": {topic: count for topic, count in counts.items() if topic.endswith("/scene")}})
