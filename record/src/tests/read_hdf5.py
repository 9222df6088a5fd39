"""Prints the content of a robomimic HDF5 file as JSON, read by h5py."""

import json
import sys

import h5py
import numpy as np
from reader_output import print_json

output = {"episodes": []}
# As robomimic opens it.
with h5py.File(sys.argv[1], "r", swmr=True, libver="latest") as file:
    assert list(file) == ["data"]
    data = file["data"]
    about = json.loads(data.attrs["env_args"])
    assert set(about) == {"env_name", "env_type", "type", "env_kwargs"} and about["env_type"] == about["type"] == 2
    columns = about["env_kwargs"]["columns"]
    # Its order of episodes.
    names = sorted(data, key=lambda name: int(name[5:]))
    assert names == [f"demo_{k}" for k in range(len(names))]
    for name in names:
        demo = data[name]
        frames = int(demo.attrs["num_samples"])
        low, images = {}, {}

        def visit(path, dataset):
            if not isinstance(dataset, h5py.Dataset):
                return
            values = dataset[()]
            assert len(values) == frames, path
            if path.endswith("_image"):
                assert dataset.dtype == np.uint8 and values.ndim == 4 and values.shape[3] == 3, path
                # One picture is read without the others.
                assert dataset.chunks == (1, *values.shape[1:]) and dataset.compression == "gzip", path
                images[path] = [picture.tobytes().hex() for picture in values]
            elif path in ("dones", "rewards"):
                assert values.shape == (frames,) and dataset.dtype == (np.int64 if path == "dones" else np.float64)
                low[path] = values.tolist()
            else:
                assert dataset.dtype == np.float64 and values.ndim == 2, path
                assert len(columns[path.removeprefix("next_").removeprefix("obs/")]) == values.shape[1], path
                low[path] = values.tolist()

        demo.visititems(visit)
        assert set(demo["obs"]) == set(demo["next_obs"])
        output["episodes"].append({"env": int(demo.attrs["env_id"]), "frames": frames, "numbers": low, "images": images})
    assert int(data.attrs["total"]) == sum(episode["frames"] for episode in output["episodes"])
output["about"] = about
print_json(output)
