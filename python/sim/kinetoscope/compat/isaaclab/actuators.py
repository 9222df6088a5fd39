"""Actuators of Isaac."""

from __future__ import annotations

from typing import Any

from ..configclass import configclass


@configclass
class ActuatorBaseCfg:
    """Gains and limits of joints: numbers, or dicts by joint pattern. As in Orbit, a gain of None is that of the file, and a
    URDF file has none: 0. A joint that no pattern of a dict names has the gain 0, too. Limits, friction and armature of None
    are those of the file."""

    joint_names_expr: Any = (".*",)
    stiffness: Any = None
    damping: Any = None
    effort_limit: Any = None
    velocity_limit: Any = None
    armature: Any = None
    friction: Any = None


@configclass
class ImplicitActuatorCfg(ActuatorBaseCfg):
    """A drive that the physics engine solves implicitly."""


@configclass
class IdealPDActuatorCfg(ActuatorBaseCfg):
    """An explicit drive."""


@configclass
class DelayedPDActuatorCfg(IdealPDActuatorCfg):
    """An explicit drive whose targets arrive late: by a whole number of physics steps, drawn from ``min_delay`` to
    ``max_delay`` for each environment at each reset, the same for all joints of the actuator."""

    min_delay: int = 0
    max_delay: int = 0


@configclass
class DCMotorCfg(IdealPDActuatorCfg):
    """An explicit drive with the torque curve of a DC motor."""

    saturation_effort: float = 0.0
