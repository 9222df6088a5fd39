"""Worker process: physics on a device for a program in another language.

`python -m kinetoscope.warp.worker --device cuda:0` reads requests from its standard input and writes answers to its standard
output. The first line it writes is `{"ok": true, "device": ..., "versions": ...}` or an error, after which it ends.

A request is a line of JSON with `op` and `bytes`, then that many bytes. The numbers are in little-endian order.

| op | fields | bytes | answer |
|---|---|---|---|
| `load` | `folder`, `scene` (JSON or its text), `num_envs` | | `sizes`: constraint rows and contacts of each environment |
| `write` | `name`, `envs` (their number; absent for all) | int32 environments, then float32 values | |
| `step` | `steps`, `capture` | | `report` |
| `solve` | `capture` | | `report` |
| `read` | `name` | | `shape`, then float32 values |
| `close` | | | |

An answer is a line of JSON with `ok` and `bytes`, then that many bytes. An error is `{"ok": false, "error": message, "kind":
kind, "bytes": 0}` with the kind "device", "unsupported" or "internal"; the worker continues. It ends with its standard input.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import traceback
from typing import Any, BinaryIO

import numpy as np

from .errors import DeviceError, KinetoscopeError, UnsupportedSceneError
from .physics import WarpPhysics

# Smallest number of bytes of one environment number, and of one value.
ITEM = 4


def read_request(stream: BinaryIO) -> tuple[dict[str, Any], bytes] | None:
    """The next request and its bytes, or None at the end of the stream, also within a request."""
    line = stream.readline()
    if not line.endswith(b"\n"):
        return None
    request = json.loads(line)
    payload = stream.read(request.get("bytes", 0))
    return (request, payload) if len(payload) == request.get("bytes", 0) else None


def answer(physics: WarpPhysics, request: dict[str, Any], payload: bytes) -> tuple[dict[str, Any], bytes]:
    """Does what a request asks for. Returns the fields of the answer and its bytes."""
    match request["op"]:
        case "load":
            scene = request["scene"]
            physics.load(request["folder"], scene if isinstance(scene, str) else json.dumps(scene), request["num_envs"])
            return {"sizes": physics.sizes()}, b""
        case "write":
            count = request.get("envs")
            envs = None if count is None else np.frombuffer(payload, "<i4", count)
            rows = physics.num_envs() if count is None else count
            values = np.frombuffer(payload, "<f4", offset=0 if count is None else ITEM * count)
            physics.write(request["name"], envs, values.reshape(rows, -1) if rows else values.reshape(0, 0))
            return {}, b""
        case "step":
            return {"report": json.loads(physics.step(request["steps"], request.get("capture", [])))}, b""
        case "solve":
            return {"report": json.loads(physics.solve(request["capture"]))}, b""
        case "read":
            values = physics.read(request["name"])
            return {"shape": values.shape}, values.astype("<f4").tobytes()
        case "close":
            physics.close()
            return {}, b""
        case other:
            raise ValueError(f'unknown request "{other}"; expected load, write, step, solve, read or close')


def error_kind(error: Exception) -> str:
    """Kind of an error in the protocol."""
    if isinstance(error, UnsupportedSceneError):
        return "unsupported"
    return "device" if isinstance(error, DeviceError) else "internal"


def failure(error: Exception) -> dict[str, Any]:
    """Answer to a request that failed."""
    message = str(error) if isinstance(error, KinetoscopeError) else f"{type(error).__name__}: {error}"
    return {"ok": False, "error": message, "kind": error_kind(error)}


def send(stream: BinaryIO, fields: dict[str, Any], payload: bytes = b"") -> None:
    """Writes an answer."""
    stream.write(json.dumps({**fields, "bytes": len(payload)}).encode() + b"\n" + payload)
    stream.flush()


def serve(physics: WarpPhysics, requests: BinaryIO, answers: BinaryIO) -> None:
    """Answers requests until the stream ends."""
    while (request := read_request(requests)) is not None:
        try:
            fields, payload = answer(physics, *request)
        except Exception as error:
            if error_kind(error) == "internal":
                traceback.print_exc()
            send(answers, failure(error))
            continue
        send(answers, {"ok": True, **fields}, payload)


def main() -> int:
    """Runs the worker. Returns the exit code: 0, or 1 without a usable device."""
    parser = argparse.ArgumentParser(prog="kinetoscope.warp.worker", description="Physics on a device, for another process.")
    parser.add_argument("--device", required=True, help='"cuda", "cuda:N" or "warp-cpu"')
    arguments = parser.parse_args()
    # The process that started the worker decides when it ends; Ctrl-C in a terminal reaches both.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Libraries print to file descriptor 1. From here on that is the standard error.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        physics = WarpPhysics(arguments.device)
    except Exception as error:
        send(answers, failure(error))
        return 1
    try:
        send(answers, {"ok": True, "device": arguments.device, "versions": physics.versions})
        serve(physics, sys.stdin.buffer, answers)
    except BrokenPipeError:
        # The other process ended without closing the standard input first.
        os._exit(0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
