"""The worker process of physics on a device, in an environment without the extension module, and its protocol."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp_scenes as scenes

import kinetoscope.errors
import kinetoscope.warp
from kinetoscope.warp import WarpPhysics

pytestmark = pytest.mark.needs_warp


class Client:
    """The other side of the protocol."""

    def __init__(self, folder, device="warp-cpu"):
        # The package with these modules only.
        package = Path(folder) / "package" / "kinetoscope"
        if not package.exists():
            shutil.copytree(Path(kinetoscope.warp.__file__).parent, package / "warp", ignore=shutil.ignore_patterns("__pycache__"))
            shutil.copy(kinetoscope.errors.__file__, package)
            (package / "__init__.py").touch()
        command = [sys.executable, "-m", "kinetoscope.warp.worker", "--device", device]
        environment = {**os.environ, "PYTHONPATH": str(package.parent)}
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment)
        self.hello, _ = self.receive()

    def receive(self):
        line = self.process.stdout.readline()
        if not line:
            return None, b""
        fields = json.loads(line)
        return fields, self.process.stdout.read(fields["bytes"])

    def send(self, payload=b"", **request):
        self.process.stdin.write(json.dumps({**request, "bytes": len(payload)}).encode() + b"\n" + payload)
        self.process.stdin.flush()

    def ask(self, payload=b"", **request):
        self.send(payload, **request)
        return self.receive()

    def read(self, name):
        fields, payload = self.ask(op="read", name=name)
        assert fields["ok"], fields
        return np.frombuffer(payload, "<f4").reshape(fields["shape"])

    def close(self):
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def client(tmp_path):
    client = Client(tmp_path)
    yield client
    client.close()


def test_worker_computes_what_the_class_computes(client, tmp_path):
    """Every operation, with the same bits, and the end of the process with its input."""
    assert client.hello["ok"] and client.hello["device"] == "warp-cpu"
    assert set(client.hello["versions"]) == {"mujoco", "mujoco-warp", "warp-lang"}
    model, text = scenes.write_scene(tmp_path, scenes.arm_xml())
    physics = WarpPhysics("warp-cpu")
    physics.load(str(tmp_path), text, 3)
    fields, _ = client.ask(op="load", folder=str(tmp_path), scene=json.loads(text), num_envs=3)
    assert fields == {"ok": True, "sizes": list(physics.sizes()), "bytes": 0}
    targets = np.linspace(0.8, 1.0, 3)[:, None] * scenes.PRESSING_TARGET
    writes = [("target_position", None, targets), ("qpos", [2, 0], np.full((2, 10), 0.1)), ("eq_active", None, np.ones((3, 2))),
              ("xfrc_applied", [1], np.full((1, 6 * model.nbody), 0.5)), ("act", None, np.zeros((3, 0)))]
    for name, envs, values in writes:
        payload = values.astype("<f4").tobytes()
        request = {"op": "write", "name": name}
        if envs is not None:
            request["envs"], payload = len(envs), np.array(envs, "<i4").tobytes() + payload
        assert client.ask(payload, **request)[0] == {"ok": True, "bytes": 0}
        physics.write(name, None if envs is None else np.array(envs), values)
    report = json.loads(physics.step(100, ["contacts", "motion"]))
    assert client.ask(op="step", steps=100, capture=["contacts", "motion"])[0]["report"] == report and report["grown"]
    for name in ("qpos", "qvel", "effort", "contacts", "cacc", "act"):
        assert np.array_equal(client.read(name), physics.read(name)), name
    assert len(physics.read("contacts")) > 0
    assert client.ask(op="solve", capture=["wrenches"])[0]["report"] == json.loads(physics.solve(["wrenches"]))
    assert np.array_equal(client.read("cfrc_int"), physics.read("cfrc_int"))
    assert client.ask(op="close")[0]["ok"]
    assert client.ask(op="step", steps=1)[0]["kind"] == "device"
    output, _ = client.process.communicate(timeout=30)
    assert output == b"" and client.process.returncode == 0


# A request, and the kind and words of its error.
FAULTS = {
    "operation": ({"op": "jump"}, "internal", "jump"),
    "field": ({"op": "read"}, "internal", "name"),
    "no scene": ({"op": "step", "steps": 1}, "device", "no scene is loaded"),
    "folder": ({"op": "load", "folder": "/nowhere", "scene": None, "num_envs": 1}, "device", "/nowhere"),
    "integrator": ({"op": "load", "folder": "rk4", "scene": None, "num_envs": 1}, "unsupported", "RK4"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_errors_keep_the_worker(name, client, tmp_path):
    request, kind, words = FAULTS[name]
    (tmp_path / "rk4").mkdir()
    _, text = scenes.write_scene(tmp_path / "rk4", scenes.arm_xml(integrator="RK4"))
    request = {key: text if key == "scene" else str(tmp_path / value) if key == "folder" else value for key, value in request.items()}
    fields, _ = client.ask(**request)
    assert fields["ok"] is False and fields["kind"] == kind and words in fields["error"]
    _, text = scenes.write_scene(tmp_path, scenes.box_xml())
    assert client.ask(op="load", folder=str(tmp_path), scene=text, num_envs=1)[0]["ok"]


def test_a_killed_worker_ends_its_pipes(client, tmp_path):
    """In the middle of a request: the other side reads the end of the stream, not half an answer."""
    _, text = scenes.write_scene(tmp_path, scenes.arm_xml())
    client.ask(op="load", folder=str(tmp_path), scene=text, num_envs=4)
    client.send(op="step", steps=1_000_000)
    client.process.send_signal(signal.SIGKILL)
    assert client.receive() == (None, b"")
    assert client.process.wait(timeout=30) == -signal.SIGKILL


def test_ctrl_c_of_the_terminal(client):
    """The process that started the worker decides: the worker answers after an interrupt."""
    client.process.send_signal(signal.SIGINT)
    assert client.ask(op="close")[0]["ok"]


@pytest.mark.parametrize("sent", [b"", b'{"op": "read", "na', b'{"op": "write", "name": "qpos", "bytes": 100}\n1234'])
def test_end_of_the_input(sent, client):
    """Also within a request."""
    output, _ = client.process.communicate(sent, timeout=30)
    assert output == b"" and client.process.returncode == 0


def test_a_device_that_does_not_exist(tmp_path):
    client = Client(tmp_path, "cuda:99")
    assert client.hello["ok"] is False and client.hello["kind"] == "device" and "warp-cpu" in client.hello["error"]
    assert client.process.wait(timeout=30) == 1
