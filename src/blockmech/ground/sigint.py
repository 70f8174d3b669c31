"""Ctrl-C while the command is still being loaded: one sentence, where Python shows a traceback.

The package loads this file first. It takes the signal of the command alone, for the half second
until `blockmech.cli.main` takes it over; a program that imports blockmech keeps its own.
"""

from __future__ import annotations

import os
import signal
import sys
from itertools import pairwise

NAMES = ("blockmech", "blockmech.exe", "blockmech-script.py")  # as which installers call it


def leave(signum: int, frame: object) -> None:
    """End the process at once: nothing is done yet, and half an import cannot be left otherwise."""
    os.write(2, b"interrupted\n")
    os._exit(128 + signum)


def is_command() -> bool:
    """Whether this process is the command: by its name, or by ``python -m blockmech``."""
    called = os.path.basename(sys.argv[0]) if getattr(sys, "argv", None) else ""
    module = called == "-m" and ("-m", "blockmech") in pairwise(sys.orig_argv)
    return called in NAMES or module


if is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, leave)
