"""``python -m kinetoscope demo``: an arm that moves, in a window, in a browser, or without a display."""

from __future__ import annotations

import argparse
import math
import time

import kinetoscope as ks


def demo(arguments: argparse.Namespace) -> None:
    """Waves the bundled arm with a hand in several environments."""
    sim = ks.SimulationManager(num_envs=arguments.num_envs, arena_space=1.5)
    arm = sim.add_robot(ks.bundled_robot("sr5_with_hand", uid="arm"))
    look = ks.Placement.look_at(eye=[1.4, 1.0, 0.9], target=[0.0, 0.0, 0.4])
    channels = ["rgb", "depth"]
    camera = sim.add_sensor(
        "camera", ks.CameraCfg(width=320, height=240, channels=channels, extrinsics=ks.Extrinsics(placement=look))
    )
    print(arm)
    print(camera)
    window = server = None
    if arguments.serve is not None:
        server = sim.serve(arguments.serve, speed=1.0)
        print(f"open {server.url}")
    elif not arguments.headless:
        try:
            window = sim.open_window("kinetoscope demo")
        except ks.ViewerError as error:
            print(error)
    joints = arm.joint_ids("arm")
    started, steps = time.perf_counter(), 0
    try:
        while steps < arguments.steps and (window is None or window.is_open):
            phase = 2 * math.pi * steps / 400
            targets = [0.6 * math.sin(phase), 0.4 + 0.3 * math.cos(phase), -1.4, 0.0, -0.6, phase % (2 * math.pi) - math.pi]
            arm.set_qpos_target(targets, joint_ids=joints)
            sim.update(10)
            steps += 10
    except KeyboardInterrupt:
        pass
    seconds = time.perf_counter() - started
    depth = camera["depth"]
    print(f"{steps} steps of {sim.num_envs} environments in {seconds:.2f} s; depth {depth.min():.2f} to {depth.max():.2f} m")
    if arguments.out is not None:
        sim.screenshot(arguments.out)
        print(f"wrote {arguments.out}")
    sim.destroy()


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(prog="python -m kinetoscope")
    parser.add_argument("--version", action="version", version=f"kinetoscope {ks.__version__}, MuJoCo {ks.mujoco_version()}")
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("demo", help="an arm that moves in several environments")
    command.add_argument("--num-envs", type=int, default=4, help="number of environments")
    command.add_argument("--steps", type=int, default=1_000_000, help="number of physics steps")
    command.add_argument("--headless", action="store_true", help="no window")
    command.add_argument("--serve", nargs="?", const="127.0.0.1:8080", metavar="ADDRESS", help="browser view")
    command.add_argument("--out", metavar="FILE.png", help="write an image at the end")
    command.set_defaults(run=demo)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
