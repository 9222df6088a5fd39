"""Files of EmbodiChain's tutorials."""

from __future__ import annotations

import os

from kinetoscope.assets import asset

# Names of the tutorials, and the bundled files in their place.
BUNDLED = {
    "Rokae/SR5/SR5.urdf": "sr5/SR5.urdf",
    "BrainCoHandRevo1/BrainCoLeftHand/BrainCoLeftHand.urdf": "revo1_left/revo1_left.urdf",
}


def get_data_path(path: str) -> str:
    """Path of a file: an absolute path as given, a file in the folder ``EMBODICHAIN_DATA_ROOT``, or a bundled asset."""
    if os.path.isabs(path):
        return path
    root = os.environ.get("EMBODICHAIN_DATA_ROOT")
    if root and os.path.exists(os.path.join(root, path)):
        return os.path.join(root, path)
    return asset(BUNDLED.get(path, path))
