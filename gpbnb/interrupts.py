"""What a command does when it is interrupted, and how long loops let an interrupt act."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

INTERRUPTED = 130
"""Exit status of an interrupted command, as shells have it."""


SLICE = 1 << 22
"""Operations of one call of a compiled loop, of which none takes longer than a quarter of a microsecond."""


def slices(count: int, work: int = 1) -> Iterator[slice]:
    """Divide items of some operations each among calls of a compiled loop, between which Ctrl-C acts."""
    size = max(SLICE // max(work, 1), 1)
    for begin in range(0, count, size):
        yield slice(begin, min(begin + size, count))


def interruptible(program: str, run: Callable[[], int]) -> int:
    """Run a command and return its exit status; if it is interrupted, print one line."""
    try:
        return run()
    except KeyboardInterrupt:
        print(f"{program}: interrupted", file=sys.stderr)
        return INTERRUPTED
