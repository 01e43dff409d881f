"""Rounding a million float64 to 11 and 24 bits, half away from zero, and to formats of processors; dividing in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.timing import Row, medians, rows
from gpbnb.arithmetic import named
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


def processor_peers(x: Any, name: str) -> dict[str, Callable[[], Any]]:
    """Those that are installed, for bfloat16 and binary16 with ties to even."""
    found: dict[str, Callable[[], Any]] = {}
    try:
        import ml_dtypes

        dtype = {"bfloat16": ml_dtypes.bfloat16, "binary16": np.float16}[name]
        found["ml_dtypes" if name == "bfloat16" else "numpy float16"] = lambda: x.astype(dtype).astype(np.float64)
    except ImportError:
        pass
    try:
        from gfloat import RoundMode, round_ndarray
        from gfloat.formats import format_info_bfloat16, format_info_binary16

        info = {"bfloat16": format_info_bfloat16, "binary16": format_info_binary16}[name]
        found["gfloat"] = lambda: round_ndarray(info, x, RoundMode.TiesToEven)
    except ImportError:
        pass
    try:
        from pychop import Chop

        exponent, significand = {"bfloat16": (8, 7), "binary16": (5, 10)}[name]
        chop = Chop(exp_bits=exponent, sig_bits=significand, rmode=1)
        found["pychop"] = lambda: chop(x)
    except ImportError:
        pass
    return found


def measure_processors(x: Any) -> list[Row]:
    """To formats with a range, subnormal numbers included."""
    table = []
    for name, fmt in (("bfloat16", named.BFLOAT16), ("binary16", named.BINARY16)):
        works: dict[str, Callable[[], Any]] = {
            "gpbnb": lambda fmt=fmt: fmt.array(x),
            "memory copy": lambda: x.copy(),
            **processor_peers(x, name),
        }
        for peer, work in works.items():
            # ml_dtypes rounds to float32 first: about six results in a million differ, at ties that this makes.
            if peer not in ("gpbnb", "memory copy", "ml_dtypes") and not np.array_equal(
                fmt.array(x).to_float(), work()
            ):
                raise RuntimeError(f"gpbnb and {peer} round differently")
        times = medians(works, 15)
        table += rows(f"round 10⁶ float64 to {name}", times, "gpbnb", {"memory copy": 0.5, "gfloat": 50, "pychop": 50})
    return table


def measure_division(x: Any) -> list[Row]:
    """Quotients of numbers of a format, which the peers hold in two bytes each."""
    table = []
    for name, fmt in (("bfloat16", named.BFLOAT16), ("binary16", named.BINARY16)):
        a, b = fmt.array(x), fmt.array(np.sqrt(x[::-1]))
        works: dict[str, Callable[[], Any]] = {"gpbnb": lambda a=a, b=b: a / b}
        try:
            import ml_dtypes

            dtype = {"bfloat16": ml_dtypes.bfloat16, "binary16": np.float16}[name]
            narrow = a.to_float().astype(dtype), b.to_float().astype(dtype)
            works["ml_dtypes" if name == "bfloat16" else "numpy float16"] = lambda n=narrow: n[0] / n[1]
        except ImportError:
            pass
        for peer, work in works.items():
            if peer != "gpbnb" and not np.array_equal((a / b).to_float(), work().astype(np.float64)):
                raise RuntimeError(f"gpbnb and {peer} divide differently")
        table += rows(f"divide 10⁶ in {name}", medians(works, 15), "gpbnb", {"ml_dtypes": 2 / 3, "numpy float16": 1.0})
    return table


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
    return table + measure_processors(x) + measure_division(x)
