"""The compiled arithmetic of a format, if it has one: its tag, and the tag for sums of products."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, cast, get_args

import numpy as np

from gpbnb.arithmetic.kernels import tags
from gpbnb.arithmetic.kernels.exact import kernel
from gpbnb.arithmetic.rounding import DRAW_BITS, Order, Rounding, Rules, digits_text

LARGEST_PRECISION = {2: 53, 10: 18, 16: 13}  # with compiled loops for filters
_WIDEST = {2: 113, 10: 34, 16: 28}  # digits of Wide
_UPPER = 61  # bits of the upper part of a significand of Wide
MODES = {
    Rounding.NEAREST: tags.AWAY,
    Rounding.EVEN: tags.EVEN,
    Rounding.CHOP: tags.ZERO,
    Rounding.UP: tags.UP,
    Rounding.DOWN: tags.DOWN,
    Rounding.ODD: tags.ODD,
    Rounding.HALF_UP: tags.HALF_UP,
}
_FLOAT_CODES = {**MODES, Rounding.STOCHASTIC: tags.RANDOM}
_REACH = 320  # largest binary exponent for which products, quotients and their residuals are normal float64
_NO_RANDOM = np.zeros(2, np.uint64)
_UNLIMITED = 2**60  # stands for an unlimited exponent in base 10
_HALFWAY = 2**63  # of the random numbers of a seed


def tag_of(rules: Rules) -> Any:
    """Return the tag of a format's arithmetic, or None if it has no compiled loops.

    Random roundings start with the first number of the seed.
    """
    if rules.precision > LARGEST_PRECISION.get(rules.base, 0):
        return None
    if rules.base != 10:
        return _float_tag(rules)
    return _decimal_tag(rules)


def _decimal_tag(rules: Rules) -> tags.Decimal | None:
    """Return the tag for pairs of int64, or None if they cannot hold the digits that decide a rounding."""
    limits, last = rules.limits, rules.precision - 1
    if rules.rounding not in MODES:
        return None
    if limits is None:
        return tags.Decimal(MODES[rules.rounding], rules.precision, -_UNLIMITED, _UNLIMITED, tags.UNLIMITED)
    if limits.fixed or not _ends_in_nines(rules) or limits.overflow != "raise":
        return None
    small = tags.GRADUAL if limits.subnormal else tags.ABRUPT
    return tags.Decimal(MODES[rules.rounding], rules.precision, limits.emin - last, _emax(rules) - last, small)


def wide_tag(rules: Rules) -> tags.Wide | None:
    """Return the tag for significands of two words, or None if they cannot hold the format."""
    base, precision, rounding, limits, _ = rules
    if base not in _WIDEST or precision > _WIDEST[base] or rounding not in MODES:
        return None
    if limits is not None and limits.overflow not in ("raise", "saturate"):
        return None
    bits = 0 if base == 10 else base.bit_length() - 1
    split = max((base**precision).bit_length() - _UPPER, 0)
    farthest = (1 << _UPPER, 0, tags.FARTHEST)
    small, quantum, lowest, largest = tags.UNLIMITED, 0, farthest, farthest
    if limits is not None:
        small = tags.FIXED if limits.fixed else tags.GRADUAL if limits.subnormal else tags.ABRUPT
        quantum = limits.emin - precision + 1
        lowest, largest = (_stored(rules, limit, split) for limit in (limits.lowest, limits.largest))
        if max(lowest[2], largest[2], -quantum) > tags.FARTHEST:
            return None
    room = 37 if base == 10 else 126 // bits
    saturates = limits is not None and limits.overflow == "saturate"
    return tags.Wide(bits, MODES[rounding], precision, room, split, small, quantum, lowest, largest, saturates)


def _stored(rules: Rules, number: Fraction, split: int) -> tuple[int, int, int]:
    """Three int64 for a number of a format."""
    free = kernel(rules._replace(limits=None))
    m, e = free.from_ratio(number.numerator, number.denominator)
    high, low = divmod(abs(m), 1 << split)
    return (-high if m < 0 else high), low, e


def _float_tag(rules: Rules, fusing: bool = False) -> tags.Float | None:
    """Return the tag for float64 storage, or None if float64 cannot hold the digits that decide a rounding.

    That of fused multiply-add, with `fusing`, tells no ties in 53 bits.
    """
    base, precision, rounding, limits, seed = rules
    random, bits = rounding is Rounding.STOCHASTIC, base.bit_length() - 1
    nan, mode = math.nan, _FLOAT_CODES[rounding]
    state = np.array([seed & (2**64 - 1), 0], np.uint64) if random else _NO_RANDOM
    if limits is None and rounding in Rounding.documented() and not fusing:
        most = math.nextafter(tags.LIMIT, 0.0)
        return tags.Float(bits, precision, mode, 0.0, tags.LEAST, nan, -most, most, nan, nan, state)
    longest = min(_longest(base, rounding, True), 53 - DRAW_BITS if random else 53)
    # A single binary digit is implicit in float64: no stored bit is even or odd.
    hidden = (base, precision) == (2, 1) and rounding in (Rounding.EVEN, Rounding.ODD)
    if limits is not None and limits.fixed:
        # Numbers up to twice the largest keep its spacing, so that none is rounded back into the range.
        precision += 1
    if precision > longest or (random and base == 16) or hidden:
        return None
    if limits is None:
        least, most = tags.LEAST, 2.0**960
        return tags.Float(bits, precision, mode, 0.0, least, nan, -most, most, nan, nan, state)
    if is_binary64(rules):  # the processor rounds its subnormal numbers, too
        most = float(np.finfo(np.float64).max)
        return tags.Float(bits, precision, mode, 0.0, 0.0, 0.0, -most, most, nan, nan, state)
    emin, emax = limits.emin + limits.fixed, _emax(rules)
    if (
        (precision == 1 and limits.subnormal)
        or limits.overflow not in ("raise", "saturate")
        or bits * (emin - precision) < -_REACH
        or bits * (emax + 1) > _REACH
    ):
        return None
    least = float(base) ** emin
    lowest, largest = float(limits.lowest), float(limits.largest)
    under, over = (lowest, largest) if limits.overflow == "saturate" else (nan, nan)
    gradual, least = (least, 0.0) if limits.subnormal else (0.0, least)
    return tags.Float(bits, precision, mode, gradual, least, 0.0, lowest, largest, under, over, state)


def is_binary32(rules: Rules) -> bool:
    """Whether the processor's float32 is this format."""
    return _is_ieee(rules, 24, -126, 127)


