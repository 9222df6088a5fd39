"""The benchmark of physics on a device, with few environments on Warp's CPU device."""

import json

import numpy as np
import pytest
import warp_scenes as scenes

from kinetoscope.warp import benchmark
from kinetoscope.warp.requirements import find_device

pytestmark = pytest.mark.needs_warp

# Positions of eight joints with drives, and of two coupled ones.
START = np.linspace(-0.4, 0.5, 10)


@pytest.fixture
def folder(tmp_path):
    _, text = scenes.write_scene(tmp_path, scenes.arm_xml())
    (tmp_path / "scene.json").write_text(text)
    start = {"qpos": START.tolist(), "ctrl": scenes.ARM_TARGET.tolist()}
    (tmp_path / "start.json").write_text(json.dumps(start))
    return tmp_path


def run(folder, *arguments):
    return benchmark.main(["--scene", str(folder), "--device", "warp-cpu", "--steps", "3", "--turns", "2", *arguments])


def test_measures_each_number_of_environments(folder, capsys):
    assert run(folder, "--envs", "2", "5") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("CPU, mujoco-warp 4.0.0, warp-lang 1.19.0, mujoco 4.0.")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[4:]]
    assert [row[0] for row in rows] == ["2", "5"]
    for row in rows:
        assert all(float(row[k]) > 0 for k in (1, 2, 3, 4, 6)), row
        assert row[5] == "-"


def test_both_sides_have_the_start_and_the_targets(folder, monkeypatch):
    monkeypatch.setattr(benchmark, "WARM_UP", 0)
    scene = benchmark.read_scene(folder)
    physics = benchmark.load_ours(scene, "warp-cpu", 3)
    data, _ = benchmark.load_plain(scene, find_device("warp-cpu")[0], 3, physics.sizes())
    for qpos in (physics.read("qpos"), data.qpos.numpy()):
        np.testing.assert_array_equal(qpos, np.tile(START, (3, 1)).astype(np.float32))
    for ctrl in (physics._worlds.drives["target_position"].numpy(), data.ctrl.numpy()):
        np.testing.assert_array_equal(ctrl, np.tile(scenes.ARM_TARGET, (3, 1)).astype(np.float32))


def test_scene_without_drives_and_start(tmp_path, capsys):
    _, text = scenes.write_scene(tmp_path, scenes.box_xml())
    (tmp_path / "scene.json").write_text(text)
    assert run(tmp_path, "--envs", "2") == 0
    assert "| 2 |" in capsys.readouterr().out


def test_table_has_medians():
    result = benchmark.Result(
        envs=8, ours=[3e6, 1e6, 2e6], plain=[1e6, 2e6, 4e6], single=12345.0, bytes_per_env=30000, first=0.0456, sizes=(32, 16),
        plain_diverged=1,
    )
    row = "| 8 | 2000000 | 2000000 | 0.50 | 12300 | 30000 | 0.0456 | 32, 16 | 1 |"
    assert benchmark.table([result]).splitlines()[2] == row


REFUSALS = [
    ("scene.json", None, "has no file scene.json; expected a folder with scene.xml and scene.json"),
    ("scene.json", "{", "the numbers of the scene are not JSON"),
    ("scene.xml", "<mujoco", "does not compile"),
    ("start.json", "[]", "start.json is invalid"),
    ("start.json", '{"qpos": []}', "start.json is invalid (KeyError('ctrl')); expected an object with numbers in qpos and ctrl"),
    ("start.json", '{"qpos": [0], "ctrl": [0, 0, 0, 0, 0, 0, 0, 0]}', "has 1 numbers in qpos and 8 in ctrl; expected 10 and 8"),
    ("start.json", '{"qpos": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0], "ctrl": []}', "has 10 numbers in qpos and 0 in ctrl; expected 10 and 8"),
]


@pytest.mark.parametrize(("name", "text", "message"), REFUSALS)
def test_refusals(folder, capsys, name, text, message):
    (folder / name).unlink()
    if text is not None:
        (folder / name).write_text(text)
    assert run(folder) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error, error
