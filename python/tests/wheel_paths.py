"""Paths of the machine that built a wheel, in its files: ``python wheel_paths.py WHEEL [FOLDER ...]``.

Rust puts the paths of source files into panic messages. A wheel is built with ``--remap-path-prefix`` for the checkout, the
folder of Cargo, the build folder, and the folder that ``rustc --print sysroot`` prints. The command lists what is left and then fails. Folders are further prefixes to search for.
"""

from __future__ import annotations

import os
import re
import sys
import zipfile
from pathlib import Path

# Folders of users and of the registry of Cargo. Paths of the standard library begin with /rustc/ and are the same everywhere.
GENERAL = rb"/(?:home|root|Users|work|builds)/[\w./+-]+|/[\w./+-]*/\.?cargo/registry/[\w./+-]+"


def found(wheel: str | os.PathLike[str], folders: list[str]) -> dict[str, list[str]]:
    """For each file of the wheel with such paths, the different paths."""
    own = [re.escape(os.fsencode(folder.rstrip("/"))) + rb"/[\w./+-]+" for folder in folders]
    pattern = re.compile(b"|".join([*own, GENERAL]))
    result = {}
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            paths = sorted({path.decode(errors="replace") for path in pattern.findall(archive.read(name))})
            if paths:
                result[name] = paths
    return result


def main() -> None:
    wheel, *folders = sys.argv[1:]
    paths = found(wheel, [str(Path(__file__).resolve().parents[2]), *folders])
    for name, own in paths.items():
        print(f"{name}: {len(own)} paths of the build machine, such as {own[0]}")
    sys.exit(1 if paths else 0)


if __name__ == "__main__":
    main()
