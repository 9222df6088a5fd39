"""Logging of Isaac's applications."""

from __future__ import annotations

import logging
from typing import Any

LOG = logging.getLogger("kinetoscope.compat.isaaclab")


def log_error(message: Any) -> None:
    LOG.error("%s", message)


def log_warn(message: Any) -> None:
    LOG.warning("%s", message)


def log_info(message: Any) -> None:
    LOG.info("%s", message)
