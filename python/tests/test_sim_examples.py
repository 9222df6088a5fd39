"""The example scripts, the notebook and the demo of the package kinetoscope."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import kinetoscope as ks

FOLDER = Path(__file__).parents[1] / "examples"


def run(*command, folder):
    result = subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=200, cwd=folder, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def demo(*flags, folder, **variables):
    """Output of the demo, on no other display than that of ``variables``, and the seconds of its steps."""
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "kinetoscope", "demo", *flags]
    run = {"cwd": folder, "env": environment | variables, "capture_output": True, "text": True, "timeout": 60, "check": False}
    result = subprocess.run(command, **run)
    assert result.returncode == 0, result.stderr
    return result.stdout, float(re.search(r"environments in ([\d.]+) s", result.stdout)[1])


def test_reach(tmp_path):
    text = run(FOLDER / "reach.py", "--num-envs", "4", folder=tmp_path)
    assert "solved 4 of 4" in text
    # The drives sag by the torque of gravity over their stiffness, at most 11 mrad at 1 m.
    assert float(re.search(r"([\d.]+) mm at most", text)[1]) < 12


def test_quadruped(tmp_path):
    text = run(FOLDER / "quadruped.py", "--num-envs", "2", "--out", "run.npz", folder=tmp_path)
    assert "(2, 120, 160, 4)" in text
    # The recording has a camera image every 0.1 s, and the states of all 400 steps.
    archive = np.load(tmp_path / "run.npz")
    assert archive["dog/joint_states/positions"].shape[1:] == (2, 12)
    assert archive["camera/color"].shape[1:] == (2, 120, 160, 4)


def test_dataset(tmp_path):
    run(FOLDER / "dataset.py", "--num-envs", "3", folder=tmp_path)
    archive = np.load(tmp_path / "labels.npz")
    assert archive["mask"].shape == (3, 128, 128) and archive["color"].shape == (3, 128, 128, 4)
    # Three cubes and the ground.
    assert len(np.unique(archive["mask"])) == 4


def blocks_of_the_page():
    """The Python programs in docs/python.md."""
    page = (FOLDER.parents[1] / "docs" / "python.md").read_text()
    return re.findall(r"```python\n(.*?)```", page, re.DOTALL)


def test_programs_of_the_page(tmp_path, monkeypatch, capsys, display):
    """The programs but those of tasks and Gymnasium, with fewer environments, smaller images and short times."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DISPLAY", display)
    changes = {
        "num_envs=64": "num_envs=2",
        "ks.CameraCfg(": "ks.CameraCfg(width=32, height=24, ",
        "playback.sim.open_window()": "timeout=0.2",
        "range(100)": "range(2)",
        "sim.open_window()": "None",
        "sim.stream_to_foxglove()": 'sim.stream_to_foxglove("127.0.0.1:0")',
    }
    blocks = [block for block in blocks_of_the_page() if "ks.Task(" not in block and "gymnasium" not in block]
    for old, new in changes.items():
        assert any(old in block for block in blocks), old
        blocks = [block.replace(old, new) for block in blocks]
    first, configurations, chains, merged, recordings, buttons, windows, segmentation = blocks
    names = {}
    exec(first, names)  # noqa: S102
    assert names["arm"].qpos.shape == (2, 6) and names["cam"]["depth"].shape == (2, 24, 32)
    (tmp_path / "scene.toml").write_text(ks.to_toml({"entities": {"dog": ks.bundled_robot("quadruped")}}))
    own = {"ks": ks}
    exec(configurations, own)  # noqa: S102
    assert own["sim"].keys() == ["dog", "imu"] and 'type = "robot"' in own["text"]
    own = {"ks": ks, "np": np}
    exec(chains, own)  # noqa: S102
    assert own["jacobians"].shape == (1000, 6, 6) and own["links"].shape[::2] == (1000, 7)
    reached = own["chain"].compute_fk(own["found"].qpos[own["found"].success])
    assert len(reached) > 900 and np.allclose(reached[:, :3], own["poses"][own["found"].success][:, :3], atol=1e-3)
    assert own["wrist"].joint_names == ["JOINT4", "JOINT5", "JOINT6"]
    exec(merged, own)  # noqa: S102
    assert own["text"].count("<robot ") == 1 and own["text"].count("<joint ") > 6
    # A recording of the same scene, from its start.
    names["sim"].reset()
    with names["sim"].record("run.npz"):
        names["sim"].update(3)
    names["sim"].reset()
    exec(recordings, names)  # noqa: S102
    assert names["stream"].clients == 0 and (tmp_path / "run.mcap").is_file()
    exec(buttons, names)  # noqa: S102
    assert names["page"].url.startswith("http://127.0.0.1:") and not names["files"].is_recording
    exec(windows, names)  # noqa: S102
    assert names["view"].wait(20)
    exec(segmentation, names)  # noqa: S102
    assert names["classes"].shape == (2, 24, 32) and "arm" in capsys.readouterr().out


