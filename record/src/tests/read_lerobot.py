"""Prints the content of a LeRobot dataset as JSON, read by pyarrow and PyAV, and checks it with LeRobot's own reader if installed."""

import io
import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import read_lerobot_videos
from PIL import Image
from reader_output import print_json

root = Path(sys.argv[1])
info = json.loads((root / "meta/info.json").read_text())
stats = json.loads((root / "meta/stats.json").read_text())
episodes = pq.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
tasks = pq.read_table(root / "meta/tasks.parquet")
assert tasks.schema.pandas_metadata["index_columns"] == ["__index_level_0__"]
assert tasks.to_pydict()["task_index"] == [0]
assert info["codebase_version"] == "v3.0" and info["total_episodes"] == len(episodes)
images = [name for name, feature in info["features"].items() if feature["dtype"] == "image"]
videos = read_lerobot_videos.read(root, info, episodes)
columns = {name: feature for name, feature in info["features"].items() if name not in videos}
camera = "observation.images.camera"


def pixels(picture):
    image = Image.open(io.BytesIO(picture["bytes"]))
    assert image.mode == "RGB"
    return np.asarray(image)


judged = "next.reward" in info["features"]
rows, output = [], []
for number, episode in enumerate(episodes):
    assert episode["episode_index"] == number and episode["tasks"] == [tasks.to_pydict()["__index_level_0__"][0]]
    path = info["data_path"].format(chunk_index=episode["data/chunk_index"], file_index=episode["data/file_index"])
    table = pq.read_table(root / path)
    assert set(table.column_names) == set(columns)
    frames = table.to_pylist()
    assert len(frames) == episode["length"] == episode["dataset_to_index"] - episode["dataset_from_index"]
    for k, frame in enumerate(frames):
        assert (frame["frame_index"], frame["episode_index"], frame["task_index"]) == (k, number, 0)
        assert frame["index"] == episode["dataset_from_index"] + k == len(rows)
        assert frame["timestamp"] == np.float32(k / info["fps"])
        for name, feature in columns.items():
            value = pixels(frame[name]) if name in images else np.atleast_1d(frame[name])
            assert list(value.shape) == feature["shape"], name
            assert feature["names"] is None or name in images or len(feature["names"]) == len(value)
        for name, video in videos.items():
            assert list(video[len(rows)]["rgb"].shape) == info["features"][name]["shape"], name
        rows.append(frame)
    if judged:
        assert info["features"]["next.done"] == {"dtype": "bool", "shape": [1], "names": None}
        output.append([{
            "state": frame["observation.state"], "reward": float(frame["next.reward"]), "done": frame["next.done"],
        } for frame in frames])
        assert all(frame["done"] in (True, False) for frame in output[-1])
        continue
    output.append([{
        "state": frame["observation.state"],
        "velocity": frame["observation.velocity"],
        "effort": frame.get("observation.effort"),
        "actions": [frame.get(name) for name in ("action", "target.velocity", "target.effort")],
        "acceleration": frame.get("sensors.imu.lin_acc_b"),
        "cube": frame.get("observation.environment_state"),
        "picture": pixels(frame[camera]).tobytes().hex() if camera in images else None,
        "video": {**videos[camera][frame["index"]], "rgb": videos[camera][frame["index"]]["rgb"].tobytes().hex()} if camera in videos else None,
    } for frame in frames])
assert info["total_frames"] == len(rows)

for name in stats:
    # Those of videos are of the images before they are coded; the test compares them with those of a dataset with images.
    if name in videos:
        continue
    if name in images:
        values = np.stack([pixels(row[name]) for row in rows]).reshape(-1, 3) / 255
    else:
        values = np.array([np.atleast_1d(row[name]) for row in rows], dtype=np.float64)
    for what, found in [("min", values.min(0)), ("max", values.max(0)), ("mean", values.mean(0)), ("std", values.std(0))]:
        # Sums of some hundred thousand numbers in another order.
        np.testing.assert_allclose(np.array(stats[name][what]).ravel(), found, rtol=1e-9, atol=1e-9, err_msg=name)
    assert stats[name]["count"] == [len(rows)]
assert set(stats) == set(info["features"]) - {"timestamp", "frame_index", "episode_index", "index", "task_index"}

# It copies what it reads: somewhere that goes away, and from nowhere else.
scratch = tempfile.TemporaryDirectory()
os.environ.update(HF_HOME=scratch.name, HF_HUB_OFFLINE="1")
try:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
except ImportError:
    read = 0
else:
    dataset, worst = LeRobotDataset("kinetoscope/recorded", root=root), 0.0
    assert (dataset.num_episodes, len(dataset), dataset.fps) == (len(episodes), len(rows), info["fps"])
    for item, row in zip((dataset[k] for k in range(len(dataset))), rows):
        assert item["task"] == episodes[0]["tasks"][0]
        for name in videos:
            # LeRobot's decoder may round differently in the conversion to RGB: by one, in each of its few steps.
            found = item[name].numpy().transpose(1, 2, 0) * 255
            worst = max(worst, np.abs(found - videos[name][row["index"]]["rgb"]).max())
        for name in columns:
            value = item[name].numpy()
            expected = pixels(row[name]).transpose(2, 0, 1).astype(np.float32) / 255 if name in images else np.asarray(row[name], value.dtype)
            np.testing.assert_array_equal(value, expected, err_msg=name)
    assert worst < 3, worst
    read = len(dataset)
print_json({"episodes": output, "fps": info["fps"], "features": sorted(info["features"]), "states": info["features"]["observation.state"]["names"], "task": episodes[0]["tasks"][0], "read_by_lerobot": read})
