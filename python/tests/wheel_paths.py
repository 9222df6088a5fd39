"""Traces of the machine that built a wheel: ``python wheel_paths.py WHEEL [FOLDER ...] [--glibc VERSION]``.

Rust puts the paths of source files into panic messages. ``cargo xtask wheel`` compiles with ``--remap-path-prefix`` for
the checkout, the folder of Cargo, the build folder, and the sources of the standard library. This command lists the
paths that are left, and fails if there are any. Folders are further prefixes to search for. With ``--glibc``, it also
fails for symbols of a newer glibc, which older distributions do not have.
"""

from __future__ import annotations

import argparse
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


def newer_symbols(wheel: str | os.PathLike[str], glibc: str) -> dict[str, list[str]]:
    """For each file of the wheel that needs a newer glibc, the versions in its table of symbols."""
    limit = [int(number) for number in glibc.split(".")]
    result = {}
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            versions = set(re.findall(rb"\0GLIBC_([0-9.]+)(?=\0)", archive.read(name)))
            newer = sorted((v.decode() for v in versions if [int(n) for n in v.split(b".")] > limit), key=lambda v: [*map(int, v.split("."))])
            if newer:
                result[name] = newer
    return result


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("wheel")
    parser.add_argument("folders", nargs="*")
    parser.add_argument("--glibc")
    arguments = parser.parse_args()
    paths = found(arguments.wheel, [str(Path(__file__).resolve().parents[2]), *arguments.folders])
    for name, own in paths.items():
        print(f"{name}: {len(own)} paths of the build machine, such as {own[0]}")
    newer = {} if arguments.glibc is None else newer_symbols(arguments.wheel, arguments.glibc)
    for name, versions in newer.items():
        print(f"{name}: needs glibc {versions[-1]}, newer than {arguments.glibc}")
    sys.exit(1 if paths or newer else 0)


if __name__ == "__main__":
    main()
