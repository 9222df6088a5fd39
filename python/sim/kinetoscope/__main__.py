"""``python -m kinetoscope demo``: an arm that moves, in a window, in a browser, or without a display."""

from __future__ import annotations

import argparse
import math
import time

import kinetoscope as ks

# Steps and image of a demo that nothing shows: its user gave no number of steps, and there is no display.
UNSEEN_STEPS = 2000
UNSEEN_IMAGE = "kinetoscope-demo.png"


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
        print(f"open {server.url}", flush=True)
    elif not arguments.headless:
        try:
            window = sim.open_window("kinetoscope demo")
        except ks.ViewerError as error:
            print(error)
    limit, image = arguments.steps, arguments.out
    if limit is None:
        # A window or a browser view ends the demo.
        limit = math.inf
        if window is None and server is None:
            limit, image = UNSEEN_STEPS, image or UNSEEN_IMAGE
            print(f"without a window: {limit} steps, then an image; --serve shows the arm in a browser, --steps N takes N steps")
    joints = arm.joint_ids("arm")
    started, steps = time.perf_counter(), 0
    try:
        while steps < limit and (window is None or window.is_open):
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
    if image is not None:
        sim.screenshot(image)
        print(f"wrote {image}")
    sim.destroy()


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(prog="python -m kinetoscope")
    parser.add_argument("--version", action="version", version=f"kinetoscope {ks.__version__}, MuJoCo {ks.mujoco_version()}")
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("demo", help="an arm that moves in several environments")
    steps = f"number of physics steps; without it, until Ctrl+C or the end of the window, or {UNSEEN_STEPS} without a window"
    command.add_argument("--num-envs", type=int, default=4, help="number of environments")
    command.add_argument("--steps", type=int, help=steps)
    command.add_argument("--headless", action="store_true", help="no window")
    command.add_argument("--serve", nargs="?", const="127.0.0.1:8080", metavar="ADDRESS", help="browser view")
    image = f"write an image at the end; {UNSEEN_IMAGE} without a window and --steps"
    command.add_argument("--out", metavar="FILE.png", help=image)
    command.set_defaults(run=demo)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
