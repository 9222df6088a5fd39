"""Images with labels: cubes fall at random places, a camera sees them from above.

python dataset.py --num-envs 8 --out labels.npz
"""

import argparse

import numpy as np

import kinetoscope as ks

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--num-envs", type=int, default=8)
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--out", default="labels.npz")
arguments = parser.parse_args()

sim = ks.SimulationManager(num_envs=arguments.num_envs, seed=arguments.seed)
colors = {"red": [0.8, 0.1, 0.1, 1.0], "green": [0.1, 0.7, 0.1, 1.0], "blue": [0.1, 0.2, 0.8, 1.0]}
cubes = {
    name: sim.add_rigid_object(uid=name, shape=ks.ObjectShape.box(size=[0.08] * 3), rgba=rgba, semantic_class="cube")
    for name, rgba in colors.items()
}
above = ks.Placement.look_at(eye=[0.0, 0.0, 1.2], target=[0.0, 0.0, 0.0], up=[1.0, 0.0, 0.0])
camera = sim.add_sensor(
    "camera",
    ks.CameraCfg(width=128, height=128, channels=["rgb", "depth", "mask"], extrinsics=ks.Extrinsics(placement=above)),
)

rng = np.random.default_rng(arguments.seed)
for cube in cubes.values():
    rotation = rng.normal(size=(sim.num_envs, 4))
    poses = np.concatenate([rng.uniform(-0.3, 0.3, (sim.num_envs, 3)) + [0, 0, 0.5], rotation], axis=1)
    cube.write_pose(poses)
sim.update(200)

mask = camera["mask"]
visible = {name: (mask == cube.mask_id).sum(axis=(1, 2)) for name, cube in cubes.items()}
for name, pixels in visible.items():
    print(f"{name}: {pixels} pixels")
np.savez_compressed(arguments.out, color=camera["rgb"], depth=camera["depth"], mask=mask, ids=[cube.mask_id for cube in cubes.values()], names=list(cubes))
print("wrote", arguments.out)