def is_binary64(rules: Rules) -> bool:
    """Whether the processor's float64 is this format."""
    return _is_ieee(rules, 53, -1022, 1023)


def _is_ieee(rules: Rules, precision: int, emin: int, emax: int) -> bool:
    limits = rules.limits
    if limits is None or limits.fixed or not limits.subnormal or limits.overflow != "raise":
        return False
    shape = rules.base, rules.precision, rules.rounding, limits.emin
    return shape == (2, precision, Rounding.EVEN, emin) and _emax(rules) == emax and _ends_in_nines(rules)


def _emax(rules: Rules) -> int:
    """Exponent of the largest number, d.dd... * base**emax."""
    if rules.limits is None:
        return _UNLIMITED
    e, _ = kernel(rules).top
    return e + rules.precision - 1


def _ends_in_nines(rules: Rules) -> bool:
    """Whether all digits of the largest number are b - 1."""
    nines = (rules.base**rules.precision - 1) * Fraction(rules.base) ** (_emax(rules) - rules.precision + 1)
    return rules.limits is not None and rules.limits.largest == nines


def _longest(base: int, rounding: Rounding, limited: bool) -> int:
    """Return the largest precision with compiled loops, where nothing else prevents them."""
    if base != 2:
        return LARGEST_PRECISION[base]
    if rounding is Rounding.STOCHASTIC:
        return 53 - DRAW_BITS
    # With 53 bits, the sign of a residual does not tell a tie.
    return 52 if rounding is Rounding.HALF_UP or (limited and rounding is Rounding.NEAREST) else LARGEST_PRECISION[2]


def check_order(order: Order, fused: bool, block: int) -> None:
    """Check the options for computing sums of products."""
    if order not in get_args(Order):
        raise ValueError(f"order: got {order!r}; needed 'left', 'pairwise' or 'blocked'")
    if fused not in (True, False):
        raise ValueError(f"fused: got {fused!r}; needed True or False")
    if isinstance(block, bool) or not isinstance(block, int | np.integer) or block < 1:
        raise ValueError(f"block: got {block!r}; needed a whole number, at least 1")
    if fused and order == "pairwise":
        raise ValueError("got pairwise sums with fused multiply-add; needed one of the two; use 'left' or 'blocked'")


def compiled_tag(rules: Rules) -> tags.Tag:
    """Return the tag of a format's arithmetic, as :func:`tag_of`; reject a format without compiled loops.

    Random roundings start halfway through the numbers of the seed, so that a loop draws none that an array draws.
    """
    if (tag := tag_of(rules)) is not None:
        if (state := tags.random_state(tag)) is not None:
            state[1] = _HALFWAY
        return cast(tags.Tag, tag)
    base, precision, rounding, limits, _ = rules
    if base not in LARGEST_PRECISION:
        why = f"base {base}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}"
    elif rounding is Rounding.STOCHASTIC and base != 2:
        why = f"stochastic rounding in base {base}; needed base 2 for compiled loops"
    elif limits is not None and limits.overflow == "wrap":
        why = "overflow that wraps around; needed 'raise' or 'saturate' for compiled loops"
    elif limits is not None and limits.overflow == "saturate" and base == 10:
        why = "overflow that saturates in base 10; needed 'raise' for compiled loops"
    elif precision > (most := _longest(base, rounding, limits is not None) - (limits is not None and limits.fixed)):
        why = f"{_described(rules)}; needed at most {most} for compiled loops"
    elif precision == 1:
        why = f"{digits_text(1, base)}; needed at least 2 for compiled loops"
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
    text = digits_text(rules.precision, rules.base)
    if rules.rounding not in Rounding.documented():
        text += f", rounded {rules.rounding.value}"
    if rules.limits is not None:
        text += " in fixed point" if rules.limits.fixed else " with a limited range"
    return text


def run_tag(rules: Rules, fused: bool, order: Order = "left", block: int = 32) -> tags.Tag:
    """Return the tag of a run's arithmetic; see :meth:`gpbnb.arithmetic.number_format.NumberFormat.run_tag`."""
    check_order(order, fused, block)
    plain = compiled_tag(rules)
    if not fused and order == "left":
        return plain
    tag = None if rules.base == 10 or is_binary64(rules) else _float_tag(rules, fusing=True)
    if tag is None:
        what = "fused multiply-add" if fused else f"{order} sums"
        raise ValueError(f"got {what} in {_described(rules)}; needed up to 52 bits, or up to 13 base-16 digits")
    return tag
