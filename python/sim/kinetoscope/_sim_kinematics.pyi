"""Types of the kinematics in the extension module: see ``_sim.pyi``."""

import os
from collections.abc import Mapping
from typing import Any, Self, TypeAlias, final

from numpy.typing import ArrayLike

from ._sim_entities import IkResult, _Array, _Fields, _Numbers
from .cfg import IkCfg, MjcfFile, RobotCfg, UrdfCfg
from .diagnostics import Diagnostic

_UrdfFiles: TypeAlias = UrdfCfg | RobotCfg | Mapping[str, Any] | str | os.PathLike[str]

@final
class KinematicChain:
    """Forward kinematics, Jacobians and inverse kinematics of a robot without a simulation: the chain of joints from
    the link ``base`` to a frame on the link ``tip``. Poses are rows x y z qw qx qy qz in the frame of ``base``.

    ``robot`` is the path of a URDF file, a ``UrdfCfg``, an ``MjcfFile``, a ``RobotCfg``, or a dict of the fields of
    a ``UrdfCfg`` or ``RobotCfg``. ``base`` is by default the root link, or the child of the last floating or planar
    joint above ``tip``. ``tcp`` is the pose of the tool in the link ``tip``, x y z qw qx qy qz.

    The columns of arrays are the joints in ``joint_names``: those that move the tip, in the order of the robot's
    joints. A mimic joint has no column. It follows its driver, whose column includes the motion of the mimic joint.

    Methods have the names, arguments and results of those of ``Robot``. They take one row of positions for each
    pose, or a single row. A row gives the same bits in any batch.
    """

    def __new__(cls, robot: _UrdfFiles | MjcfFile, tip: str, base: str | None = None, tcp: _Numbers | None = None) -> Self: ...
    @property
    def base(self) -> str:
        """Name of the link in whose frame poses and Jacobians are."""
    @property
    def diagnostics(self) -> list[Diagnostic]:
        """Everything repaired, ignored or unusual in the files: texts with the attributes ``kind``, ``message``,
        ``file`` and ``line``.
        """
    @property
    def dof(self) -> int:
        """Number of joints, the columns of joint arrays."""
    @property
    def joint_names(self) -> list[str]:
        """Names of the joints that move the tip, in the order of the robot's joints. Mimic joints are left out: they
        follow their drivers.
        """
    @property
    def link_names(self) -> list[str]:
        """Names of the links from the base to the tip."""
    @property
    def qpos_limits(self) -> _Array:
        """Position limits [rad or m], shape (joints, 2): those of the files, narrowed by those of mimic joints that
        follow; infinite without limits.
        """
    @property
    def reach(self) -> float:
        """Sum of the distances from the base over all joints to the frame [m]. With prismatic joints at 0, the frame
        is never farther from the base.
        """
    @property
    def tip(self) -> str:
        """Name of the link that the frame is fixed to."""
    def compute_fk(self, /, qpos: ArrayLike) -> _Array:
        """Poses of the frame at joint positions, rows x y z qw qx qy qz in the frame of the base, shape (N, 7).
        Positions beyond the limits are not clamped.
        """
    def compute_ik(self, /, targets: ArrayLike, cfg: IkCfg | _Fields | None = None, initial: ArrayLike | None = None) -> IkResult:
        """Joint positions within the limits at which the frame reaches target poses, rows x y z qw qx qy qz in the
        frame of the base. Settings are those of ``IkCfg``. The search starts at ``initial``, by default at 0 or at
        the ``ref`` of an MJCF file, clamped to the limits. One target stands for all rows of ``initial``, and one
        row of ``initial`` for all targets. A target that cannot be reached is not an error: see
        ``IkResult.success``. Ctrl+C ends a call with many targets after the current one.
        """
    def compute_link_fk(self, /, qpos: ArrayLike) -> _Array:
        """Poses of the links in ``link_names`` at joint positions, rows x y z qw qx qy qz in the frame of the base,
        shape (N, links, 7).
        """
    def jacobian(self, /, qpos: ArrayLike) -> _Array:
        """Jacobians of the frame at joint positions, shape (N, 6, joints): the velocity of its origin, then its
        angular velocity, both in the axes of the base, per unit of each joint's velocity.
        """
    def __repr__(self) -> str: ...
