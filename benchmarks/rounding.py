"""Rounding a million float64 to 11 and 24 bits, half away from zero."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.timing import Row, medians, rows
from gpbnb.arithmetic.formats import FloatFormat

COUNT = 1_000_000
EXPONENT_BITS = {11: 5, 24: 8}


def with_numpy(x: Any, bits: int) -> Any:
    """Round to `bits` by significand and exponent."""
    m, e = np.frexp(x)
    scaled = np.ldexp(m, bits)
    return np.ldexp(np.trunc(scaled + np.copysign(0.5, scaled)), e - bits)


def peers(x: Any, bits: int) -> dict[str, Callable[[], Any]]:
    """Those that are installed."""
    found: dict[str, Callable[[], Any]] = {}
    try:
        from gfloat import RoundMode, round_ndarray
        from gfloat.formats import format_info_binary16, format_info_binary32

        info = {11: format_info_binary16, 24: format_info_binary32}[bits]
        found["gfloat"] = lambda: round_ndarray(info, x, RoundMode.TiesToAway)
    except ImportError:
        pass
    try:
        from pychop import Chop

        chop = Chop(exp_bits=EXPONENT_BITS[bits], sig_bits=bits - 1, rmode=8)
        found["pychop"] = lambda: chop(x)
    except ImportError:
        pass
    return found


def measure() -> list[Row]:
    """Times beside a memory copy, and beside the peers."""
    table = []
    # Sizes that binary16 holds as normal numbers too.
    x = np.random.default_rng(11).uniform(1e-3, 1e3, COUNT)
    for bits in (11, 24):
        fmt = FloatFormat(2, bits)
        works: dict[str, Callable[[], Any]] = {
            "gpbnb": lambda fmt=fmt: fmt.array(x),
            "memory copy": lambda: x.copy(),
            "numpy frexp": lambda bits=bits: with_numpy(x, bits),
            **peers(x, bits),
        }
        if not np.array_equal(fmt.array(x).to_float(), with_numpy(x, bits)):
            raise RuntimeError("gpbnb and numpy round differently")
        times = medians(works, 15)
        task = f"round 10⁶ float64 to {bits} bits"
        table += rows(task, times, "gpbnb", {"memory copy": 0.5, "gfloat": 50, "pychop": 50})
    return table
