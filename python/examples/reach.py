"""Inverse kinematics: the arm of each environment reaches a random point.

python reach.py --num-envs 16
"""

import argparse

import numpy as np

import kinetoscope as ks

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--num-envs", type=int, default=16)
parser.add_argument("--seed", type=int, default=0)
arguments = parser.parse_args()

sim = ks.SimulationManager(num_envs=arguments.num_envs, seed=arguments.seed)
arm = sim.add_robot(ks.bundled_robot("sr5", uid="arm"))
rng = np.random.default_rng(arguments.seed)

# Targets are poses that the arm can reach: those of random joint positions.
reachable = arm.compute_fk(rng.uniform(-1.0, 1.0, (sim.num_envs, arm.dof)), "arm")
found = arm.compute_ik(reachable, "arm")
print(f"solved {found.success.sum()} of {sim.num_envs}, {found.iterations.mean():.1f} iterations on average")

arm.set_qpos_target(found.qpos)
sim.update(300)
tip = arm.compute_fk(arm.qpos, "arm")
error = np.linalg.norm(tip[:, :3] - reachable[:, :3], axis=1)
print(f"distance to the target after 3 s: {1000 * error.mean():.2f} mm on average, {1000 * error.max():.2f} mm at most")
