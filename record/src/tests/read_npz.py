"""Prints the last rows of a recording as JSON, read by NumPy."""

import json
import sys

import numpy as np
from reader_output import print_json, weighed

with np.load(sys.argv[1], allow_pickle=False) as file:
    about = json.loads(file["recording.json"])
    others = ("recording.json", "start.snapshot", "scene.zip", "notes.jsonl")
    arrays = {name: file[name] for name in file.files if name not in others}
    assert file["notes.jsonl"] == b"", "there are no notes"
assert "cube" in [mask["name"] for mask in about["mask_ids"]]

streams = {stream["name"]: stream for stream in about["streams"]}
for name, stream in streams.items():
    rows = arrays[f"{name}/step"].shape[0]
    assert arrays[f"{name}/time"].shape == (rows, len(stream["env_ids"])), name
    for array in stream["arrays"]:
        assert list(arrays[array["name"]].shape) == [rows, len(stream["env_ids"]), *array["shape"]], array
names = streams["arm/joint_states"]["columns"]
depth = arrays["camera/depth"][-1, 1]
assert depth.dtype == np.float32 and arrays["camera/color"].dtype == np.uint8
finite = depth[np.isfinite(depth)].astype(np.float64)
last = {name: array[-1, 1] for name, array in arrays.items() if array.ndim > 2}
print_json({
    "names": names,
    "position": last["arm/joint_states/positions"].tolist(),
    "velocity": last["arm/joint_states/velocities"].tolist(),
    "effort": last["arm/joint_states/efforts"].tolist(),
    "target": last["arm/targets/positions"].tolist(),
    "tip": last["arm/link_poses"][-1].tolist(),
    "tip_name": "env_1/" + streams["arm/link_poses"]["columns"][-1],
    "cube": last["cube/pose"][0].tolist(),
    "acceleration": last["imu/lin_acc_b"].tolist(),
    "orientation": last["imu/quat_w"].tolist(),
    "intrinsics": last["camera/lens/intrinsics"].ravel().tolist(),
    "camera": last["camera/lens/pose"].tolist(),
    "nanoseconds": round(arrays["arm/joint_states/time"][-1, 1].item() * 1e9),
    "depth_shape": list(depth.shape),
    "depth_finite": int(np.isfinite(depth).sum()),
    "depth_range": [finite.min().item(), finite.max().item()],
    "mask_sum": weighed(last["camera/mask"].ravel()),
    "color_sum": weighed(last["camera/color"][..., :3].ravel()),
    "rows": arrays["arm/joint_states/positions"].shape[0],
    "pictures": arrays["camera/color"].shape[0],
})
