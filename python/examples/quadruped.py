"""Sensors of a quadruped: a camera, a height scanner, contact forces, an IMU with noise, recorded to a file.

python quadruped.py --num-envs 4 --steps 400 --out run.mcap
"""

import argparse

import numpy as np

import kinetoscope as ks

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--num-envs", type=int, default=4)
parser.add_argument("--steps", type=int, default=400)
parser.add_argument("--out", help="recording: .mcap, .npz, .gif and others")
arguments = parser.parse_args()

sim = ks.SimulationManager(ks.SimulationManagerCfg.legged(num_envs=arguments.num_envs, arena_space=2.0))
dog = sim.add_robot(ks.bundled_robot("quadruped", uid="dog"))
sim.add_terrain(
    uid="hills", heights=ks.TerrainGenerator.rough(ks.RoughTerrain(range=[0.0, 0.04], seed=1)), thickness=0.2
)

front = ks.Placement.pose(pos=[0.51, 0.0, 0.015], rotation=[0.5, -0.5, 0.5, -0.5])
camera = sim.add_sensor(
    "camera",
    ks.CameraCfg(
        width=160,
        height=120,
        update_period=0.1,
        channels=["rgb", "depth"],
        extrinsics=ks.Extrinsics(parent="dog/base", placement=front),
    ),
)
scanner = sim.add_sensor(
    "scanner",
    ks.RayCasterCfg(
        parent="dog/base",
        offset=[0.0, 0.0, 20.0, 1.0, 0.0, 0.0, 0.0],
        alignment="yaw",
        targets=ks.HitTargets.named(["hills", "ground"]),
    ),
)
feet = sim.add_sensor("feet", ks.ContactSensorCfg(bodies=["dog/.*_FOOT"], track_air_time=True))
noise = {"lin_acc_b": ks.NoiseCfg(std=0.05), "ang_vel_b": ks.NoiseCfg(std=0.01)}
imu = sim.add_sensor("imu", ks.ImuCfg(body="dog/base", sampling=ks.SamplingCfg(noise=noise)))

# Every environment has another mass of the base.
sim.randomize([ks.RandomizationTerm(property="mass", pattern="dog/base", draw=ks.RandomizationOp.scale([0.8, 1.2]))])
print("mass of the base [kg]:", np.round(sim.property("mass", "dog/base")[:, 0], 2))

recorder = sim.record(arguments.out, overwrite=True) if arguments.out else None
sim.update(arguments.steps)
if recorder is not None:
    print(recorder.finish())

print("images:", camera["rgb"].shape, camera["depth"].shape, "taken at", camera.stamps, "s")
print("heights below the robot [m]:", scanner["hits"][..., 2].min(), "to", scanner["hits"][..., 2].max())
print("vertical forces on the feet [N]:\n", np.round(feet["net_forces_w"][..., 2], 1))
print("specific force [m/s²]:\n", np.round(imu["lin_acc_b"], 2))
