"""Prints the content of a folder of images as JSON, read by Pillow: format, size and position-weighted sum of each."""

import csv
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from reader_output import print_json, weighed

root = Path(sys.argv[1])
with open(root / "times.csv", newline="") as file:
    rows = list(csv.DictReader(file))
output = {}
for row in rows:
    with Image.open(root / row["picture"]) as picture:
        assert picture.format == "PNG" and not getattr(picture, "is_animated", False)
        numbers = np.asarray(picture)
        output[row["picture"]] = [picture.mode, list(picture.size), weighed(numbers.ravel()), int(row["step"])]
assert sorted(output) == sorted(str(path.relative_to(root)) for path in root.rglob("*.png"))
print_json(output)
