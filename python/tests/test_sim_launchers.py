"""The command-line flags of the launchers of Orbit, Isaac Lab and EmbodiChain."""

import argparse
import http.client
import logging
from urllib.parse import urlparse

import pytest

import kinetoscope as ks
from kinetoscope.compat.embodichain.lab.gym.utils.gym_utils import add_env_launcher_args_to_parser
from kinetoscope.compat.embodichain.lab.sim import SimulationManager, SimulationManagerCfg
from kinetoscope.compat.embodichain.lab.visualization import VisualizationCfg, ViserServerCfg, visualization_cfg_from_args
from kinetoscope.compat.isaaclab import carb
from kinetoscope.compat.isaaclab.app import AppLauncher

# Name, default, and a value on the command line with what it is parsed to. The flags of Orbit 0.3 and Isaac Lab 2.3; the default
# of --device is another one there.
ISAAC = [
    ("headless", False, [], True),
    ("livestream", -1, ["3"], 3),
    ("offscreen_render", False, [], True),
    ("enable_cameras", False, [], True),
    ("device", "cpu", ["cuda:1"], "cuda:1"),
    ("verbose", False, [], True),
    ("info", False, [], True),
    ("experience", "", ["a.kit"], "a.kit"),
    ("rendering_mode", None, ["quality"], "quality"),
    ("kit_args", "", ["--a=b --c"], "--a=b --c"),
    ("ros", -1, ["2"], 2),
    ("cpu", False, [], True),
    ("xr", False, [], True),
    ("anim_recording_enabled", False, [], True),
    ("anim_recording_start_time", 0.0, ["1.5"], 1.5),
    ("anim_recording_stop_time", 10.0, ["3"], 3.0),
]
# The flags of EmbodiChain, by their names on the command line.
EMBODICHAIN = [
    ("num_envs", 1, ["3"], 3),
    ("device", "cpu", ["cuda"], "cuda"),
    ("headless", False, [], True),
    ("renderer", "auto", ["fast-rt"], "fast-rt"),
    ("arena_space", 5.0, ["2"], 2.0),
    ("gpu_id", 0, ["1"], 1),
    ("gym_config", "", ["a.json"], "a.json"),
    ("action_config", None, ["a.json"], "a.json"),
    ("preview", False, [], True),
    ("filter_visual_rand", False, [], True),
    ("filter_dataset_saving", False, [], True),
    ("max_episodes", None, ["2"], 2),
    ("viser", False, [], True),
    ("viser-host", "127.0.0.1", ["0.0.0.0"], "0.0.0.0"),
    ("viser-port", 8080, ["9000"], 9000),
    ("viser-fps", 15.0, ["12.5"], 12.5),
    ("viser-image-fps", 2.0, ["1.5"], 1.5),
    ("viser-soft-body-fps", 5.0, ["4"], 4.0),
    ("viser-env-ids", [0], ["1", "3"], [1, 3]),
]
# Flags of EmbodiChain that end the program: their defaults, a value, and the replacement in the message.
REFUSED = [
    ("record_trajectory", False, [], "sim.native.record"),
    ("trajectory_save_dir", None, ["a"], "sim.native.record"),
    ("profile", False, [], "profiler"),
    ("profile_output", None, ["a"], "profiler"),
]


def parser_of(launcher):
    parser = argparse.ArgumentParser()
    (AppLauncher.add_app_launcher_args if launcher == "isaac" else add_env_launcher_args_to_parser)(parser)
    return parser


@pytest.fixture(autouse=True)
def launcher():
    """Flags of one test have no effect on the next."""
    yield
    parser_of("isaac")
    AppLauncher({"headless": True})
    carb.LOG.setLevel(logging.NOTSET)


def page_status(url):
    """Status of the page at the address of a browser view."""
    address = urlparse(url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=20)
    connection.request("GET", "/")
    response = connection.getresponse()
    assert b"<html" in response.read().lower()
    return response.status


FLAGS = [("isaac", *row) for row in ISAAC] + [("embodichain", *row) for row in EMBODICHAIN]


@pytest.mark.parametrize(("launcher_name", "name", "default", "values", "parsed"), FLAGS, ids=lambda v: str(v)[:30])
def test_flags(launcher_name, name, default, values, parsed):
    parser, destination = parser_of(launcher_name), name.replace("-", "_")
    assert vars(parser.parse_args([]))[destination] == default
    values = [f"--{name}={values[0]}"] if len(values) == 1 else [f"--{name}", *values]
    assert vars(parser.parse_args(values))[destination] == parsed
    # Every flag is in the help, and a misspelt one is an error.
    assert f"--{name} " in parser.format_help() or f"--{name}\n" in parser.format_help() or f"--{name}]" in parser.format_help()
    with pytest.raises(SystemExit):
        parser.parse_args([f"--{name}x"])


def test_all_flags_are_tested():
    for launcher_name, rows in (("isaac", ISAAC), ("embodichain", EMBODICHAIN + REFUSED)):
        known = set(vars(parser_of(launcher_name).parse_args([])))
        assert known == {name.replace("-", "_") for name, *_ in rows}


def launch(*flags):
    return AppLauncher(parser_of("isaac").parse_args(flags)).app


