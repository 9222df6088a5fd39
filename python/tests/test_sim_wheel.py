"""The search for paths of the build machine in a wheel."""

import subprocess
import sys
import zipfile
from pathlib import Path

import wheel_paths


def wheel(path, **contents):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return path


def test_paths_of_the_build_machine_are_found(tmp_path):
    clean = b"\0/rustc/59807616/library/core/src/option.rs\0python/sim/src/lib.rs\0https://example.org/home\0"
    assert wheel_paths.found(wheel(tmp_path / "clean.whl", a=clean), [str(tmp_path)]) == {}
    cargo = b"\0/opt/" + b".cargo/registry/src/index/pyo3-1.0.0/src/lib.rs\0"
    own = str(tmp_path).encode() + b"/sim/src/lib.rs"
    named = wheel(tmp_path / "named.whl", a=clean, b=clean + own + cargo)
    assert wheel_paths.found(named, [str(tmp_path)]) == {
        "b": sorted([own.decode(), "/opt/" + ".cargo/registry/src/index/pyo3-1.0.0/src/lib.rs"])
    }
    command = [sys.executable, Path(wheel_paths.__file__)]
    for path, code in ((tmp_path / "clean.whl", 0), (named, 1)):
        assert subprocess.run([*command, path], capture_output=True, check=False).returncode == code
