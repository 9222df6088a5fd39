"""Adapters for libraries of reinforcement learning.

- ``kinetoscope.rl.sb3``: Stable-Baselines3,
- ``kinetoscope.rl.rsl_rl``: rsl_rl,
- ``kinetoscope.rl.skrl``: skrl,
- ``kinetoscope.rl.torchrl``: TorchRL,
- ``kinetoscope.rl.rllib``: RLlib,
- ``kinetoscope.rl.ray``: rollouts by actors of Ray on many machines, for any learner; ``kinetoscope.rl.rollout`` is the part of
  one process.

Each module imports its library when it is imported itself, and :class:`kinetoscope.MissingPackageError` names a package that is
missing or too old, with the command that installs it. All of them need Gymnasium. The package ``kinetoscope`` requires none of
these libraries.
"""

from ._requirements import require

require("kinetoscope.rl", "gymnasium", "1.1", "gymnasium")
