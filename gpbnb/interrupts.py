"""What a command does when it is interrupted."""

from __future__ import annotations

import sys
from collections.abc import Callable

INTERRUPTED = 130
"""Exit status of an interrupted command, as shells have it."""


def interruptible(program: str, run: Callable[[], int]) -> int:
    """Run a command and return its exit status; if it is interrupted, print one line."""
    try:
        return run()
    except KeyboardInterrupt:
        print(f"{program}: interrupted", file=sys.stderr)
        return INTERRUPTED
