"""A quadruped in the place of ANYmal C: the bundled robot with the same joint and foot names, start and base height."""

from __future__ import annotations

from ....assets import asset
from ..actuators import ImplicitActuatorCfg
from ..assets import ArticulationCfg
from ..sim import UrdfFileCfg

ANYMAL_C_CFG = ArticulationCfg(
    prim_path="/World/Robot",
    spawn=UrdfFileCfg(asset_path=asset("quadruped/quadruped.urdf")),
    init_state=ArticulationCfg.InitialStateCfg(
        pos=(0.0, 0.0, 0.6),
        joint_pos={".*HAA": 0.0, ".*F_HFE": 0.4, ".*H_HFE": -0.4, ".*F_KFE": -0.8, ".*H_KFE": 0.8},
    ),
    # ANYmal's own drive is a network of its manufacturer; these gains stand as high.
    actuators={"legs": ImplicitActuatorCfg(joint_names_expr=(".*",), stiffness=80.0, damping=5.0)},
    soft_joint_pos_limit_factor=0.95,
)
