"""The formats of processors by name, and any format in words.

The named formats are those of IEEE 754, accelerators, IBM's hexadecimal floating point and the IBM 704.

All IEEE and accelerator formats round to nearest, ties to even, with gradual underflow; use
``dataclasses.replace(BINARY32, rounding=Rounding.UP)`` for another rounding. Overflow is an error, and there is no
infinity, NaN or negative zero; ``replace(FP8_E4M3, overflow="saturate")`` takes the largest number. IBM's machines
chop, and a result below their smallest number becomes zero.

References
----------
IEEE Std 754-2019, table 3.5. OCP 8-bit floating point specification (OFP8), revision 1.0 (2023). IBM System/360
Principles of Operation, A22-6821. OCP Microscaling Formats (MX) specification, version 1.0 (2023). IBM 704 Manual of
Operation, 24-6661.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.names import format_parts


def _ieee(base: int, precision: int, emax: int) -> FloatFormat:
    return FloatFormat(base, precision, Rounding.EVEN, emin=1 - emax, emax=emax)


BINARY16 = _ieee(2, 11, 15)
BINARY32 = _ieee(2, 24, 127)
BINARY64 = _ieee(2, 53, 1023)
BINARY128 = _ieee(2, 113, 16383)

#: binary32 with its last 16 bits cut off.
BFLOAT16 = _ieee(2, 8, 127)
#: The 19 bits of a binary32 operand that tensor cores use.
TF32 = _ieee(2, 11, 127)
FP8_E5M2 = _ieee(2, 3, 15)
#: Its largest number is 1.75 * 2**8, since the significand of all ones means NaN there.
FP8_E4M3 = FloatFormat(2, 4, Rounding.EVEN, emin=-6, emax=8, largest=Fraction(448))

#: Elements of OCP's microscaling formats, whose largest numbers are 28, 7.5 and 6.
FP6_E3M2 = FloatFormat(2, 3, Rounding.EVEN, emin=-2, emax=4)
FP6_E2M3 = FloatFormat(2, 4, Rounding.EVEN, emin=0, emax=2)
FP4_E2M1 = FloatFormat(2, 2, Rounding.EVEN, emin=0, emax=2)

DECIMAL32 = _ieee(10, 7, 96)
DECIMAL64 = _ieee(10, 16, 384)
DECIMAL128 = _ieee(10, 34, 6144)

#: Short and long hexadecimal numbers of the System/360, from 16**-65 to 16**63.
IBM_HEX32 = FloatFormat(16, 6, Rounding.CHOP, emin=-65, emax=62, subnormal=False)
IBM_HEX64 = FloatFormat(16, 14, Rounding.CHOP, emin=-65, emax=62, subnormal=False)

#: The 36-bit word of the IBM 704 with a sign, a characteristic of 8 bits and a fraction of 27, from 2**-129 to 2**127.
IBM_704 = FloatFormat(2, 27, Rounding.CHOP, emin=-129, emax=126, subnormal=False)

NAMED = {
    "BINARY16": BINARY16,
    "BINARY32": BINARY32,
    "BINARY64": BINARY64,
    "BINARY128": BINARY128,
    "BFLOAT16": BFLOAT16,
    "TF32": TF32,
    "FP8_E4M3": FP8_E4M3,
    "FP8_E5M2": FP8_E5M2,
    "FP6_E3M2": FP6_E3M2,
    "FP6_E2M3": FP6_E2M3,
    "FP4_E2M1": FP4_E2M1,
    "DECIMAL32": DECIMAL32,
    "DECIMAL64": DECIMAL64,
    "DECIMAL128": DECIMAL128,
    "IBM_HEX32": IBM_HEX32,
    "IBM_HEX64": IBM_HEX64,
    "IBM_704": IBM_704,
}


def format_named(given: Any) -> Any:
    """Return the format that a name means, such as "float32", "Q15" or "Q3.12"; anything else as it is."""
    if not isinstance(given, str):
        return given
    found = format_parts(given)
    return NAMED[found] if isinstance(found, str) else FixedFormat(*found)


def digits(fmt: NumberFormat) -> str:
    """Name the precision of a format, as in "4 decimal digits" or "24 bits"."""
    return digits_text(fmt.precision, fmt.base)


_ROUNDINGS = {
    Rounding.NEAREST: "rounded to nearest",
    Rounding.CHOP: "chopped",
    Rounding.EVEN: "ties to even",
    Rounding.HALF_UP: "ties rounded up",
    Rounding.UP: "rounded up",
    Rounding.DOWN: "rounded down",
    Rounding.ODD: "rounded to odd",
    Rounding.STOCHASTIC: "stochastically rounded",
}


def rounding_text(rounding: Rounding) -> str:
    """Describe a rounding in words that need no code, such as "chopped" or "ties to even"."""
    return _ROUNDINGS[rounding]


def arithmetic(fmt: NumberFormat) -> str:
    """Name digits, rounding and range of a format, as in "24 bits, ties to even, exponents -126 to 127"."""
    rounding = "" if fmt.rounding is Rounding.NEAREST else f", {rounding_text(fmt.rounding)}"
    fraction = getattr(fmt, "fraction_bits", None)
    if fraction is not None:
        overflow = {"saturate": ", saturated", "wrap": ", wrapped around"}.get(getattr(fmt, "overflow", ""), "")
        return f"fixed point of {1 + fmt.precision} bits, {fraction} of them fraction{rounding}{overflow}"
    least, largest = getattr(fmt, "emin", None), getattr(fmt, "emax", None)
    if least is None:
        return digits(fmt) + rounding
    flushed = "" if getattr(fmt, "subnormal", True) else ", no subnormal numbers"
    overflow = ", saturated" if getattr(fmt, "overflow", "") == "saturate" else ""
    return f"{digits(fmt)}{rounding}, exponents {least} to {largest}{flushed}{overflow}"


def format_text(fmt: FloatFormat | FixedFormat) -> str:
    """Describe a format in a few words: the name of a processor's format, or what :func:`arithmetic` says.

    Examples
    --------
    >>> from gpbnb import FloatFormat
    >>> format_text(BINARY32), format_text(FloatFormat(10, 7, "chop"))
    ('BINARY32', '7 decimal digits, chopped')
    """
    return next((name for name, each in NAMED.items() if fmt == each), arithmetic(fmt))
