"""Compares images with those of the installed `mujoco.Renderer`.

python agreement.py [--images FOLDER] [--size HEIGHT WIDTH] MODEL.xml ...   rows of these models
python agreement.py --write                                                 all models of tests/models.py: agreement.json
python agreement.py --page                                                  the tables of docs/python-render.md

Rows have PSNR of color with the default flags and without shadows and reflections, the fraction of pixels whose bytes
differ by at most 4, equal segmentation inside silhouettes, and the median relative difference of depth there.
"""

import argparse
import dataclasses
import json
import os
import pathlib
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

import page  # noqa: E402

SIZE = (240, 320)


def compare(named, size, folder):
    """Rows of models by name and view."""
    import comparison
    import models

    rows = {}
    for name, path in named.items():
        model = models.load(path)
        if model is None:
            print(f"{name}: does not load")
            continue
        start = time.perf_counter()
        for view, row in comparison.compare_model(model, size, folder, name).items():
            rows.setdefault(name, {})[view] = dataclasses.asdict(row)
            print(f"{name:42} {view:9} PSNR {row.psnr:5.1f} plain {row.plain:5.1f}  within 4 {row.near:.3f}  "
                  f"segmentation {row.segmentation:.5f}  depth {row.depth:.1e}  {time.perf_counter() - start:.1f} s",
                  flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=pathlib.Path)
    parser.add_argument("--images", type=pathlib.Path)
    parser.add_argument("--size", type=int, nargs=2, default=SIZE)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--page", action="store_true")
    args = parser.parse_args()
    if args.page:
        page.write()
        return
    if args.images:
        args.images.mkdir(parents=True, exist_ok=True)
    import mujoco

    if args.models:
        named = {f"{path.parent.name}/{path.stem}": path for path in args.models}
    else:
        import models

        named = models.paths()
    rows = compare(named, tuple(args.size), args.images)
    result = {"mujoco": mujoco.__version__, "size": list(args.size), "models": rows}
    if args.write:
        page.RESULT.write_text(json.dumps(page.rounded(result), indent=1) + "\n")
    print("\n".join(page.summary(result)))


if __name__ == "__main__":
    os.environ.setdefault("MUJOCO_GL", "osmesa")
    main()