def test_flags_of_isaac_that_change_nothing_say_so(recwarn):
    assert not launch().headless and launch("--headless").headless and launch("--livestream", "1").headless
    launch("--offscreen_render", "--enable_cameras", "--livestream", "0", "--ros", "0", "--anim_recording_stop_time", "3")
    assert not recwarn.list
    for flags in (["--experience", "a.kit"], ["--kit_args=--a"], ["--rendering_mode", "balanced"]):
        with pytest.warns(UserWarning, match=rf"{flags[0].split('=')[0]} has no effect: .*[a-z]"):
            launch(*flags)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--cpu"], ("--cpu", "--device cpu")),
        (["--xr"], ("--xr", "--livestream 1")),
        (["--ros", "2"], ("--ros", "run.mcap")),
        (["--anim_recording_enabled"], ("--anim_recording_enabled", "run.mcap")),
    ],
)
def test_flags_of_isaac_without_a_counterpart(flags, words):
    with pytest.raises(ValueError, match="does not support") as error:
        launch(*flags)
    assert all(word in str(error.value) for word in words)


def test_flags_that_a_script_defines_are_its_own():
    """Orbit's scripts had a flag --cpu of their own, which the launcher neither defines nor reads."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cpu", action="store_true", help="of the script")
    AppLauncher.add_app_launcher_args(parser)
    args = parser.parse_args(["--cpu", "--headless"])
    assert args.cpu and AppLauncher(args).app.headless and "of the script" in parser.format_help()
    # A control: that of the launcher is refused.
    with pytest.raises(ValueError, match="--device cpu"):
        launch("--cpu")


def test_messages_of_carb(caplog):
    for flags, levels in (([], ["WARNING"]), (["--info"], ["INFO", "WARNING"]), (["--verbose"], ["INFO", "WARNING"])):
        carb.LOG.setLevel(logging.NOTSET)
        launch(*flags)
        caplog.clear()
        carb.log_info("a")
        carb.log_warn("b")
        assert [record.levelname for record in caplog.records] == levels, flags
        assert carb.LOG.isEnabledFor(logging.DEBUG) == (flags == ["--verbose"])


def test_livestream_serves_the_simulation(capsys):
    from kinetoscope.compat.isaaclab.assets import AssetBaseCfg
    from kinetoscope.compat.isaaclab.scene import InteractiveScene, InteractiveSceneCfg
    from kinetoscope.compat.isaaclab.sim import GroundPlaneCfg, SimulationCfg, SimulationContext

    for flags in (["--livestream", "2"], ["--headless"]):
        launch(*flags)
        sim = SimulationContext(SimulationCfg(dt=0.005))
        cfg = InteractiveSceneCfg(num_envs=2, env_spacing=1.0)
        cfg.ground = AssetBaseCfg(prim_path="/World/ground", spawn=GroundPlaneCfg())
        InteractiveScene(cfg)
        sim.reset()
        sim.step()
        assert sim.window is None
        text = capsys.readouterr().out
        if flags == ["--headless"]:
            # A control: nothing is served.
            assert sim.server is None and "open" not in text
        else:
            assert text == f"open {sim.server.url}\n" and urlparse(sim.server.url).hostname == "127.0.0.1"
            assert page_status(sim.server.url) == 200
        sim.close()


@pytest.mark.parametrize(("name", "default", "values", "word"), REFUSED)
def test_flags_of_embodichain_without_a_counterpart(name, default, values, word, capsys):
    parser = parser_of("embodichain")
    assert vars(parser.parse_args([]))[name] == default
    with pytest.raises(SystemExit) as error:
        parser.parse_args([f"--{name}", *values])
    text = capsys.readouterr().err
    assert error.value.code == 2 and f"does not support --{name}" in text and word in text


def test_the_browser_view_of_embodichain(capsys):
    """--viser serves the simulation from its first step on, at the address of the flags."""
    args = parser_of("embodichain").parse_args(["--viser", "--viser-port", "0", "--num_envs", "2", "--viser-env-ids", "all"])
    view = visualization_cfg_from_args(args)
    assert view == VisualizationCfg(backend="viser", env_ids=None, viser_server=ViserServerCfg(port=0))
    sim = SimulationManager(SimulationManagerCfg(visualization=view))
    sim.build_multiple_arenas(2)
    assert sim.server is None
    sim.update(step=1)
    url = sim.server.url
    assert page_status(url) == 200 and capsys.readouterr().out == f"open {url}\n"
    sim.update(step=1)
    assert sim.server.url == url and not capsys.readouterr().out
    sim.stop_visualization()
    sim.update(step=1)
    assert sim.server is None
    with pytest.raises(OSError):
        page_status(url)
    sim.start_visualization()
    assert page_status(sim.server.url) == 200
    url = sim.server.url
    sim.destroy()
    with pytest.raises(OSError):
        page_status(url)


def test_views_of_embodichain_that_are_off_or_wrong():
    args = parser_of("embodichain").parse_args([])
    sim = SimulationManager(SimulationManagerCfg(visualization=visualization_cfg_from_args(args)))
    sim.update(step=1)
    assert sim.server is None
    sim.destroy()
    with pytest.raises(ks.ConfigError, match=r"backend is 'rerun'; known names: none, viser"):
        SimulationManager(SimulationManagerCfg(visualization=VisualizationCfg(backend="rerun")))
    with pytest.raises(ValueError, match="--viser-env-ids"):
        visualization_cfg_from_args(parser_of("embodichain").parse_args(["--viser-env-ids", "all", "1"]))
