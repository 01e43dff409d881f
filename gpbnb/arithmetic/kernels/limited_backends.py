"""Backends for the formats of processors: every rounding mode, and a limited range."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, Protocol, cast, get_args

import numpy as np

from gpbnb.arithmetic.kernels import tags
from gpbnb.arithmetic.kernels.backends import LARGEST_PRECISION, Backend, Compiled, Components, Exact, Floats, Pairs
from gpbnb.arithmetic.kernels.exact import ExactKernel
from gpbnb.arithmetic.kernels.limited import LimitedKernel, limited_kernel
from gpbnb.arithmetic.rounding import DRAW_BITS, Order, Rounding, Rules

_CODES = {
    Rounding.NEAREST: tags.AWAY,
    Rounding.EVEN: tags.EVEN,
    Rounding.CHOP: tags.ZERO,
    Rounding.UP: tags.UP,
    Rounding.DOWN: tags.DOWN,
    Rounding.ODD: tags.ODD,
}
_REACH = 320  # largest binary exponent for which products, quotients and their residuals are normal float64
_HARDWARE = {(24, -126, 127): tags.Hardware32(), (53, -1022, 1023): tags.Hardware64()}
_UNLIMITED = 2**60  # stands for an unlimited exponent in base 10


class Accumulator(Protocol):
    """A format that can accumulate sums of products."""

    def run_tag(self, fused: bool = False, *, order: Order = "left", block: int = 32) -> tags.Tag:
        """Return the tag of its arithmetic for a compiled loop."""


class LimitedExact(Exact):
    """Any format, stored as Python integers."""

    def __init__(self, rules: Rules) -> None:
        self.base, self.precision, self.rules = rules.base, rules.precision, rules
        self.nearest = rules.rounding is Rounding.NEAREST
        self.kernel = limited_kernel(rules)

    def __reduce__(self) -> tuple[Any, ...]:
        return limited_exact, (self.rules,)

    def apply(self, name: str, *operands: Components) -> Components:
        try:
            return super().apply(name, *operands)
        except OverflowError as error:
            raise OverflowError(f"{_NAMES[name]}{self._place(name, operands)}: {error}") from None

    def _place(self, name: str, operands: tuple[Components, ...]) -> str:
        """Index of the first entry that overflows, for the message."""
        parts = np.broadcast_arrays(*(part for components in operands for part in components))
        operation = getattr(self.kernel, name)
        for index in np.ndindex(parts[0].shape):
            try:
                operation(*(part[index] for part in parts))
            except OverflowError:
                return f" at [{', '.join(map(str, index))}]" if index else ""
        return ""


_NAMES = {
    "add": "addition",
    "subtract": "subtraction",
    "multiply": "multiplication",
    "divide": "division",
    "fused": "fused multiply-add",
    "sqrt": "square root",
    "negative": "negation",
    "absolute": "absolute value",
}


class LimitedFloats(Floats):
    """Bases 2 and 16, stored as float64."""

    fuses = True

    def __init__(self, rules: Rules, tag: Any) -> None:
        self.base, self.precision, self.rules = rules.base, rules.precision, rules
        self.nearest = rules.rounding is Rounding.NEAREST
        self.kernel = limited_kernel(rules)
        self.bits = rules.base.bit_length() - 1
        self.tag = tag
        if isinstance(tag, tags.Hardware64):
            self.lowest_power, self.highest_power = -1074, 1024

    def __reduce__(self) -> tuple[Any, ...]:
        return limited_backend, (self.rules,)

    def apply(self, name: str, *operands: Components) -> Components | None:
        limits = self.rules.limits
        if name in ("negative", "absolute") and limits is not None and limits.fixed:
            return None if np.any(operands[0][0] == float(limits.lowest)) else super().apply(name, *operands)
        return super().apply(name, *operands)

    def run_tag(self) -> Any:
        if isinstance(self.tag, tags.Limited) and isinstance(self.tag.mode, tags.Random):
            return self.tag._replace(mode=_random(self.rules.seed))
        return self.tag

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        if isinstance(self.tag, tags.Limited) and isinstance(self.tag.mode, tags.Random):
            self.tag.mode.state[1] = 0


class LimitedPairs(Pairs):
    """Base 10, stored as pairs of int64."""

    def __init__(self, rules: Rules) -> None:
        self.base, self.precision, self.rules = rules.base, rules.precision, rules
        self.nearest = rules.rounding is Rounding.NEAREST
        self.kernel = limited_kernel(rules)
        self.exact = limited_exact(rules)
        limits, last = rules.limits, rules.precision - 1
        least, largest = (-_UNLIMITED, _UNLIMITED) if limits is None else (limits.emin - last, _emax(rules) - last)
        flush = limits is not None and not limits.subnormal
        self.tag = tags.LimitedDecimal(_CODES[rules.rounding], rules.precision, least, largest, flush)

    def __reduce__(self) -> tuple[Any, ...]:
        return limited_backend, (self.rules,)


def _mode(rounding: Rounding, seed: int) -> tags.Even | tags.Mode | tags.Random:
    if rounding is Rounding.STOCHASTIC:
        return _random(seed)
    return tags.Even() if rounding is Rounding.EVEN else tags.Mode(_CODES[rounding])


def _random(seed: int) -> tags.Random:
    return tags.Random(np.array([seed & (2**64 - 1), 0], np.uint64))


def _emax(rules: Rules) -> int:
    """Exponent of the largest number, d.dd... * base**emax."""
    limits = rules.limits
    if limits is None:
        return _UNLIMITED
    e, _ = limited_kernel(rules).top
    return e + rules.precision - 1


def check_order(order: Order, fused: bool, block: int) -> None:
    """Check the options for computing sums of products.

    Raises
    ------
    ValueError : an unknown order, pairwise sums with fused multiply-add, blocks of less than one product, or `fused`
        that is neither true nor false.
    """
    if order not in get_args(Order):
        raise ValueError(f"order: got {order!r}; needed 'left', 'pairwise' or 'blocked'")
    if fused not in (True, False):
        raise ValueError(f"fused: got {fused!r}; needed True or False")
    if block < 1:
        raise ValueError(f"block: got {block}; needed at least 1")
    if fused and order == "pairwise":
        raise ValueError("got pairwise sums with fused multiply-add; needed one of the two; use 'left' or 'blocked'")


def restart(kernel: ExactKernel, backend: Backend) -> None:
    """Restart the random numbers of stochastic rounding, if there are any."""
    for part in (kernel, backend):
        if isinstance(part, (LimitedKernel, LimitedFloats)):
            part.restart()


def check_compiled(backend: Backend, rules: Rules) -> None:
    """Reject a format without compiled loops.

    Raises
    ------
    ValueError : it has none; the message names the setting that prevents them, and what to set instead.
    """
    if isinstance(backend, Compiled):
        return
    base, precision, rounding, limits, _ = rules
    if base not in LARGEST_PRECISION:
        why = f"base {base}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}"
    elif rounding is Rounding.STOCHASTIC and base != 2:
        why = f"stochastic rounding in base {base}; needed base 2 for compiled loops"
    elif limits is not None and limits.overflow == "wrap":
        why = "overflow that wraps around; needed 'raise' or 'saturate' for compiled loops"
    elif precision > (most := _longest(base, rounding, limits is not None) - (limits is not None and limits.fixed)):
        why = f"{_described(rules)}; needed at most {most} for compiled loops"
    elif precision == 1:
        why = "one digit; needed at least 2 for compiled loops"
    elif base == 10:
        why = "a largest number that does not end in nines; needed one that does, for compiled loops of base 10"
    else:
        why = (
            f"a range down to the exponent {limits.emin if limits else None} and up to {_emax(rules)}; needed numbers, "
            f"with all digits, between 2**-{_REACH} and 2**{_REACH} for compiled loops"
        )
    raise ValueError(f"got {why}")


def _described(rules: Rules) -> str:
    """Describe digits, base and what else limits the digits of compiled loops."""
    text = f"{rules.precision} digits of base {rules.base}"
    if rules.rounding not in Rounding.documented():
        text += f", rounded {rules.rounding.value}"
    if rules.limits is not None:
        text += " in fixed point" if rules.limits.fixed else " with a limited range"
    return text


def _longest(base: int, rounding: Rounding, limited: bool) -> int:
    """Return the largest precision with compiled loops, where nothing else prevents them."""
    if base != 2:
        return LARGEST_PRECISION[base]
    if rounding is Rounding.STOCHASTIC:
        return 53 - DRAW_BITS
    return 52 if limited or rounding not in Rounding.documented() else LARGEST_PRECISION[2]


def run_tag(backend: Backend, rules: Rules, fused: bool, order: Order = "left", block: int = 32) -> tags.Tag:
    """Return the tag for a separate compiled loop; see :meth:`gpbnb.arithmetic.formats.FloatFormat.run_tag`."""
    check_order(order, fused, block)
    check_compiled(backend, rules)
    if not fused and order == "left":
        return cast(Compiled, backend).run_tag()
    tag = _float_tag(rules, hardware=False) if rules.base in (2, 16) else None
    if tag is None:
        what = "fused multiply-add" if fused else f"{order} sums"
        raise ValueError(f"got {what} in {_described(rules)}; needed base 2 up to 52 digits, or 16 up to 13")
    products: Any = tags.Fused() if fused else tags.Separate()
    sums = {"left": products, "pairwise": tags.Pairwise(), "blocked": tags.Blocked(block, products)}[order]
    return cast(tags.Limited, tag._replace(sums=sums))


def mixed_tag(stored: tags.Tag, sums: tags.Tag) -> tags.Mixed:
    """Return the tag for numbers in one arithmetic whose sums of products are accumulated in another.

    Raises
    ------
    ValueError : one of the two does not use float64, or the sums have fewer digits than the numbers.
    """
    for tag in (stored, sums):
        if not isinstance(tag, tags.FLOATS) or isinstance(tag, tags.Mixed):
            raise ValueError(f"got sums kept in {sums} with numbers in {stored}; needed base 2 or 16 for both")
    if _digits(sums) < _digits(stored):
        raise ValueError(
            f"got sums of {_digits(sums)} digits with numbers of {_digits(stored)}; needed at least as many digits "
            "for sums as for numbers"
        )
    return tags.Mixed(stored, sums)


def _digits(tag: tags.Tag) -> int:
    if isinstance(tag, tags.Hardware32):
        return 24
    return tag.precision if isinstance(tag, tags.Binary | tags.Hexadecimal | tags.Limited) else 53


@lru_cache(maxsize=256)
def limited_exact(rules: Rules) -> LimitedExact:
    """Return the backend that holds every number of a format."""
    return LimitedExact(rules)


@lru_cache(maxsize=256)
def limited_backend(rules: Rules) -> Backend:
    """Return the fastest backend for a format."""
    if rules.base == 10 and rules.precision <= LARGEST_PRECISION[10] and rules.rounding in _CODES:
        if rules.limits is None or (not rules.limits.fixed and rules.limits.largest == _all_nines(rules, _emax(rules))):
            return LimitedPairs(rules)
    elif rules.base in (2, 16) and (tag := _float_tag(rules)) is not None:
        return LimitedFloats(rules, tag)
    return limited_exact(rules)


def _all_nines(rules: Rules, emax: int) -> Any:
    scale = rules.base ** (rules.precision - 1)
    return (rules.base * scale - 1) * (limited_kernel(rules).to_fraction(1, emax - rules.precision + 1))


def _float_tag(rules: Rules, hardware: bool = True) -> Any:
    """Return the tag for float64 storage, or None if float64 cannot hold the digits that decide a rounding."""
    base, precision, rounding, limits, seed = rules
    random = rounding is Rounding.STOCHASTIC
    longest = min(_longest(base, rounding, True), 53 - DRAW_BITS if random else 53)
    # A single binary digit is implicit in float64: no stored bit is even or odd.
    hidden = (base, precision) == (2, 1) and rounding in (Rounding.EVEN, Rounding.ODD)
    digits = tags.Two() if base == 2 else tags.Sixteen()
    mode = _mode(rounding, seed)
    if limits is None:
        nan, least, largest = math.nan, 2.0**-960, 2.0**960
        return (
            tags.Limited(digits, mode, tags.Separate(), precision, 0.0, least, nan, -largest, largest, nan, nan)
            if precision <= longest and not (random and base == 16) and not hidden
            else None
        )
    emin, emax = limits.emin, _emax(rules)
    if limits.fixed:  # numbers up to twice the largest keep its spacing, so that none is rounded back into the range
        emin, precision = emin + 1, precision + 1
    plain = not limits.fixed and limits.subnormal and limits.largest == _all_nines(rules, emax)
    if hardware and base == 2 and rounding is Rounding.EVEN and plain and (precision, limits.emin, emax) in _HARDWARE:
        return _HARDWARE[precision, limits.emin, emax]
    bits = base.bit_length() - 1
    if (
        precision > longest
        or hidden
        or (precision == 1 and limits.subnormal)
        or (random and base == 16)
        or limits.overflow == "wrap"
        or bits * (emin - precision) < -_REACH
        or bits * (emax + 1) > _REACH
    ):
        return None
    least = float(base) ** emin
    lowest, largest = float(limits.lowest), float(limits.largest)
    beyond = (lowest, largest) if limits.overflow == "saturate" else (math.nan, math.nan)
    return tags.Limited(
        digits,
        mode,
        tags.Separate(),
        precision,
        least if limits.subnormal else 0.0,
        0.0 if limits.subnormal else least,
        0.0,
        lowest,
        largest,
        *beyond,
    )
