"""Medians of processor times, measured in turns, so that what else the machine does enters little."""

from __future__ import annotations

import platform
import statistics
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("numpy", "scipy", "numba", "ml_dtypes", "apytypes", "gfloat", "pychop", "mpmath", "gmpy2", "python-flint")


class Row(NamedTuple):
    """One library at one task."""

    task: str
    library: str
    seconds: float
    ratio: float  # to the time of gpbnb
    least: float | None  # the ratio to be reached, if one is

    @property
    def reached(self) -> str:
        """``yes``, ``no`` or nothing."""
        return "" if self.least is None else "yes" if self.ratio >= self.least else "no"


def medians(works: dict[str, Callable[[], object]], turns: int, once: frozenset[str] = frozenset()) -> dict[str, float]:
    """Median processor seconds of each work over `turns` turns, after one that is not counted; `once`: the slow ones.

    Each turn begins with another work, since a work also pays for the memory that the one before it gave back.
    """
    times: dict[str, list[float]] = {name: [] for name in works}
    for name, work in works.items():
        if name not in once:
            work()
    names = list(works)
    for turn in range(turns):
        first = turn % len(names)
        for name in names[first:] + names[:first]:
            if name in once and turn:
                continue
            start = time.process_time()
            works[name]()
            times[name].append(time.process_time() - start)
    return {name: statistics.median(values) for name, values in times.items()}


def rows(task: str, times: dict[str, float], own: str, faster: dict[str, float]) -> list[Row]:
    """A row for each library; `faster`: the least ratio to reach, below 1 for an allowed slowdown."""
    return [Row(task, name, seconds, seconds / times[own], faster.get(name)) for name, seconds in times.items()]


def machine() -> dict[str, str]:
    """What it ran on."""
    found = {
        "processor": _processor(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]}, {len(names)} cores" if names else platform.processor() or "unknown"
