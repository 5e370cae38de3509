"""A process that ends with its parent, however the parent ends, by PR_SET_PDEATHSIG of the Linux kernel's prctl.

Other systems have no such call: there a process outlives a parent that is killed.
"""

import ctypes
import os
import signal
import sys


def end_with(parent: int) -> None:
    """Kill this process as soon as its parent has ended, at once if it has ended already."""
    _at_parents_death(signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def outlive() -> None:
    """Take `end_with` back."""
    _at_parents_death(0)


def _at_parents_death(number: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, number)
