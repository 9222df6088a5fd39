"""Spawners of primitive shapes. A property of None keeps the value of this package."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from ... import cfg as native
from ...errors import ConfigError
from .. import unsupported
from .._tensors import array
from ..configclass import configclass


@configclass
class RigidBodyPropertiesCfg:
    """Properties of a rigid body. Only ``kinematic_enabled`` has a meaning here."""

    rigid_body_enabled: Any = None
    kinematic_enabled: Any = None
    disable_gravity: Any = None
    linear_damping: Any = None
    angular_damping: Any = None
    max_linear_velocity: Any = None
    max_angular_velocity: Any = None
    max_depenetration_velocity: Any = None
    max_contact_impulse: Any = None
    enable_gyroscopic_forces: Any = None
    retain_accelerations: Any = None
    solver_position_iteration_count: Any = None
    solver_velocity_iteration_count: Any = None
    sleep_threshold: Any = None
    stabilization_threshold: Any = None


@configclass
class MassPropertiesCfg:
    """Mass [kg], or density [kg/m³] without a mass."""

    mass: Any = None
    density: Any = None


@configclass
class CollisionPropertiesCfg:
    """Properties of a collision shape, which always collides."""

    collision_enabled: Any = None
    contact_offset: Any = None
    rest_offset: Any = None
    torsional_patch_radius: Any = None
    min_torsional_patch_radius: Any = None


@configclass
class RigidBodyMaterialCfg:
    """Friction of a body. Both coefficients must be equal: there is one coefficient here."""

    static_friction: float = 0.5
    dynamic_friction: float = 0.5
    restitution: float = 0.0


@configclass
class PreviewSurfaceCfg:
    """Color of a body."""

    diffuse_color: Any = (0.18, 0.18, 0.18)
    opacity: float = 1.0


@configclass
class ShapeCfg:
    """Fields of all shapes."""

    rigid_props: Any = None
    mass_props: Any = None
    collision_props: Any = None
    physics_material: Any = None
    visual_material: Any = None
    activate_contact_sensors: bool = False


@configclass
class CuboidCfg(ShapeCfg):
    """A box with full side lengths [m]."""

    size: Any = (1.0, 1.0, 1.0)


@configclass
class SphereCfg(ShapeCfg):
    """A sphere [m]."""

    radius: float = 1.0


@configclass
class CylinderCfg(ShapeCfg):
    """A cylinder along z [m]."""

    radius: float = 1.0
    height: float = 1.0
    axis: str = "Z"


@configclass
class CapsuleCfg(ShapeCfg):
    """A capsule along z [m]: ``height`` is that of the cylindrical part."""

    radius: float = 1.0
    height: float = 1.0
    axis: str = "Z"


@configclass
class ConeCfg(ShapeCfg):
    """A cone along z [m], with its base at -height / 2."""

    radius: float = 1.0
    height: float = 1.0
    axis: str = "Z"


# A shape with an axis.
AxialCfg: TypeAlias = CylinderCfg | CapsuleCfg | ConeCfg


def axial(cfg: AxialCfg) -> dict[str, Any]:
    """The shape of this package for a shape with an axis."""
    radius, height = float(cfg.radius), float(cfg.height)
    if isinstance(cfg, CylinderCfg):
        return native.ObjectShape.cylinder(radius=radius, length=height)
    if isinstance(cfg, CapsuleCfg):
        return native.ObjectShape.capsule(radius=radius, length=height)
    return native.ObjectShape.cone(radius=radius, height=height)


def shape(cfg: Any, owner: str) -> dict[str, Any]:
    """Fields of the shape and material of a rigid object of this package."""
    if isinstance(cfg, CuboidCfg):
        form = native.ObjectShape.box(size=[float(x) for x in np.asarray(array(cfg.size))])
    elif isinstance(cfg, SphereCfg):
        form = native.ObjectShape.sphere(radius=float(cfg.radius))
    elif isinstance(cfg, AxialCfg):
        unsupported(f"{owner}.spawn", axis=cfg.axis.upper() != "Z")
        form = axial(cfg)
    else:
        known = "CuboidCfg, SphereCfg, CylinderCfg, CapsuleCfg or ConeCfg"
        raise ConfigError(f"{owner}: spawn is a {type(cfg).__name__}; a rigid object is a {known}")
    fields: dict[str, Any] = {"shape": form}
    body = cfg.rigid_props
    if body is None:
        raise ConfigError(f"{owner}: spawn has no rigid_props, so it is no rigid object; set RigidBodyPropertiesCfg()")
    meant = RigidBodyPropertiesCfg(rigid_body_enabled=True, disable_gravity=False, linear_damping=0.0, angular_damping=0.0)
    refuse(f"{owner}.rigid_props", body, meant, "kinematic_enabled")
    if body.kinematic_enabled:
        fields["body_type"] = "kinematic"
    if cfg.collision_props is not None:
        refuse(f"{owner}.collision_props", cfg.collision_props, CollisionPropertiesCfg(collision_enabled=True))
    if cfg.mass_props is not None:
        name = "density" if cfg.mass_props.mass is None else "mass"
        value = getattr(cfg.mass_props, name)
        if value is not None:
            fields[name] = float(value)
    material = cfg.physics_material
    if material is not None:
        unsupported(f"{owner}.physics_material", static_friction=material.static_friction != material.dynamic_friction)
        fields["friction"] = [float(material.dynamic_friction), 0.005, 0.0001]
        if material.restitution > 0:
            fields["restitution"] = float(material.restitution)
    if cfg.visual_material is not None:
        fields["rgba"] = [*(float(c) for c in cfg.visual_material.diffuse_color), float(cfg.visual_material.opacity)]
    return fields


def refuse(owner: str, cfg: Any, meant: Any, *known: str) -> None:
    """Refuses values other than None and those of ``meant``, except for the fields in ``known``."""
    values = vars(cfg)
    unsupported(
        owner,
        **{
            name: value is not None and value != getattr(meant, name)
            for name, value in values.items()
            if name not in known
        },
    )
