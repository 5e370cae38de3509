"""A process that ends with its parent, however the parent ends.

The Linux kernel does this itself (PR_SET_PDEATHSIG of prctl). Other systems, such as macOS, have no such call: a thread
checks every fifth of a second whether the parent still exists. This has not been tested on macOS.
"""

import ctypes
import os
import signal
import sys
import threading
import time

DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of Linux's prctl."""

SECONDS_BETWEEN_LOOKS = 0.2
"""Seconds between two looks at the parent, where the kernel does not tell."""

_watching = threading.Event()


def end_with(parent: int) -> None:
    """Kill this process as soon as its parent has ended, at once if it has ended already."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    else:
        _watching.set()
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def outlive() -> None:
    """Take `end_with` back."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DEATH_SIGNAL, 0)
    _watching.clear()


def _watch(parent: int) -> None:
    while _watching.is_set():
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(SECONDS_BETWEEN_LOOKS)