def test_tasks_of_the_page():
    """The tasks in docs/python.md."""
    first, second = (code for code in blocks_of_the_page() if "ks.Task(" in code)
    sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=2, threads=1))
    sim.add_robot(ks.bundled_robot("quadruped", uid="dog"))
    sim.add_sensor("eye", ks.CameraCfg(width=16, height=16, extrinsics=ks.Extrinsics(parent="dog/base")))
    names = {"ks": ks, "sim": sim, "actions": np.zeros((2, 12))}
    exec(first, names)  # noqa: S102
    assert names["observations"].shape == (2, 15) and names["observations"].dtype == np.float32
    assert names["task"].images("critic", "view").shape == (2, 16, 16, 3)
    names = {"ks": ks}
    exec(second, names)  # noqa: S102
    assert set(names["levels"]) <= {0, 1, 2} and len(names["levels"]) == 64


def test_notebook():
    cells = json.loads((FOLDER / "tour.ipynb").read_text())["cells"]
    names: dict = {}
    shown = []
    for cell in cells:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            *lines, last = "".join(cell["source"]).rstrip().split("\n")
            if re.fullmatch(r"[\w.()\[\]\", :]+", last) and "destroy" not in last:
                exec("\n".join(lines), names)  # noqa: S102
                shown.append(eval(last, names))  # noqa: S307
            else:
                exec("\n".join([*lines, last]), names)  # noqa: S102
    robot, camera, positions, view = shown
    assert robot.__class__.__name__ == "Robot" and positions.shape == (4, 6)
    assert "<iframe" in view._repr_html_() and camera.uid == "camera"


def test_demo(tmp_path):
    text = run("-m", "kinetoscope", "demo", "--headless", "--steps", "50", "--out", "a.png", folder=tmp_path)
    assert "50 steps of 4 environments" in text and (tmp_path / "a.png").is_file()
    assert run("-m", "kinetoscope", "--version", folder=tmp_path).endswith("MuJoCo 4.0.1\n")


@pytest.mark.parametrize("flags", [[], ["--headless"]])
def test_demo_without_a_display(flags, tmp_path):
    """The command as the page has it ends by itself, with an image of the arms."""
    text, _ = demo(*flags, folder=tmp_path)
    assert "2000 steps of 4 environments" in text and "wrote kinetoscope-demo.png" in text and "--serve" in text
    # The window's error is only printed where a window was asked for.
    assert ("DISPLAY" in text) == (not flags)
    image = np.asarray(Image.open(tmp_path / "kinetoscope-demo.png"))
    assert image.shape == (540, 960, 4) and len(np.unique(image.reshape(-1, 4), axis=0)) > 100
    # A control: with a number of steps, there is no image.
    (tmp_path / "kinetoscope-demo.png").unlink()
    assert "50 steps of 4" in demo(*flags, "--steps", "50", folder=tmp_path)[0] and not list(tmp_path.iterdir())


def test_demo_in_a_window_and_in_a_browser(tmp_path, display):
    """Views run in real time: 50 steps of 10 ms take half a second, and less without a view."""
    assert demo("--headless", "--steps", "50", folder=tmp_path)[1] < 0.4
    text, seconds = demo("--steps", "50", folder=tmp_path, DISPLAY=display)
    assert "50 steps of 4 environments" in text and "DISPLAY" not in text and seconds > 0.4
    text, seconds = demo("--serve", "127.0.0.1:0", "--steps", "50", folder=tmp_path)
    assert re.search(r"^open http://127\.0\.0\.1:[1-9]\d*/?", text, re.MULTILINE) and seconds > 0.4
    assert "50 steps of 4 environments" in text and not list(tmp_path.iterdir())
