"""Ctrl+C during calls of the physics: an interrupted call would leave a device between two states."""

from __future__ import annotations

import signal
import threading
from types import FrameType


class HeldInterrupts:
    """Notes Ctrl+C instead of raising KeyboardInterrupt, until `release`.

    Only in the main thread, where Python runs handlers of signals, and only if a handler in Python is set.
    """

    def __init__(self) -> None:
        self._noted = False
        handler = signal.getsignal(signal.SIGINT)
        is_main = threading.current_thread() is threading.main_thread()
        self._handler = handler if is_main and callable(handler) else None
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._note)

    def _note(self, _signal: int, _frame: FrameType | None) -> None:
        self._noted = True

    def release(self) -> bool:
        """Sets the handler from before. True if there was a Ctrl+C, which the caller must send again."""
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
        return self._noted
