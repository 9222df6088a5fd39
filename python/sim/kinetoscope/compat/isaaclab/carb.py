"""Logging of Isaac's applications."""

from __future__ import annotations

import logging
from typing import Any

_LOG = logging.getLogger("kinetoscope.compat.isaaclab")


def log_error(message: Any) -> None:
    _LOG.error("%s", message)


def log_warn(message: Any) -> None:
    _LOG.warning("%s", message)


def log_info(message: Any) -> None:
    _LOG.info("%s", message)
