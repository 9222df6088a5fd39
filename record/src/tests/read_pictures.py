"""Says as JSON what is in a folder of pictures, read by Pillow: kind, size and sum of the numbers of each, every number by its place."""

import csv
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from told import tell, weighed

root = Path(sys.argv[1])
with open(root / "times.csv", newline="") as file:
    rows = list(csv.DictReader(file))
told = {}
for row in rows:
    with Image.open(root / row["picture"]) as picture:
        assert picture.format == "PNG" and not getattr(picture, "is_animated", False)
        numbers = np.asarray(picture)
        told[row["picture"]] = [picture.mode, list(picture.size), weighed(numbers.ravel()), int(row["step"])]
assert sorted(told) == sorted(str(path.relative_to(root)) for path in root.rglob("*.png"))
tell(told)
