"""Selections of entities of a scene."""

from __future__ import annotations

from typing import Any

from ..configclass import MISSING, configclass


@configclass
class SceneEntityCfg:
    """An entity of a scene by its name, with a selection of its joints and bodies: names or patterns of them, or indices.
    ``resolve`` finds the other of both. Without a selection, it is all of them."""

    name: str = MISSING  # type: ignore[assignment]
    joint_names: Any = None
    joint_ids: Any = slice(None)
    body_names: Any = None
    body_ids: Any = slice(None)
    preserve_order: bool = False

    def resolve(self, scene: Any) -> None:
        """Finds the indices of names, or the names of indices, in a scene. All joints or bodies become ``slice(None)``."""
        if self.name not in scene.keys():
            raise ValueError(f"the scene has no entity {self.name!r}; known names: {', '.join(scene.keys())}")
        self._resolve(scene[self.name], "joint")
        self._resolve(scene[self.name], "body")

    def _resolve(self, entity: Any, what: str) -> None:
        names, ids = getattr(self, f"{what}_names"), getattr(self, f"{what}_ids")
        if names is None and ids == slice(None):
            return
        known = getattr(entity, f"{what}_names")
        if names is not None:
            names = [names] if isinstance(names, str) else list(names)
            find = entity.find_joints if what == "joint" else entity.find_bodies
            found, found_names = find(names, preserve_order=self.preserve_order)
            if ids != slice(None):
                chosen = [ids] if isinstance(ids, int) else list(ids)
                if chosen != found:
                    given = [known[at] for at in chosen]
                    raise ValueError(f"{what}_names {names} and {what}_ids {chosen} differ: the indices are those of {given}")
            # All of them in their order: a slice selects without a copy.
            is_all = found == list(range(len(known)))
            setattr(self, f"{what}_ids", slice(None) if is_all else found)
            setattr(self, f"{what}_names", found_names)
            return
        chosen = [ids] if isinstance(ids, int) else list(range(len(known))[ids] if isinstance(ids, slice) else ids)
        setattr(self, f"{what}_ids", chosen)
        setattr(self, f"{what}_names", [known[at] for at in chosen])
