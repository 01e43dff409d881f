"""The formats of processors, by name: IEEE 754, accelerators, IBM's hexadecimal floating point and the IBM 704.

All IEEE and accelerator formats round to nearest, ties to even, with gradual underflow; use
``dataclasses.replace(BINARY32, rounding=Rounding.UP)`` for another rounding. There is no infinity, NaN or negative
zero: overflow is an error. IBM's machines chop, and a result below their smallest number becomes zero.

References
----------
IEEE Std 754-2019, table 3.5. OCP 8-bit floating point specification (OFP8), revision 1.0 (2023). IBM System/360
Principles of Operation, A22-6821. IBM 704 Manual of Operation, 24-6661.
"""

from __future__ import annotations

from fractions import Fraction

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding


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
    "DECIMAL32": DECIMAL32,
    "DECIMAL64": DECIMAL64,
    "DECIMAL128": DECIMAL128,
    "IBM_HEX32": IBM_HEX32,
    "IBM_HEX64": IBM_HEX64,
    "IBM_704": IBM_704,
}
